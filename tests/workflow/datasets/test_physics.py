"""A small dataset of the real physics through the command line: checked, described, reproduced."""

import json

import numpy as np
import pytest
import yaml
from stand_in import Cluster

from castblast.dataset.file.schema import flag_names
from castblast.dataset.file.store import open_dataset

SIZE = 48


@pytest.fixture(scope="module")
def recipe(repository, tmp_path_factory):
    """The shipped recipe `full` on a coarse mesh."""
    content = yaml.safe_load(
        (repository / "data_specs" / "recipes" / "full.yaml").read_text(encoding="utf-8")
    )
    content["solver"] |= {"zones": 100, "mode": "paper"}
    content |= {"shard_size": 8, "max_failed_share": 0.1}
    path = tmp_path_factory.mktemp("physics") / "coarse.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return path


@pytest.fixture(scope="module")
def file(castblast, recipe):
    """The dataset, made with two workers."""
    out = recipe.parent / "two" / "data.nc"
    done = castblast("generate", recipe, "--size", SIZE, "--workers", 2, "--out", out, "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["n_ok"] + document["n_failed"] == SIZE
    return out


def test_check_finds_no_fault(castblast_here, file):
    done = castblast_here("dataset", "check", file)
    assert done.returncode == 0, done.stdout
    assert "no faults" in done.stdout


def test_one_worker_gives_the_same_bytes(castblast, recipe, file):
    out = recipe.parent / "one" / "data.nc"
    done = castblast("generate", recipe, "--size", SIZE, "--workers", 1, "--out", out, "--quiet")
    assert done.returncode == 0, done.stderr
    assert out.read_bytes() == file.read_bytes()


def test_a_cluster_and_another_cut_into_shards_give_the_same_rows(
    castblast, castblast_here, recipe, file, tmp_path
):
    """Two worker processes over TCP, five rows to a shard: rows do not know their neighbours."""
    other = tmp_path / "coarse.yaml"
    content = yaml.safe_load(recipe.read_text())
    other.write_text(yaml.safe_dump(content | {"shard_size": 5}, sort_keys=False))
    cluster = Cluster(tmp_path / "cluster")
    try:
        cluster.wait(2)
        done = castblast(
            "generate", other, "--size", SIZE, "--scheduler", cluster.address,
            "--out", tmp_path, "--quiet",
        )  # fmt: skip
    finally:
        cluster.close()
    assert done.returncode == 0, done.stderr
    done = castblast_here("dataset", "diff", file, tmp_path / "data.nc", "--json")
    assert done.returncode == 0, done.stdout
    assert json.loads(done.stdout)["same"]


def test_an_extension_keeps_old_rows_and_is_reproduced(castblast, castblast_here, file, tmp_path):
    done = castblast("dataset", "extend", file, "--add", 8, "--out", tmp_path, "--json")
    assert done.returncode == 0, done.stderr
    more = tmp_path / "data.nc"
    assert json.loads(done.stdout)["id"] == "full/1.4.0"
    done = castblast_here("dataset", "diff", file, more, "--json")
    assert done.returncode == 4
    found = json.loads(done.stdout)
    assert found["rows"] == {"common": SIZE, "first_only": 0, "second_only": 8}
    assert found["variables"] == {}
    for sample in (3, SIZE + 5):
        done = castblast_here("dataset", "reproduce", more, "--sample", sample, "--json")
        assert done.returncode == 0, done.stdout
        assert json.loads(done.stdout)["same"]


@pytest.mark.parametrize("sample", [0, 17, SIZE - 1])
def test_samples_are_reproduced_from_the_file_alone(castblast, file, sample, tmp_path):
    """In another folder, without the recipe or the explosives of the source tree at hand."""
    moved = tmp_path / "moved.nc"
    moved.write_bytes(file.read_bytes())
    done = castblast("dataset", "reproduce", moved, "--sample", sample, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["same"]
    assert document["recomputed"]["burden_velocity"] == document["stored"]["burden_velocity"]


def test_a_changed_number_is_not_reproduced(castblast_here, file, tmp_path):
    import netCDF4

    moved = tmp_path / "moved.nc"
    moved.write_bytes(file.read_bytes())
    with netCDF4.Dataset(moved, "a") as stored:
        stored["burden_velocity"][3] *= 1.0 + 1e-6
    assert castblast_here("dataset", "check", moved).returncode == 4
    done = castblast_here("dataset", "reproduce", moved, "--sample", 3)
    assert done.returncode == 4
    assert "differs, most in burden_velocity" in done.stdout


def test_no_such_sample(castblast_here, file):
    done = castblast_here("dataset", "reproduce", file, "--sample", SIZE)
    assert done.returncode == 2
    assert f"no sample {SIZE}; ids are 0 to {SIZE - 1}" in done.stderr


def test_describe(castblast_here, file):
    done = castblast_here("dataset", "describe", file, "--json")
    document = json.loads(done.stdout)
    assert document["size"] == SIZE
    assert sum(document["split"].values()) == SIZE
    assert document["explosive"] == dict.fromkeys(
        ("anfo", "doped_emulsion", "gassed_emulsion", "heavy_anfo"), SIZE // 4
    )
    ucs = document["variables"]["ucs"]
    assert 10e6 <= ucs["min"] < ucs["mean"] < ucs["max"] <= 200e6


def test_physics_of_the_rows(file):
    """Facts every row keeps: pressure falls, the hole grows, charge and stemming fill the hole."""
    dataset = open_dataset(file)
    ok = dataset["status"].to_numpy() == 0
    value = {str(k): np.broadcast_to(v.to_numpy(), (SIZE,))[ok] for k, v in dataset.items()
             if v.dims in ((), ("sample",))}  # fmt: skip
    assert np.allclose(value["charge_length"] + value["stemming_length"], value["bench_height"])
    assert np.all(value["stemming_length"] >= 0.4 * value["burden"] * (1 - 1e-12))
    assert np.all(value["charge_length"] >= 1.0)
    assert np.all(value["expanded_hole_radius"] > 0.5 * value["hole_diameter"])
    assert np.all(value["equilibrium_pressure"] < value["explosion_pressure"])
    assert np.all(value["burden_velocity"] > 0.0)
    assert np.all(np.abs(value["energy_residual"]) < 0.01)
    pressure = dataset["history_pressure"].to_numpy()[ok]
    start = dataset["explosive_initial_pressure"].to_numpy()[dataset["explosive"].to_numpy()[ok]]
    assert np.all(pressure <= start[:, None] * (1 + 1e-6))
    assert set(flag_names(dataset["split"])) <= {"train", "valid", "calibration", "test"}
