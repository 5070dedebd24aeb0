"""Rows of a dataset that a person or a model chose, instead of a Latin hypercube: as a CSV file.

One row a line; heads are ``name [SI unit]`` for every variable that the recipe samples, and
``explosive``. A quantity may carry its own unit. Values lie in the ranges of the recipe and obey
its constraints, so that chosen rows and drawn ones fill the same domain.

Chosen rows are training rows, all of them. Had they gone to the other splits too, the test rows
would no longer be a sample of the domain, and scores before and after could not be compared.
"""

from __future__ import annotations

import csv
import hashlib
import io
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from castblast.dataset.design import Design, row_faults
from castblast.dataset.simulation import Columns, FloatArray, Simulator
from castblast.errors import SpecError, nearest_name
from castblast.files import write_text
from castblast.specs.loading import read_text
from castblast.specs.quantity import parse_quantity
from castblast.specs.recipe import SPLIT_NAMES, Recipe, VariableSpec

_HEAD = re.compile(r"\s*(\w+)\s*(?:\[([^\]]*)\])?\s*")
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
        writer.writerow([*map(repr, row), name])
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
    reader = csv.reader(io.StringIO(read_text(path)))
    lines = [(reader.line_num, cells) for cells in reader if any(cell.strip() for cell in cells)]
    if len(lines) < 2:
        raise SpecError(f"{path}: a line of heads and at least one row are needed")
    units = _read_heads(lines[0][1], recipe, path)
    rows: list[dict[str, float]] = []
    kinds, faults = [], []
    for number, cells in lines[1:]:
        try:
            row, kind = _read_row(dict(zip(units, cells, strict=True)), units, recipe, explosives)
        except ValueError:
            faults.append(f"{path}: line {number}: {len(cells)} cells for {len(units)} heads")
        except SpecError as fault:
            faults += [f"{path}: line {number}: {line}" for line in str(fault).splitlines()]
        else:
            rows.append(row)
            kinds.append(kind)
    if faults:
        raise SpecError("\n".join(faults))
    names = [spec.name for spec in (*recipe.sampled, *recipe.fixed)]
    columns = {name: np.array([row[name] for row in rows]) for name in names}
    return columns, np.array(kinds, dtype=np.int8)


def _read_heads(heads: Sequence[str], recipe: Recipe, path: Path) -> dict[str, str]:
    """Unit of every column, in order; raises for heads that are not those of the recipe."""
    wanted = (*(spec.name for spec in recipe.sampled), "explosive")
    units, faults = {}, []
    for head in heads:
        match = _HEAD.fullmatch(head)
        name, unit = (match[1], match[2] or "") if match else (head, "")
        if name in units:
            faults.append(f"head '{head}': given twice")
        elif name not in wanted:
            faults.append(f"head '{head}': the recipe samples no such variable"
                          f"{nearest_name(name, wanted)}")  # fmt: skip
        units[name] = unit
    faults += [f"no column '{name}', which the recipe samples" for name in wanted[:-1]
               if name not in units]  # fmt: skip
    if "explosive" not in units:
        faults.append("no column 'explosive'")
    if faults:
        raise SpecError("\n".join(f"{path}: {fault}" for fault in faults))
    return units


def _read_row(
    cells: dict[str, str], units: dict[str, str], recipe: Recipe, explosives: Sequence[str]
) -> tuple[dict[str, float], int]:
    """Values [SI] and index of the explosive of one row."""
    row, faults = {}, []
    for spec in recipe.sampled:
        text = f"{cells[spec.name].strip()} {units[spec.name]}".strip()
        try:
            row[spec.name] = parse_quantity(text, spec.variable.unit, spec.name)
        except SpecError as fault:
            faults.append(str(fault))
    name = cells["explosive"].strip()
    if name not in explosives:
        hint = nearest_name(name, explosives)
        faults.append(f"explosive '{name}': not one of the recipe{hint} ({', '.join(explosives)})")
    if faults:
        raise SpecError("\n".join(faults))
    # Plain values first: a ratio may be one to a variable that is held itself.
    for spec in sorted(recipe.fixed, key=lambda spec: spec.ratio_of is not None):
        row[spec.name] = spec.at(0.0) * (1.0 if spec.ratio_of is None else row[spec.ratio_of])
    faults = [line for spec in recipe.sampled if (line := _range_fault(spec, row))]
    if faults:
        raise SpecError("\n".join(faults))
    return row, list(explosives).index(name)


def _range_fault(spec: VariableSpec, row: dict[str, float]) -> str:
    """Say that a value lies outside the range of the recipe; empty if it does not."""
    base = 1.0 if spec.ratio_of is None else row[spec.ratio_of]
    low, high = spec.at(0.0) * base, spec.at(1.0) * base
    # The check of a written dataset allows no rounding beyond plain ranges.
    slack = 0.0 if spec.ratio_of is None else _ROUNDING
    if low * (1.0 - slack) <= row[spec.name] <= high * (1.0 + slack):
        return ""
    shown = spec.variable.show
    ratio = "" if spec.ratio_of is None else f" at this {spec.ratio_of}"
    value = shown(row[spec.name])
    return f"{spec.name} = {value}: the recipe has {shown(low)} to {shown(high)}{ratio}"


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
    digest = hashlib.sha256()
    for name in sorted(columns):
        digest.update(name.encode())
        digest.update(np.ascontiguousarray(columns[name], dtype="<f8").tobytes())
    digest.update(np.ascontiguousarray(explosive, dtype=np.int8).tobytes())
    return digest.hexdigest()
