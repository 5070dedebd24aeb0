"""The rule of a design: what completes it and what makes it impossible, for every reader alike.

A design is a mapping of input names of `castblast.design.variables` to SI values. Spacing, charge
diameter, stemming and charge length follow from other inputs where they are not given; a design
that no bench can hold is refused. Both stand here as data, linear terms of the inputs, so that the
physics, the surrogates and the exported page apply the same numbers and words; no other place may
state them again.

Everything works on columns, one value per design, so that a row of a large table costs next to
nothing; words are made only for the rows that somebody asks about. The functions for one design
are columns of one. Nothing but NumPy is needed: a prediction must start at once.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from castblast.design.variables import INPUTS, STEMMING_RATIO, VARIABLES
from castblast.errors import SpecError, nearest_name
from castblast.types import BoolArray, FloatArray

#: Input names to SI values: a column (n,), or one value for all rows.
InputColumns: TypeAlias = Mapping[str, float | FloatArray]

#: The near field is a slice across a long charge. A charge shorter than this many diameters acts
#: as a concentrated one (Lang 1976, after Livingston), which the model does not describe.
COLUMN_CHARGE_DIAMETERS = 6.0
#: Lengths that must add up, and limits between inputs, hold to this relative tolerance.
ROUND_OFF = 1e-9
#: Inputs for which 0 means "the default of the end mode".
OPTIONAL = frozenset({"outer_radius", "zones"})
#: Relative margin of a bound: 60 deg must pass a bound of 60 deg.
_BOUND_MARGIN = 1e-12
_INPUTS = {v.name: v for v in INPUTS}
#: A field of a message: factor, input, and the input in whose unit it is shown.
MESSAGE_FIELD = re.compile(r"\{(?:([\d.]+)\*)?(\w+)(?::(\w+))?\}")


class Completion(NamedTuple):
    """How an input follows from others: the sum of coefficient times input.

    Attributes
    ----------
    name : str
        The input that is filled in where it is not known yet.
    terms : mapping of str to float
    unless : str
        Left out where this input is known; empty: never.
    """

    name: str
    terms: Mapping[str, float]
    unless: str = ""

    @property
    def words(self) -> str:
        """The sum as people write it, such as ``bench height - stemming length``."""
        text = ""
        for name, factor in self.terms.items():
            size = "" if abs(factor) == 1.0 else f"{abs(factor):g} "
            sign = (" - " if factor < 0.0 else " + ") if text else ""
            text += f"{sign}{size}{name.replace('_', ' ')}"
        return text


class DesignRule(NamedTuple):
    """What a possible design keeps: the sum of coefficient times input is at least 0.

    Attributes
    ----------
    terms : mapping of str to float
    message : str
        Said where the rule is broken. ``{name}`` is the value of an input with its unit,
        ``{6*name:other}`` six times that value, in the unit in which people read `other`.
    given : tuple of str
        The rule says something only where all of these are given.
    """

    terms: Mapping[str, float]
    message: str
    given: tuple[str, ...] = ()


#: Applied in this order, to what is given and the defaults of the table.
COMPLETIONS = (
    Completion("charge_diameter", {"hole_diameter": 1.0}),
    Completion("spacing", {"burden": 1.0}),
    Completion("stemming_length", {"burden": STEMMING_RATIO}, unless="charge_length"),
    Completion("charge_length", {"bench_height": 1.0, "stemming_length": -1.0}),
    Completion("stemming_length", {"bench_height": 1.0, "charge_length": -1.0}),
)
DESIGN_RULES = (
    # Where one length follows from the other, a sum that does not fit shows as a length below 0.
    DesignRule(
        {"bench_height": 1.0, "stemming_length": -1.0, "charge_length": -1.0},
        "stemming_length {stemming_length} and charge_length {charge_length} do not fit a "
        "bench_height of {bench_height}: their sum must not exceed it",
        given=("stemming_length", "charge_length"),
    ),
    DesignRule(
        {"stemming_length": 1.0},
        "charge_length {charge_length} leaves no room for stemming: at most the bench_height of "
        "{bench_height}",
    ),
    DesignRule(
        {"charge_length": 1.0, "hole_diameter": -COLUMN_CHARGE_DIAMETERS},
        "charge_length {charge_length} leaves no room for a column charge: at least "
        f"{COLUMN_CHARGE_DIAMETERS:g} hole diameters, "
        f"{{{COLUMN_CHARGE_DIAMETERS:g}*hole_diameter:charge_length}} (bench_height "
        "{bench_height}, stemming_length {stemming_length})",
    ),
    DesignRule(
        {"hole_diameter": 1.0, "charge_diameter": -1.0},
        "charge_diameter {charge_diameter} must not exceed the hole_diameter of {hole_diameter}",
    ),
    DesignRule(
        {"friction_angle": 1.0, "dilation_angle": -1.0},
        "dilation_angle {dilation_angle} must not exceed the friction_angle of {friction_angle}",
    ),
    DesignRule(
        {"spacing": 1.0, "hole_diameter": -1.0},
        "spacing {spacing} leaves no rock between the holes: more than the hole_diameter of "
        "{hole_diameter} is needed",
    ),
    DesignRule(
        {"burden": 1.0, "hole_diameter": -0.5},
        "burden {burden} leaves no rock before the hole: more than half the hole_diameter of "
        "{hole_diameter} is needed",
    ),
)
#: Pairs of which the first is lowered to the second where it lies above it by rounding only.
_SNAPPED = (("charge_diameter", "hole_diameter"), ("dilation_angle", "friction_angle"))
#: Inputs that are filled in from others.
COMPLETED = tuple(dict.fromkeys(entry.name for entry in COMPLETIONS))


class FaultyRows(NamedTuple):
    """One kind of fault.

    Attributes
    ----------
    rows : (n,) bool
        The rows that have it.
    say : callable
        Turns the number of such a row into a line with value, unit and what is allowed.
    """

    rows: BoolArray
    say: Callable[[int], str]


def name_faults(names: Iterable[str]) -> list[str]:
    """Say which names are no inputs, with the nearest one, in alphabetical order."""
    return [
        f"unknown input '{name}'{nearest_name(str(name), _INPUTS)}"
        for name in sorted(set(map(str, names)) - set(_INPUTS))
    ]


def as_columns(values: InputColumns, count: int) -> dict[str, FloatArray]:
    """Give every value the length of a column, without a copy.

    Raises
    ------
    SpecError
        A value that is no number, or a column of another length.
    """
    columns, faults = {}, []
    for name, value in values.items():
        try:
            column = np.asarray(value, dtype=np.float64)
            columns[name] = column if column.shape == (count,) else np.broadcast_to(column, count)
        except (TypeError, ValueError, OverflowError):
            shown = repr(value[:60]) if isinstance(value, str) else f"a {type(value).__name__}"
            faults.append(f"{name}: {shown}: a number in SI units is needed")
    require_none(faults)
    return columns


def completions_of(names: Iterable[str]) -> list[Completion]:
    """Completions that apply where `names` are given or have a default, in their order."""
    known, used = {*names} | {v.name for v in INPUTS if v.default is not None}, []
    for entry in COMPLETIONS:
        if entry.name not in known and entry.unless not in known:
            known.add(entry.name)
            used.append(entry)
    return used


@np.errstate(over="ignore", invalid="ignore")  # what is infinite is refused by its bounds
def complete_columns(values: InputColumns, count: int) -> dict[str, FloatArray]:
    """Fill in the defaults of the table and what follows from other inputs; checks nothing.

    Parameters
    ----------
    values : mapping
        Input names to SI values.
    count : int
        Number of rows.

    Returns
    -------
    dict of (count,)
        All inputs but those that have neither a default nor a completion (`rise_time`,
        `outer_radius`, `zones`), unless given. Given columns are no copies.
    """
    given = as_columns(values, count)
    defaults = {v.name: v.default for v in INPUTS if v.default is not None}
    full = as_columns(defaults, count) | given
    for entry in completions_of(given):
        total, size = _sum(entry.terms, full)
        nothing = (np.abs(total) <= ROUND_OFF * size) & np.isfinite(size)
        full[entry.name] = np.where(nothing, 0.0, total)
    for name, limit in _SNAPPED:
        above = full[name] > full[limit]
        close = above & (full[name] <= full[limit] * (1.0 + ROUND_OFF))
        if close.any():
            full[name] = np.where(close, full[limit], full[name])
    return full


def fault_columns(values: InputColumns, count: int) -> list[FaultyRows]:
    """Find everything that makes designs unusable: values beyond their bounds, then the rules.

    Parameters
    ----------
    values : mapping
        Input names to SI values.
    count : int
        Number of rows.

    Returns
    -------
    list of FaultyRows
        Values in the order of `variables.INPUTS`, whatever the order of `values`; the rules of a
        design in theirs.

    Raises
    ------
    SpecError
        Unknown names.
    """
    require_none(name_faults(values))
    return value_fault_columns(values, count) + design_fault_columns(values, count)


def value_fault_columns(values: InputColumns, count: int) -> list[FaultyRows]:
    """Find given values outside their bounds, and completed ones above them, in table order."""
    full = complete_columns(values, count)
    faults = []
    for name, variable in _INPUTS.items():
        if name in values:
            column = as_columns({name: values[name]}, count)[name]
        elif name in COMPLETED:
            column = full[name]
        else:
            continue
        margin = _BOUND_MARGIN * max(abs(variable.lower), abs(variable.upper))
        # Written so that NaN lies outside.
        inside = column <= variable.upper + margin
        if name in values:  # a completed length below its bound breaks a rule of the design
            inside = inside & (column >= variable.lower - margin)
        else:
            inside = inside | ~np.isfinite(column)
        if name in OPTIONAL:
            inside = inside | (column == 0.0)
        faults.append(FaultyRows(~inside, partial(_say_value, name, column)))
    return faults


@np.errstate(over="ignore", invalid="ignore")
def design_fault_columns(values: InputColumns, count: int) -> list[FaultyRows]:
    """Find what makes designs impossible.

    Parameters
    ----------
    values : mapping
        Input names to SI values; the rest is filled in. Bounds are not checked here.
    count : int
        Number of rows.

    Returns
    -------
    list of FaultyRows
        One for every rule of `DESIGN_RULES` that can be broken.
    """
    full = complete_columns(values, count)
    faults = []
    for rule in DESIGN_RULES:
        if set(rule.given) <= set(values):
            total, size = _sum(rule.terms, full)
            faults.append(FaultyRows(total < -ROUND_OFF * size, partial(_say_rule, rule, full)))
    return faults


def design_faults(values: Mapping[str, float]) -> list[str]:
    """Say what makes one design impossible, one line per fault; empty if nothing does.

    Parameters
    ----------
    values : mapping
        Input names to SI values; the rest is filled in. Bounds are not checked here.
    """
    return [fault.say(0) for fault in design_fault_columns(values, 1) if fault.rows[0]]


def resolve_design(values: Mapping[str, float]) -> dict[str, float]:
    """Check and complete one design; see `complete_columns`.

    Raises
    ------
    SpecError
        Unknown names; or all faults, one a line.
    """
    require_possible(fault_columns(values, 1))
    return {name: float(column[0]) for name, column in complete_columns(values, 1).items()}


def require_possible(faults: Iterable[FaultyRows]) -> None:
    """Raise all faults of the first row that has any, one a line.

    Raises
    ------
    SpecError
    """
    faults = list(faults)
    if not faults:
        return
    faulty = np.any([fault.rows for fault in faults], axis=0)
    if faulty.any():
        row = int(np.argmax(faulty))
        require_none([fault.say(row) for fault in faults if fault.rows[row]])


def require_none(faults: list[str]) -> None:
    """Raise a `SpecError` of these lines, if there are any."""
    if faults:
        raise SpecError("\n".join(faults))


def lines_by_row(faults: Iterable[FaultyRows]) -> dict[int, list[str]]:
    """Give every faulty row its lines, rows in ascending order."""
    lines: dict[int, list[str]] = {}
    for fault in faults:
        for row in np.flatnonzero(fault.rows).tolist():
            lines.setdefault(row, []).append(fault.say(row))
    return dict(sorted(lines.items()))


def rules_as_data() -> dict[str, Any]:
    """Give the rule of a design as plain JSON values, for copies in other languages.

    Completions and rules mean what `Completion` and `DesignRule` say; a rule is broken where its
    sum lies below minus `round_off` times the largest of its terms.
    """
    return {
        "defaults": {v.name: v.default for v in INPUTS if v.default is not None},
        "completions": [
            {"name": c.name, "terms": dict(c.terms), "unless": c.unless} for c in COMPLETIONS
        ],
        "rules": [
            {"terms": dict(r.terms), "message": r.message, "given": list(r.given)}
            for r in DESIGN_RULES
        ],
        "round_off": ROUND_OFF,
    }


def _sum(
    terms: Mapping[str, float], full: Mapping[str, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Sum of the terms (n,), and the size (n,) of the largest."""
    parts = [factor * full[name] for name, factor in terms.items()]
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total, np.max(np.abs(parts), axis=0)


def _say_value(name: str, column: FloatArray, row: int) -> str:
    variable = VARIABLES[name]
    return (
        f"{name} {variable.show(float(column[row]))} is not plausible: "
        f"{variable.show(variable.lower)} to {variable.show(variable.upper)}"
    )


def _say_rule(rule: DesignRule, full: Mapping[str, FloatArray], row: int) -> str:
    def shown(field: re.Match[str]) -> str:
        factor, name, as_name = field.groups()
        return VARIABLES[as_name or name].show(float(factor or 1.0) * float(full[name][row]))

    return MESSAGE_FIELD.sub(shown, rule.message)
