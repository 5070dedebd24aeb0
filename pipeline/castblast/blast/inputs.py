"""Complete the inputs of blasts for the physics: the rule of a design, burden set and rise time.

Inputs are a mapping of the names of `castblast.design.variables` to SI values, in columns, one
value per blast. `castblast.design.rule` completes and refuses them; added here are what a
prediction does not know: the parameter set of the burden model, and the rise time, which depends on
the explosive.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from castblast.design.rule import (
    FaultyRows,
    InputColumns,
    as_columns,
    complete_columns,
    design_fault_columns,
    design_faults,
    fault_columns,
    name_faults,
    require_none,
    require_possible,
)
from castblast.design.variables import BURDEN_PARAMETER_SETS, INPUT_NAMES
from castblast.errors import nearest_name
from castblast.explosive.isentrope import Explosive, in_hole_velocity
from castblast.types import FloatArray, IndexArray

__all__ = [
    "FaultyRows",
    "InputColumns",
    "design_fault_columns",
    "design_faults",
    "resolve_columns",
    "resolve_inputs",
]


def resolve_columns(
    values: InputColumns,
    explosives: Sequence[Explosive],
    explosive: IndexArray,
    parameter_set: str = "authors",
) -> dict[str, FloatArray]:
    """Complete the inputs of n blasts with all defaults and check the designs.

    Parameters
    ----------
    values : mapping
        Input names of `castblast.design.variables` to SI values; what is missing is filled in.
        Resolved columns are returned unchanged.
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
    require_none(name_faults(values) + _set_faults(parameter_set))
    count = len(explosive)
    require_possible(fault_columns(values, count))
    full = complete_columns({**BURDEN_PARAMETER_SETS[parameter_set], **values}, count)
    if "rise_time" not in full:
        full["rise_time"] = _rise_time(full["hole_diameter"], explosives, explosive)
    unset = as_columns({"outer_radius": 0.0, "zones": 0.0}, count)
    return {name: full[name] if name in full else unset[name] for name in INPUT_NAMES}


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


def _rise_time(
    diameter: FloatArray, explosives: Sequence[Explosive], explosive: IndexArray
) -> FloatArray:
    """Time [s] in which the detonation passes one hole diameter [m].

    One row at a time on purpose: the power in the velocity rounds as the C library does, while
    the vector units of some processors round its last bit otherwise.
    """
    rows = zip(diameter.tolist(), explosive.tolist(), strict=True)
    return np.array([d / in_hole_velocity(explosives[i], d) for d, i in rows], dtype=np.float64)


def _set_faults(parameter_set: str) -> list[str]:
    """An unknown set of the burden model."""
    if parameter_set in BURDEN_PARAMETER_SETS:
        return []
    return [
        f"unknown burden parameter set '{parameter_set}': one of "
        f"{', '.join(sorted(BURDEN_PARAMETER_SETS))}"
        f"{nearest_name(parameter_set, BURDEN_PARAMETER_SETS)}"
    ]
