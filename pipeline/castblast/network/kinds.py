"""Kinds and texts of the entries of a record, held against what they may be.

A record may come from anywhere, and its texts end in source code, pages and worksheets: names,
units and rules have the patterns of `castblast.names`, so that none can end a comment or a string.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from numbers import Real
from typing import Any

import numpy as np

from castblast.names import is_label, is_unit, is_variable, shortened
from castblast.network.parts import Column, ShellParts

#: Groups of a provenance, and those of its texts that go into the heads of exports.
_GROUPS = ("spec", "dataset", "held_inputs", "scores")
_HEADS = (
    ("spec", "name"), ("dataset", "name"), ("dataset", "dataset_version"),
    ("dataset", "content_sha256"), ("", "castblast_version"),
)  # fmt: skip
_LONGEST_TEXT = 20_000


def kind_faults(shell: ShellParts) -> list[str]:
    """Say which entries are of the wrong kind, or hold a text that none may, one line each."""
    faults = []
    for column in (*shell.inputs, *shell.derived, *shell.outputs):
        faults += _column_faults(column)
    for name in shell.explosives:
        if not is_label(name):
            faults.append(f"explosive '{shortened(name)}': is no name")
    for rule in shell.constraints:
        if not is_label(rule.label):
            faults.append(f"rule '{shortened(rule.label)}': is not plain text")
        faults += _numbers(f"rule '{shortened(rule.label)}'", {"lower": rule.lower})
        faults += _coefficient_faults(f"rule '{shortened(rule.label)}'", rule.coefficients)
        if not is_unit(rule.unit):
            faults.append(f"rule '{shortened(rule.label)}': '{shortened(rule.unit)}' is not a unit")
    if not all(isinstance(name, str) for name in shell.golden.explosives):
        faults.append("golden rows: names of explosives are needed")
    if shell.density is not None:
        part = {"threshold": shell.density.threshold, "level": shell.density.level}
        faults += _numbers("density", part)
    return faults + _provenance_faults(shell.provenance)


def _column_faults(column: Column) -> list[str]:
    where = shortened(column.name)
    faults = []
    if not is_variable(column.name):
        faults.append(f"column '{where}': small letters, digits and '_' are allowed in a name")
    if not is_unit(column.unit):
        faults.append(f"{where}: '{shortened(column.unit)}' is not a unit")
    if not isinstance(column.transform, str):
        faults.append(f"{where}: unknown transform '{shortened(column.transform)}'")
    names = ("mean", "scale", "lower", "upper", "relative_band")
    numbers = {name: getattr(column, name) for name in names if hasattr(column, name)}
    faults += _numbers(where, numbers)
    if hasattr(column, "coefficients"):
        faults += _coefficient_faults(where, column.coefficients)
    return faults


def _coefficient_faults(where: str, coefficients: object) -> list[str]:
    if not isinstance(coefficients, Mapping):
        return [f"{where}: coefficients: names with numbers are needed"]
    return _numbers(where, {shortened(name): value for name, value in coefficients.items()})


def _numbers(where: str, entries: Mapping[str, object]) -> list[str]:
    return [
        f"{where}: {name}: {shortened(value)}: a number is needed"
        for name, value in entries.items()
        if not _is_number(value)
    ]


def _is_number(value: object) -> bool:
    """Say whether a value is a number that fits a float; infinities are looked at elsewhere."""
    if isinstance(value, bool | np.bool_) or not isinstance(value, Real):
        return False
    try:
        float(value)
    except OverflowError:
        return False
    return True


def _provenance_faults(provenance: object) -> list[str]:
    if not isinstance(provenance, Mapping):
        return ["provenance: a group of entries is needed"]
    faults = [
        f"provenance: {name}: a group of entries is needed"
        for name in _GROUPS
        if not isinstance(provenance.get(name, {}), Mapping)
    ]
    if faults:
        return faults
    for group, name in _HEADS:
        entry = (provenance.get(group, {}) if group else provenance).get(name, "")
        if entry and not is_label(entry):
            place = f"{group}.{name}" if group else name
            faults.append(f"provenance: {place}: '{shortened(entry)}': is not plain text")
    faults += _numbers("provenance: held_inputs", provenance.get("held_inputs", {}))
    scores = provenance.get("scores", {})
    for split, group in scores.items():
        if not isinstance(group, Mapping) or not all(
            isinstance(v, Mapping) for v in group.values()
        ):
            faults.append(f"provenance: scores.{shortened(split)}: groups of numbers are needed")
    odd = next(_odd_texts(provenance), None)
    if odd is not None:
        faults.append(f"provenance: '{shortened(odd)}': such a text is not allowed")
    return faults


def _odd_texts(value: Any) -> Iterator[str]:
    """Texts with control characters or halves of characters, and such as are far too long."""
    if isinstance(value, str):
        plain = value.replace("\n", " ").replace("\t", " ").replace("\u00a0", " ")
        if len(value) > _LONGEST_TEXT or not plain.isprintable():
            yield value
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _odd_texts(str(key))
            yield from _odd_texts(inner)
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from _odd_texts(inner)
    elif isinstance(value, Real) and not isinstance(value, bool) and not _finite(value):
        yield shortened(value)


def _finite(value: Real) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:
        return False
