"""Scores and the conformal band against figures known by hand or by theorem."""

import math

import numpy as np
import pytest

from castblast.errors import DatasetError
from castblast.surrogate.metrics import (
    conformal_band,
    coverage,
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


def test_conformal_rank() -> None:
    """With 39 residuals the 95 % band is the 38th smallest: ceil(40 x 0.95) = 38."""
    predicted = np.full((39, 1), 10.0)
    truth = predicted * (1.0 + 0.001 * np.arange(1, 40)[:, None])
    assert conformal_band(truth, predicted) == pytest.approx(0.038)


def test_conformal_band_covers_as_the_theorem_says() -> None:
    """Exchangeable residuals: mean coverage is exactly ceil(0.95 (n + 1)) / (n + 1).

    With n = 39 that is 0.95. 4,000 independent calibrations, the coverage of each computed from
    the distribution itself (relative errors uniform in 0 to 1 %); Beta(38, 2) has a standard
    deviation of 0.034, so the mean is known to 0.0005.
    """
    rng = np.random.default_rng(1)
    predicted = np.full((39, 4000), 100.0)
    truth = predicted * (1.0 + 0.01 * rng.random((39, 4000)) * rng.choice([-1, 1], (39, 4000)))
    shares = conformal_band(truth, predicted) / 0.01
    assert shares.mean() == pytest.approx(0.95, abs=4 * 0.034 / math.sqrt(4000))


def test_coverage_counts_rows() -> None:
    predicted = np.full((10, 1), 10.0)
    truth = predicted + 0.1 * np.arange(10)[:, None]
    assert coverage(truth, predicted, np.array([0.0451])) == pytest.approx(0.5)


def test_too_few_calibration_rows_are_refused() -> None:
    with pytest.raises(DatasetError, match="18 rows are too few"):
        conformal_band(np.ones((18, 1)), np.ones((18, 1)))


def test_a_band_around_zero_is_refused() -> None:
    with pytest.raises(DatasetError, match="not finite"):
        conformal_band(np.ones((40, 1)), np.zeros((40, 1)))
