"""The format of a dataset: what is written keeps to it, what departs from it is reported."""

import json
import re
import socket
from pathlib import Path

import numpy as np
import pytest
from fake_blast import fake_generate, fake_simulator, write_recipe

from castblast.dataset.file.check import check
from castblast.dataset.file.content import content_hash
from castblast.dataset.file.schema import (
    DESCRIPTORS,
    HISTORIES,
    LABELS,
    REQUIRED_ATTRIBUTES,
    flag_names,
    names_with_role,
)
from castblast.dataset.file.store import open_dataset
from castblast.design.variables import INPUT_NAMES, OUTPUT_NAMES, VARIABLES
from castblast.specs.quantity import parse_quantity
from castblast.specs.recipe import load_recipe, recipe_from_text


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A dataset of 60 rows, a fifth of which failed."""
    folder = tmp_path_factory.mktemp("format")
    recipe = write_recipe(folder / "r.yaml", max_failed_share=1.0)
    simulator = fake_simulator(recipe, fail_above=100e6)
    fake_generate(recipe, folder / "data.nc", simulator=simulator)
    return folder


@pytest.fixture
def dataset(made):
    return open_dataset(made / "data.nc")


def places(dataset):
    return {fault.where for fault in check(dataset)}


def faults_at(dataset, where):
    return " / ".join(fault.message for fault in check(dataset) if fault.where == where)


def rehash(dataset):
    dataset.attrs["content_sha256"] = content_hash(dataset)
    return dataset


def test_what_is_written_has_no_fault(dataset):
    assert check(dataset) == []
    assert 0 < dataset.attrs["n_failed"] < 60


def test_every_variable_of_the_table_is_there_with_its_unit(dataset):
    for name in (*INPUT_NAMES, *OUTPUT_NAMES):
        attributes = dataset[name].attrs
        assert attributes["units"] == VARIABLES[name].unit
        assert attributes["long_name"]
    assert set(names_with_role(dataset, "input")) == {"ucs", "burden", "charge_length"}
    assert "stemming_length" in names_with_role(dataset, "derived")
    assert dataset["bench_height"].dims == ()
    assert set(names_with_role(dataset, "target")) == {
        "equilibrium_pressure",
        "expanded_hole_radius",
        "crushed_zone_radius",
        "burden_velocity",
    }


def test_cf_rules(dataset):
    """Names, units, flags and ranges as CF-1.11 wants them (sections 2.3, 2.5.1, 3.1, 3.5)."""
    names = [str(name) for name in dataset.variables]
    assert len({name.lower() for name in names}) == len(names)
    for name, variable in dataset.variables.items():
        assert re.fullmatch(r"[a-zA-Z][a-zA-Z0-9_]*", str(name))
        attributes = variable.attrs
        assert attributes["long_name"]
        if "units" in attributes and attributes["units"] != "1":
            assert parse_quantity(f"1 {attributes['units']}", attributes["units"]) == 1.0
        for bound in ("valid_min", "valid_max"):
            if bound in attributes:
                assert np.asarray(attributes[bound]).dtype == variable.dtype
        if "flag_values" in attributes:
            assert np.asarray(attributes["flag_values"]).dtype == variable.dtype
            assert len(attributes["flag_meanings"].split()) == len(attributes["flag_values"])
        elif variable.dtype.kind in "fi":
            assert "units" in attributes
        if variable.dims == (name,):  # coordinates: nothing missing, in order
            assert "_FillValue" not in variable.encoding
            assert np.all(np.diff(variable.to_numpy()) > 0)
    assert "standard_name" not in str([v.attrs for v in dataset.variables.values()])
    assert dataset.attrs["Conventions"] == "CF-1.11, ACDD-1.3"


def test_no_time_host_or_path(made, dataset):
    text = json.dumps({k: str(v) for k, v in dataset.attrs.items()})
    raw = (made / "data.nc").read_bytes()
    for secret in (socket.gethostname(), str(made), str(Path.cwd()), str(Path.home())):
        if len(secret) > 4:
            assert secret not in text
            assert secret.encode() not in raw
    assert not re.search(r"\d{4}-\d{2}-\d{2}T|\d{2}:\d{2}:\d{2}", text)


def test_the_file_alone_holds_recipe_and_explosives(made, dataset):
    recipe = recipe_from_text(dataset.attrs["recipe"], "file")
    assert recipe == load_recipe(made / "r.yaml").recipe
    assert dataset.attrs["recipe_sha256"] == recipe.sha256()
    texts = json.loads(dataset.attrs["explosive_specs"])
    assert list(texts) == dataset["explosive_name"].to_numpy().tolist() == list(recipe.explosives)
    assert set(flag_names(dataset["explosive"])) == set(texts)
    assert dataset["explosive_density"].to_numpy().tolist() == [800.0, 950.0, 1280.0]


def test_failed_rows_keep_inputs_and_lose_outputs(dataset):
    failed = dataset["status"].to_numpy() != 0
    assert np.array_equal(failed, dataset["ucs"].to_numpy() > 100e6)
    assert set(flag_names(dataset["status"])) == {"ok", "not_converged"}
    for name in (*OUTPUT_NAMES, *HISTORIES):
        assert np.isnan(dataset[name].to_numpy()[failed]).all()
        assert np.isfinite(dataset[name].to_numpy()[~failed]).all()
    assert np.isfinite(dataset["burden"].to_numpy()).all()


@pytest.mark.parametrize("name", ["burden", "rise_time", "burden_velocity", "split", "sample"])
def test_missing_variable(dataset, name):
    assert faults_at(dataset.drop_vars(name), name) == "is missing"


@pytest.mark.parametrize("name", REQUIRED_ATTRIBUTES)
def test_missing_attribute(dataset, name):
    del dataset.attrs[name]
    assert f"attribute {name}" in places(dataset)


def put(name, row, value):
    """A change of one value, or of those of all finished rows."""

    def change(dataset):
        rows = dataset["status"].to_numpy() == 0 if row == "ok" else row
        dataset[name].to_numpy()[rows] = value

    return change


def note(name, key, value):
    return lambda dataset: dataset[name].attrs.update({key: value})


@pytest.mark.parametrize(
    ("where", "change", "words"),
    [
        ("ucs", note("ucs", "units", "MPa"), "units are 'MPa', not 'Pa'"),
        ("ucs", lambda d: d.update({"ucs": d["ucs"].astype(np.float32)}),
         "type is float32, not float64"),
        ("burden_velocity", note("burden_velocity", "role", "input"), "role is 'input'"),
        ("equilibrium_pressure", put("equilibrium_pressure", "ok", -1.0),
         "implausible; allowed: 0 to 1e+11 Pa"),
        ("burden", put("burden", 4, 16.0), "outside the sampled range: 1 sample, id 4 (16 m first"),
        ("split", note("split", "flag_meanings", "train valid calibration exam"), "exam"),
        ("burdn", lambda d: d.update({"burdn": d["burden"]}),
         "is not part of the format, did you mean 'burden'?"),
        *((name, put(name, 0, 99), "unknown codes [99]") for name in ("split", "status",
                                                                      "explosive")),
    ],
)  # fmt: skip
def test_a_departure_is_named(dataset, where, change, words):
    change(dataset)
    assert words in faults_at(dataset, where)


def test_ids_twice(dataset):
    ids = ("sample", np.r_[0, np.arange(59)].astype(np.int32), dataset["sample"].attrs)
    assert faults_at(dataset.assign_coords(sample=ids), "sample") == "1 ids twice: 0"


def test_hole_in_a_finished_row(dataset):
    row = int(np.flatnonzero(dataset["status"].to_numpy() == 0)[3])
    dataset["burden_velocity"].to_numpy()[row] = np.nan
    dataset["history_radius"].to_numpy()[row, 2] = np.inf
    assert f"not finite in finished samples: 1 sample, id {row}" in faults_at(
        dataset, "burden_velocity"
    )
    assert f"id {row}" in faults_at(dataset, "history_radius")


def test_number_in_a_failed_row(dataset):
    row = int(np.flatnonzero(dataset["status"].to_numpy() != 0)[0])
    dataset["burden_velocity"].to_numpy()[row] = 3.0
    assert f"not NaN in failed samples: 1 sample, id {row}" in faults_at(dataset, "burden_velocity")


def test_changed_value(dataset):
    """A change that no rule forbids is seen by the hash."""
    dataset["burden"].to_numpy()[4] *= 1.0 + 1e-15
    assert places(dataset) == {"content_sha256"}
    assert places(rehash(dataset)) == set()


def test_hash_is_over_the_content_only(dataset):
    """The order of variables and the compression do not count; type, unit and values do."""
    shuffled = dataset[sorted(map(str, dataset.data_vars), reverse=True)]
    assert content_hash(shuffled) == content_hash(dataset)
    single = dataset.assign(burden=dataset["burden"].astype(np.float32))
    assert content_hash(single) != content_hash(dataset)


def test_all_faults_at_once(dataset):
    del dataset.attrs["license"]
    dataset["ucs"].attrs["units"] = "MPa"
    dataset["split"].to_numpy()[0] = 99
    dataset = dataset.drop_vars(["venting_time", "history_time"])
    assert places(dataset) == {
        "attribute license", "ucs", "split", "venting_time", "history_time", "content_sha256"
    }  # fmt: skip


def test_the_format_page_names_everything(repository):
    page = (repository / "data_specs" / "FORMAT.md").read_text(encoding="utf-8")
    words = set(re.findall(r"[A-Za-z_0-9]+", page))
    for name in (*LABELS, *HISTORIES, *DESCRIPTORS, *REQUIRED_ATTRIBUTES):
        assert name in words, name
