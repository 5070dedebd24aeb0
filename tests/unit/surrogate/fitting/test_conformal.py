"""The conformal band of MAPIE against the rank by hand, and coverage against the theorem."""

import math

import numpy as np
import pytest
from scipy.stats import beta

from castblast.errors import DatasetError
from castblast.surrogate.fitting.conformal import band_coverage, conformal_band, expected_coverage


@pytest.mark.parametrize("rows", [20, 39, 100, 499, 500])
def test_band_is_the_residual_of_rank_095_of_n_plus_1(rows: int) -> None:
    """Lei et al. (2018): the ceil(0.95 (n + 1))-th smallest relative residual, for every sign."""
    rng = np.random.default_rng(rows)
    predicted = rng.uniform(1.0, 3.0, (rows, 3)) * [1.0, 1e9, -1e-3]
    truth = predicted * (1.0 + 0.02 * rng.normal(size=(rows, 3)))
    residuals = np.sort(np.abs(truth - predicted) / np.abs(predicted), axis=0)
    expected = residuals[math.ceil(0.95 * (rows + 1)) - 1]
    np.testing.assert_array_equal(conformal_band(truth, predicted), expected)


def test_band_covers_as_the_theorem_says() -> None:
    """Over draws of 199 calibration rows the coverage of new rows is Beta(190, 10): mean 0.95.

    Heavy tails and a bias change nothing: only the rank counts.
    """
    rng = np.random.default_rng(3)
    shares = []
    for _ in range(200):
        noise = 0.3 + 0.05 * rng.standard_t(2, (2199, 1))
        predicted = rng.uniform(10.0, 20.0, (2199, 1))
        truth = predicted * (1.0 + noise)
        band = conformal_band(truth[:199], predicted[:199])
        shares.append(band_coverage(truth[199:], predicted[199:], band)[0].share)
    spread = beta(190, 10).std() / math.sqrt(200)
    assert np.mean(shares) == pytest.approx(0.95, abs=4 * spread)


def test_coverage_comes_with_its_exact_binomial_interval() -> None:
    """Of 10 rows none outside: 0.025^(1/10) = 0.6915 to 1 (Clopper & Pearson)."""
    truth = np.full((10, 2), 5.0)
    truth[0, 1] = 6.0
    first, second = band_coverage(truth, np.full((10, 2), 5.0), np.array([0.01, 0.01]))
    assert (first.share, first.upper, first.rows) == (1.0, 1.0, 10)
    assert first.lower == pytest.approx(0.025 ** (1 / 10), rel=1e-9)
    assert second.share == pytest.approx(0.9)


def test_expected_share_of_a_sound_band() -> None:
    """Residuals drawn anew 4,000 times: 95 % of the measured shares lie between the stated ends.

    The residuals are uniform, so the rank's value is the coverage of the band; with ends at whole
    rows at most a few tenths of a per cent more than 95 % lie within.
    """
    rng = np.random.default_rng(8)
    low, high = expected_coverage(500, 1000)
    assert 0.92 < low < 0.93
    assert 0.97 < high < 0.98
    coverages = np.sort(rng.random((4000, 500)), axis=1)[:, math.ceil(501 * 0.95) - 1]
    shares = rng.binomial(1000, coverages) / 1000
    within = np.mean((shares >= low) & (shares <= high))
    assert within == pytest.approx(0.953, abs=4 * math.sqrt(0.05 * 0.95 / 4000))


def test_too_few_rows_or_a_prediction_of_zero_are_refused() -> None:
    with pytest.raises(DatasetError, match="19 rows are too few for a 95 % band"):
        conformal_band(np.ones((19, 1)), np.ones((19, 1)))
    with pytest.raises(DatasetError, match="not finite"):
        conformal_band(np.ones((40, 1)), np.zeros((40, 1)))
