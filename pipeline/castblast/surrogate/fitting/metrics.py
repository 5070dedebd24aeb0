"""How good a surrogate is: R², the 95 % relative error and the share within a bound.

The published marks for burden velocity are R² 0.9997 and 95 % of predictions within 2.5 % of the
truth; the same two figures are given for every target and explosive here.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import floor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from castblast.disk.plain import finite
from castblast.types import FloatArray

#: Bound on the relative error whose share is reported.
WITHIN = 0.025
#: Share of rows that the relative-error figure and the band are about.
LEVEL = 0.95


class Score(NamedTuple):
    """Figures of one target on a set of rows.

    Attributes
    ----------
    r2 : float
        Coefficient of determination, one total variance per set of rows.
    relative_error_95 : float
        Least relative error that at least 95 % of the rows do not exceed.
    share_within : float
        Share of rows whose relative error is at most `WITHIN`.
    rows : int
    """

    r2: float
    relative_error_95: float
    share_within: float
    rows: int

    def to_document(self) -> dict[str, float | None]:
        """Plain JSON values; None where a figure is not finite, as JSON has no such numbers."""
        document: dict[str, float | None] = finite(self._asdict())
        return document


def relative_errors(truth: FloatArray, predicted: FloatArray) -> FloatArray:
    """(predicted - truth) / truth, signed; infinite where a truth of 0 is missed."""
    with np.errstate(divide="ignore", invalid="ignore"):
        errors: FloatArray = np.where(predicted == truth, 0.0, (predicted - truth) / np.abs(truth))
    return errors


def r_squared(truth: FloatArray, predicted: FloatArray) -> FloatArray:
    """1 - residual / total sum of squares along the first axis; (n, ...) to (...)."""
    residual = np.sum((truth - predicted) ** 2, axis=0)
    total = np.sum((truth - truth.mean(axis=0)) ** 2, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        result: FloatArray = np.asarray(1.0 - residual / total)
    return result


def error_quantile(truth: FloatArray, predicted: FloatArray) -> FloatArray:
    """Absolute relative error that `LEVEL` of the rows do not exceed, along the first axis."""
    errors = np.abs(relative_errors(truth, predicted))
    return np.asarray(np.quantile(errors, LEVEL, axis=0, method="inverted_cdf"))


def score(truth: FloatArray, predicted: FloatArray) -> Score:
    """Score one target; truth and predicted (n,) in the same unit, n at least 2."""
    errors = np.abs(relative_errors(truth, predicted))
    return Score(
        float(r_squared(truth, predicted)),
        float(error_quantile(truth, predicted)),
        float(np.mean(errors <= WITHIN)),
        len(truth),
    )


def score_targets(
    truth: FloatArray, predicted: FloatArray, names: Sequence[str]
) -> dict[str, Score]:
    """Score every target; truth and predicted (n, m)."""
    return {name: score(truth[:, j], predicted[:, j]) for j, name in enumerate(names)}


def score_by_explosive(
    truth: FloatArray, predicted: FloatArray, names: Sequence[str], explosive: NDArray[np.str_]
) -> dict[str, dict[str, Score]]:
    """Score every target on the rows of each explosive: explosive -> target -> score."""
    return {
        str(kind): score_targets(truth[explosive == kind], predicted[explosive == kind], names)
        for kind in np.unique(explosive)
        if np.count_nonzero(explosive == kind) > 1
    }


def summary_error(scores: dict[str, Score]) -> float:
    """Geometric mean over the targets of the 95 % relative error: the one figure of choice."""
    errors = np.array([entry.relative_error_95 for entry in scores.values()])
    with np.errstate(divide="ignore"):
        return float(np.exp(np.mean(np.log(errors))))


def show_r_squared(value: float | None) -> str:
    """R² cut, not rounded, to five places: a model that misses is never shown as 1."""
    return "-" if value is None else f"{floor(value * 1e5) / 1e5:.5f}"


def show_share(value: float | None) -> str:
    """A fraction in percent."""
    return "-" if value is None else f"{value:.2%}"
