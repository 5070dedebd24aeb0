"""Complete and check the inputs of blasts: defaults, derived lengths, designs no bench can hold.

Inputs are a mapping of the names of `castblast.variables` to SI values. Everything works on
columns, one value per blast, so that a row of a large design costs next to nothing; words are
made only for the rows that somebody asks about. The functions for one blast are columns of one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from castblast.errors import SpecError, nearest_name
from castblast.explosive.isentrope import Explosive, FloatArray, in_hole_velocity
from castblast.variables import BURDEN_PARAMETER_SETS, INPUTS, STEMMING_RATIO, VARIABLES

IntArray: TypeAlias = NDArray[np.integer]
BoolArray: TypeAlias = NDArray[np.bool_]
#: Input names to SI values: a column (n,), or one value for all rows.
InputColumns: TypeAlias = Mapping[str, float | FloatArray]

#: The near field is a slice across a long charge. A charge shorter than this many diameters acts
#: as a concentrated one (Lang 1976, after Livingston), which the model does not describe.
COLUMN_CHARGE_DIAMETERS = 6.0
#: Lengths that must add up are compared with this relative tolerance.
_ROUND_OFF = 1e-9
#: Inputs for which 0 means "the default of the end mode".
_OPTIONAL = frozenset({"outer_radius", "zones"})
_INPUTS = {v.name: v for v in INPUTS}
#: Inputs that the rules of a design are about.
_DESIGN_RULED = (
    "bench_height", "stemming_length", "charge_length", "hole_diameter", "charge_diameter",
    "friction_angle", "dilation_angle",
)  # fmt: skip


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


def resolve_columns(
    values: InputColumns,
    explosives: Sequence[Explosive],
    explosive: IntArray,
    parameter_set: str = "authors",
) -> dict[str, FloatArray]:
    """Complete the inputs of n blasts with all defaults and check the designs.

    Parameters
    ----------
    values : mapping
        Input names of `castblast.variables` to SI values; what is missing is filled in. Resolved
        columns are returned unchanged.
    explosives : sequence of Explosive
        Give the in-hole velocity of detonation for the default rise time.
    explosive : (n,) int
        Index into `explosives`.
    parameter_set : str
        Burden-model defaults, a key of `variables.BURDEN_PARAMETER_SETS`.

    Returns
    -------
    dict of (n,)
        Every name of `variables.INPUTS`, in that order. `outer_radius` and `zones` are 0 where
        the near field is to choose. For reading only: constants and given columns are no copies.

    Raises
    ------
    SpecError
        Unknown names; or all faults of the first row that has any, one a line.
    """
    _require(_name_faults(values, parameter_set))
    count = len(explosive)
    given = _columns(values, count)
    faults = _value_faults(given) + design_fault_columns(given, count)
    faulty = np.any([fault.rows for fault in faults], axis=0)
    if faulty.any():
        row = int(np.argmax(faulty))
        _require([fault.say(row) for fault in faults if fault.rows[row]])
    full = _fill_design(given, count) | _columns(BURDEN_PARAMETER_SETS[parameter_set], count)
    full |= given
    if "rise_time" not in full:
        full["rise_time"] = _rise_time(full["hole_diameter"], explosives, explosive)
    unset = _columns(dict.fromkeys(_OPTIONAL, 0.0), count)
    return {name: full[name] if name in full else unset[name] for name in _INPUTS}


def resolve_inputs(
    values: Mapping[str, float], explosive: Explosive, parameter_set: str = "authors"
) -> dict[str, float]:
    """Complete the inputs of one blast: `resolve_columns` for a single row.

    Raises
    ------
    SpecError
        Unknown names, implausible values and impossible designs, all of them one a line.
    """
    full = resolve_columns(values, (explosive,), np.zeros(1, dtype=np.int64), parameter_set)
    return {name: float(column[0]) for name, column in full.items()}


@np.errstate(over="ignore", invalid="ignore")  # what is infinite is refused by its bounds
def design_fault_columns(values: InputColumns, count: int) -> list[FaultyRows]:
    """Find what makes designs impossible.

    Parameters
    ----------
    values : mapping
        Input names to SI values; defaults are filled in. Bounds are not checked here.
    count : int
        Number of rows.

    Returns
    -------
    list of FaultyRows
        One for every rule.
    """
    full = _fill_design(_columns(values, count), count)
    charge, height = full["charge_length"], full["bench_height"]
    # Where one length follows from the other, a sum that does not fit shows as a length below 0.
    together = {"stemming_length", "charge_length"} <= set(values)
    too_long = full["stemming_length"] + charge > height * (1.0 + _ROUND_OFF)
    table = (
        (
            too_long & together,
            "stemming_length {stemming_length} and charge_length {charge_length} do not fit a "
            "bench_height of {bench_height}: their sum must not exceed it",
        ),
        (
            full["stemming_length"] < 0.0,
            "charge_length {charge_length} leaves no room for stemming: at most the bench_height "
            "of {bench_height}",
        ),
        (
            charge < COLUMN_CHARGE_DIAMETERS * full["hole_diameter"],
            "charge_length {charge_length} leaves no room for a column charge: at least "
            f"{COLUMN_CHARGE_DIAMETERS:g} hole diameters, {{shortest_charge}} (bench_height "
            "{bench_height}, stemming_length {stemming_length})",
        ),
        (
            full["charge_diameter"] > full["hole_diameter"] * (1.0 + _ROUND_OFF),
            "charge_diameter {charge_diameter} must not exceed the hole_diameter of "
            "{hole_diameter}",
        ),
        (
            full["dilation_angle"] > full["friction_angle"] * (1.0 + _ROUND_OFF),
            "dilation_angle {dilation_angle} must not exceed the friction_angle of "
            "{friction_angle}",
        ),
    )
    return [FaultyRows(rows, partial(_say_design, template, full)) for rows, template in table]


def design_faults(values: Mapping[str, float]) -> list[str]:
    """Say what makes one design impossible, one line per fault; empty if nothing does.

    Parameters
    ----------
    values : mapping
        Input names to SI values; defaults are filled in. Bounds are not checked here.
    """
    return [fault.say(0) for fault in design_fault_columns(values, 1) if fault.rows[0]]


def _columns(values: InputColumns, count: int) -> dict[str, FloatArray]:
    """Give every value the length of a column, without a copy."""
    columns = {}
    for name, value in values.items():
        column = np.asarray(value, dtype=np.float64)
        columns[name] = column if column.shape == (count,) else np.broadcast_to(column, (count,))
    return columns


def _fill_design(given: Mapping[str, FloatArray], count: int) -> dict[str, FloatArray]:
    """Defaults of the table and of the design: all but the rise time."""
    defaults = {v.name: v.default for v in INPUTS if v.default is not None}
    full = _columns(defaults, count) | dict(given)
    full.setdefault("charge_diameter", full["hole_diameter"])
    full.setdefault("spacing", full["burden"])
    if "charge_length" not in full:
        full.setdefault("stemming_length", STEMMING_RATIO * full["burden"])
        full["charge_length"] = full["bench_height"] - full["stemming_length"]
    elif "stemming_length" not in full:
        room = full["bench_height"] - full["charge_length"]
        none = np.abs(room) <= _ROUND_OFF * full["bench_height"]
        full["stemming_length"] = np.where(none, 0.0, room)
    return full


def _rise_time(
    diameter: FloatArray, explosives: Sequence[Explosive], explosive: IntArray
) -> FloatArray:
    """Time [s] in which the detonation passes one hole diameter [m].

    One row at a time on purpose: the power in the velocity rounds as the C library does, while
    the vector units of some processors round its last bit otherwise.
    """
    rows = zip(diameter.tolist(), explosive.tolist(), strict=True)
    return np.array([d / in_hole_velocity(explosives[i], d) for d, i in rows], dtype=np.float64)


def _name_faults(names: Iterable[str], parameter_set: str) -> list[str]:
    """Names that the table does not know."""
    faults = [
        f"unknown input '{name}'{nearest_name(name, _INPUTS)}"
        for name in names
        if name not in _INPUTS
    ]
    if parameter_set not in BURDEN_PARAMETER_SETS:
        faults.append(
            f"unknown burden parameter set '{parameter_set}': one of "
            f"{', '.join(sorted(BURDEN_PARAMETER_SETS))}"
            f"{nearest_name(parameter_set, BURDEN_PARAMETER_SETS)}"
        )
    return faults


def _value_faults(given: Mapping[str, FloatArray]) -> list[FaultyRows]:
    """Values outside their plausibility bounds."""
    faults = []
    for name, column in given.items():
        variable = _INPUTS[name]
        inside = (column >= variable.lower) & (column <= variable.upper)  # false for NaN
        if name in _OPTIONAL:
            inside |= column == 0.0
        faults.append(FaultyRows(~inside, partial(_say_value, name, column)))
    return faults


def _say_value(name: str, column: FloatArray, row: int) -> str:
    variable = VARIABLES[name]
    return (
        f"{name} {variable.show(float(column[row]))} is not plausible: "
        f"{variable.show(variable.lower)} to {variable.show(variable.upper)}"
    )


def _say_design(template: str, full: Mapping[str, FloatArray], row: int) -> str:
    shown = {name: VARIABLES[name].show(float(full[name][row])) for name in _DESIGN_RULED}
    shortest = COLUMN_CHARGE_DIAMETERS * float(full["hole_diameter"][row])
    shown["shortest_charge"] = VARIABLES["charge_length"].show(shortest)
    return template.format_map(shown)


def _require(faults: list[str]) -> None:
    if faults:
        raise SpecError("\n".join(faults))
