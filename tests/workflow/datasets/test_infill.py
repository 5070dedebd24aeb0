"""Chosen rows: a design file is read with all its faults, simulated and joined for training."""

import json
from pathlib import Path

import numpy as np
import pytest
from fake_blast import fake_generate, fake_simulator, write_recipe

from castblast.dataset.building.extend import read_existing
from castblast.dataset.file.check import check
from castblast.dataset.file.store import open_dataset
from castblast.dataset.rows.design_file import read_design_file, write_design_file
from castblast.errors import SpecError
from castblast.stages.datasets import extend as extending
from castblast.stages.datasets.infill import infill, shares_of

VARIABLES = {
    "ucs": {"lower": "10 MPa", "upper": "200 MPa", "distribution": "log_uniform"},
    "burden": {"lower": "1 m", "upper": "6 m"},
    "spacing": {"lower": 0.8, "upper": 1.8, "ratio_of": "burden"},
    "charge_length": {"lower": "1 m", "upper": "9 m"},
    "bench_height": "10 m",
}
EXPLOSIVES = ("anfo", "heavy_anfo", "doped_emulsion")
SPEC = """
kind: mlp
hidden_layers: [4]
max_iterations: 20
features: [ucs, burden, spacing, charge_length]
targets: [burden_velocity, expanded_hole_radius]
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("infill")
    split = {"train": 0.6, "valid": 0.1, "calibration": 0.2, "test": 0.1}
    recipe = write_recipe(folder / "r.yaml", variables=VARIABLES, size=240, split=split)
    return fake_generate(recipe, folder / "data.nc").path


@pytest.fixture(scope="module")
def chosen(made) -> Path:
    spec = made.with_name("small_net.yaml")
    spec.write_text(SPEC)
    infill(made, spec, 20, made.with_name("next.csv"), members=2)
    return made.with_name("next.csv")


def extend(made: Path, design: Path, out: Path, **options):
    simulator = fake_simulator(made.with_name("r.yaml"))
    return extending.extend(made, design, out, simulator=simulator, **options)


def test_infill_writes_rows_of_the_domain(made, chosen) -> None:
    existing = read_existing(made)
    recipe = existing.source.recipe
    columns, explosive = read_design_file(chosen, recipe, EXPLOSIVES)
    assert len(explosive) == 20
    assert set(explosive.tolist()) <= {0, 1, 2}
    shares = shares_of(recipe, columns)
    assert shares.min() >= -1e-12
    assert shares.max() <= 1 + 1e-12
    assert (columns["bench_height"] == 10.0).all()
    stemming = columns["bench_height"] - columns["charge_length"]
    assert (stemming >= 0.4 * columns["burden"] * (1 - 1e-12)).all()


def test_same_call_same_file(made, chosen, tmp_path) -> None:
    outcome = infill(made, made.with_name("small_net.yaml"), 20, tmp_path / "n.csv", members=2)
    assert (tmp_path / "n.csv").read_bytes() == chosen.read_bytes()
    spread = outcome.document["spread_of_chosen"], outcome.document["spread_of_candidates"]
    assert np.mean([spread[0][n] / spread[1][n] for n in spread[0]]) > 1.0


def test_chosen_rows_join_the_training_rows_only(made, chosen, tmp_path) -> None:
    old = open_dataset(made)
    extend(made, chosen, tmp_path / "data.nc", workers=2)
    new = open_dataset(tmp_path / "data.nc")
    assert check(new) == []
    first, fresh = new.isel(sample=slice(0, 240)), new.isel(sample=slice(240, 260))
    np.testing.assert_array_equal(first["split"].to_numpy(), old["split"].to_numpy())
    assert (fresh["split"].to_numpy() == 0).all()
    assert len(set(fresh["design_batch"].to_numpy().tolist())) == 1
    columns, explosive = read_design_file(chosen, read_existing(made).source.recipe, EXPLOSIVES)
    for name in ("ucs", "burden", "spacing", "charge_length"):
        np.testing.assert_array_equal(fresh[name].to_numpy(), columns[name])
    np.testing.assert_array_equal(fresh["explosive"].to_numpy(), explosive)
    (parent,) = json.loads(new.attrs["extends"])
    assert len(parent["design_sha256"]) == 64
    assert "chosen, from design files, training rows only" in new.attrs["design_method"]
    extend(made, chosen, tmp_path / "again.nc", workers=1)
    assert (tmp_path / "again.nc").read_bytes() == (tmp_path / "data.nc").read_bytes()
    assert "finished already" in extend(made, chosen, tmp_path / "data.nc").lines[0]


def test_another_design_is_another_dataset_and_can_be_extended(made, chosen, tmp_path) -> None:
    out = tmp_path / "data.nc"
    extend(made, chosen, out)
    lines = chosen.read_text().splitlines(keepends=True)
    less = tmp_path / "less.csv"
    less.write_text("".join([lines[0], *lines[2:], lines[1]]))
    with pytest.raises(SpecError, match="extends"):
        extend(made, less, out)
    more = tmp_path / "more.nc"
    extending.extend(out, 15, more, simulator=fake_simulator(made.with_name("r.yaml")))
    parents = json.loads(open_dataset(more).attrs["extends"])
    assert ["design_sha256" in parent for parent in parents] == [True, False]
    fresh = open_dataset(more).isel(sample=slice(260, 275))["split"].to_numpy()
    assert len(set(fresh.tolist())) > 1


def test_a_design_file_keeps_every_bit(made, tmp_path) -> None:
    recipe = read_existing(made).source.recipe
    rng = np.random.default_rng(0)
    columns = {
        "ucs": rng.uniform(1e7, 2e8, 9),
        "burden": rng.uniform(1.0, 5.0, 9),
        "charge_length": rng.uniform(1.0, 7.0, 9),
    }
    columns["spacing"] = columns["burden"] * rng.uniform(0.8, 1.8, 9)
    names = [EXPLOSIVES[k] for k in rng.integers(0, 3, 9)]
    path = write_design_file(tmp_path / "d.csv", recipe, columns, names)
    read, kinds = read_design_file(path, recipe, EXPLOSIVES)
    for name, values in columns.items():
        np.testing.assert_array_equal(read[name], values)
    assert [EXPLOSIVES[k] for k in kinds] == names


def test_every_fault_of_a_design_file_is_named(made, tmp_path) -> None:
    recipe = read_existing(made).source.recipe
    path = tmp_path / "bad.csv"
    path.write_text("ucs [MPa],burden [m],spacing [m],charge_length [m],explosive\n")
    with pytest.raises(SpecError, match="no data rows"):
        read_design_file(path, recipe, EXPLOSIVES)
    path.write_text("ucs [MPa],burdn [m],spacing [m],explosive\n80,3,3,anfo\n")
    with pytest.raises(SpecError) as fault:
        read_design_file(path, recipe, EXPLOSIVES)
    for part in ("burdn", "did you mean 'burden'?", "the column 'charge_length' is missing"):
        assert part in str(fault.value)
    head = "ucs [MPa],burden [m],spacing [m],charge_length [m],explosive\n"
    rows = ["80,3,3,5,anfo", "80,3,9,5,anfo", "300,3,3,5,anfu", "80,x,3,5,anfo", "80,3,3,5"]
    path.write_text(head + "\n".join(rows) + "\n")
    with pytest.raises(SpecError) as fault:
        read_design_file(path, recipe, EXPLOSIVES)
    message = str(fault.value)
    assert "line 2" not in message
    for part in (
        "line 3: spacing = 9 m: the recipe has 2.4 m to 5.4 m at this burden",
        "line 4: explosive 'anfu'",
        "line 5: burden",
        "line 6: 4 cells for 5 heads",
    ):
        assert part in message


def test_rows_that_break_a_constraint_are_refused(made, tmp_path) -> None:
    """A charge of 9 m in a bench of 10 m leaves a sixth of a burden of 6 m as stemming."""
    path = tmp_path / "bad.csv"
    head = "ucs [MPa],burden [m],spacing [m],charge_length [m],explosive\n"
    path.write_text(head + "80,3,3,5,anfo\n80,6,6,9,anfo\n")
    with pytest.raises(SpecError, match=r"bad.csv: row 2: constraints: stemming_length below 0\.4"):
        extend(made, path, tmp_path / "o.nc")
    assert not (tmp_path / "o.nc").exists()


def test_a_dataset_is_extended_by_rows_or_by_a_file(castblast, made) -> None:
    both = castblast("dataset", "extend", made, "--add", "5", "--design", "x.csv")
    neither = castblast("dataset", "extend", made)
    for result in (both, neither):
        assert result.returncode == 2
        assert "either --add N or --design FILE" in result.stderr + result.stdout
