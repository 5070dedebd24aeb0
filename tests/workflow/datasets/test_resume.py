"""Builds stopped, damaged, repeated or spread out end in the same bytes, or say why not."""

import json
from contextlib import nullcontext

import numpy as np
import pytest
from fake_blast import fake_generate, fake_simulator, write_recipe

from castblast.dataset.building import build
from castblast.dataset.building.workplace import sole_builder
from castblast.dataset.file.store import open_dataset
from castblast.disk.locks import LockedError
from castblast.errors import OutputError, SimulationError, SpecError

#: Shards of the small recipe: 60 rows, 12 to a shard.
SHARDS = 5


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Bytes of dataset and card of an undisturbed build."""
    folder = tmp_path_factory.mktemp("undisturbed")
    fake_generate(write_recipe(folder / "r.yaml"), folder / "data.nc", workers=1)
    return contents(folder)


def contents(folder):
    return [(folder / name).read_bytes() for name in ("data.nc", "DATASHEET.md")]


def shards(folder):
    return sorted((folder / "data.work").glob("shard-*.npz"))


def half_built(tmp_path):
    """Break down in mid-run: some shards are there, the dataset is not."""
    recipe = write_recipe(tmp_path / "r.yaml")
    with pytest.raises(RuntimeError, match="broke down"):
        fake_generate(
            recipe, tmp_path / "data.nc", simulator=fake_simulator(recipe, break_at=2), workers=1
        )
    assert 0 < len(shards(tmp_path)) < SHARDS
    assert not (tmp_path / "data.nc").exists()
    return recipe


@pytest.mark.parametrize("workers", [2, 4])
def test_same_bytes_for_any_number_of_workers(tmp_path, undisturbed, workers):
    fake_generate(write_recipe(tmp_path / "r.yaml"), tmp_path / "data.nc", workers=workers)
    assert contents(tmp_path) == undisturbed
    assert not (tmp_path / "data.work").exists()


def test_no_scheduler_there(tmp_path, monkeypatch):
    monkeypatch.setattr("castblast.dataset.building.build._CONNECT_SECONDS", 0.5)
    recipe = write_recipe(tmp_path / "r.yaml")
    with pytest.raises(SpecError, match=r"--scheduler tcp://127.0.0.1:1: no Dask scheduler"):
        fake_generate(recipe, tmp_path / "data.nc", scheduler="tcp://127.0.0.1:1")


def test_goes_on_after_a_breakdown(tmp_path, undisturbed):
    recipe = half_built(tmp_path)
    valid = len(shards(tmp_path))
    outcome = fake_generate(recipe, tmp_path / "data.nc")
    assert outcome.lines[0] == f"resume: {valid} of {SHARDS} shards valid, {SHARDS - valid} to do"
    assert contents(tmp_path) == undisturbed


@pytest.mark.parametrize("damage", ["cut", "empty", "text", "changed", "foreign"])
def test_damaged_shards_are_made_again(tmp_path, undisturbed, damage):
    recipe = half_built(tmp_path)
    first = shards(tmp_path)[0]
    content = first.read_bytes()
    if damage == "cut":
        first.write_bytes(content[: len(content) // 2])
    elif damage == "empty":
        first.write_bytes(b"")
    elif damage == "text":
        first.write_text("burden,velocity\n")
    elif damage == "changed":
        with np.load(first) as stored:
            arrays = dict(stored)
        arrays["burden_velocity"][0] = 1.0
        np.savez(first, **arrays)
    else:
        other = tmp_path / "other"
        fake_recipe = write_recipe(other / "r.yaml", seed=8)
        with pytest.raises(RuntimeError):
            fake_generate(
                fake_recipe,
                other / "data.nc",
                simulator=fake_simulator(fake_recipe, break_at=2),
                workers=1,
            )
        first.write_bytes(shards(other)[0].read_bytes())
    outcome = fake_generate(recipe, tmp_path / "data.nc")
    assert "1 cut shard moved aside" in outcome.lines[0]
    assert contents(tmp_path) == undisturbed


def test_finished_dataset_is_left_alone(tmp_path):
    recipe = write_recipe(tmp_path / "r.yaml")
    fake_generate(recipe, tmp_path / "data.nc")
    before = (tmp_path / "data.nc").stat().st_mtime_ns
    broken = fake_simulator(recipe, break_at=0)
    outcome = fake_generate(recipe, tmp_path / "data.nc", simulator=broken)
    assert "finished already" in outcome.lines[0]
    assert (tmp_path / "data.nc").stat().st_mtime_ns == before


def test_cut_dataset_is_made_again(tmp_path, undisturbed):
    recipe = write_recipe(tmp_path / "r.yaml")
    (tmp_path / "data.nc").write_bytes(undisturbed[0][:1000])
    fake_generate(recipe, tmp_path / "data.nc")
    assert contents(tmp_path) == undisturbed
    assert (tmp_path / "data.nc.cut").exists()


def test_foreign_file_is_not_overwritten(tmp_path):
    import xarray as xr

    xr.Dataset({"temperature": ("x", np.zeros(3))}).to_netcdf(tmp_path / "data.nc")
    before = (tmp_path / "data.nc").read_bytes()
    with pytest.raises(SpecError, match="is not a dataset of castblast"):
        fake_generate(write_recipe(tmp_path / "r.yaml"), tmp_path / "data.nc")
    assert (tmp_path / "data.nc").read_bytes() == before


@pytest.mark.parametrize("finished", [True, False])
def test_changed_recipe_names_the_difference_and_the_ways_on(tmp_path, finished):
    recipe = write_recipe(tmp_path / "r.yaml") if finished else half_built(tmp_path)
    if finished:
        fake_generate(recipe, tmp_path / "data.nc")
    ranges = {
        "ucs": {"lower": "10 MPa", "upper": "250 MPa", "distribution": "log_uniform"},
        "burden": {"lower": "1 m", "upper": "15 m"},
        "bench_height": "12 m",
    }
    write_recipe(recipe, variables=ranges, seed=8, title="A new title")
    with pytest.raises(SpecError) as caught:
        fake_generate(recipe, tmp_path / "data.nc")
    message = str(caught.value)
    assert "variables.ucs.upper: 200 MPa → 250 MPa" in message
    assert "variables.bench_height.value: 10 m → 12 m" in message
    assert "variables.charge_length.lower: 1 m → (not given)" in message
    assert "seed: 7 → 8" in message
    assert "title" not in message
    assert "--restart" in message
    assert "new name or version" in message
    fake_generate(recipe, tmp_path / "data.nc", restart=True)
    assert open_dataset(tmp_path / "data.nc").attrs["design_seed"] == "8"


def test_changed_code_is_a_difference(tmp_path):
    recipe = half_built(tmp_path)
    note = tmp_path / "data.work" / "made_from.json"
    content = json.loads(note.read_text())
    content["code"]["source_sha256"] = "0" * 64
    content["libraries"]["numba"] = "0.1"
    note.write_text(json.dumps(content))
    with pytest.raises(SpecError) as caught:
        fake_generate(recipe, tmp_path / "data.nc")
    assert "the code of the physics has changed" in str(caught.value)
    assert "numba: 0.1 → " in str(caught.value)


def test_too_many_failed_samples(tmp_path):
    """The stage fails naming causes and rows; a larger allowance then needs no new simulation."""
    recipe = write_recipe(tmp_path / "r.yaml", max_failed_share=0.05)
    failing = fake_simulator(recipe, fail_above=100e6)
    with pytest.raises(SimulationError) as caught:
        fake_generate(recipe, tmp_path / "data.nc", simulator=failing)
    lines = str(caught.value).splitlines()
    assert "more than the max_failed_share of 5.0%" in lines[0]
    assert "not_converged: the run reached its step or time limit" in lines[1]
    assert len(lines) == 7
    assert all("sample" in line and "ucs 1" in line and "MPa" in line for line in lines[2:])
    assert not (tmp_path / "data.nc").exists()
    write_recipe(recipe, max_failed_share=1.0)
    broken = fake_simulator(recipe, break_at=0)
    outcome = fake_generate(recipe, tmp_path / "data.nc", simulator=broken)
    assert f"{SHARDS} of {SHARDS} shards valid" in outcome.lines[0]
    assert "not_converged" in outcome.lines[1]


def test_progress_counts_rows_rate_and_failures(tmp_path):
    recipe = write_recipe(tmp_path / "r.yaml", max_failed_share=1.0)
    seen = []
    fake_generate(
        recipe,
        tmp_path / "data.nc",
        simulator=fake_simulator(recipe, fail_above=100e6),
        progress=lambda share, line: seen.append((share, line)),
    )
    shares = [share for share, _ in seen]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    running = [line for _, line in seen if "samples/s" in line]
    assert len(running) == SHARDS
    assert running[-1].startswith("60/60 failed 13 ")
    assert running[-1].endswith("ETA 0:00:00")


def test_a_second_build_in_the_same_place_is_refused(tmp_path):
    """It would remove the shards of the first one."""
    recipe = write_recipe(tmp_path / "r.yaml")
    broken = fake_simulator(recipe, break_at=0)
    target = tmp_path / "data.nc"
    with sole_builder(target), pytest.raises(LockedError, match="is writing there; wait"):
        fake_generate(recipe, target, simulator=broken)
    fake_generate(recipe, target)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["DATASHEET.md", "data.nc", "r.yaml"]


def test_unwritable_place_stops_before_any_run(tmp_path):
    (tmp_path / "file").touch()
    recipe = write_recipe(tmp_path / "r.yaml")
    with pytest.raises(OutputError, match="cannot be written to"):
        fake_generate(
            recipe,
            tmp_path / "file" / "data.nc",
            simulator=fake_simulator(recipe, break_at=0),
        )


def test_workers_say_nothing_on_the_screen(tmp_path, capfd):
    fake_generate(write_recipe(tmp_path / "r.yaml"), tmp_path / "data.nc", workers=2)
    out, err = capfd.readouterr()
    assert out == ""
    assert err == ""


class SlowToClose:
    """Stands in for a client of Dask that takes too long to close."""

    def __init__(self, *_, **__):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        raise TimeoutError("Timeout")


def test_a_slow_end_of_dask_does_not_hide_the_interrupt(monkeypatch):
    monkeypatch.setattr("dask.distributed.Client", SlowToClose)
    monkeypatch.setattr(build, "_local_cluster", lambda _: nullcontext())
    with pytest.raises(KeyboardInterrupt), build._client(1, None):
        raise KeyboardInterrupt
    with pytest.raises(TimeoutError), build._client(1, None):
        pass
