"""The one reader of tables: heads with units, numbers in SI within their bounds, faults by line.

Everything that comes as rows of cells goes through `read_table`: holes, balls, ground, ore, rows of
a dataset, designs to predict. What a table may look like is said in ``data_specs/README.md``.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from castblast.errors import SpecError
from castblast.specs.quantity import QuantityError
from castblast.specs.tables.cells import Faults, NumberColumn, shown
from castblast.specs.tables.heads import Form, Head, Rows, read_heads, with_unit_row
from castblast.specs.tables.text import Sheet, open_sheet
from castblast.specs.units import scaled, unit_factor
from castblast.types import FloatArray, IntArray

__all__ = ["ID_HEADS", "Form", "Table", "read_table", "table_of"]

#: Heads of a column that names the rows.
ID_HEADS = ("id", "name", "label", "hole", "hole_id", "hole_name", "hole_no", "hole_number")
_CHUNK = 4096
_LONGEST_ID = 200


@dataclass(frozen=True)
class Table:
    """Columns of a table of n rows.

    Attributes
    ----------
    path : Path
    line : array (n,), int64
        Line of the file that each row stands in.
    number : dict of str to array (n,)
        In SI units; NaN where an optional cell is empty.
    text : dict of str to list of str
    unit : dict of str to str
        Unit that the head of a column of numbers gives; empty: none.
    label : list of str
        Ids of the rows as the file gives them; empty without a column of ids.
    label_head : str
        Head of that column.
    """

    path: Path
    line: IntArray
    number: dict[str, FloatArray]
    text: dict[str, list[str]]
    unit: dict[str, str] = field(default_factory=dict)
    label: list[str] = field(default_factory=list)
    label_head: str = ""

    def place(self, row: int) -> str:
        """Line of a row, and its id where it has one, for messages: ``line 5 (hole 'H4')``."""
        label = self.label[row] if self.label else ""
        return _place(int(self.line[row]), self.label_head, label)

    def where(self, row: int) -> str:
        """File and place of a row."""
        return f"{self.path}: {self.place(row)}"


Check = Callable[[Table], Iterable[tuple[int, str]]]


def read_table(path: Path, form: Form, check: Check | None = None) -> Table:
    """Read a table.

    Parameters
    ----------
    path : Path
        Text in UTF-8, UTF-16 or Windows-1252; cells apart by ``,``, ``;``, tabs or blanks; decimal
        commas where something else separates the cells; units in brackets behind the heads, in a
        row below them, or behind each number; remarks behind ``#``.
    form : Form
    check : callable, optional
        Gives line and message of every further fault of the rows, told with the others. Numbers
        that could not be read are NaN.

    Raises
    ------
    SpecError
        One line per fault, with file, line and column; the first twenty.
    """
    return table_of(path, open_sheet(path), form, check)


def table_of(path: Path, sheet: Sheet, form: Form, check: Check | None = None) -> Table:
    """Read a sheet that is open already; see `read_table`."""
    heads, rows = read_heads(path, sheet, form)
    rows = with_unit_row(path, form, heads, rows)
    faults = Faults()
    cells = _Cells(path, form, heads, comma=sheet.separator != ",")
    for chunk in _chunks(rows):
        cells.add(chunk, faults)
    cells.add_column_faults(faults)
    table = cells.table()
    _value_faults(table, form, faults)
    if form.unique_ids:
        _label_faults(table, faults)
    if check is not None and all(line for line, _ in faults.lines):
        for line, message in check(table):
            faults.add(line, message)
    if faults.count:
        raise SpecError("\n".join(faults.messages()))
    return table


class _Cells:
    """Cells below the heads, taken up a chunk of rows at a time."""

    def __init__(self, path: Path, form: Form, heads: list[Head], *, comma: bool) -> None:
        self.path, self.form, self.heads = path, form, heads
        self.lines: list[int] = []
        self.numbers = {
            k: NumberColumn(form.unit(head.name), bool(head.unit), comma)
            for k, head in enumerate(heads)
            if head.kind == "number"
        }
        self.words: dict[int, list[str]] = {
            k: [] for k, head in enumerate(heads) if head.kind in ("text", "label")
        }
        self.label = next((k for k, head in enumerate(heads) if head.kind == "label"), None)

    def add(self, chunk: list[tuple[int, list[str]]], faults: Faults) -> None:
        """Take up rows; what is no number, or has no head, is a fault."""
        lines, cells = _same_width(self.path, len(self.heads), chunk, faults)
        if not lines:
            return
        first = len(self.lines)
        self.lines += lines
        for k in self.words:
            self.words[k] += [cell.strip() for cell in cells[k]]
        for k, column in self.numbers.items():
            name = self.heads[k].name
            for row, cell, wrong in column.read(cells[k], name in self.form.required):
                place = f"{self.path}: {self.place(first + row)}: {name}: {shown(cell)}"
                faults.add(lines[row], f"{place}: {wrong}")
        for k in (k for k, head in enumerate(self.heads) if head.kind == "blank"):
            for line, cell in zip(lines, cells[k], strict=True):
                if cell.strip():
                    faults.add(line, f"{self.path}: line {line}: '{shown(cell)}' has no head")

    def place(self, row: int) -> str:
        """Line of a row, and its id if it has one."""
        label = "" if self.label is None else self.words[self.label][row]
        return _place(self.lines[row], self.label_head(), label)

    def label_head(self) -> str:
        """Head of the column of ids."""
        return "" if self.label is None else self.heads[self.label].name or "row"

    def add_column_faults(self, faults: Faults) -> None:
        """Say where units are missing, and where both decimal signs are used."""
        points = any(column.points for column in self.numbers.values())
        for k, column in self.numbers.items():
            head = self.heads[k]
            for row, cell in column.commas if points else ():
                faults.add(
                    self.lines[row],
                    f"{self.path}: {self.place(row)}: {head.name}: {shown(cell)}: a comma in a "
                    f"file with decimal points; write numbers without thousands separators",
                )
            if head.unit or self.form.bare or column.unit == "1" or not column.plain:
                continue
            try:
                unit_factor("", column.unit)
            except QuantityError as fault:
                faults.add(0, f"{self.path}: column '{head.raw.strip()}': {fault}")

    def table(self) -> Table:
        """All of it, in SI."""
        heads = self.heads
        return Table(
            path=self.path,
            line=np.array(self.lines, dtype=np.int64),
            number={
                heads[k].name: scaled(c.values(), heads[k].factor) for k, c in self.numbers.items()
            },
            text={heads[k].name: w for k, w in self.words.items() if heads[k].kind == "text"},
            unit={heads[k].name: heads[k].unit for k in self.numbers},
            label=[] if self.label is None else self.words[self.label],
            label_head=self.label_head(),
        )


def _place(line: int, head: str, label: str) -> str:
    return f"line {line} ({head} '{shown(label)}')" if label else f"line {line}"


def _chunks(rows: Rows) -> Iterator[list[tuple[int, list[str]]]]:
    while chunk := list(itertools.islice(rows, _CHUNK)):
        yield chunk


def _same_width(
    path: Path, width: int, chunk: list[tuple[int, list[str]]], faults: Faults
) -> tuple[list[int], list[tuple[str, ...]]]:
    """Lines and columns of the rows that have a cell for every head; blank ends do not count."""
    lines, rows = [], []
    for line, cells in chunk:
        if len(cells) > width and not "".join(cells[width:]).strip():
            cells = cells[:width]
        if len(cells) == width:
            lines.append(line)
            rows.append(cells)
            continue
        hint = ""
        if len(cells) > width and len(cells) % width == 0:
            hint = "; decimal commas need ';' or tabs between the cells"
        faults.add(line, f"{path}: line {line}: {len(cells)} cells for {width} heads{hint}")
    return lines, list(zip(*rows, strict=True))


def _value_faults(table: Table, form: Form, faults: Faults) -> None:
    """Hold all columns against their bounds, as the fields of YAML files are."""
    for name, values in table.number.items():
        rule = form.columns[name]
        if isinstance(rule, str):
            continue
        bad = np.flatnonzero(~rule.within(values) & ~np.isnan(values))
        for row in bad.tolist():
            value, unit = float(values[row]), table.unit[name] or rule.unit
            written = (
                value / unit_factor(table.unit[name], rule.unit) if table.unit[name] else value
            )
            shown_value = f"{written:.6g} {'' if unit == '1' else unit}".strip()
            try:
                rule.check(value)
            except QuantityError as fault:
                line = f"{table.where(row)}: {name}: {shown_value}: {fault}"
                faults.add(int(table.line[row]), line)


def _label_faults(table: Table, faults: Faults) -> None:
    """Say which ids are missing or given twice."""
    first: dict[str, int] = {}
    for row, label in enumerate(table.label):
        line, head = int(table.line[row]), table.label_head
        if not label or len(label) > _LONGEST_ID:
            wrong = "empty" if not label else f"longer than {_LONGEST_ID} characters"
            faults.add(line, f"{table.path}: line {line}: {head}: {wrong}")
        elif label in first:
            above = table.line[first[label]]
            faults.add(
                line,
                f"{table.path}: lines {above} and {line}: {head} '{shown(label)}': given twice",
            )
        first.setdefault(label, row)
