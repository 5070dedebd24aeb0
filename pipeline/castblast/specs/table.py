"""CSV files of people: heads with units, such as ``delay [ms]``, numbers in SI, faults by line."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from castblast.errors import SpecError, nearest_name
from castblast.specs.loading import read_text
from castblast.specs.quantity import QuantityError, convert

_HEAD = re.compile(r"\s*([\w/ ]*?\w)\s*(?:\[([^\]]*)\])?\s*")
_MOST_FAULTS = 20


@dataclass(frozen=True)
class Table:
    """Columns of a CSV file.

    Attributes
    ----------
    path : Path
    line : array (n,), int64
        Line of the file that each row stands in.
    number : dict of str to array (n,)
        In SI units; NaN where an optional cell is empty.
    text : dict of str to list of str
    """

    path: Path
    line: NDArray[np.int64]
    number: dict[str, NDArray[np.float64]]
    text: dict[str, list[str]]


def read_table(
    path: Path,
    units: Mapping[str, str],
    required: Sequence[str],
    texts: Sequence[str] = (),
    *,
    bare: bool = False,
) -> Table:
    """Read a CSV file.

    Parameters
    ----------
    path : Path
    units : mapping of column name to SI unit
    required : sequence of str
        Columns that must be there, without empty cells.
    texts : sequence of str
        Columns of words.
    bare : bool
        A head without a unit is in SI; otherwise it is refused.

    Raises
    ------
    SpecError
        One line per fault, with file, line and column; the first twenty.
    """
    lines = _split_lines(path)
    (head_line, heads), rows = lines[0], lines[1:]
    names, factors = _read_heads(path, head_line, heads, units, texts, bare=bare)
    faults = [f"{path}: the column '{name}' is missing" for name in required if name not in names]
    if faults:
        raise SpecError("\n".join(faults))
    if not rows:
        raise SpecError(f"{path}: holds heads only; at least one row is needed")
    for line, cells in rows:
        if len(cells) != len(names):
            faults.append(f"{path}: line {line}: {len(cells)} cells for {len(names)} heads")
    if faults:
        raise SpecError("\n".join(_first(faults)))
    number, text = {}, {}
    for k, name in enumerate(names):
        cells_of = [cells[k].strip() for _, cells in rows]
        if name in texts:
            text[name] = cells_of
            continue
        column = np.array([_to_number(cell) for cell in cells_of])
        number[name] = column * factors[k]
        bad = np.flatnonzero(~np.isfinite(column))
        faults += [
            f"{path}: line {rows[i][0]}: {name}: {cells_of[i] or 'empty'}: a number is needed"
            for i in bad[: _MOST_FAULTS + 1]
            if cells_of[i] or name in required
        ]
    if faults:
        raise SpecError("\n".join(_first(faults)))
    return Table(path, np.array([line for line, _ in rows]), number, text)


def _split_lines(path: Path) -> list[tuple[int, list[str]]]:
    """Line numbers and cells of lines that are neither empty nor a remark behind ``#``."""
    reader = csv.reader(io.StringIO(read_text(path).removeprefix("\ufeff")))
    try:
        lines = [
            (reader.line_num, cells)
            for cells in reader
            if any(cell.strip() for cell in cells) and not cells[0].lstrip().startswith("#")
        ]
    except csv.Error as fault:
        raise SpecError(f"{path}: line {reader.line_num}: is no CSV: {fault}") from None
    if not lines:
        raise SpecError(f"{path}: is empty")
    return lines


def _read_heads(
    path: Path,
    line: int,
    heads: Sequence[str],
    units: Mapping[str, str],
    texts: Sequence[str],
    *,
    bare: bool,
) -> tuple[list[str], list[float]]:
    """Names and SI factors of the columns."""
    names: list[str] = []
    factors, faults = [], []
    for head in heads:
        match = _HEAD.fullmatch(head)
        name, written = (match[1], (match[2] or "").strip()) if match else (head.strip(), "")
        where = f"{path}: line {line}: column '{head.strip()}'"
        factor = 1.0
        if name in names:
            faults.append(f"{where}: given twice")
        elif name not in units and name not in texts:
            hint = nearest_name(name, (*units, *texts))
            known = ", ".join((*units, *texts)[:12])
            faults.append(f"{where}: unknown column{hint or '; known: ' + known}")
        elif name in units and not (bare and not written):
            try:
                factor = convert(f"1 {written}", units[name])
            except QuantityError as fault:
                faults.append(f"{where}: {fault}")
        names.append(name)
        factors.append(factor)
    if faults:
        raise SpecError("\n".join(_first(faults)))
    return names, factors


def _to_number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _first(faults: list[str]) -> list[str]:
    more = len(faults) - _MOST_FAULTS
    return faults if more <= 0 else [*faults[:_MOST_FAULTS], f"... and {more} more"]
