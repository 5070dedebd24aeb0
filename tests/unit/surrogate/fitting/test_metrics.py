"""Scores and the conformal band against figures known by hand or by theorem."""

import math

import numpy as np
import pytest

from castblast.surrogate.fitting.metrics import (
    error_quantile,
    r_squared,
    score,
    score_by_explosive,
    summary_error,
)


def test_r_squared_of_known_predictors() -> None:
    """1 for the truth itself, 0 for its mean, -3 for the mirror image about the mean."""
    truth = np.array([1.0, 2.0, 3.0, 6.0])
    mean = np.full(4, truth.mean())
    assert r_squared(truth, truth) == 1.0
    assert r_squared(truth, mean) == 0.0
    assert r_squared(truth, 2.0 * mean - truth) == -3.0


def test_95_percent_error_of_a_ladder() -> None:
    """Errors of 1 % to 100 %: 95 of the 100 rows do not exceed 95 %, and 2 of them 2.5 %."""
    truth = np.full(100, 50.0)
    predicted = truth * (1.0 + 0.01 * np.arange(1, 101) * (-1.0) ** np.arange(100))
    assert error_quantile(truth, predicted) == pytest.approx(0.95, rel=1e-12)
    found = score(truth + 0.0, predicted)
    assert found.share_within == 0.02
    assert found.rows == 100


def test_a_missed_zero_is_an_infinite_error_and_no_json_number() -> None:
    found = score(np.array([0.0, 1.0, 2.0]), np.array([0.1, 1.0, 2.0]))
    assert found.relative_error_95 == math.inf
    assert found.to_document()["relative_error_95"] is None
    assert score(np.array([0.0, 1.0]), np.array([0.0, 1.0])).relative_error_95 == 0.0


def test_scores_by_explosive_use_own_rows() -> None:
    truth = np.array([[1.0], [2.0], [1.0], [2.0]])
    predicted = np.array([[1.0], [2.0], [1.1], [2.2]])
    kinds = np.array(["a", "a", "b", "b"])
    found = score_by_explosive(truth, predicted, ["v"], kinds)
    assert found["a"]["v"].relative_error_95 == 0.0
    assert found["b"]["v"].relative_error_95 == pytest.approx(0.1)


def test_summary_is_the_geometric_mean() -> None:
    truth = np.array([1.0, 2.0])
    scores = {"a": score(truth, truth * 1.01), "b": score(truth, truth * 1.04)}
    assert summary_error(scores) == pytest.approx(0.02)
