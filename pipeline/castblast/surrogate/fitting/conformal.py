"""Error bands that hold for any model: split-conformal, per target, relative to the prediction.

MAPIE finds the rank. It is given relative residuals about a prediction of nothing, so the band is
a share of the prediction, the same for every row of a target; for the targets here errors grow
with the value, and a share is what people read.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from castblast.errors import DatasetError
from castblast.types import FloatArray

#: Share of new truths that a band is to hold.
LEVEL = 0.95


class Coverage(NamedTuple):
    """Share of test rows within the band of one target, and what so many rows say of it.

    Attributes
    ----------
    share : float
    lower, upper : float
        Exact binomial interval (Clopper & Pearson 1934) of the coverage, at 95 %.
    rows : int
    """

    share: float
    lower: float
    upper: float
    rows: int


def conformal_band(truth: FloatArray, predicted: FloatArray, level: float = LEVEL) -> FloatArray:
    """Split-conformal band relative to the prediction, per target.

    Parameters
    ----------
    truth, predicted : (n, m)
        Calibration rows, used for nothing else.
    level : float

    Returns
    -------
    (m,)
        q such that a new truth of the same distribution lies in predicted x (1 -+ q) with a
        probability of at least `level`, over the draw of calibration and new rows.

    Raises
    ------
    DatasetError
        Too few rows for a finite band, or a prediction of 0.

    References
    ----------
    Lei, G'Sell, Rinaldo, Tibshirani & Wasserman (2018), Distribution-free predictive inference
    for regression, J. Am. Stat. Assoc. 113, 1094-1111, algorithm 2 with scaled residuals.
    """
    # Of fewer rows no residual has the rank that the band needs; MAPIE asks for one row more.
    if len(truth) < math.ceil(round(1.0 / (1.0 - level), 9)):
        message = (
            f"split 'calibration': {len(truth)} rows are too few for a {100 * level:.3g} % band"
        )
        raise DatasetError(message)
    with np.errstate(divide="ignore", invalid="ignore"):
        residuals = (truth - predicted) / np.abs(predicted)
    if not np.isfinite(residuals).all():
        message = "the error band is not finite: predictions of the calibration rows reach 0"
        raise DatasetError(message)
    return np.array([_half_width(column, level) for column in residuals.T])


def _half_width(residuals: FloatArray, level: float) -> float:
    """Half-width of the interval about 0 that MAPIE makes of residuals (n,)."""
    from mapie.regression import SplitConformalRegressor
    from sklearn.dummy import DummyRegressor

    nothing = np.zeros((len(residuals), 1))
    model = DummyRegressor(strategy="constant", constant=0.0).fit(nothing, residuals)
    split = SplitConformalRegressor(model, confidence_level=level, prefit=True)
    _, interval = split.conformalize(nothing, residuals).predict_interval(nothing[:1])
    return float(interval[0, 1, 0])


def band_coverage(truth: FloatArray, predicted: FloatArray, band: FloatArray) -> list[Coverage]:
    """Measure on rows (n, m) how many truths lie in predicted x (1 -+ band), per target."""
    from scipy.stats import binomtest

    inside = np.abs(truth - predicted) <= band * np.abs(predicted)
    rows, found = len(inside), []
    for count in inside.sum(axis=0).tolist():
        ends = binomtest(count, rows).proportion_ci(LEVEL, method="exact")
        found.append(Coverage(count / rows, float(ends.low), float(ends.high), rows))
    return found


def expected_coverage(
    calibration_rows: int, test_rows: int, level: float = LEVEL
) -> tuple[float, float]:
    """Central 95 % of the shares that a sound band may show on test rows.

    The band is only right on average over the draw of its calibration rows: with rank r of n, the
    coverage of one band is Beta(r, n + 1 - r) (Vovk 2012, Conditional validity of inductive
    conformal predictors, Proc. ACML 25), and its test rows are binomial on top. A share outside
    these ends speaks against the rows being of one distribution, not one outside `level` alone.
    """
    from scipy.stats import betabinom

    rank = math.ceil((calibration_rows + 1) * level)
    shares = betabinom(test_rows, rank, calibration_rows + 1 - rank).ppf([0.025, 0.975])
    return float(shares[0]) / test_rows, float(shares[1]) / test_rows
