"""Where a surrogate errs: by explosive, by every input in tenths, and its worst rows."""

from __future__ import annotations

from typing import Any

import numpy as np

from castblast.disk.plain import finite
from castblast.surrogate.fitting.features import Split, Table, domain_constraints
from castblast.surrogate.fitting.metrics import (
    LEVEL,
    relative_errors,
    score_by_explosive,
    score_targets,
)
from castblast.surrogate.fitting.training import Fit
from castblast.types import BoolArray, FloatArray, IntArray


def strata(fit: Fit, split: Split = "test", bins: int = 10) -> dict[str, Any]:
    """Score every target by explosive and by bins of equal count of every input.

    Returns
    -------
    dict
        Plain JSON values: ``rows``; ``by_explosive``, explosive -> target -> score; ``by_input``,
        input -> list of bins with lower, upper [SI] and targets -> score; ``spread``, target ->
        input -> greatest over least 95 % relative error of its bins.
    """
    rows, table = fit.table.rows(split), fit.table
    truth, predicted, names = table.targets[rows], fit.predicted[rows], table.target_names
    kinds = table.frame["explosive"].to_numpy(dtype=str)[rows]
    by_input: dict[str, list[dict[str, Any]]] = {}
    for name in table.feature_names:
        values = table.frame[name].to_numpy(dtype=np.float64)[rows]
        edges = _edges(values, bins)
        place = _places(values, edges)
        by_input[name] = []
        for number in range(len(edges) - 1):
            own = place == number
            if np.count_nonzero(own) < 2:
                continue
            scores = score_targets(truth[own], predicted[own], names)
            by_input[name].append(
                {
                    "lower": float(edges[number]),
                    "upper": float(edges[number + 1]),
                    "targets": {key: entry.to_document() for key, entry in scores.items()},
                }
            )
    by_explosive = score_by_explosive(truth, predicted, names, kinds)
    return {
        "split": split,
        "rows": len(rows),
        "by_explosive": {
            kind: {key: entry.to_document() for key, entry in scores.items()}
            for kind, scores in by_explosive.items()
        },
        "by_input": by_input,
        "spread": {
            target: {name: _spread(cells, target) for name, cells in by_input.items()}
            for target in names
        },
    }


def worst_cases(fit: Fit, count: int = 10, split: Split = "test") -> list[dict[str, Any]]:
    """Rows with the largest relative error of any target, worst first.

    Returns
    -------
    list of dict
        Plain JSON values: sample; explosive; inputs [SI]; target, the one that is worst, and its
        relative_error, signed; truth, predicted and relative_errors of every target; in_domain, of
        the training rows; edge, the input closest to an end of its range, with its place there
        (0 and 1 are the ends; beyond them it is outside).
    """
    rows, table = fit.table.rows(split), fit.table
    errors = relative_errors(table.targets[rows], fit.predicted[rows])
    ranked = np.nan_to_num(np.abs(errors), nan=np.inf, posinf=np.inf)
    order = np.argsort(-ranked.max(axis=1), kind="stable")[:count]
    inside, places = _in_training_domain(table, rows), _places_in_box(table, rows)
    cases = []
    for i in order.tolist():
        row, worst = int(rows[i]), int(np.argmax(ranked[i]))
        edge = int(np.argmin(np.minimum(places[i], 1.0 - places[i])))
        name = table.feature_names[edge]
        numbers = table.frame.iloc[row]
        cases.append(
            {
                "sample": int(table.sample[row]),
                "explosive": str(numbers["explosive"]),
                "inputs": {key: float(numbers[key]) for key in table.feature_names},
                "target": table.target_names[worst],
                "relative_error": finite(errors[i, worst]),
                "truth": _by_target(table, table.targets[row]),
                "predicted": _by_target(table, fit.predicted[row]),
                "relative_errors": _by_target(table, errors[i]),
                "in_domain": bool(inside[i]),
                "edge": {"input": name, "place": float(places[i, edge])},
            }
        )
    return cases


