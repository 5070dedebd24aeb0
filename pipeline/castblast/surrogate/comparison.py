"""The league table: every fit on the same test rows, and which one is shipped.

The choice is made on validation rows alone; test rows are only reported. Intervals come from the
bootstrap over test rows with the same draws for every model, so that a difference between two of
them can be told from the luck of the rows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from castblast.errors import SpecError
from castblast.network import Floats
from castblast.surrogate.metrics import WITHIN, error_quantile, r_squared, score
from castblast.surrogate.training import Fit

#: Published figures of the 3 x 7 network for burden velocity, from 10,000 runs.
PAPER_MARKS: Mapping[str, float] = {"r2": 0.9997, "relative_error_95": 0.025, "runs": 10000}
_RESAMPLES = 1000
_SEED = 0
_RULE = (
    "lowest geometric mean over the targets of the 95 % relative error on the validation rows, "
    "among the models that can be exported"
)


def compare(fits: Sequence[Fit]) -> dict[str, Any]:
    """Rank fits of one dataset.

    Returns
    -------
    dict
        Plain JSON values without times: rule, marks of the paper, dataset, chosen, gap, and the
        league with scores and 95 % bootstrap intervals per target, best validation error first.

    Raises
    ------
    SpecError
        Nothing to compare, or no fit that can be exported.
    """
    targets = _common_targets(fits)
    league = sorted(fits, key=lambda fit: (fit.restart.valid_error, fit.spec.name))
    exportable = [fit for fit in league if fit.network is not None]
    if not exportable:
        message = "none of the models can be exported; add one, such as reference_mlp"
        raise SpecError(message)
    chosen, best = exportable[0], league[0]
    test = chosen.table.rows("test")
    draws = np.random.default_rng(_SEED).integers(0, len(test), (_RESAMPLES, len(test)))
    errors = {fit.spec.name: _summary_draws(fit, targets, draws) for fit in league}
    return {
        "rule": _RULE,
        "paper": {"target": "burden_velocity", **PAPER_MARKS},
        "dataset": dict(chosen.table.source),
        "test_rows": len(test),
        "interval": f"95 %, percentile bootstrap over test rows, {_RESAMPLES} draws",
        "targets": list(targets),
        "chosen": chosen.spec.name,
        "best_overall": best.spec.name,
        "gap": chosen.restart.valid_error / best.restart.valid_error,
        "league": [
            _entry(fit, targets, draws, errors[fit.spec.name], errors[best.spec.name])
            for fit in league
        ],
    }


def _common_targets(fits: Sequence[Fit]) -> tuple[str, ...]:
    if not fits:
        message = "no fit to compare"
        raise SpecError(message)
    targets = tuple(
        name
        for name in fits[0].table.target_names
        if all(name in fit.table.target_names for fit in fits)
    )
    if not targets:
        names = ", ".join(fit.spec.name for fit in fits)
        message = f"{names}: no target in common, nothing to compare"
        raise SpecError(message)
    return targets


def _columns(fit: Fit, target: str) -> tuple[Floats, Floats]:
    """Truth and prediction of one target on the test rows."""
    rows, j = fit.table.rows("test"), fit.table.target_names.index(target)
    return fit.table.targets[rows, j], fit.predicted[rows, j]


def _summary_draws(fit: Fit, targets: Sequence[str], draws: NDArray[np.int64]) -> Floats:
    """Logarithm of the summary error on every bootstrap draw, (b,)."""
    logs = []
    for target in targets:
        truth, predicted = _columns(fit, target)
        quantiles = error_quantile(truth[draws].T, predicted[draws].T)
        logs.append(np.log(np.maximum(quantiles, np.finfo(float).tiny)))
    mean: Floats = np.mean(logs, axis=0)
    return mean


def _entry(
    fit: Fit, targets: Sequence[str], draws: NDArray[np.int64], errors: Floats, best: Floats
) -> dict[str, Any]:
    low, high = np.quantile(errors - best, (0.025, 0.975))
    return {
        "name": fit.spec.name,
        "kind": fit.spec.kind,
        "description": fit.spec.description,
        "exportable": fit.network is not None,
        "parameters": fit.network.parameter_count if fit.network else None,
        "converged": fit.restart.converged,
        "iterations": fit.restart.iterations,
        "valid_error": _finite(fit.restart.valid_error),
        "test_error": _finite(float(np.exp(_point(fit, targets)))),
        "distinguishable_from_first": bool(low > 0.0 or high < 0.0),
        "targets": {target: _target_entry(fit, target, draws) for target in targets},
    }


def _point(fit: Fit, targets: Sequence[str]) -> float:
    every = np.arange(len(fit.table.rows("test")))[None, :]
    return float(_summary_draws(fit, targets, every)[0])


def _target_entry(fit: Fit, target: str, draws: NDArray[np.int64]) -> dict[str, Any]:
    truth, predicted = _columns(fit, target)
    point = score(truth, predicted)
    r2 = np.quantile(r_squared(truth[draws].T, predicted[draws].T), (0.025, 0.975))
    error = np.quantile(
        error_quantile(truth[draws].T, predicted[draws].T), (0.025, 0.975), method="inverted_cdf"
    )
    return {
        "r2": _finite(point.r2),
        "r2_interval": [_finite(value) for value in r2.tolist()],
        "relative_error_95": _finite(point.relative_error_95),
        "relative_error_95_interval": [_finite(value) for value in error.tolist()],
        f"share_within_{WITHIN:g}": point.share_within,
        "meets_paper_r2": bool(point.r2 >= PAPER_MARKS["r2"]),
        "meets_paper_error": bool(point.relative_error_95 <= PAPER_MARKS["relative_error_95"]),
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
