"""What enters training: finished rows, the frozen split, and a domain read off the rows."""

import dataclasses
import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from castblast.errors import DatasetError, SpecError, Status
from castblast.specs.models.model import PAPER_FEATURES, PAPER_TARGETS, MlpSpec, RidgeSpec
from castblast.specs.recipe import SPLIT_NAMES
from castblast.surrogate.fitting.features import (
    SPLITS,
    Split,
    domain_constraints,
    input_columns,
    read_table,
)
from castblast.surrogate.fitting.rows import read_rows
from castblast.surrogate.fitting.training import fit_spec


@pytest.fixture(scope="module")
def table(toy_dataset):
    return read_table(toy_dataset(600), PAPER_FEATURES, PAPER_TARGETS)


def test_splits_are_those_of_recipes() -> None:
    assert SPLITS == get_args(Split) == SPLIT_NAMES


def test_failed_samples_are_left_out(toy_dataset) -> None:
    """Their targets are not numbers; not one of them may reach a fit."""
    dataset = toy_dataset(600)
    failed = np.arange(0, 600, 7)
    dataset["status"][failed] = int(Status.NOT_CONVERGED)
    dataset["burden_velocity"][failed] = np.nan
    table = read_table(dataset, PAPER_FEATURES, PAPER_TARGETS)
    assert not set(table.sample) & set(failed)
    assert len(table.sample) == 600 - len(failed)
    assert np.isfinite(table.targets).all()


def test_every_row_is_in_one_split(table) -> None:
    rows = np.concatenate([table.rows(split) for split in SPLITS])
    assert sorted(rows) == list(range(600))


def test_columns_keep_their_values(toy_dataset, table) -> None:
    dataset = toy_dataset(600)
    np.testing.assert_array_equal(table.frame["burden"], dataset["burden"])
    np.testing.assert_array_equal(
        table.targets[:, table.target_names.index("burden_velocity")], dataset["burden_velocity"]
    )
    meanings = dataset["explosive"].attrs["flag_meanings"].split()
    assert list(table.frame["explosive"][:5]) == [
        meanings[k] for k in dataset["explosive"].values[:5]
    ]


def test_held_inputs_and_source_are_kept(table) -> None:
    assert table.held == {"poisson_ratio": 0.25}
    assert table.source["name"] == "toy"
    assert table.source["content_sha256"] == "a" * 64


def test_fewer_training_rows_are_nested_and_leave_the_rest(table) -> None:
    small, large = table.with_train_rows(100), table.with_train_rows(200)
    in_small = set(small.sample[small.rows("train")])
    assert len(in_small) == 100
    assert in_small < set(large.sample[large.rows("train")])
    for split in ("valid", "calibration", "test"):
        np.testing.assert_array_equal(
            small.sample[small.rows(split)], table.sample[table.rows(split)]
        )


def test_domain_rules_hold_for_every_training_row_and_come_close_to_one(table) -> None:
    train = table.frame.iloc[table.rows("train")]
    rules = domain_constraints(table)
    assert len(rules) == 5
    for rule in rules:
        margin = np.asarray(rule.margin(train))
        assert margin.min() > 0.0
        assert margin.min() < 0.05 * np.ptp(margin)
    (least,) = re.findall(r"at least (\S+)", rules[0].label)
    assert float(least) == pytest.approx(0.4, abs=0.01)
    assert "burden" in rules[0].label


def test_the_domain_takes_in_the_ends_of_the_ranges_that_were_drawn_from(table) -> None:
    """No sample of a Latin hypercube lies on 0 or 1, yet it was drawn from all between them."""
    count = len(table.frame)
    drawn = (np.random.default_rng(3).permutation(count) + 0.5) / count
    frame = table.frame.assign(ucs=drawn, burden=np.exp(drawn))
    changed = dataclasses.replace(table, frame=frame)
    kinds = ["log" if name == "burden" else "linear" for name in table.feature_names]
    ones = np.ones(len(kinds))
    columns = {c.name: c for c in input_columns(changed, kinds, ones, ones)}
    assert columns["ucs"].lower == 0.0
    assert 1.0 <= columns["ucs"].upper < 1.02
    assert 0.98 < columns["burden"].lower <= 1.0
    assert np.e <= columns["burden"].upper < np.e * 1.02


