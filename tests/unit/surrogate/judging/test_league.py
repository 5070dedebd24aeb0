"""The league: who is told apart from whom, who is chosen, what is missed by how much."""

import dataclasses
import json

import numpy as np
import pytest

from castblast.errors import SpecError
from castblast.specs.models.model import PAPER_FEATURES, PAPER_TARGETS, RidgeSpec
from castblast.surrogate.fitting.features import read_table
from castblast.surrogate.fitting.training import fit_spec
from castblast.surrogate.judging.comparison import compare, mark_of
from castblast.surrogate.judging.timing import timings

SPEC = RidgeSpec(name="power_law", input_transform="log", target_transform="log", penalty=0.0)
PASSED = {"passed": True, "reasons": []}
FAILED = {"passed": False, "reasons": ["burden_velocity falls with burden: 3 of 9 are wrong"]}


@pytest.fixture(scope="module")
def fit(toy_dataset):
    return fit_spec(SPEC, read_table(toy_dataset(600), PAPER_FEATURES, PAPER_TARGETS))


def renamed(fit, name, factor=1.0, valid=1.0):
    """The same fit under another name, its errors times a factor, its validation error too."""
    predicted = fit.table.targets + factor * (fit.predicted - fit.table.targets)
    restart = fit.restart._replace(valid_error=fit.restart.valid_error * valid)
    return dataclasses.replace(
        fit,
        spec=fit.spec.model_copy(update={"name": name}),
        predicted=predicted,
        restarts=(restart,),
        chosen=0,
    )


def entry(league, name):
    return next(one for one in league["league"] if one["name"] == name)


def test_identical_models_cannot_be_told_apart_and_better_ones_can(fit) -> None:
    """Twins differ by nothing on every draw; half the error on every row is less on every draw."""
    fits = [fit, renamed(fit, "twin"), renamed(fit, "half", 0.5, valid=0.5)]
    league = compare(fits)
    assert entry(league, "power_law")["not_distinguishable_from"] == ["twin"]
    assert entry(league, "twin")["not_distinguishable_from"] == ["power_law"]
    assert entry(league, "half")["not_distinguishable_from"] == []
    assert entry(league, "twin")["distinguishable_from_first"]
    assert not entry(league, "half")["distinguishable_from_first"]
    for target in PAPER_TARGETS:
        whole, half = (
            entry(league, name)["targets"][target]["relative_error_95"] for name in ("twin", "half")
        )
        assert half == pytest.approx(0.5 * whole, rel=1e-6)


def test_the_league_is_ranked_and_chosen_by_validation_rows_test_rows_only_report(fit) -> None:
    """Half the error on the test rows wins nothing for a model that is worse on validation rows."""
    league = compare(
        [renamed(fit, "lucky", 0.5, valid=2.0), fit, renamed(fit, "unlucky", 3.0, 0.9)]
    )
    names = [one["name"] for one in league["league"]]
    assert names == ["unlucky", "power_law", "lucky"]
    assert league["chosen"] == league["best_exportable"] == league["best_overall"] == "unlucky"
    reported = {one["name"]: one["test_error"] for one in league["league"]}
    assert reported["lucky"] < reported["power_law"] < reported["unlucky"]


def test_luck_of_the_rows_is_not_taken_for_skill(fit) -> None:
    """Two models whose errors are the same numbers dealt to other rows are not told apart."""
    rng = np.random.default_rng(5)
    ratio = fit.predicted / fit.table.targets
    test = fit.table.rows("test")
    shuffled = ratio.copy()
    shuffled[test] = ratio[rng.permutation(test)]
    other = dataclasses.replace(renamed(fit, "shuffled"), predicted=shuffled * fit.table.targets)
    league = compare([fit, other])
    assert entry(league, "shuffled")["not_distinguishable_from"] == ["power_law"]


def test_a_model_that_fails_the_gate_is_marked_and_not_chosen(fit) -> None:
    fits = [renamed(fit, "best", 0.5, valid=0.5), renamed(fit, "next", 0.8, valid=0.8), fit]
    gates = {"best": FAILED, "next": PASSED, "power_law": PASSED}
    league = compare(fits, gates)
    assert league["best_overall"] == league["best_exportable"] == "best"
    assert league["chosen"] == "next"
    assert league["gap"] == pytest.approx(0.8 / 0.5)
    assert entry(league, "best")["gate_passed"] is False
    assert entry(league, "best")["gate_reasons"] == FAILED["reasons"]
    assert "physics gate" in league["rule"]
    assert compare(fits)["chosen"] == "best"
    assert entry(compare(fits), "best")["gate_passed"] is None


def test_where_all_fail_none_is_chosen(fit) -> None:
    league = compare([fit], {"power_law": FAILED})
    assert league["chosen"] is None
    assert league["best_exportable"] == "power_law"
    json.dumps(league, allow_nan=False)


def test_the_choice_needs_an_exportable_model(fit) -> None:
    with pytest.raises(SpecError, match="none of the models can be exported"):
        compare([dataclasses.replace(fit, network=None)])


def test_marks_say_by_how_much_they_are_missed(fit) -> None:
    """Errors scaled so that the velocity misses its mark by 3 and then keeps it exactly."""
    mark = mark_of("burden_velocity")
    assert mark == (0.99995, 0.005)
    assert mark_of("crushed_zone_radius") == (0.9999, 0.01)
    figures = entry(compare([fit]), "power_law")["targets"]["burden_velocity"]
    scale = 3.0 * mark.relative_error_95 / figures["relative_error_95"]
    three = entry(compare([renamed(fit, "three", scale)]), "three")["targets"]["burden_velocity"]
    assert three["mark"]["error_over_mark"] == pytest.approx(3.0)
    assert not three["mark"]["met"]
    left = (1.0 - figures["r2"]) * scale**2 / (1.0 - mark.r2)
    assert three["mark"]["variance_left_over_mark"] == pytest.approx(left, rel=1e-6)
    tiny = entry(compare([renamed(fit, "tiny", 1e-6)]), "tiny")
    assert tiny["meets_marks"]
    assert all(one["mark"]["met"] for one in tiny["targets"].values())


def test_the_document_is_the_same_twice_and_holds_no_times(fit) -> None:
    first, second = (
        json.dumps(compare([fit, renamed(fit, "twin")], {"twin": PASSED})) for _ in range(2)
    )
    assert first == second
    slower = dataclasses.replace(fit, seconds=fit.seconds + 100.0)
    assert json.dumps(compare([slower, renamed(fit, "twin")], {"twin": PASSED})) == first


def test_times_are_measured_and_a_batch_is_cheaper_per_row(fit) -> None:
    cost = timings([fit], batch=400)["power_law"]
    assert cost["batch_rows"] == 400
    assert 0.0 < cost["network_batch"] < cost["network_row"] < cost["row"]
    assert 0.0 < cost["batch"] < cost["row"]
    assert cost["fit_seconds"] == fit.seconds
    assert cost["stored_bytes"] > 1000
