"""A table of answers over a grid of designs, for whoever can read nothing but a table."""

from __future__ import annotations

import csv
import io
from itertools import product

import numpy as np

from castblast.design.rule import COMPLETED, complete_columns, design_fault_columns
from castblast.design.variables import INPUT_NAMES, VARIABLES
from castblast.export.source.plain import example_row
from castblast.names import cell_text
from castblast.network import InputColumn, Network, keeps_ranges_and_rules, predict_rows
from castblast.types import FloatArray

#: What a blaster looks up by; other inputs stay at an example design.
_AXES = ("hole_diameter", "burden", "ucs", "bench_height")
_LEVELS = 5


def lookup_csv(network: Network) -> str:
    """Write answers over the grid of the first axes that the network has, usual units.

    Spacing, stemming and charge follow the axes by the rule of a design. Designs that no bench can
    hold and rows outside the domain are left out; the others are inside or unusual.
    """
    axes = [name for name in _AXES if name in network.input_names] or [network.input_names[0]]
    rows = _grid(network, axes)
    heads = [f"{c.name} [{_unit(c.name, c.unit)}]" for c in network.inputs]
    for c in network.outputs:
        heads += [f"{c.name}{part} [{_unit(c.name, c.unit)}]"
                  for part in ("", "_prediction_lower", "_prediction_upper")]  # fmt: skip
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["explosive", *heads, "domain"])
    shown = np.array([_factor(name) for name in network.input_names])
    factors = np.array([_factor(name) for name in network.output_names])
    for kind, explosive in enumerate(network.explosives):
        found = predict_rows(network, rows, np.full(len(rows), kind, dtype=np.int64))
        parts = np.stack([found.values, *found.prediction], axis=2) * factors[:, None]
        for row, answer, inside in zip(rows * shown, parts, found.inside, strict=True):
            numbers = [f"{value:.6g}" for value in (*row, *answer.ravel())]
            writer.writerow([cell_text(explosive), *numbers, "inside" if inside else "unusual"])
    return stream.getvalue()


def _grid(network: Network, axes: list[str]) -> FloatArray:
    """Rows of the grid that are possible and keep ranges and rules, (n, k)."""
    names = network.input_names
    columns = {column.name: column for column in network.inputs}
    levels = [_levels(columns[name]) for name in axes]
    rows = np.tile(example_row(network), (_LEVELS ** len(axes), 1))
    for row, values in zip(rows, product(*levels), strict=True):
        for name, value in zip(axes, values, strict=True):
            row[names.index(name)] = value
    given = {n: rows[:, i].copy() for i, n in enumerate(names) if n not in COMPLETED}
    full = complete_columns({n: v for n, v in given.items() if n in INPUT_NAMES}, len(rows))
    for name in set(names) & set(COMPLETED):
        rows[:, names.index(name)] = full[name]
    kept = keeps_ranges_and_rules(network, rows)
    for fault in design_fault_columns(full, len(rows)):
        kept &= ~fault.rows
    return np.asarray(rows[kept])


def _levels(column: InputColumn) -> list[float]:
    if column.transform == "log":
        inner = np.geomspace(column.lower, column.upper, _LEVELS)[1:-1].tolist()
    else:
        inner = np.linspace(column.lower, column.upper, _LEVELS)[1:-1].tolist()
    return [column.lower, *inner, column.upper]


def _factor(name: str) -> float:
    return VARIABLES[name].display_factor if name in VARIABLES else 1.0


def _unit(name: str, unit: str) -> str:
    return VARIABLES[name].file_unit if name in VARIABLES else unit