def error_maps(
    fit: Fit, target: str = "burden_velocity", split: Split = "test", bins: int = 6, pairs: int = 6
) -> list[dict[str, Any]]:
    """Error over the planes of inputs where it differs most from cell to cell.

    Parameters
    ----------
    bins : int
        Cells along each input, of equal count of rows in one dimension.
    pairs : int
        Planes; the inputs are those whose bins differ most, see `strata`.

    Returns
    -------
    list of dict
        Plain JSON values: target, across and up (inputs), across_edges and up_edges [SI], error
        (k x k, first axis across; 95 % relative error of the rows in a cell, None where they are
        too few) and rows (k x k).
    """
    document = strata(fit, split, bins)
    spread = document["spread"][target]
    ranked = sorted(spread, key=lambda name: (-(spread[name] or 0.0), name))
    planes = [(a, b) for k, b in enumerate(ranked) for a in ranked[:k]][:pairs]
    return [_error_map(fit, target, split, bins, *plane) for plane in planes]


def _error_map(
    fit: Fit, target: str, split: Split, bins: int, across: str, up: str
) -> dict[str, Any]:
    rows, table = fit.table.rows(split), fit.table
    j = table.target_names.index(target)
    errors = np.abs(relative_errors(table.targets[rows, j], fit.predicted[rows, j]))
    edges, places = [], []
    for name in (across, up):
        values = table.frame[name].to_numpy(dtype=np.float64)[rows]
        edges.append(_edges(values, bins))
        places.append(_places(values, edges[-1]))
    shape = (len(edges[0]) - 1, len(edges[1]) - 1)
    error, counts = np.full(shape, np.nan), np.zeros(shape, dtype=np.int64)
    for a in range(shape[0]):
        for b in range(shape[1]):
            own = (places[0] == a) & (places[1] == b)
            counts[a, b] = np.count_nonzero(own)
            if counts[a, b] >= 5:  # of fewer rows a 95 % figure says nothing
                error[a, b] = np.quantile(errors[own], LEVEL, method="inverted_cdf")
    return {
        "target": target,
        "across": across,
        "up": up,
        "across_edges": edges[0].tolist(),
        "up_edges": edges[1].tolist(),
        "error": finite(error),
        "rows": counts.tolist(),
    }


def _edges(values: FloatArray, bins: int) -> FloatArray:
    """Ends of bins of equal count; fewer where values repeat."""
    return np.unique(np.quantile(values, np.linspace(0.0, 1.0, bins + 1)))


def _places(values: FloatArray, edges: FloatArray) -> IntArray:
    """Bin of each value; the last bin holds its upper end."""
    place = np.searchsorted(edges, values, side="right") - 1
    return np.clip(place, 0, max(len(edges) - 2, 0)).astype(np.int64)


def _spread(cells: list[dict[str, Any]], target: str) -> float | None:
    errors = [cell["targets"][target]["relative_error_95"] for cell in cells]
    if not errors or None in errors or min(errors) <= 0.0:
        return None
    return float(max(errors) / min(errors))


def _places_in_box(table: Table, rows: IntArray) -> FloatArray:
    """Where rows lie between the least and greatest training value of each feature, (n, k)."""
    numeric = table.frame[list(table.feature_names)].to_numpy(dtype=np.float64)
    train = numeric[table.rows("train")]
    low, width = train.min(axis=0), np.ptp(train, axis=0)
    places: FloatArray = (numeric[rows] - low) / np.where(width > 0.0, width, 1.0)
    return places


def _in_training_domain(table: Table, rows: IntArray) -> BoolArray:
    """Rows inside the box and the rules of the training rows, for fits without a network too."""
    places = _places_in_box(table, rows)
    inside: BoolArray = np.all((places >= 0.0) & (places <= 1.0), axis=1)
    frame = table.frame.iloc[rows]
    columns = {name: frame[name].to_numpy(dtype=np.float64) for name in table.feature_names}
    for rule in domain_constraints(table):
        inside &= np.asarray(rule.margin(columns)) >= 0.0
    return inside


def _by_target(table: Table, values: FloatArray) -> dict[str, float | None]:
    return dict(zip(table.target_names, finite(values), strict=True))
