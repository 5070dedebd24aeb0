"""The league table: every fit on the same test rows, and which one is shipped.

The choice is made on validation rows alone; test rows are only reported. Intervals come from the
bootstrap over test rows with the same draws for every model, so that a difference between two of
them can be told from the luck of the rows. Times are in `timing`, as they never come out the same
twice.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypedDict

import numpy as np

from castblast.disk.plain import finite
from castblast.errors import SpecError
from castblast.surrogate.fitting.metrics import error_quantile, r_squared, score
from castblast.surrogate.fitting.training import Fit
from castblast.types import FloatArray, IntArray

#: Published figures of the 3 x 7 network for burden velocity, from 10,000 runs.
PAPER_MARKS: Mapping[str, float] = {"r2": 0.9997, "relative_error_95": 0.025, "runs": 10000}
_RESAMPLES = 1000
_SEED = 0
_RULE = (
    "lowest geometric mean over the targets of the 95 % relative error on the validation rows, "
    "among the models that can be exported"
)
_GATE_RULE = " and pass the physics gate"


class Mark(NamedTuple):
    """What is asked of a target on test rows: least R² and greatest 95 % relative error."""

    r2: float
    relative_error_95: float


class PaperFigures(TypedDict):
    """Published figures of the target they are for."""

    target: str
    r2: float
    relative_error_95: float
    runs: float


class MarkFigures(TypedDict):
    """A mark and how far a fit is from it: 1 or less is met; 3 is three times the error allowed."""

    r2: float
    relative_error_95: float
    met: bool
    error_over_mark: float | None
    variance_left_over_mark: float | None


#: Figures of one fit for one target on test rows, with 95 % intervals; None: not finite.
TargetFigures = TypedDict(
    "TargetFigures",
    {
        "r2": float | None,
        "r2_interval": list[float | None],
        "relative_error_95": float | None,
        "relative_error_95_interval": list[float | None],
        "share_within_0.025": float,
        "meets_paper_r2": bool,
        "meets_paper_error": bool,
        "mark": MarkFigures,
    },
)


class LeagueEntry(TypedDict):
    """One fit of the league; ``gate_passed`` is None where the gate did not judge it."""

    name: str
    kind: str
    description: str
    exportable: bool
    gate_passed: bool | None
    gate_reasons: list[str]
    parameters: int | None
    bytes: int | None
    converged: bool
    iterations: int
    valid_error: float | None
    test_error: float | None
    distinguishable_from_first: bool
    not_distinguishable_from: list[str]
    meets_marks: bool
    targets: dict[str, TargetFigures]


class League(TypedDict):
    """The league table as it is written, see `compare`."""

    rule: str
    paper: PaperFigures
    dataset: dict[str, Any]
    test_rows: int
    interval: str
    targets: list[str]
    chosen: str | None
    best_exportable: str
    best_overall: str
    gap: float
    league: list[LeagueEntry]


class ComparisonDocument(League):
    """All of a comparison as ``comparison.json`` holds it: the league and what was asked besides.

    Models and targets are keys; the documents of a gate, a learning curve, shifts, strata and
    Sobol indices are those of the modules of these names.
    """

    extent: dict[str, Any]
    remarks: list[str]
    gate: dict[str, dict[str, Any]]
    paper_met_from: dict[str, int | None]
    learning: dict[str, dict[str, Any]]
    shifts: dict[str, dict[str, Any]]
    strata: dict[str, Any]
    worst_cases: list[dict[str, Any]]
    sobol: dict[str, Any] | None


def mark_of(target: str) -> Mark:
    """Mark of a target: sharper for the burden velocity, one for all others."""
    return Mark(0.99995, 0.005) if target == "burden_velocity" else Mark(0.9999, 0.01)


def compare(fits: Sequence[Fit], gates: Mapping[str, Mapping[str, Any]] | None = None) -> League:
    """Rank fits of one dataset.

    Parameters
    ----------
    fits : sequence of Fit
    gates : mapping of fit name to document, optional
        From `gate.check_physics`; a fit that has none was not judged and counts as passed.

    Returns
    -------
    League
        Plain JSON values without times: rule, marks of the paper, dataset; ``best_exportable``;
        ``chosen``, the same unless it fails the gate (None if all do); ``best_overall``; ``gap``,
        validation error of the chosen (else of the best exportable) over that of the best overall;
        and the league with scores, marks and 95 % bootstrap intervals per target, best validation
        error first.

    Raises
    ------
    SpecError
        Nothing to compare, or no fit that can be exported.
    """
    gates = gates or {}
    targets = _common_targets(fits)
    league = sorted(fits, key=lambda fit: (fit.restart.valid_error, fit.spec.name))
    exportable = [fit for fit in league if fit.network is not None]
    if not exportable:
        message = "none of the models can be exported; add one, such as reference_mlp"
        raise SpecError(message)
    passing = [fit for fit in exportable if gates.get(fit.spec.name, {}).get("passed", True)]
    shipped, best = (passing or exportable)[0], league[0]
    test = best.table.rows("test")
    draws = np.random.default_rng(_SEED).integers(0, len(test), (_RESAMPLES, len(test)))
    errors = {fit.spec.name: _summary_draws(fit, targets, draws) for fit in league}
    entries = []
    for fit in league:
        alike = [
            name
            for name, other in errors.items()
            if name != fit.spec.name and not _distinguishable(errors[fit.spec.name], other)
        ]
        gate = gates.get(fit.spec.name)
        entries.append(_entry(fit, targets, draws, alike, best.spec.name, gate))
    return {
        "rule": _RULE + (_GATE_RULE if gates else ""),
        "paper": {
            "target": "burden_velocity",
            "r2": PAPER_MARKS["r2"],
            "relative_error_95": PAPER_MARKS["relative_error_95"],
            "runs": PAPER_MARKS["runs"],
        },
        "dataset": dict(best.table.source),
        "test_rows": len(test),
        "interval": f"95 %, percentile bootstrap over test rows, {_RESAMPLES} draws",
        "targets": list(targets),
        "chosen": shipped.spec.name if passing else None,
        "best_exportable": exportable[0].spec.name,
        "best_overall": best.spec.name,
        "gap": shipped.restart.valid_error / best.restart.valid_error,
        "league": entries,
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


def _columns(fit: Fit, target: str) -> tuple[FloatArray, FloatArray]:
    """Truth and prediction of one target on the test rows."""
    rows, j = fit.table.rows("test"), fit.table.target_names.index(target)
    return fit.table.targets[rows, j], fit.predicted[rows, j]


def _summary_draws(fit: Fit, targets: Sequence[str], draws: IntArray) -> FloatArray:
    """Logarithm of the summary error on every bootstrap draw, (b,)."""
    logs = []
    for target in targets:
        truth, predicted = _columns(fit, target)
        quantiles = error_quantile(truth[draws].T, predicted[draws].T)
        logs.append(np.log(np.maximum(quantiles, np.finfo(float).tiny)))
    mean: FloatArray = np.mean(logs, axis=0)
    return mean


def _distinguishable(mine: FloatArray, theirs: FloatArray) -> bool:
    """Whether the bootstrap interval of the difference of two summary errors excludes 0."""
    low, high = np.quantile(mine - theirs, (0.025, 0.975))
    return bool(low > 0.0 or high < 0.0)


def _entry(
    fit: Fit,
    targets: Sequence[str],
    draws: IntArray,
    alike: Sequence[str],
    first: str,
    gate: Mapping[str, Any] | None,
) -> LeagueEntry:
    scores = {target: _target_entry(fit, target, draws) for target in targets}
    parameters = fit.network.parameter_count if fit.network else None
    return {
        "name": fit.spec.name,
        "kind": fit.spec.kind,
        "description": fit.spec.description,
        "exportable": fit.network is not None,
        "gate_passed": None if gate is None else bool(gate["passed"]),
        "gate_reasons": [] if gate is None else list(gate["reasons"]),
        "parameters": parameters,
        "bytes": None if parameters is None else 8 * parameters,
        "converged": fit.restart.converged,
        "iterations": fit.restart.iterations,
        "valid_error": finite(fit.restart.valid_error),
        "test_error": finite(float(np.exp(_point(fit, targets)))),
        "distinguishable_from_first": fit.spec.name != first and first not in alike,
        "not_distinguishable_from": list(alike),
        "meets_marks": all(entry["mark"]["met"] for entry in scores.values()),
        "targets": scores,
    }


def _point(fit: Fit, targets: Sequence[str]) -> float:
    every = np.arange(len(fit.table.rows("test")))[None, :]
    return float(_summary_draws(fit, targets, every)[0])


def _target_entry(fit: Fit, target: str, draws: IntArray) -> TargetFigures:
    truth, predicted = _columns(fit, target)
    point = score(truth, predicted)
    r2 = np.quantile(r_squared(truth[draws].T, predicted[draws].T), (0.025, 0.975))
    error = np.quantile(
        error_quantile(truth[draws].T, predicted[draws].T), (0.025, 0.975), method="inverted_cdf"
    )
    mark = mark_of(target)
    return {
        "r2": finite(point.r2),
        "r2_interval": finite(r2),
        "relative_error_95": finite(point.relative_error_95),
        "relative_error_95_interval": finite(error),
        "share_within_0.025": point.share_within,
        "meets_paper_r2": bool(point.r2 >= PAPER_MARKS["r2"]),
        "meets_paper_error": bool(point.relative_error_95 <= PAPER_MARKS["relative_error_95"]),
        "mark": {
            "r2": mark.r2,
            "relative_error_95": mark.relative_error_95,
            "met": bool(point.r2 >= mark.r2 and point.relative_error_95 <= mark.relative_error_95),
            "error_over_mark": finite(point.relative_error_95 / mark.relative_error_95),
            "variance_left_over_mark": finite((1.0 - point.r2) / (1.0 - mark.r2)),
        },
    }
