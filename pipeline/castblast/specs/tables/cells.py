"""Columns of written numbers turned into arrays, with the line and the cell of whatever is none."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from castblast.names import shortened
from castblast.specs.quantity import QuantityError, convert
from castblast.specs.tables.text import NUMBER
from castblast.types import FloatArray

MOST_FAULTS = 20
_PLAIN = re.compile(r"[0-9eE+\-.\s]*", re.ASCII)
_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?", re.ASCII)
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:[,.' \u00a0\u202f]\d{3})+(?:[.,]\d*)?", re.ASCII)
_FORTRAN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)[dD][+-]?\d+", re.ASCII)
_WITH_UNIT = re.compile(r"[+-]?(?:\d|\.\d)\S*\s*[^\W\d].*|[+-]?[\d.]+\s*[%°]")
_COMMA_UNIT = re.compile(r"([+-]?\d*),(\d+(?:[eE][+-]?\d+)?\s*[^\d\s].*)")
_LONGEST_CELL = 40


@dataclass
class Faults:
    """The first faults of a table by line, and the number of all."""

    lines: list[tuple[int, str]] = field(default_factory=list)
    count: int = 0

    def add(self, line: int, message: str) -> None:
        """Count one; the first `MOST_FAULTS` are kept."""
        self.count += 1
        if len(self.lines) < MOST_FAULTS:
            self.lines.append((line, message))

    def messages(self) -> list[str]:
        """Messages in the order of their lines, and how many more there are."""
        kept = [message for _, message in sorted(self.lines, key=lambda entry: entry[0])]
        more = self.count - len(kept)
        return [*kept, f"... and {more} more"] if more > 0 else kept


@dataclass
class NumberColumn:
    """Reads the cells of one column, chunk by chunk.

    Attributes
    ----------
    unit : str
        SI unit.
    written : bool
        The head gives a unit, so that the cells must not.
    comma : bool
        Commas may be decimal signs, because something else stands between the cells.
    """

    unit: str
    written: bool
    comma: bool
    parts: list[FloatArray] = field(default_factory=list)
    #: Some cell has a decimal point; rows and cells with a decimal comma, the first; some cell has
    #: no unit; rows read.
    points: bool = False
    commas: list[tuple[int, str]] = field(default_factory=list)
    plain: bool = False
    count: int = 0

    def read(self, cells: Sequence[str], required: bool) -> list[tuple[int, str, str]]:
        """Add a chunk; returns number in it, cell and what is wrong of those that are no numbers.

        Cells that carry a unit are in SI.
        """
        first = self.count
        self.count += len(cells)
        joined = "".join(cells)
        if _PLAIN.fullmatch(joined):
            try:
                values = np.fromiter(map(float, cells), np.float64, len(cells))
            except ValueError:
                pass  # an empty cell, or something like 1-2
            else:
                self.points |= "." in joined
                self.plain = True
                if np.isfinite(values).all():
                    self.parts.append(values)
                    return []
        values = np.full(len(cells), np.nan)
        faults = []
        for k, cell in enumerate(map(str.strip, cells)):
            if not cell and not required:
                continue
            values[k], wrong = self._one(cell, first + k)
            if wrong:
                faults.append((k, cell, wrong))
        self.parts.append(values)
        return faults

    def _one(self, cell: str, row: int) -> tuple[float, str]:
        """Value of a cell, NaN with words where it is no number."""
        if NUMBER.fullmatch(cell):
            self.plain = True
            self.points |= "." in cell
            value = float(cell)
            return (value, "") if math.isfinite(value) else (math.nan, "is too large for a number")
        if self.comma and _COMMA.fullmatch(cell):
            self.plain = True
            self._saw_comma(row, cell)
            return float(cell.replace(",", ".")), ""
        if not self.written and _WITH_UNIT.fullmatch(cell) and not _FORTRAN.fullmatch(cell):
            plain = cell
            if self.comma and (match := _COMMA_UNIT.fullmatch(cell)):
                plain = f"{match[1]}.{match[2]}"
                self._saw_comma(row, cell)
            try:
                value = convert(plain, self.unit)
            except QuantityError as fault:
                return math.nan, str(fault)
            return value, ""
        return math.nan, _why(cell)

    def _saw_comma(self, row: int, cell: str) -> None:
        if len(self.commas) < MOST_FAULTS:
            self.commas.append((row, cell))

    def values(self) -> FloatArray:
        """All that was read, in the order of the rows."""
        return np.concatenate(self.parts) if self.parts else np.empty(0)


def is_number(cell: str) -> bool:
    """Whether a cell looks like a number, with either decimal sign."""
    cell = cell.strip()
    return bool(NUMBER.fullmatch(cell) or _COMMA.fullmatch(cell) or _THOUSANDS.fullmatch(cell))


def shown(cell: str) -> str:
    """Cell for a message, cut where it is long."""
    return shortened(cell, _LONGEST_CELL) or "empty"


def _why(cell: str) -> str:
    if _THOUSANDS.fullmatch(cell):
        return "a number is needed, without thousands separators"
    if _COMMA.fullmatch(cell):
        return "a number is needed, with a decimal point, or with ';' between the cells"
    if _FORTRAN.fullmatch(cell):
        return "a number is needed; write its exponent with e, not d"
    return "a number is needed"
