"""How many runs are enough: a power law through the learning curve, and where it meets a mark.

error(n) = floor + scale * n^-exponent is fitted to the logarithm of the errors, so that every
point counts alike. Its uncertainty comes from the residual bootstrap: the law is fitted again to
points with the scatter of the first fit. Nothing is promised where the law does not describe the
points, where there are too few of them, or where the answer would lie more than ten times beyond
the largest number of runs tried.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from castblast.surrogate.fitting.training import LearningPoint
from castblast.types import FloatArray

#: Fewest points of a curve: one more than the law has parameters.
FEWEST_POINTS = 4
#: Scatter about the law (standard deviation of the logarithm) above which it is not trusted.
MOST_SCATTER = 0.25
#: How far beyond the largest number of runs tried the law is used.
REACH = 10.0
#: Doubling the runs must promise a gain of this share, else the advice is to stop.
WORTHWHILE_GAIN = 0.1
_DRAWS = 100
_SEED = 0


@dataclass(frozen=True, eq=False)
class PowerLaw:
    """error = floor + scale * rows^-exponent.

    Attributes
    ----------
    floor, scale, exponent : float
    draws : (b, 3)
        The same of fits to resampled points.
    scatter : float
        Standard deviation of the logarithm of the points about the law.
    most_rows : float
        Largest number of rows of a point.
    """

    floor: float
    scale: float
    exponent: float
    draws: FloatArray
    scatter: float
    most_rows: float

    def __call__(self, rows: Any) -> FloatArray:
        """Error at numbers of rows."""
        return _law(np.array([self.floor, self.scale, self.exponent]), np.asarray(rows, float))

    def interval(self, rows: Any) -> tuple[FloatArray, FloatArray]:
        """95 % interval of the law at numbers of rows."""
        each = np.stack([_law(draw, np.asarray(rows, float)) for draw in self.draws])
        low, high = np.quantile(each, (0.025, 0.975), axis=0)
        return low, high

    def rows_for(self, error: float) -> tuple[float, tuple[float, float]]:
        """Rows at which the law reaches an error, and their 95 % interval; inf where never."""
        own = np.array([[self.floor, self.scale, self.exponent]])
        return float(_rows_for(own, error)[0]), tuple(
            np.quantile(_rows_for(self.draws, error), (0.025, 0.975), method="nearest").tolist()
        )


def fit_power_law(rows: Sequence[float], errors: Sequence[float]) -> PowerLaw:
    """Fit the law to points of a learning curve.

    Parameters
    ----------
    rows : sequence of float
        Distinct numbers of training rows, at least `FEWEST_POINTS`.
    errors : sequence of float
        Above 0.

    Raises
    ------
    ValueError
        Too few points, or an error that is not above 0.
    """
    n, e = np.asarray(rows, dtype=np.float64), np.asarray(errors, dtype=np.float64)
    if len(n) < FEWEST_POINTS or not (np.isfinite(e) & (e > 0.0)).all():
        message = f"a power law needs {FEWEST_POINTS} points with errors above 0"
        raise ValueError(message)
    best = _fit(n, np.log(e))
    fitted = np.log(_law(best, n))
    residuals = np.log(e) - fitted
    # Three parameters flatter the points; the scatter is that of the freedom that is left.
    freedom = len(n) - 3
    scatter = float(np.sqrt(np.sum(residuals**2) / freedom))
    rng = np.random.default_rng(_SEED)
    draws = [
        _fit(n, fitted + scatter * rng.standard_normal(len(n)), start=best) for _ in range(_DRAWS)
    ]
    floor, scale, exponent = best.tolist()
    return PowerLaw(
        floor=floor,
        scale=scale,
        exponent=exponent,
        draws=np.array(draws),
        scatter=scatter,
        most_rows=float(n.max()),
    )


def learning_report(points: Sequence[LearningPoint], marks: Mapping[str, float]) -> dict[str, Any]:
    """Say per target what the learning curve promises.

    Parameters
    ----------
    points : sequence of LearningPoint
        From `training.learning_curve`.
    marks : mapping of target name to float
        95 % relative error to be reached on test rows.

    Returns
    -------
    dict
        Plain JSON values, target -> ``rows``, ``error``, ``law`` (floor, scale, exponent, scatter
        and 95 % intervals; None if there is none), ``trusted`` (bool) and ``why_not``, ``mark``,
        ``band`` (rows, lower, upper of the law, to draw; None without one),
        ``reached_at`` (fewest rows from which on all points meet it, or None), ``runs_for_mark``
        and ``runs_for_mark_interval`` (training rows; None where nothing is promised), ``stop``
        (bool) and ``advice``, a sentence.
    """
    return {target: _target_report(points, target, mark) for target, mark in marks.items()}


def _target_report(points: Sequence[LearningPoint], target: str, mark: float) -> dict[str, Any]:
    rows = [point.rows for point in points]
    errors = [point.test[target].relative_error_95 for point in points]
    reached = None
    for count, error in sorted(zip(rows, errors, strict=True), reverse=True):
        if error > mark:
            break
        reached = count
    law, why_not = _judge(rows, errors)
    needed, interval = _needed(law, mark, reached, trusted=not why_not)
    stop, advice = _advise(law, target, mark, reached, needed, why_not)
    return {
        "rows": rows,
        "error": errors,
        "law": None if law is None else _document(law),
        "trusted": not why_not,
        "why_not": why_not,
        "mark": mark,
        "band": None if law is None else _band(law, min(rows)),
        "reached_at": reached,
        "runs_for_mark": needed,
        "runs_for_mark_interval": interval,
        "stop": stop,
        "advice": advice,
    }


def _judge(rows: Sequence[int], errors: Sequence[float]) -> tuple[PowerLaw | None, str]:
    """Fit the law, and say why it is not to be trusted if so."""
    if len(rows) < FEWEST_POINTS:
        return None, f"{len(rows)} points, at least {FEWEST_POINTS} are needed"
    if not all(isfinite(error) and error > 0.0 for error in errors):
        return None, "an error of the curve is 0 or not finite"
    law = fit_power_law(rows, errors)
    if law.scatter > MOST_SCATTER:
        return law, (
            f"the points scatter by {law.scatter:.0%} about the law, more than {MOST_SCATTER:.0%}"
        )
    if law.exponent < 0.02 or law(rows[0]) <= 1.02 * law(rows[-1]):
        return law, "the error does not fall with the rows"
    return law, ""


def _needed(
    law: PowerLaw | None, mark: float, reached: int | None, *, trusted: bool
) -> tuple[int | None, list[int | None] | None]:
    """Training rows at which the law meets the mark, with an interval; None: not promised."""
    if law is None or not trusted:
        return None, None
    rows, ends = law.rows_for(mark)
    most = REACH * law.most_rows
    if reached is not None or not rows <= most:
        return None, None
    # An end beyond the reach of the law is left open.
    return round(rows), [round(end) if end <= most else None for end in ends]


def _advise(
    law: PowerLaw | None,
    target: str,
    mark: float,
    reached: int | None,
    needed: int | None,
    why_not: str,
) -> tuple[bool, str]:
    """Whether to stop, and a sentence for people."""
    name = target.replace("_", " ")
    if reached is not None:
        return True, f"{name}: {mark:.2%} is met from {reached:,} rows on"
    if law is None or why_not:
        return False, f"{name}: {mark:.2%} is not met; no forecast, as {why_not}"
    most = law.most_rows
    gain = 1.0 - float(law(2.0 * most) / law(most))
    if needed is not None:
        return False, f"{name}: {mark:.2%} needs about {needed:,} training rows"
    if gain < WORTHWHILE_GAIN:
        return True, (
            f"{name}: stop, twice the rows would lower the error by {gain:.0%} only; {mark:.2%} "
            "needs another model"
        )
    return False, (
        f"{name}: {mark:.2%} is more than {REACH:g} times the {most:,.0f} rows tried away; twice "
        f"the rows would lower the error by {gain:.0%}"
    )


def _band(law: PowerLaw, fewest: float) -> dict[str, list[float]]:
    rows = np.geomspace(fewest, REACH * law.most_rows, 40)
    low, high = law.interval(rows)
    return {"rows": rows.tolist(), "lower": low.tolist(), "upper": high.tolist()}


def _document(law: PowerLaw) -> dict[str, Any]:
    low, high = np.quantile(law.draws, (0.025, 0.975), axis=0).tolist()
    names = ("floor", "scale", "exponent")
    values = {name: float(getattr(law, name)) for name in names}
    ends = {f"{name}_interval": [low[k], high[k]] for k, name in enumerate(names)}
    return {**values, **ends, "scatter": law.scatter}


def _law(parameters: FloatArray, rows: FloatArray) -> FloatArray:
    floor, scale, exponent = parameters
    return np.asarray(floor + scale * rows**-exponent)


def _rows_for(parameters: FloatArray, error: float) -> FloatArray:
    """Rows (b,) at which laws (b, 3) reach an error; inf where they never do."""
    floor, scale, exponent = parameters.T
    rows = np.full(len(parameters), np.inf)
    can = (error > floor) & (exponent > 0.0)
    rows[can] = np.exp(np.minimum(np.log(scale[can] / (error - floor[can])) / exponent[can], 700.0))
    return rows


def _fit(rows: FloatArray, log_errors: FloatArray, start: FloatArray | None = None) -> FloatArray:
    """Least squares in logarithms; bounded to floor >= 0, scale > 0, 0 <= exponent <= 4."""
    from scipy.optimize import least_squares

    middle = float(np.exp(np.mean(np.log(rows))))

    def parts(p: FloatArray) -> tuple[FloatArray, FloatArray]:
        # p: floor as a share of the least error, logarithm of the fall at the middle, exponent
        fall = np.exp(p[1]) * (rows / middle) ** -p[2]
        return p[0] * least + fall, fall

    def residuals(p: FloatArray) -> FloatArray:
        return np.asarray(np.log(parts(p)[0]) - log_errors)

    def slopes(p: FloatArray) -> FloatArray:
        law, fall = parts(p)
        each = (np.full_like(law, least), fall, -fall * np.log(rows / middle))
        return np.stack(each, axis=1) / law[:, None]

    least = float(np.exp(log_errors.min()))
    guesses = [np.array([share, float(np.median(log_errors)), 0.7]) for share in (0.05, 0.5, 0.9)]
    if start is not None:
        floor, scale, exponent = start.tolist()
        fall = np.log(max(scale, 1e-300)) - exponent * np.log(middle)
        guesses = [np.array([min(max(floor / least, 1e-9), 1.9), max(fall, -40.0), exponent])]
    bounds = ([0.0, -50.0, 0.0], [2.0, 10.0, 4.0])
    runs = [
        least_squares(residuals, np.clip(guess, *bounds), jac=slopes, bounds=bounds)
        for guess in guesses
    ]
    share, fall, exponent = min(runs, key=lambda run: float(run.cost)).x.tolist()
    return np.array([share * least, np.exp(fall) * middle**exponent, exponent])