def test_all_faults_of_the_columns_at_once(toy_dataset) -> None:
    dataset = toy_dataset(600).drop_vars(["burden", "split"])
    with pytest.raises(DatasetError) as fault:
        read_table(dataset, PAPER_FEATURES, ("burden_velocty",))
    message = str(fault.value)
    assert "burden: the dataset has no such variable" in message
    assert "split: the dataset has no such variable" in message
    assert "did you mean 'burden_velocity'?" in message


def test_too_few_rows_say_how_many_are_needed(toy_dataset) -> None:
    dataset = toy_dataset(600)
    dataset["status"][100:] = 1
    with pytest.raises(DatasetError) as fault:
        read_table(dataset, PAPER_FEATURES, PAPER_TARGETS)
    assert "split 'train'" in str(fault.value)
    assert "(500 failed samples left out)" in str(fault.value)
    assert "at least 100 are needed" in str(fault.value)


def test_a_finished_row_without_a_number_is_a_fault(toy_dataset) -> None:
    dataset = toy_dataset(600)
    dataset["ucs"][17] = np.nan
    with pytest.raises(DatasetError, match="ucs: not finite in 1 finished rows, first sample 17"):
        read_table(dataset, PAPER_FEATURES, PAPER_TARGETS)


def test_an_explosive_without_training_rows_is_a_fault(toy_dataset) -> None:
    dataset = toy_dataset(600)
    dataset["split"][np.flatnonzero(dataset["explosive"] == 0)] = 3
    with pytest.raises(DatasetError, match="explosive 'anfo': no training rows"):
        read_table(dataset, PAPER_FEATURES, PAPER_TARGETS)


def test_labels_need_meanings(toy_dataset) -> None:
    dataset = toy_dataset(600)
    del dataset["split"].attrs["flag_meanings"]
    with pytest.raises(DatasetError, match="split: is not a flag variable"):
        read_table(dataset, PAPER_FEATURES, PAPER_TARGETS)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"features": ("ucs", "poisson_ratio")},
         "spec: features: poisson_ratio: the dataset holds it at 0.25, so nothing can be learned"),
        ({"derived": {"length": {"coefficients": {"bench_height": 1.0, "charge_length": -1.0,
                                                  "stemming_length": -1.0}}},
          "features": ("bench_height", "charge_length", "stemming_length")},
         "spec: derived: length: the sum of bench_height, charge_length, stemming_length is the"),
        ({"targets": ("powder_factor",)},
         "spec: targets: powder_factor: is 0.5 kg/m3 in every row of the dataset; there is"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("kind", [RidgeSpec, MlpSpec])
def test_what_the_dataset_holds_is_no_column_to_learn_from(toy_dataset, change, line, kind) -> None:
    """One line each, from the library as from a verb, instead of a scaling by nothing."""
    dataset = toy_dataset(600)
    held = ("sample", np.full(600, 0.5), {"role": "output"})
    dataset = dataset.assign(powder_factor=held)
    spec = kind(name="spec", **change)
    table = read_table(dataset, spec.features, spec.targets)
    with pytest.raises(SpecError, match=re.escape(line)) as raised:
        fit_spec(spec, table)
    assert "\n" not in str(raised.value)
    with pytest.raises(SpecError, match=re.escape(line)):
        read_rows(dataset, [spec], Path("toy.nc"))


@pytest.mark.parametrize(
    "values",
    [("sample", np.array(["a"] * 600)), ((), 0.5), (("sample", "place"), np.zeros((600, 2)))],
    ids=["text", "one number", "a table"],
)
def test_what_is_no_column_of_numbers_is_told(toy_dataset, values) -> None:
    dataset = toy_dataset(600).drop_vars("ucs").assign(ucs=values)
    with pytest.raises(DatasetError, match=r"^ucs: is no column of numbers, one per sample$"):
        read_table(dataset, PAPER_FEATURES, PAPER_TARGETS)
