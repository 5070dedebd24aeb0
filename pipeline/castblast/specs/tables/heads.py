"""Heads of a table: which column each one is, and its unit, however people write them."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from castblast.errors import SpecError, nearest_name
from castblast.specs.quantity import QuantityError, QuantityIn, VariableIn
from castblast.specs.tables.cells import is_number, shown
from castblast.specs.tables.text import Sheet
from castblast.specs.units import unit_factor

_HEAD = re.compile(r"([^\[(]*?)\s*(?:\[([^\]]*)\]|\((.*)\))?", re.DOTALL)
_KNOWN_SHOWN = 12
_MOST_FAULTS = 20
Rows = Iterator[tuple[int, list[str]]]


@dataclass(frozen=True)
class Form:
    """What a table may hold.

    Attributes
    ----------
    columns : mapping of name to rule
        Columns of numbers: the SI unit, or unit and bounds as the fields of YAML files have them.
    required : sequence of str
        Columns that must be there, without empty cells.
    texts : sequence of str
        Columns of words.
    aliases : mapping of str to str
        Other heads of columns. Upper and lower case, blanks and underscores do not matter.
    ids : sequence of str
        Heads of a column that names the rows; (): none.
    unique_ids : bool
        No row is without an id, and no two have the same.
    loose : bool
        Heads that are not known are left out; otherwise they are refused.
    bare : bool
        A head without a unit is in SI; otherwise it is refused.
    chosen : mapping of str to str
        Name of a column to the head that stands for it, or to its number from 1, with a unit in
        brackets where the file gives none. Other heads that are not known are left out then.
    instead : mapping of str to sequence of str
        Columns that together stand for a required one.
    hint : str
        What to do if no column is there.
    """

    columns: Mapping[str, str | QuantityIn | VariableIn]
    required: Sequence[str] = ()
    texts: Sequence[str] = ()
    aliases: Mapping[str, str] = field(default_factory=dict)
    ids: Sequence[str] = ()
    unique_ids: bool = False
    loose: bool = False
    bare: bool = False
    chosen: Mapping[str, str] = field(default_factory=dict)
    instead: Mapping[str, Sequence[str]] = field(default_factory=dict)
    hint: str = ""

    def names(self) -> tuple[str, ...]:
        """Names of all columns."""
        return (*self.columns, *self.texts)

    def unit(self, name: str) -> str:
        """SI unit of a column of numbers."""
        rule = self.columns[name]
        return rule if isinstance(rule, str) else rule.unit

    def written(self, name: str) -> str:
        """A column as its head is written: ``burden [m]``."""
        if name in self.texts or self.unit(name) == "1":
            return name
        return f"{name} [{self.unit(name)}]"


@dataclass
class Head:
    """A column of the file: what it is (number, text, label, nothing) and its unit."""

    name: str
    kind: str
    unit: str = ""
    factor: float = 1.0
    raw: str = ""


def normal(head: str) -> str:
    """Head without what people write in many ways: case, blanks, dashes, dots, underscores."""
    return re.sub(r"[\s_\-.:/]+", "_", head.strip().lower()).strip("_")


def read_heads(path: Path, sheet: Sheet, form: Form) -> tuple[list[Head], Rows]:
    """Find out what each column is."""
    where = f"{path}: line {sheet.head_line}"
    if form.chosen:
        heads, rows = _chosen_heads(where, sheet, form)
    else:
        _require_heads(where, sheet, form)
        heads, rows = [_one_head(head, form) for head in sheet.heads], sheet.rows
        if form.ids and heads and heads[0].kind == "blank":
            heads[0].kind = "label"  # numbers of the rows, as pandas writes them
    faults = _head_faults(where, sheet, heads, form)
    found = {head.name for head in heads}
    missing = [
        name
        for name in form.required
        if name not in found and not (form.instead.get(name) and found >= {*form.instead[name]})
    ]
    if missing and not found & set(form.required) and len(missing) > 1:
        # Another form altogether: one line says more than one for each head.
        given = ", ".join(f"'{shown(head)}'" for head in sheet.heads[:_KNOWN_SHOWN])
        needed = ", ".join(form.written(name) for name in form.required)
        raise SpecError(f"{where}: the heads are {given}; needed: {needed}{form.hint}")
    faults += [f"{path}: the column '{name}' is missing" for name in missing]
    if faults:
        raise SpecError("\n".join(faults[:_MOST_FAULTS]))
    return heads, rows


def _require_heads(where: str, sheet: Sheet, form: Form) -> None:
    known = any(_one_head(head, form).kind in ("number", "text") for head in sheet.heads)
    numbers = sum(map(is_number, sheet.heads))
    if not known and 2 * numbers >= len(sheet.heads):
        needed = ", ".join(form.written(name) for name in form.required or form.names()[:4])
        raise SpecError(
            f"{where}: holds {numbers} numbers where the heads of {len(sheet.heads)} columns are "
            f"needed, such as {needed}{form.hint}"
        )


def _one_head(raw: str, form: Form) -> Head:
    match = _HEAD.fullmatch(raw.strip())
    name = match[1].strip() if match else raw.strip()
    unit = next((part.strip() for part in match.groups()[1:] if part), "") if match else ""
    known = form.names()
    if name in known:
        return _head_of(name, form, unit, raw)
    plain = normal(name)
    spelled = {normal(k): k for k in known} | {normal(k): v for k, v in form.aliases.items()}
    if plain in spelled:
        return _head_of(spelled[plain], form, unit, raw)
    if plain in form.ids:
        return Head(name, "label", unit, raw=raw)
    return Head(name, "unknown" if plain else "blank", unit, raw=raw)


def _head_of(name: str, form: Form, unit: str, raw: str) -> Head:
    return Head(name, "text" if name in form.texts else "number", unit, raw=raw)


def _chosen_heads(where: str, sheet: Sheet, form: Form) -> tuple[list[Head], Rows]:
    """Heads as the user maps them; a file without heads begins with its first row."""
    heads = [_one_head(head, form) for head in sheet.heads]
    spelled = {normal(head.raw): k for k, head in enumerate(heads)}
    spelled |= {normal(head.name): k for k, head in enumerate(heads) if head.name}
    faults, numbered = [], []
    for name, text in form.chosen.items():
        match = _HEAD.fullmatch(text.strip())
        asked, unit = (match[1], (match[2] or match[3] or "").strip()) if match else (text, "")
        if asked.isdecimal() and len(asked) < 5:
            k: int | None = int(asked) - 1 if 0 < int(asked) <= len(heads) else None
            numbered.append(k)
        else:
            k = spelled.get(normal(text), spelled.get(normal(asked)))
        if k is None:
            hint = nearest_name(asked, [head.name for head in heads])
            faults.append(f"{where}: no column '{asked}' for '{name}'{hint}")
            continue
        kind = "label" if name == "id" and form.ids else ""
        made = _head_of(name, form, unit or heads[k].unit, heads[k].raw)
        heads[k] = Head("id", kind, raw="id") if kind else made
    if faults:
        raise SpecError("\n".join(faults))
    headless = bool(numbered) and any(
        k is not None and heads[k].kind == "number" and is_number(sheet.heads[k]) for k in numbered
    )
    for head in heads:
        if head.kind == "unknown" or (headless and head.raw not in form.chosen.values()):
            head.kind = head.kind if head.name in form.chosen else "left out"
    if not headless:
        return heads, sheet.rows
    return heads, itertools.chain([(sheet.head_line, sheet.heads)], sheet.rows)


def _head_faults(where: str, sheet: Sheet, heads: list[Head], form: Form) -> list[str]:
    """Say what is wrong with the heads, and set the factors of their units."""
    faults = []
    seen: set[str] = set()
    for head in heads:
        place = f"{where}: column '{shown(head.raw.strip())}'"
        key = "a column of ids" if head.kind == "label" else head.name
        if head.kind in ("number", "text", "label") and key in seen:
            faults.append(f"{place}: given twice")
        seen.add(key)
        if head.kind == "unknown" and not form.loose:
            hint = nearest_name(head.name, form.names())
            known = "; known: " + ", ".join(form.names()[:_KNOWN_SHOWN])
            faults.append(f"{place}: unknown column{hint or known}")
        elif head.kind == "number" and head.unit:
            try:
                head.factor = unit_factor(head.unit, form.unit(head.name))
            except QuantityError as fault:
                faults.append(f"{place}: {fault}")
    return faults


def with_unit_row(path: Path, form: Form, heads: list[Head], rows: Rows) -> Rows:
    """Take units from a second row of heads, if there is one."""
    first = next(rows, None)
    if first is None:
        raise SpecError(f"{path}: has a header but no data rows")
    line, cells = first
    numbers = [
        (head, cells[k].strip().strip("[]()").strip())
        for k, head in enumerate(heads)
        if head.kind == "number" and k < len(cells) and form.unit(head.name) != "1"
    ]
    given = [(head, unit) for head, unit in numbers if unit]
    if not given or any(head.unit or re.search(r"^[\d.,+-]", unit) for head, unit in given):
        return itertools.chain([first], rows)
    faults = []
    for head, unit in given:
        try:
            head.unit, head.factor = unit, unit_factor(unit, form.unit(head.name))
        except QuantityError as fault:
            head.unit = ""
            faults.append(f"{path}: line {line}: column '{head.raw.strip()}': {fault}")
    if len(faults) == len(given):
        return itertools.chain([first], rows)
    if faults:
        raise SpecError("\n".join(faults))
    second = next(rows, None)
    if second is None:
        raise SpecError(f"{path}: holds heads and units only; at least one row is needed")
    return itertools.chain([second], rows)
