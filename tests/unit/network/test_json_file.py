"""A network.json that cannot be used is refused in one line that names the file and the entry."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from toy_network import toy_network

from castblast.errors import SpecError
from castblast.network import predict_rows
from castblast.network.json_file import from_json, read_network, to_document, to_json
from castblast.specs.models.model import PAPER_FEATURES, PAPER_TARGETS, RidgeSpec
from castblast.surrogate.fitting.features import read_table
from castblast.surrogate.fitting.training import fit_spec


@pytest.fixture(scope="module")
def text(toy_dataset) -> str:
    spec = RidgeSpec(name="ridge", input_transform="log", target_transform="log")
    table = read_table(toy_dataset(600), PAPER_FEATURES, PAPER_TARGETS)
    return to_json(fit_spec(spec, table).network)


def test_the_file_says_what_a_reader_needs(text: str) -> None:
    document = json.loads(text)
    assert document["schema_version"] == 2
    assert document["explosives"] == ["anfo", "doped_emulsion", "gassed_emulsion", "heavy_anfo"]
    assert document["inputs"][0]["unit"] == "Pa"
    assert 0.0 < document["outputs"][0]["relative_band"] < 1.0
    assert len(document["golden"]["inputs"]) == 200
    provenance = document["provenance"]
    assert provenance["dataset"]["content_sha256"] == "a" * 64
    assert provenance["dataset"]["recipe_sha256"] == "b" * 64
    assert provenance["spec"]["name"] == "ridge"
    assert 0.9 < provenance["scores"]["test"]["burden_velocity"]["r2"] <= 1.0
    assert provenance["band_coverage_on_test"]["burden_velocity"] > 0.8


def test_a_file_of_version_1_opens() -> None:
    network = toy_network()
    first = replace(network.layers[0], weights=network.layers[0].weights[1:])
    document = to_document(replace(
        network, derived=(), density=None, members=(), layers=(first, *network.layers[1:])
    ))  # fmt: skip
    for key in ("derived", "density", "members"):
        del document[key]
    old = from_json(json.dumps(document | {"schema_version": 1}))
    assert old.schema_version == 2
    assert (old.derived, old.density, old.members) == ((), None, ())
    rows = predict_rows(old, old.golden.inputs, np.zeros(200, dtype=np.int64))
    assert np.isnan(rows.score).all()


def test_no_times_or_paths_in_the_file(text: str) -> None:
    assert "seconds" not in text
    assert "/" not in text.replace("m s-1", "")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.pop("layers"), "entry 'layers' is missing"),
        (lambda d: d.update(format="onnx"), "not a network of castblast"),
        (lambda d: d.update(schema_version=9), "schema version 9, this one reads 1 and 2"),
        (lambda d: d["layers"][0].update(biases=["x"]), "layers.0..biases: lists of numbers"),
        (lambda d: d["layers"][0].update(biases=["1.0"] * 4), "layers.0..biases: lists of numbers"),
        (lambda d: d["layers"][0].update(activation=7), "layers.0..activation: a text is needed"),
        (lambda d: d.update(layers={"a": 1}), "layers: a list is needed"),
        (lambda d: d.update(explosives="anfo"), "explosives: a list is needed"),
        (lambda d: d.update(explosives=[1, 2]), "explosives: a list of texts is needed"),
        (lambda d: d.update(provenance=[]), "provenance: a group of entries is needed"),
        (lambda d: d["provenance"].update(spec="x"), "provenance: spec: a group"),
        (lambda d: d["provenance"].update(held_inputs={"ucs": "x"}), "ucs: x: a number is needed"),
        (lambda d: d["provenance"].update(scores={"test": 3}), "scores.test: groups of numbers"),
        (lambda d: d["provenance"].update(castblast_version="*/ x"), "castblast_version: .* plain"),
        (lambda d: d["provenance"].update(note="a\x1b[2Jb"), "such a text is not allowed"),
        (lambda d: d["inputs"][0].update(mean="1"), "mean: 1: a number is needed"),
        (lambda d: d["inputs"][0].update(mean=True), "mean: True: a number is needed"),
        (lambda d: d["inputs"][0].update(scale=10**400), "scale: an integer of about 400 digits"),
        (lambda d: d["inputs"][0].update(lower=None), "lower: None: a number is needed"),
        (lambda d: d["inputs"][0].update(name="a b"), "column 'a b': small letters"),
        (lambda d: d["inputs"][0].update(unit="m*/"), "is not a unit"),
        (lambda d: d["inputs"][0].update(extra=1), "inputs.0.: 'extra' is unknown"),
        (
            lambda d: d["constraints"].append({"label": "a", "coefficients": [], "lower": 0}),
            "coefficients: names with numbers",
        ),
        (
            lambda d: d["constraints"].append({"label": "a*/", "coefficients": {}, "lower": 0}),
            "is not plain text",
        ),
        (lambda d: d["golden"].update(explosives=[{}]), "golden.explosives: a list of texts"),
        (lambda d: d.update(density={"centres": [[0.0]]}), "entry .*whitening.* is missing"),
        (lambda d: d.update(members=[[{"weights": []}]]), "entry .*biases.* is missing"),
        (lambda d: d["layers"][0].update(weights=[[1.0], [2.0]]), "do not take 10 values"),
        (lambda d: d["inputs"][0].pop("mean"), "unusable entry"),
        (lambda d: d.update(outputs=[]), "at least one input, output"),
    ],
)
def test_a_garbled_file_is_named(text: str, tmp_path: Path, change, message: str) -> None:
    document = json.loads(text)
    change(document)
    path = tmp_path / "network.json"
    path.write_text(json.dumps(document))
    with pytest.raises(SpecError, match=message) as fault:
        read_network(path)
    lines = str(fault.value).splitlines()
    assert all(line.startswith(f"{path}: ") and len(line) < 300 for line in lines)


def test_a_cut_file_names_the_line(text: str, tmp_path: Path) -> None:
    path = tmp_path / "network.json"
    path.write_text(text[: len(text) // 2])
    with pytest.raises(SpecError, match=r"network\.json: line \d+: not JSON"):
        read_network(path)


@pytest.mark.parametrize("content", [b"", b"[1]", b"\xff\xfe\x00"])
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "network.json"
    path.write_bytes(content)
    with pytest.raises(SpecError, match=r"not JSON|not a network|not a text"):
        read_network(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"none\.json: no such file"):
        read_network(tmp_path / "none.json")
    with pytest.raises(SpecError, match="is a folder"):
        read_network(tmp_path)
