"""Learning curves whose law is known, and curves that promise nothing."""

import json

import numpy as np
import pytest

from castblast.surrogate.fitting.metrics import Score
from castblast.surrogate.fitting.training import LearningPoint
from castblast.surrogate.judging.learning import fit_power_law, learning_report

SIZES = (250, 500, 1000, 2000, 4000, 8000)


def curve(errors):
    """Learning curve of one target."""
    points = []
    for rows, error in zip(SIZES, errors, strict=False):
        score = {"burden_velocity": Score(1.0, float(error), 1.0, 100)}
        points.append(LearningPoint(rows, score, score))
    return points


def report(errors, mark=0.0025):
    document = learning_report(curve(errors), {"burden_velocity": mark})
    json.dumps(document, allow_nan=False)
    return document["burden_velocity"]


@pytest.mark.parametrize(
    ("floor", "scale", "exponent"), [(0.002, 0.8, 0.75), (0.0, 30.0, 1.1), (0.01, 500.0, 1.6)]
)
def test_an_exact_law_is_recovered(floor, scale, exponent) -> None:
    n = np.array(SIZES, dtype=float)
    law = fit_power_law(n, floor + scale * n**-exponent)
    assert law.floor == pytest.approx(floor, rel=1e-4, abs=1e-6)
    assert law.scale == pytest.approx(scale, rel=1e-3)
    assert law.exponent == pytest.approx(exponent, rel=1e-4)
    assert law.scatter < 1e-5


def test_intervals_hold_the_truth_about_as_often_as_they_say() -> None:
    """20 noisy curves of one law: its exponent lies in most of the 95 % intervals.

    Six points leave three degrees of freedom, so the intervals are somewhat short: with 95 % cover
    fewer than 14 of 20 has a probability of 3e-5, with 85 % of 2 %.
    """
    n, rng = np.array(SIZES, dtype=float), np.random.default_rng(1)
    held = 0
    for _ in range(20):
        law = fit_power_law(n, (0.001 + 2.0 * n**-0.8) * np.exp(0.03 * rng.standard_normal(6)))
        low, high = np.quantile(law.draws[:, 2], (0.025, 0.975))
        held += low <= 0.8 <= high
    assert held >= 14


def test_runs_for_a_mark_follow_from_the_law() -> None:
    """0.002 + 0.8 n^-0.75 = 0.0025 at n = 1600^(4/3) = 18,714."""
    n = np.array(SIZES, dtype=float)
    found = report(0.002 + 0.8 * n**-0.75)
    assert found["trusted"]
    assert found["runs_for_mark"] == pytest.approx(18714, rel=1e-3)
    assert found["reached_at"] is None
    assert not found["stop"]
    assert "18,71" in found["advice"]


def test_a_mark_that_is_met_needs_no_more_runs() -> None:
    n = np.array(SIZES, dtype=float)
    found = report(0.8 * n**-0.75, mark=0.8 * 1500**-0.75)
    assert found["reached_at"] == 2000
    assert found["runs_for_mark"] is None
    assert found["stop"]


def test_a_floor_above_the_mark_says_stop() -> None:
    n = np.array(SIZES, dtype=float)
    found = report(0.01 + 100.0 * n**-1.5)
    assert found["trusted"]
    assert found["runs_for_mark"] is None
    assert found["stop"]
    assert "another model" in found["advice"]


@pytest.mark.parametrize(
    ("errors", "why"),
    [
        ((0.02, 0.03, 0.012, 0.03, 0.01, 0.02), "scatter"),
        ((0.01, 0.01, 0.01, 0.01, 0.01, 0.01), "does not fall"),
        ((0.03, 0.02, 0.01), "3 points"),
        ((0.03, 0.02, 0.01, 0.005, 0.0, 0.0), "0 or not finite"),
        ((0.03, 0.02, 0.01, np.inf, 0.005, 0.004), "0 or not finite"),
    ],
)
def test_poor_curves_promise_nothing(errors, why) -> None:
    document = learning_report(curve(errors), {"burden_velocity": 1e-4})["burden_velocity"]
    assert not document["trusted"]
    assert why in document["why_not"]
    assert document["runs_for_mark"] is None
    assert document["runs_for_mark_interval"] is None


def test_no_forecast_far_beyond_the_rows_tried() -> None:
    """0.8 n^-0.5 meets 0.0005 at 2.6 million rows, 320 times those tried: not promised."""
    n = np.array(SIZES, dtype=float)
    found = report(0.8 * n**-0.5, mark=0.0005)
    assert found["runs_for_mark"] is None
    assert not found["stop"]
    assert "more than 10 times" in found["advice"]
