"""Rows unlike those trained on: a model that knows why meets them, one that knows names cannot."""

import json

import numpy as np
import pytest

from castblast.specs.models.model import PAPER_FEATURES, PAPER_TARGETS, RidgeSpec
from castblast.surrogate.fitting.features import read_table
from castblast.surrogate.fitting.metrics import score_targets, summary_error
from castblast.surrogate.fitting.training import Fit, Restart, fit_spec
from castblast.surrogate.judging.shifts import (
    describes_explosives,
    dimensionless_groups,
    shift_tests,
)

SPEC = RidgeSpec(name="power_law", input_transform="log", target_transform="log", penalty=0.0)
#: What the toy dataset multiplies its answers with, to some power.
STRENGTH = {"anfo": 1.0, "doped_emulsion": 1.3, "gassed_emulsion": 1.1, "heavy_anfo": 1.2}


@pytest.fixture(scope="module")
def table(toy_dataset):
    return read_table(toy_dataset(1500, bend=0.0), PAPER_FEATURES, PAPER_TARGETS)


def describing(descriptor):
    """Least squares on logarithms of the inputs and of one number that describes an explosive."""

    def refit(spec, table):
        inputs = np.log(table.frame[list(table.feature_names)].to_numpy())
        number = np.array([descriptor[name] for name in table.frame["explosive"]])
        matrix = np.column_stack([np.ones(len(inputs)), inputs, number])
        train = table.rows("train")
        weights = np.linalg.lstsq(matrix[train], np.log(table.targets[train]), rcond=None)[0]
        predicted = np.exp(matrix @ weights)
        valid = table.rows("valid")
        scores = score_targets(table.targets[valid], predicted[valid], table.target_names)
        restart = Restart(0, summary_error(scores), 0, True)
        band = np.zeros(len(table.target_names))
        return Fit(spec, None, None, table, predicted, band, (restart,), 0, 0.0)

    return refit


def by_name(document):
    return {test["name"]: test for test in document["tests"]}


def test_the_right_descriptor_meets_an_explosive_it_never_saw(table) -> None:
    """The toy's answers are powers of the strength: its logarithm makes the law exact anywhere."""
    refit = describing({name: np.log(value) for name, value in STRENGTH.items()})
    found = shift_tests(refit(SPEC, table), table, able=True, refit=refit)
    json.dumps(found, allow_nan=False)
    tests = by_name(found)
    for name in STRENGTH:
        assert tests[name]["error"] < 1e-9
        kinds = table.frame["explosive"].to_numpy()
        assert tests[name]["train_rows"] == np.sum((kinds != name) & (table.split == "train"))
        assert tests[name]["judged_rows"] == np.sum((kinds == name) & (table.split == "test"))


def test_a_descriptor_that_says_nothing_of_it_fails_there_only(table) -> None:
    """Arbitrary numbers fit three explosives within a few percent but not the fourth."""
    refit = describing({"anfo": 3.0, "doped_emulsion": 0.0, "gassed_emulsion": 1.0,
                        "heavy_anfo": 2.0})  # fmt: skip
    found = by_name(shift_tests(refit(SPEC, table), table, able=True, refit=refit))
    assert found["doped_emulsion"]["error"] > 0.05
    assert found["doped_emulsion"]["ratio"] > 1.5
    assert found["the outer box"]["ratio"] == pytest.approx(1.0, abs=0.2)


def test_a_model_that_knows_names_is_marked_as_unable(table) -> None:
    fit = fit_spec(SPEC, table)
    found = shift_tests(fit, table)
    assert not describes_explosives(SPEC)
    assert found["able_to_meet_new_explosives"] is False
    for name in STRENGTH:
        assert by_name(found)[name]["not_run"] == "the model knows explosives by name alone"
    json.dumps(found, allow_nan=False)


def test_corner_and_groups_leave_out_what_they_say(table) -> None:
    """The power law is exact, so it extrapolates; rows of the training are inside only."""
    seen = []

    def refit(spec, part):
        seen.append(part)
        return fit_spec(spec, part)

    found = by_name(shift_tests(fit_spec(SPEC, table), table, refit=refit))
    groups = dimensionless_groups(table)
    assert set(groups) == {
        "burden over hole diameter", "young modulus over ucs", "stemming length over burden",
    }  # fmt: skip
    corner = found["the outer box"]
    assert corner["error"] < 1e-9
    assert corner["error_of_as_many_random_rows"] < 1e-9
    inner, control = seen[:2]
    assert len(inner.rows("train")) == len(control.rows("train"))
    assert len(inner.rows("train")) == pytest.approx(0.5 * len(table.rows("train")), rel=0.02)
    whole = table.frame.iloc[table.rows("train")]
    part = inner.frame.iloc[inner.rows("train")]
    for name in PAPER_FEATURES:
        assert part[name].max() < whole[name].max()
        assert part[name].min() > whole[name].min()
    for part, (name, values) in zip(seen[2:], groups.items(), strict=True):
        edge = np.quantile(values[table.rows("train")], 0.8)
        kept = dimensionless_groups(part)[name][part.rows("train", "valid", "calibration")]
        assert kept.max() <= edge
        assert found[name]["judged_rows"] == np.sum((values > edge) & (table.split == "test"))


def test_too_few_rows_are_said_not_judged(toy_dataset) -> None:
    table = read_table(toy_dataset(400), PAPER_FEATURES, PAPER_TARGETS)
    few = table.with_train_rows(120)
    found = by_name(shift_tests(fit_spec(SPEC, few), few))
    assert found["the outer box"]["not_run"].startswith("too few rows are left to train")
