"""Rows of a dataset that a person or a model chose, instead of a Latin hypercube: as a CSV file.

One row a line; heads are ``name [SI unit]`` for every variable that the recipe samples, and
``explosive``; any form of a table is read (see `castblast.specs.tables.table`). Values lie in the
ranges of the recipe and obey its constraints, so that chosen rows and drawn ones fill the same
domain.

Chosen rows are training rows, all of them. Had they gone to the other splits too, the test rows
would no longer be a sample of the domain, and scores before and after could not be compared.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from castblast.dataset.rows.design import Design, row_faults
from castblast.dataset.rows.simulation import Columns, Simulator
from castblast.disk.files import write_text
from castblast.errors import SpecError, nearest_name
from castblast.identity import digest
from castblast.names import cell_text
from castblast.specs.catalogue import resolve_explosive
from castblast.specs.recipe import SPLIT_NAMES, Recipe, VariableSpec
from castblast.specs.tables.table import ID_HEADS, Form, Table, read_table
from castblast.types import FloatArray

_ROUNDING = 1e-12


def write_design_file(
    path: Path, recipe: Recipe, columns: Columns, explosive: Sequence[str]
) -> Path:
    """Write chosen rows; floats read back to the same bits."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(
        [f"{spec.name} [{spec.variable.unit}]" for spec in recipe.sampled] + ["explosive"]
    )
    values = np.stack([columns[spec.name] for spec in recipe.sampled], axis=1)
    for row, name in zip(values.tolist(), explosive, strict=True):
        writer.writerow([*map(repr, row), cell_text(name)])
    return write_text(path, buffer.getvalue())


def read_design_file(
    path: Path, recipe: Recipe, explosives: Sequence[str]
) -> tuple[dict[str, FloatArray], NDArray[np.int8]]:
    """Read chosen rows.

    Parameters
    ----------
    explosives : sequence of str
        Names in the order of the recipe.

    Returns
    -------
    columns : dict of (n,) [SI]
        Sampled and fixed variables of the recipe.
    explosive : (n,) int8
        Index into `explosives`.

    Raises
    ------
    SpecError
        Missing or unknown heads, values that are no numbers or outside the ranges of the recipe,
        unknown explosives: all faults, each with its line.
    """
    form = Form(
        columns={spec.name: spec.variable.unit for spec in recipe.sampled},
        required=tuple(spec.name for spec in recipe.sampled),
        texts=("explosive",),
        ids=ID_HEADS,
    )
    table = read_table(path, form, lambda table: _row_faults(table, recipe, explosives))
    if "explosive" not in table.text:
        raise SpecError(f"{path}: the column 'explosive' is missing")
    number = {name: k for k, name in enumerate(explosives)}
    names = [resolve_explosive(name, explosives) or name for name in table.text["explosive"]]
    kinds = [number[name] for name in names]
    columns = _with_fixed(table.number, recipe, len(kinds))
    return columns, np.array(kinds, dtype=np.int8)


def _with_fixed(given: dict[str, FloatArray], recipe: Recipe, count: int) -> dict[str, FloatArray]:
    """Columns of all variables of the recipe: those that it samples, and those that it holds."""
    columns = {spec.name: given[spec.name] for spec in recipe.sampled}
    # Plain values first: a ratio may be one to a variable that is held itself.
    for spec in sorted(recipe.fixed, key=lambda spec: spec.ratio_of is not None):
        base = np.ones(count) if spec.ratio_of is None else columns[spec.ratio_of]
        columns[spec.name] = spec.at(0.0) * base
    return {spec.name: columns[spec.name] for spec in (*recipe.sampled, *recipe.fixed)}


def _row_faults(
    table: Table, recipe: Recipe, explosives: Sequence[str]
) -> Iterator[tuple[int, str]]:
    """Say which explosives and values are not those of the recipe."""
    for row, name in enumerate(table.text.get("explosive", ())):
        if resolve_explosive(name, explosives) is None:
            hint = nearest_name(name, explosives)
            known = ", ".join(explosives)
            line = f"explosive '{name}': not one of the recipe{hint} ({known})"
            yield int(table.line[row]), f"{table.where(row)}: {line}"
    columns = _with_fixed(table.number, recipe, len(table.line))
    for spec in recipe.sampled:
        base = 1.0 if spec.ratio_of is None else columns[spec.ratio_of]
        low, high = spec.at(0.0) * base, spec.at(1.0) * base
        # The check of a written dataset allows no rounding beyond plain ranges.
        slack = 0.0 if spec.ratio_of is None else _ROUNDING
        value = columns[spec.name]
        outside = (value < low * (1.0 - slack)) | (value > high * (1.0 + slack))
        for row in np.flatnonzero(outside).tolist():
            yield int(table.line[row]), f"{table.where(row)}: {_range_words(spec, columns, row)}"


def _range_words(spec: VariableSpec, columns: Columns, row: int) -> str:
    base = 1.0 if spec.ratio_of is None else float(columns[spec.ratio_of][row])
    shown = spec.variable.show
    ratio = "" if spec.ratio_of is None else f" at this {spec.ratio_of}"
    low, high = shown(spec.at(0.0) * base), shown(spec.at(1.0) * base)
    value = shown(float(columns[spec.name][row]))
    return f"{spec.name} = {value}: the recipe has {low} to {high}{ratio}"


def design_of_rows(
    recipe: Recipe,
    simulator: Simulator,
    columns: dict[str, FloatArray],
    explosive: NDArray[np.int8],
    where: str,
    *,
    first_sample: int,
    batch: int,
) -> Design:
    """Make chosen rows a design of training rows.

    Parameters
    ----------
    columns, explosive
        From `read_design_file`.
    where : str
        Names the file in messages.
    first_sample, batch : int
        First id, and the batch number of all rows.

    Raises
    ------
    SpecError
        Rows that no bench can hold, or that break a constraint of the recipe.
    """
    faults = [
        f"{where}: row {number}: {fault}"
        for number, fault in enumerate(row_faults(recipe, simulator, columns), 1)
        if fault
    ]
    if faults:
        raise SpecError("\n".join(faults))
    count = len(explosive)
    return Design(
        sample=np.arange(first_sample, first_sample + count, dtype=np.int32),
        columns=columns,
        inputs=simulator.resolve(columns, explosive),
        explosive=explosive,
        split=np.full(count, SPLIT_NAMES.index("train"), dtype=np.int8),
        batch=np.full(count, batch, dtype=np.int16),
        drawn=count,
    )


def rows_sha256(columns: Columns, explosive: NDArray[np.int8]) -> str:
    """SHA-256 (hex) of chosen rows: part of what a dataset was made from."""
    values = {name: np.asarray(columns[name], dtype="<f8").tobytes() for name in sorted(columns)}
    kinds = np.asarray(explosive, dtype=np.int8).tobytes()
    return digest(*chain.from_iterable(values.items()), kinds)
