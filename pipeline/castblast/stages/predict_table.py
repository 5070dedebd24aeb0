"""Answers for a table of designs: a CSV file in, the same designs with their answers out."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from castblast.errors import SpecError, nearest_name
from castblast.network import Network
from castblast.stages.predict import load_network, predict
from castblast.variables import INPUT_NAMES, VARIABLES

_HEAD = re.compile(r"\s*(\w+)\s*(?:\[([^\]]*)\])?\s*")


@dataclass(frozen=True)
class PredictionTable:
    """Answers for many designs: documents, and the designs with answers as CSV text."""

    rows: list[dict[str, Any]]
    text: str


def predict_csv(path: Path, network: Path | None = None) -> PredictionTable:
    """Predict every row of a CSV file with heads like ``burden [m]`` and ``explosive``.

    Raises
    ------
    SpecError
        Unreadable file, unknown heads or units, values that are no numbers or not plausible; each
        fault with its line, all at once.
    """
    model = load_network(network)
    lines = _read_lines(path)
    names, units = _read_heads(lines[0][1], path)
    documents, faults = [], []
    for number, cells in lines[1:]:
        try:
            documents.append(_predict_line(names, units, cells, model))
        except SpecError as fault:
            faults += [f"{path}: line {number}: {line}" for line in str(fault).splitlines()]
    if faults:
        raise SpecError("\n".join(faults))
    return PredictionTable(documents, _csv_text(documents, model))


def _read_lines(path: Path) -> list[tuple[int, list[str]]]:
    """Line numbers and cells of the lines that are not empty, the heads first."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        message = f"{path}: no such file"
        raise SpecError(message) from None
    except UnicodeDecodeError:
        message = f"{path}: is not a text file in UTF-8"
        raise SpecError(message) from None
    reader = csv.reader(io.StringIO(text))
    lines = [(reader.line_num, cells) for cells in reader if any(c.strip() for c in cells)]
    if len(lines) < 2:
        message = f"{path}: a line of heads and at least one design are needed"
        raise SpecError(message)
    return lines


def _read_heads(heads: Sequence[str], path: Path) -> tuple[list[str], list[tuple[str, str]]]:
    """Names, and SI unit with written unit, of the columns."""
    from castblast.specs.quantity import parse_quantity

    names: list[str] = []
    units, faults = [], []
    for head in heads:
        match = _HEAD.fullmatch(head)
        name, written = (match[1], (match[2] or "").strip()) if match else (head, "")
        where = f"{path}: head '{head}'"
        if name in names:
            faults.append(f"{where}: given twice")
        elif name not in (*INPUT_NAMES, "explosive"):
            hint = nearest_name(name, (*INPUT_NAMES, "explosive"))
            faults.append(f"{where}: no such input{hint}")
        elif name != "explosive":
            try:
                parse_quantity(f"1 {written}".strip(), VARIABLES[name].unit, where)
            except SpecError as fault:
                faults.append(str(fault))
        names.append(name)
        units.append((VARIABLES[name].unit if name in INPUT_NAMES else "", written))
    if faults:
        raise SpecError("\n".join(faults))
    return names, units


def _predict_line(
    names: Sequence[str], units: Sequence[tuple[str, str]], cells: Sequence[str], model: Network
) -> dict[str, Any]:
    from castblast.specs.quantity import parse_quantity

    if len(cells) != len(names):
        message = f"{len(cells)} cells for {len(names)} heads"
        raise SpecError(message)
    explosive, values, faults = "anfo", {}, []
    for name, (unit, written), cell in zip(names, units, cells, strict=True):
        if name == "explosive":
            explosive = cell.strip() or explosive
        elif cell.strip():
            try:
                values[name] = parse_quantity(f"{cell.strip()} {written}".strip(), unit, name)
            except SpecError as fault:
                faults.append(str(fault))
    if faults:
        raise SpecError("\n".join(faults))
    return predict(values, explosive, model)


def _csv_text(documents: Sequence[Mapping[str, Any]], model: Network) -> str:
    """Designs and answers in display units, one a line."""
    columns = (*model.inputs, *model.outputs)
    heads = [f"{c.name} [{VARIABLES[c.name].shown_unit}]" for c in columns]
    bands = [
        f"{c.name}_prediction_{end} [{VARIABLES[c.name].shown_unit}]"
        for c in model.outputs
        for end in ("lower", "upper")
    ]
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(["explosive", *heads, *bands, "in_domain", "out_of_domain", "domain",
                     "density_score"])  # fmt: skip
    for document in documents:
        values = {**document["inputs"], **document}
        cells = [f"{values[c.name] * VARIABLES[c.name].display_factor:.8g}" for c in columns]
        ends = [
            _shown_end(document, c.name, end) for c in model.outputs for end in ("lower", "upper")
        ]
        inside = "yes" if document["in_domain"] else "no"
        outside = " ".join(document["out_of_domain"])
        score = "" if document["density_score"] is None else f"{document['density_score']:.4g}"
        verdict = [inside, outside, document["domain"], score]
        writer.writerow([document["explosive"], *cells, *ends, *verdict])
    return buffer.getvalue()


def _shown_end(document: Mapping[str, Any], name: str, end: str) -> str:
    """End of a prediction band in the usual unit; empty where none is stated."""
    band = document["prediction_band"].get(name)
    return "" if band is None else f"{band[end] * VARIABLES[name].display_factor:.4g}"
