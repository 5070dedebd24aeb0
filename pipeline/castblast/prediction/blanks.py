"""Columns of designs with blank cells: each row is completed from what it gives itself.

A blank cell of an input with one value for all (a default, or what training held) is that value.
Of the others (stemming or charge, spacing, ...) rows that give the same ones go through
`predict_columns` together: at most a hundred kinds, whatever the number of rows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from castblast.design.rule import COMPLETED, FaultyRows
from castblast.design.variables import VARIABLES
from castblast.network import Bounds, Evaluate, RowPredictions, Shell
from castblast.prediction.columns import (
    ColumnPredictions,
    NetworkDesigns,
    UnseenInput,
    held_inputs,
    predict_columns,
)
from castblast.types import BoolArray, FloatArray


def predict_with_blanks(
    values: Mapping[str, FloatArray],
    explosive: NDArray[np.integer],
    network: Shell,
    evaluate: Evaluate | None = None,
) -> ColumnPredictions:
    """Predict columns of designs in which NaN stands for a cell that is not given.

    Parameters and results are those of `predict_columns`.
    """
    count = len(explosive)
    held = held_inputs(network)
    filled, open_names = {}, []
    for name, column in values.items():
        blank = np.isnan(column)
        value = held.get(name, VARIABLES[name].default)
        if name in COMPLETED or value is None:
            filled[name] = column
            if blank.any():
                open_names.append(name)
        else:
            filled[name] = np.where(blank, value, column)
    if not open_names:
        return predict_columns(filled, explosive, network, evaluate)
    given = np.stack([~np.isnan(filled[name]) for name in open_names], axis=1)
    kinds, kind_of = np.unique(given, axis=0, return_inverse=True)
    parts = []
    for k, kind in enumerate(kinds):
        rows = np.flatnonzero(kind_of.ravel() == k)
        absent = {name for name, there in zip(open_names, kind, strict=True) if not there}
        part = {name: column[rows] for name, column in filled.items() if name not in absent}
        parts.append(_Part(rows, predict_columns(part, explosive[rows], network, evaluate)))
    return _joined(parts, count)


@dataclass(frozen=True)
class _Part:
    rows: NDArray[np.intp]
    answers: ColumnPredictions


def _joined(parts: list[_Part], count: int) -> ColumnPredictions:
    """Put the answers of all parts back into the order of the rows."""

    def column(take: Callable[[ColumnPredictions], NDArray[np.generic]]) -> NDArray[np.generic]:
        pieces = [(part.rows, take(part.answers)) for part in parts]
        first = pieces[0][1]
        kind = np.result_type(*(piece for _, piece in pieces))
        whole = np.empty((count, *first.shape[1:]), dtype=kind)
        for rows, piece in pieces:
            whole[rows] = piece
        return whole

    def floats(take: Callable[[ColumnPredictions], FloatArray]) -> FloatArray:
        return column(take).astype(np.float64, copy=False)

    def flags(take: Callable[[ColumnPredictions], BoolArray]) -> BoolArray:
        return column(take).astype(np.bool_, copy=False)

    def bounds(take: Callable[[ColumnPredictions], Bounds]) -> Bounds:
        return Bounds(floats(lambda a: take(a).lower), floats(lambda a: take(a).upper))

    def input_column(name: str) -> FloatArray:
        return floats(lambda answers: answers.designs.inputs[name])

    faults = [
        FaultyRows(_spread(part, fault.rows, count), _in_part(part, fault.say))
        for part in parts
        for fault in part.answers.designs.faults
    ]
    unseen = [
        UnseenInput(entry.name, _spread(part, entry.rows, count), _in_part(part, entry.say))
        for part in parts
        for entry in part.answers.designs.unseen
    ]
    inputs = {name: input_column(name) for name in parts[0].answers.designs.inputs}
    return ColumnPredictions(
        NetworkDesigns(inputs, faults, unseen),
        RowPredictions(
            values=floats(lambda a: a.rows.values),
            prediction=bounds(lambda a: a.rows.prediction),
            network=bounds(lambda a: a.rows.network),
            score=floats(lambda a: a.rows.score),
            inside=flags(lambda a: a.rows.inside),
        ),
        flags(lambda a: a.refused),
        column(lambda a: a.domain).astype(np.str_),
    )


def _spread(part: _Part, rows: BoolArray, count: int) -> BoolArray:
    whole = np.zeros(count, dtype=bool)
    whole[part.rows] = rows
    return whole


def _in_part(part: _Part, say: Callable[[int], str]) -> Callable[[int], str]:
    """Words for a row of all, from those for a row of the part."""
    return lambda row: say(int(np.searchsorted(part.rows, row)))
