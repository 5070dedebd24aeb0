"""Answers for a table of designs: a table in, the same designs with their answers out.

In columns from the first cell to the last: a hundred thousand designs take a few seconds.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from castblast.design.rule import FaultyRows
from castblast.design.variables import INPUT_NAMES, VARIABLES
from castblast.errors import SpecError
from castblast.names import cell_text
from castblast.network import Network, offending_inputs
from castblast.prediction.answer import answer_document, load_network
from castblast.prediction.blanks import predict_with_blanks
from castblast.prediction.columns import ColumnPredictions, explosive_position
from castblast.specs.quantity import VariableIn
from castblast.specs.tables.table import ID_HEADS, Form, Table, read_table
from castblast.specs.tables.text import NUMBER
from castblast.types import FloatArray, IntArray

_FORM = Form(
    columns={name: VariableIn(name) for name in INPUT_NAMES},
    texts=("explosive",),
    ids=ID_HEADS,
)
_MOST_FAULTS = 20
_CHUNK = 4096
_SPECIAL = re.compile(r'[,";\t\r\n]')


@dataclass(frozen=True)
class PredictionTable:
    """Answers for many designs.

    Attributes
    ----------
    table : Table
        As read, with lines and ids.
    network : Network
    explosive : array (n,), int64
        Positions in `network.explosives`.
    answers : ColumnPredictions
    """

    table: Table
    network: Network
    explosive: IntArray
    answers: ColumnPredictions

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """A document for each design, as `answer.predict` makes it; with its id, if it has one."""
        documents = answer_document(self.answers, self.explosive, self.network)
        if not self.table.label:
            return list(documents)
        return [
            {"id": label, **document}
            for label, document in zip(self.table.label, documents, strict=True)
        ]

    @cached_property
    def text(self) -> str:
        """Designs and answers as CSV in display units, one a line, in the order of the table."""
        return "\n".join([_heads(self), *_lines(self)]) + "\n"


def predict_csv(
    path: str | Path,
    network: str | Path | None = None,
    *,
    explosive: str = "anfo",
    common: Mapping[str, float] | None = None,
) -> PredictionTable:
    """Predict every row of a table with heads like ``burden [m]`` and ``explosive``.

    Parameters
    ----------
    path : Path
        See `castblast.specs.tables.table`; any inputs, and ids of the rows. Blank cells are
        completed.
    network : path, optional
    explosive : str
        For rows without one.
    common : mapping of input name to float [SI], optional
        Inputs of all rows that are no columns of the table.

    Raises
    ------
    SpecError
        Unreadable table, unknown heads or units, values that are no numbers or not plausible,
        impossible designs; the first faults, each with its line.
    """
    path = Path(path)
    network = None if network is None else Path(network)
    model = load_network(network)
    table = read_table(path, _FORM)
    common = common or {}
    if twice := [name for name in common if name in table.number]:
        message = f"{path}: the table has a column '{twice[0]}'; leave it out beside the table"
        raise SpecError(message)
    count = len(table.line)
    index = _explosives(table, model, explosive)
    values = table.number | {name: np.full(count, value) for name, value in common.items()}
    answers = predict_with_blanks(values, index, model)
    _require_possible(table, answers.designs.faults)
    return PredictionTable(table, model, index, answers)


def _explosives(table: Table, network: Network, default: str) -> IntArray:
    """Positions of the explosives of all rows."""
    written = table.text.get("explosive")
    if written is None:
        return np.full(len(table.line), explosive_position(network, default), dtype=np.int64)
    position: dict[str, int] = {}
    faults = []
    for name in dict.fromkeys(written):
        try:
            position[name] = explosive_position(network, name or default)
        except SpecError as fault:
            faults.append(f"{table.where(written.index(name))}: {fault}")
    if faults:
        raise SpecError("\n".join(_first(faults)))
    return np.array([position[name] for name in written], dtype=np.int64)


def _require_possible(table: Table, faults: list[FaultyRows]) -> None:
    """Raise what refuses designs, by line; words are made for the first rows only."""
    faulty = np.zeros(len(table.line), dtype=bool)
    for fault in faults:
        faulty |= fault.rows
    rows = np.flatnonzero(faulty)
    lines = [
        f"{table.where(row)}: {fault.say(row)}"
        for row in rows[:_MOST_FAULTS].tolist()
        for fault in faults
        if fault.rows[row]
    ]
    if len(rows) > _MOST_FAULTS:
        lines.append(f"... and {len(rows) - _MOST_FAULTS} more lines")
    if lines:
        raise SpecError("\n".join(lines))


def _first(faults: list[str]) -> list[str]:
    more = len(faults) - _MOST_FAULTS
    return faults if more <= 0 else [*faults[:_MOST_FAULTS], f"... and {more} more"]


def _heads(found: PredictionTable) -> str:
    columns = (*found.network.inputs, *found.network.outputs)
    heads = [f"{c.name} [{VARIABLES[c.name].file_unit}]" for c in columns]
    bands = [
        f"{c.name}_prediction_{end} [{VARIABLES[c.name].file_unit}]"
        for c in found.network.outputs
        for end in ("lower", "upper")
    ]
    ids = [_cell(found.table.label_head)] if found.table.label else []
    verdict = ["in_domain", "out_of_domain", "domain", "density_score"]
    return ",".join([*ids, "explosive", *heads, *bands, *verdict])


def _lines(found: PredictionTable) -> Iterator[str]:
    """One line of CSV for each design."""
    network, answers = found.network, found.answers
    numbers = np.concatenate(
        [
            _shown(np.stack(list(answers.designs.inputs.values()), axis=1), network.input_names),
            _shown(answers.rows.values, network.output_names),
            _bands(found),
        ],
        axis=1,
    )
    plain = len(network.inputs) + len(network.outputs)
    # A quantity without a band has nothing but blank cells there.
    blank = np.isnan(numbers).all(axis=0)
    forms = ["%.8g"] * plain + ["%.4g"] * (numbers.shape[1] - plain)
    form = ",".join("" if empty else one for one, empty in zip(forms, blank, strict=True))
    names = [_cell(name) for name in network.explosives]
    labels = [f"{_cell(label)}," for label in found.table.label] or [""] * len(numbers)
    score = ["" if value != value else f"{value:.4g}" for value in answers.rows.score.tolist()]
    outside = _outside(found)
    inside = ["yes," if domain == "inside" else "no," for domain in answers.domain.tolist()]
    verdict = [
        f"{lead}{outside.get(k, '')},{domain},{value}"
        for k, (lead, domain, value) in enumerate(
            zip(inside, answers.domain.tolist(), score, strict=True)
        )
    ]
    for first in range(0, len(numbers), _CHUNK):
        part = slice(first, first + _CHUNK)
        for label, kind, row, words in zip(
            labels[part],
            found.explosive[part].tolist(),
            numbers[part, ~blank].tolist(),
            verdict[part],
            strict=True,
        ):
            yield f"{label}{names[kind]},{form % tuple(row)},{words}"


def _shown(values: FloatArray, names: tuple[str, ...]) -> FloatArray:
    """SI values (n, m) in the units that people read."""
    return np.asarray(values * np.array([VARIABLES[name].display_factor for name in names]))


def _bands(found: PredictionTable) -> FloatArray:
    """Lower and upper ends of all outputs side by side (n, 2 m), in the units that people read."""
    names = found.network.output_names
    low, high = (_shown(end, names) for end in found.answers.rows.prediction)
    return np.stack([low, high], axis=2).reshape(len(low), -1)


def _outside(found: PredictionTable) -> dict[int, str]:
    """Inputs at fault, in words, of the rows outside the domain."""
    answers, network = found.answers, found.network
    rows = np.flatnonzero(answers.domain != "inside")
    if not len(rows):
        return {}
    numeric = np.stack(list(answers.designs.inputs.values()), axis=1)[rows]
    columns = [offending_inputs(network, numeric)]
    names = list(network.input_names)
    for entry in answers.designs.unseen:
        names.append(entry.name)
        columns.append(entry.rows[rows, None])
    flags = np.concatenate(columns, axis=1)
    # Few kinds of rows, many rows: words are made once for each kind.
    kinds, kind_of = np.unique(flags, axis=0, return_inverse=True)
    words = [
        " ".join(dict.fromkeys(name for name, at in zip(names, kind, strict=True) if at))
        for kind in kinds
    ]
    return {row: words[kind] for row, kind in zip(rows.tolist(), kind_of.ravel(), strict=True)}


def _cell(text: str) -> str:
    """Text as a cell of a CSV file; a spreadsheet must not take it for a formula."""
    if not NUMBER.fullmatch(text):
        text = cell_text(text)
    return '"' + text.replace('"', '""') + '"' if _SPECIAL.search(text) else text
