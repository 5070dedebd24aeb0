"""Explosive files: catalogue, a user's own JWL set or table, and faulty files."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from castblast.api.catalogue import catalogue
from castblast.dataset.file.provenance import load_explosives
from castblast.disk.resources import resource
from castblast.errors import CheckError, SpecError
from castblast.explosive.isentrope import energy, in_hole_velocity, pressure
from castblast.prediction.answer import predict
from castblast.specs.catalogue import explosive_names, resolve_explosive
from castblast.specs.explosive import load_explosive, require_consistent
from castblast.specs.recipe import load_recipe
from castblast.stages.explosives import check_explosive, describe
from castblast.stages.predict_table import predict_csv

TNT = {
    "name": "tnt",
    "density": "1630 kg/m3",
    "detonation_velocity": "6930 m/s",
    "heat_of_explosion": "4.3 MJ/kg",
    "cj_pressure": "21 GPa",
    "jwl": {
        "A": "371.2 GPa",
        "B": "3.231 GPa",
        "R1": 4.15,
        "R2": 0.95,
        "omega": 0.30,
        "E0": "7.0 GPa",
    },
    "source": "LLNL",
}


def written(tmp_path: Path, content: dict[str, object]) -> str:
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return str(path)


def test_the_catalogue_holds_the_four() -> None:
    assert explosive_names() == ("anfo", "doped_emulsion", "gassed_emulsion", "heavy_anfo")
    assert [entry["name"] for entry in catalogue()] == list(explosive_names())
    for name in explosive_names():
        spec = load_explosive(name)
        assert spec.name == name
        assert spec.derived
        assert sum(spec.composition.values()) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ("written", "name"),
    [
        ("HANFO", "heavy_anfo"),
        ("Heavy ANFO", "heavy_anfo"),
        (" heavy-anfo ", "heavy_anfo"),
        ("ANFO", "anfo"),
        ("Surface  Emulsion", "gassed_emulsion"),
    ],
)
def test_every_reader_knows_what_people_call_an_explosive(
    written: str, name: str, tmp_path
) -> None:
    """The catalogue, predict, its tables, recipes and `explosive show` resolve a name alike."""
    assert load_explosive(written).name == name
    assert resolve_explosive(written) == name
    assert predict({}, written)["explosive"] == name
    table = tmp_path / "designs.csv"
    table.write_text(f"explosive,burden [m]\n{written},3\n")
    assert [row["explosive"] for row in predict_csv(table).rows] == [name]
    assert describe(written)["name"] == name
    text = resource("data_specs/recipes/quickstart.yaml").read_text(encoding="utf-8")
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text(re.sub(r"explosives: .*", f"explosives: ['{written}']", text))
    assert [entry.name for entry in load_explosives(load_recipe(recipe))] == [name]


def test_a_name_stands_for_what_is_to_choose_from() -> None:
    """A network names its explosives as its dataset did; nothing else answers in their place."""
    assert resolve_explosive("my mix", ["My_Mix", "anfo"]) == "My_Mix"
    assert resolve_explosive("emul", ["gassed_emulsion"]) == "gassed_emulsion"
    assert resolve_explosive("emul", ["anfo"]) is None
    assert resolve_explosive("", ["anfo"]) is None


def test_in_hole_velocities_lie_in_the_measured_envelope() -> None:
    """In-hole velocities of ANFO usual in the field: 3.3-3.9 at 100 mm to 4.3-4.6 km/s at 250."""
    anfo = load_explosive("anfo").to_explosive()
    for diameter, low, high in ((0.10, 3300, 3900), (0.15, 3900, 4300), (0.25, 4300, 4600)):
        assert low <= in_hole_velocity(anfo, diameter) <= high
    emulsion = load_explosive("gassed_emulsion").to_explosive()
    assert 4800 <= in_hole_velocity(emulsion, 0.1) <= 5800


def test_unknown_names() -> None:
    with pytest.raises(SpecError, match="unknown explosive 'anof', did you mean 'anfo'"):
        load_explosive("anof")
    with pytest.raises(SpecError, match="no such file"):
        load_explosive("nowhere/mine.yaml")


def test_own_file_round_trip(tmp_path: Path) -> None:
    """A file with the numbers of the catalogue gives the same explosive, to the last bit."""
    original = resource("data_specs/explosives/anfo.yaml").read_text()
    path = tmp_path / "copy.yaml"
    path.write_text(original)
    assert load_explosive(path) == load_explosive("anfo")
    assert load_explosive(path).sha256() == load_explosive("anfo").sha256()


def test_constants_left_out_follow_from_the_cj_state(tmp_path: Path) -> None:
    spec = load_explosive(written(tmp_path, TNT))
    assert spec.to_explosive().isentrope.c == pytest.approx(1.048e9, rel=1e-3)
    jwl = {name: value for name, value in TNT["jwl"].items() if name != "E0"}
    without = load_explosive(written(tmp_path, TNT | {"jwl": jwl})).to_explosive()
    assert without.total_energy == pytest.approx(7.0e9, rel=2e-3)


def test_table_of_a_jwl_set_gives_the_same_explosive(tmp_path: Path) -> None:
    import numpy as np

    anfo = load_explosive("anfo").to_explosive()
    volumes = np.geomspace(0.6, 300.0, 60)
    rows = [[float(v), float(pressure(anfo.isentrope, float(v)))] for v in volumes]
    rows[3][1] = f"{rows[3][1] * 1e-9!r} GPa"
    content = {k: v for k, v in TNT.items() if k not in ("jwl", "cj_pressure")} | {
        "density": "800 kg/m3",
        "detonation_velocity": "4806 m/s",
        "heat_of_explosion": "3.75 MJ/kg",
        "isentrope": rows,
    }
    path = written(tmp_path, content)
    table = load_explosive(path).to_explosive()
    assert table.isentrope.tabulated
    # The energy at the end of the table is unknown to the file: compare what the gas can do.
    for v in (1.0, 3.0, 20.0):
        assert pressure(table.isentrope, v) == pytest.approx(pressure(anfo.isentrope, v), rel=1e-3)
    done = energy(table.isentrope, 1.0) - energy(table.isentrope, 20.0)
    assert done == pytest.approx(
        energy(anfo.isentrope, 1.0) - energy(anfo.isentrope, 20.0), rel=1e-4
    )
    assert table.total_energy == pytest.approx(anfo.total_energy, rel=0.01)
    assert check_explosive(path).faults == []
    assert describe(path)["form"] == "table"


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"detonation_velocity": "5.2 m/s"}, "detonation_velocity: 5.2 m/s: implausible"),
        ({"density": 1630}, "density: 1630: no unit given; a density is needed"),
        ({"source": None}, "source: None: "),
        ({"jwl": None}, "either 'jwl' or 'isentrope' is needed"),
        ({"isentrope": [[1, 2e9]]}, "either 'jwl' or 'isentrope' is needed"),
        ({"jwl": {"A": "1 GPa"}}, "jwl.B: is missing"),
        ({"jwl": TNT["jwl"] | {"E": "7 GPa"}}, "jwl.E: unknown key"),
        ({"jwl": TNT["jwl"] | {"R2": 0}}, "jwl.R2: 0: must be larger than 0"),
        ({"jwl": None, "isentrope": [[1, "3 m"], [2]]}, "row 1 ([1, '3 m']): 'm' is a length"),
        ({"vod": "4 km/s"}, "vod: unknown key"),
    ],
)
def test_faulty_files(tmp_path: Path, change: dict[str, object], line: str) -> None:
    path = written(tmp_path, TNT | change)
    with pytest.raises(SpecError) as caught:
        load_explosive(path)
    assert line in str(caught.value)
    assert str(caught.value).startswith(path)


def test_inconsistent_explosives_are_refused_by_name_and_value(tmp_path: Path) -> None:
    """The emulsion of many rock-blasting papers with a detonation state it does not belong to."""
    jwl = {"A": "214.4 GPa", "B": "0.182 GPa", "R1": 4.2, "R2": 0.9, "omega": 0.15,
           "E0": "4.192 GPa"}  # fmt: skip
    content = TNT | {
        "name": "mixed",
        "density": "1300 kg/m3",
        "detonation_velocity": "4000 m/s",
        "cj_pressure": "5.2 GPa",
        "jwl": jwl,
    }
    path = written(tmp_path, content)
    spec = load_explosive(path)
    with pytest.raises(CheckError, match=r"tangency .* \+55\.8 %; allowed: within 2 %"):
        require_consistent(spec)
    assert require_consistent(spec, allow_inconsistent=True)
    assert describe(path)["work"] == {}
