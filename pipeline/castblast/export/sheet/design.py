"""The rule of a design as formulas of a worksheet, from the data of `castblast.design.rule`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from castblast.design.rule import (
    COMPLETED,
    DESIGN_RULES,
    MESSAGE_FIELD,
    ROUND_OFF,
    DesignRule,
    completions_of,
)
from castblast.design.variables import INPUTS, VARIABLES
from castblast.export.sheet.block import in_formula
from castblast.names import as_words
from castblast.network import Network

if TYPE_CHECKING:
    from openpyxl.worksheet.worksheet import Worksheet


def write_refusals(network: Network, sheet: Worksheet, top: int, cells: Mapping[str, str]) -> str:
    """Write one formula for every reason why no bench can hold a design, down column A.

    Parameters
    ----------
    network : Network
    sheet : Worksheet
    top : int
        Row of the title; the formulas follow.
    cells : mapping of str to str
        Input names of the network to the addresses of their SI values on `sheet`.

    Returns
    -------
    str
        A formula that joins the reasons, for any sheet; an empty text where there are none.
    """
    sheet.cell(top, 1, "Why no bench can hold the design, by the rule that castblast applies")
    formulas = [
        *(_bounds(name, cell) for name, cell in cells.items() if name in VARIABLES),
        *_rules(network, cells),
    ]
    for row, formula in enumerate(formulas, top + 1):
        sheet.cell(row, 1, f'=IFERROR({formula},"")')
    places = (f"'{sheet.title}'!$A${row}" for row in range(top + 1, top + 1 + len(formulas)))
    return "TRIM(" + "&".join(places) + ")"


def _bounds(name: str, cell: str) -> str:
    variable = VARIABLES[name]
    margin = 1e-12 * max(abs(variable.lower), abs(variable.upper))
    allowed = f"{variable.show(variable.lower)} to {variable.show(variable.upper)}"
    lead, end = in_formula(f"{as_words(name)} "), in_formula(f" is not plausible: {allowed}. ")
    inside = f"AND({cell}>={variable.lower - margin!r},{cell}<={variable.upper + margin!r})"
    return f'IF({inside},"",{lead}&{_shown(cell, name)}&{end})'


def _rules(network: Network, cells: Mapping[str, str]) -> list[str]:
    """Rules that a design of this network can break, each as text or an empty text."""
    held = network.provenance.get("held_inputs", {})
    values = {v.name: v.default for v in INPUTS if v.default is not None}
    values |= {n: float(v) for n, v in held.items() if n in VARIABLES and n not in COMPLETED}
    known = {name: repr(value) for name, value in values.items()} | dict(cells)
    for entry in completions_of(known):
        known[entry.name] = f"({'+'.join(_terms(entry.terms, known))})"
    return [_rule(rule, known) for rule in DESIGN_RULES if set(rule.given) <= set(cells)]


def _rule(rule: DesignRule, known: Mapping[str, str]) -> str:
    parts = _terms(rule.terms, known)
    sizes = ",".join(f"ABS({part})" for part in parts)
    words, end = [], 0
    for field in MESSAGE_FIELD.finditer(rule.message):
        factor, name, as_name = field.groups()
        words.append(in_formula(as_words(rule.message[end : field.start()])))
        words.append(_shown(f"{factor or '1'}*{known[name]}", as_name or name))
        end = field.end()
    words.append(in_formula(f"{as_words(rule.message[end:])}. "))
    return f'IF({"+".join(parts)}<-{ROUND_OFF!r}*MAX({sizes}),{"&".join(words)},"")'


def _terms(terms: Mapping[str, float], known: Mapping[str, str]) -> list[str]:
    return [f"({factor!r})*{known[name]}" for name, factor in terms.items()]


def _shown(formula: str, name: str) -> str:
    """A formula in SI as text in the unit that people use; no format, which differs by country."""
    variable = VARIABLES[name]
    unit = "" if variable.shown_unit == "1" else f" {variable.shown_unit}"
    return f"ROUND({formula}*{variable.display_factor!r},4)&{in_formula(unit)}"
