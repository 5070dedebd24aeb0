"""Whatever stands in a file of text, reading it ends with a result or with a fault in words."""

import json
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from hostile import BRIEF, LINES, VALUES, broken, mangled, outcome
from hypothesis import given
from hypothesis import strategies as st
from toy_network import toy_network

from castblast.cli.screen import Screen
from castblast.design.variables import INPUT_NAMES, VARIABLES
from castblast.disk.reading import parse_json, read_json
from castblast.disk.resources import resource
from castblast.errors import CastblastError
from castblast.export.targets import TARGETS
from castblast.network import Network
from castblast.network.json_file import from_document, from_json, to_document
from castblast.specs.bench.bench import BenchSpec
from castblast.specs.bench.ground.spec import GroundSpec, read_ground
from castblast.specs.bench.ore import read_ore
from castblast.specs.case import CaseSpec, parse_values
from castblast.specs.explosive import ExplosiveSpec
from castblast.specs.loading import make_spec, parse_yaml
from castblast.specs.quantity import parse_quantity, parse_variable
from castblast.specs.recipe import Recipe
from castblast.specs.tables.table import Form, read_table


def _yaml(name: str) -> Any:
    return parse_yaml(resource(name).read_text(encoding="utf-8"), name)


EXPLOSIVE = _yaml("data_specs/explosives/anfo.yaml")
RECIPE = _yaml("data_specs/recipes/paper.yaml")
BENCH = _yaml("data_specs/benches/polygon.yaml")
CASE = {"explosive": "anfo", "mode": "equilibrium", "set": {"ucs": "90 MPa", "burden": "3 m"}}
NETWORK = to_document(toy_network())
TEXT = resource("data_specs/benches/demo.yaml").read_bytes()


def in_folder(files: dict[str, bytes], read: Callable[[Path], Any]) -> Any:
    """Write files into a folder that is gone afterwards, and read them there."""
    with TemporaryDirectory() as name:
        for file, content in files.items():
            (Path(name) / file).write_bytes(content)
        return outcome(lambda: read(Path(name)))


def _use_explosive(content: Any) -> Any:
    spec = make_spec(content, ExplosiveSpec, "e.yaml")
    return spec.check(), spec.cj_state(), spec.to_explosive(), spec.sha256()


@given(broken(EXPLOSIVE))
@BRIEF
def test_explosives(content: Any) -> None:
    outcome(lambda: _use_explosive(content))


@given(broken(RECIPE))
@BRIEF
def test_recipes(content: Any) -> None:
    outcome(lambda: make_spec(content, Recipe, "r.yaml").sha256())


@given(broken(BENCH))
@BRIEF
def test_benches(content: Any) -> None:
    outcome(lambda: make_spec(content, BenchSpec, "b.yaml").sha256())


@given(broken(CASE))
@BRIEF
def test_cases(content: Any) -> None:
    outcome(lambda: parse_values(make_spec(content, CaseSpec, "c.yaml").values, "c.yaml"))


@given(st.one_of(LINES, mangled(TEXT).map(lambda data: data.decode("latin-1"))))
@BRIEF
def test_any_text_as_yaml(text: str) -> None:
    found = outcome(lambda: make_spec(parse_yaml(text, "b.yaml"), BenchSpec, "b.yaml"))
    assert isinstance(found, BenchSpec | CastblastError)


@given(VALUES, st.sampled_from(sorted({v.unit for v in VARIABLES.values()})))
@BRIEF
def test_quantities(value: Any, unit: str) -> None:
    outcome(lambda: parse_quantity(value, unit, "here"))


@given(VALUES, st.sampled_from(INPUT_NAMES))
@BRIEF
def test_variables(value: Any, name: str) -> None:
    outcome(lambda: parse_variable(name, value, "here"))


def _use_network(network: Network) -> None:
    for target in ("python", "c", "js"):
        TARGETS[target].write(network)


@given(broken(NETWORK))
@BRIEF
def test_records_of_networks(document: Any) -> None:
    """A record that passes can be written out in every language."""
    found = outcome(lambda: from_document(document))
    if isinstance(found, Network):
        outcome(lambda: _use_network(found))


@given(st.one_of(st.text(max_size=30), mangled(json.dumps(NETWORK).encode()).map(repr)))
@BRIEF
def test_any_text_as_json(text: str) -> None:
    outcome(lambda: parse_json(text))
    outcome(lambda: from_json(text))


@given(mangled(json.dumps(NETWORK["inputs"]).encode()))
@BRIEF
def test_any_bytes_as_json(content: bytes) -> None:
    in_folder({"a.json": content}, lambda folder: read_json(folder / "a.json"))


_ENCODINGS = ("utf-8", "utf-16", "latin-1")
_FORMS = (
    Form(columns={"x": "m", "y": "m"}, required=("x",), texts=("name",), bare=True),
    Form(columns={"x": "m", "delay": "s"}, required=("x", "delay"), ids=("name",), unique_ids=True),
)


@given(LINES | st.binary(max_size=300), st.sampled_from(_FORMS), st.sampled_from(_ENCODINGS))
@BRIEF
def test_tables(written: str | bytes, form: Form, encoding: str) -> None:
    content = written.encode(encoding, "replace") if isinstance(written, str) else written
    found = in_folder({"t.csv": content}, lambda folder: read_table(folder / "t.csv", form))
    assert not isinstance(found, CastblastError) or "t.csv" in str(found)


@given(LINES, st.sampled_from(["csv", "yaml"]))
@BRIEF
def test_ore(text: str, suffix: str) -> None:
    content = f"name,x,y\na,-1,0\na,-3,0\na,-2,2\n{text}".encode()
    in_folder({f"o.{suffix}": content}, lambda folder: read_ore(folder / f"o.{suffix}"))


_GRIDS = {
    "asc": b"ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9\n"
    b"1 2 3\n4 5 6\n",
    "csv": b"x,y,z\n0,0,1\n1,0,1\n0,1,1\n1,1,2\n",
    "xyz": b"0 0 1\n1 0 1\n0 1 1\n1 1 2\n",
    "stl": b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
    b"endloop\nendfacet\nendsolid a\n",
}


@pytest.mark.parametrize("suffix", _GRIDS)
def test_ground(suffix: str) -> None:
    key = "stl" if suffix == "stl" else "heightmap"

    @given(st.one_of(mangled(_GRIDS[suffix]), LINES.map(str.encode), st.binary(max_size=300)))
    @BRIEF
    def check(content: bytes) -> None:
        spec = GroundSpec.model_validate({key: f"g.{suffix}"})
        found = in_folder({f"g.{suffix}": content}, lambda folder: read_ground((spec,), folder))
        assert isinstance(found, CastblastError) or np.isfinite(found.walls.corner).all()

    check()


@given(st.lists(st.lists(st.text(max_size=8), min_size=2, max_size=2), max_size=3), st.text())
@BRIEF
def test_any_text_can_be_shown(rows: list[list[str]], title: str) -> None:
    Screen().table(["a", "b"], rows, title)
