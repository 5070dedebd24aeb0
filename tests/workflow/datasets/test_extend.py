"""More rows for a written dataset: the old ones stay, the new ones can be made again."""

import hashlib
import json

import netCDF4
import numpy as np
import pytest
from fake_blast import FakeBlast, fake_generate, fake_simulator, write_recipe

from castblast.dataset.building.extend import read_existing
from castblast.dataset.file.check import check
from castblast.dataset.file.compare import compare
from castblast.dataset.file.store import open_dataset
from castblast.errors import CheckError, SimulationError, SpecError
from castblast.stages.datasets.dataset import describe_dataset
from castblast.stages.datasets.diff import diff_datasets
from castblast.stages.datasets.extend import extend


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A dataset of 60 rows, a fifth of which failed."""
    folder = tmp_path_factory.mktemp("extend")
    recipe = write_recipe(folder / "r.yaml", max_failed_share=1.0)
    simulator = fake_simulator(recipe, fail_above=100e6)
    return fake_generate(recipe, folder / "data.nc", simulator=simulator).path


def extend_fake(path, add, out, *, simulator=None, **options):
    simulator = simulator or fake_simulator(path.with_name("r.yaml"), fail_above=100e6)
    return extend(path, add, out, simulator=simulator, **options)


@pytest.fixture(scope="module")
def extended(made):
    before = made.read_bytes()
    out = made.parent / "more" / "data.nc"
    extend_fake(made, 25, out, workers=2)
    assert made.read_bytes() == before
    return out


def test_old_rows_are_equal_and_new_ones_follow(made, extended):
    old, new = open_dataset(made), open_dataset(extended)
    assert new["sample"].to_numpy().tolist() == list(range(85))
    first = new.isel(sample=slice(0, 60))
    for name in old.variables:
        np.testing.assert_array_equal(first[name].to_numpy(), old[name].to_numpy(), strict=True)
        assert str(first[name].attrs) == str(old[name].attrs)
    fresh = new.isel(sample=slice(60, 85))
    assert not set(fresh["burden"].to_numpy()) & set(old["burden"].to_numpy())
    assert set(fresh["design_batch"].to_numpy()).isdisjoint(old["design_batch"].to_numpy())
    assert np.bincount(fresh["split"].to_numpy()).tolist() == [20, 1, 1, 3]
    assert check(new) == []


def test_the_file_says_what_it_was_extended_from(made, extended):
    old, new = open_dataset(made).attrs, open_dataset(extended).attrs
    assert new["id"] == "small/1.3.0"
    parent = {"id": "small/1.2.0", "size": 60, "content_sha256": old["content_sha256"]}
    assert json.loads(new["extends"]) == [parent]
    assert json.loads(new["made_from"])["extends"] == [parent]
    assert new["designs_drawn"] > old["designs_drawn"]
    assert new["rows_sha256"] != old["rows_sha256"]
    assert "small/1.2.0 extended to 85 samples" in new["history"]
    assert describe_dataset(extended).document["size"] == 85


def test_old_rows_are_not_simulated(made, tmp_path):
    """A simulator that counts: only the new rows, and the one that compiles, reach it."""
    log = tmp_path / "log.txt"

    class Counting(FakeBlast):
        def run(self, inputs, explosive):
            with log.open("a") as stream:
                print(len(explosive), file=stream)
            return super().run(inputs, explosive)

    base = fake_simulator(made.with_name("r.yaml"), fail_above=100e6)
    extend_fake(made, 25, tmp_path, simulator=Counting(**vars(base)), workers=1)
    assert sum(map(int, log.read_text().split())) == 1 + 25


@pytest.mark.parametrize("workers", [1, 4])
def test_the_same_extension_has_the_same_bytes(made, extended, tmp_path, workers):
    extend_fake(made, 25, tmp_path / "data.nc", workers=workers)
    assert (tmp_path / "data.nc").read_bytes() == extended.read_bytes()


def test_goes_on_after_a_breakdown(made, extended, tmp_path):
    """The second shard of the new rows breaks down; the same command then finishes."""
    burden = open_dataset(extended)["burden"].to_numpy()
    broken = fake_simulator(made.with_name("r.yaml"), fail_above=100e6)
    broken = FakeBlast(**{**vars(broken), "broken": (float(burden[72]),)})
    with pytest.raises(RuntimeError, match="broke down"):
        extend_fake(made, 25, tmp_path, simulator=broken, workers=1)
    assert not (tmp_path / "data.nc").exists()
    outcome = extend_fake(made, 25, tmp_path)
    assert outcome.lines[0].startswith("resume: ")
    assert (tmp_path / "data.nc").read_bytes() == extended.read_bytes()


def test_an_extension_can_be_extended(made, extended, tmp_path):
    path = tmp_path / "data.nc"
    fake = fake_simulator(made.with_name("r.yaml"), fail_above=100e6)
    extend(extended, 5, path, simulator=fake)
    attributes = open_dataset(path).attrs
    assert attributes["id"] == "small/1.4.0"
    assert [entry["size"] for entry in json.loads(attributes["extends"])] == [60, 85]


def test_an_extension_that_is_there_is_left_alone(made, extended):
    outcome = extend_fake(made, 25, extended)
    assert "finished already" in outcome.lines[0]
    with pytest.raises(SpecError, match="size: 85 → 90"):
        extend_fake(made, 30, extended)


def test_never_onto_itself(made):
    with pytest.raises(SpecError, match="is the dataset to be extended"):
        extend_fake(made, 5, made)


def test_new_failures_count(made, tmp_path):
    """The share of failures is that of all rows."""
    recipe = write_recipe(tmp_path / "r.yaml", max_failed_share=0.1)
    path = fake_generate(recipe, tmp_path / "data.nc").path
    failing = fake_simulator(recipe, fail_above=0.0)
    with pytest.raises(SimulationError, match=r"20 of 80 samples failed \(25\.0%\)"):
        extend_fake(path, 20, tmp_path / "more", simulator=failing)


def damaged(made, tmp_path, change):
    path = tmp_path / "data.nc"
    path.write_bytes(made.read_bytes())
    with netCDF4.Dataset(path, "a") as stored:
        change(stored)
    return path


def test_a_damaged_dataset_is_not_extended(made, tmp_path):
    def change(stored):
        stored["burden"][3] *= 1.0 + 1e-12

    with pytest.raises(CheckError, match="not extended"):
        read_existing(damaged(made, tmp_path, change))


def test_other_code_does_not_extend(made, tmp_path):
    """Rows of one dataset come from one physics; the message has the difference and ways on."""

    def change(stored):
        origin = json.loads(stored.made_from)
        origin["code"]["source_sha256"] = hashlib.sha256(b"other").hexdigest()
        origin["libraries"]["numba"] = "0.1"
        stored.made_from = json.dumps(origin)

    with pytest.raises(SpecError) as caught:
        read_existing(damaged(made, tmp_path, change))
    message = str(caught.value)
    assert "the code of the physics has changed" in message
    assert "numba: 0.1 → " in message
    assert "either extend it with what made it" in message
    assert "new version" in message


def test_diff_of_a_dataset_with_itself(made):
    outcome = diff_datasets(made, made)
    assert outcome.ok
    assert outcome.lines[0].startswith("small/1.2.0: the same 60 samples")
    assert not outcome.rows


def test_diff_of_an_extension(made, extended):
    outcome = diff_datasets(made, extended)
    assert not outcome.ok
    text = "\n".join(outcome.lines)
    assert "size: 60 → 85" in text
    assert "version: 1.2.0 → 1.3.0" in text
    assert "60 common, 25 only in the second (ids 60 to 84)" in text
    assert "the 60 common samples are equal in every value" in text
    assert outcome.document["rows"] == {"common": 60, "first_only": 0, "second_only": 25}


def test_diff_finds_the_largest_difference_and_its_row(made, tmp_path):
    def change(stored):
        stored["burden_velocity"][7] *= 1.0 + 1e-6
        stored["burden_velocity"][2] *= 1.0 - 1e-7
        stored["history_radius"][4, 5] *= np.float32(1.001)
        stored["split"][9] = 3 - stored["split"][9]
        stored["ucs"].units = "MPa"
        stored.license = "other"

    outcome = diff_datasets(made, damaged(made, tmp_path, change))
    found = outcome.document["variables"]
    assert found["burden_velocity"]["rows"] == 2
    assert found["burden_velocity"]["sample"] == 7
    assert found["burden_velocity"]["largest_relative_difference"] == pytest.approx(1e-6, rel=1e-3)
    assert found["history_radius"]["sample"] == 4
    assert found["split"] == {"rows": 1, "largest_relative_difference": np.inf, "sample": 9}
    assert outcome.document["form"] == ["ucs: units Pa → MPa"]
    assert outcome.document["attributes"] == ["license: CC-BY-4.0 → other"]
    assert [row[0] for row in outcome.rows] == ["split", "history_radius", "burden_velocity"]


def test_diff_by_id_not_by_place(made):
    """Rows in another order, and some missing: the common ones are still equal."""
    dataset = open_dataset(made)
    other = dataset.isel(sample=np.r_[50:30:-1, 5:20])
    found = compare(dataset, other)
    assert found.columns == []
    assert found.common == 35
    assert len(found.first_only) == 25
    assert not found.same


def test_diff_of_a_failed_and_a_finished_row(made):
    one, two = open_dataset(made), open_dataset(made)
    row = int(np.flatnonzero(one["status"].to_numpy() != 0)[0])
    two["status"].to_numpy()[row] = 0
    two["burden_velocity"].to_numpy()[row] = 3.0
    found = {column.name: column for column in compare(one, two).columns}
    assert set(found) == {"status", "burden_velocity"}
    assert found["burden_velocity"].largest == np.inf


def test_diff_of_recipes(made, tmp_path):
    recipe = write_recipe(tmp_path / "r.yaml", explosives=["anfo", "heavy_anfo"], seed=8)
    other = fake_generate(recipe, tmp_path / "data.nc").path
    outcome = diff_datasets(made, other)
    text = "\n".join(outcome.lines)
    assert "seed: 7 → 8" in text
    assert "explosive: flag_meanings" in text
    assert ("number of explosives", "1", "changed", "") in outcome.rows
