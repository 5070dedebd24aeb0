"""Arithmetic of a charged hole, and the rule that it must not outgrow the rock about it.

How far a hole expands is known after the near field only (or from a surrogate), so that this rule
cannot stand among those of `castblast.design.rule`; it is the same for everybody all the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import pi

import numpy as np

from castblast.design.rule import FaultyRows
from castblast.design.variables import VARIABLES
from castblast.types import FloatArray

#: Exponent with which spacing and twice the burden blend into the width of the break-out plane;
#: that of `castblast.burden.geometry`, which the kernels take.
_BLEND = 12


def charge_mass(density: float, diameter: float, length: float) -> float:
    """Mass [kg] of a charge of `density` [kg m-3], `diameter` and `length` [m]."""
    return density * 0.25 * pi * diameter**2 * length


def charge_length(density: float, diameter: float, mass: float) -> float:
    """Length [m] of a charge of `density` [kg m-3], `diameter` [m] and `mass` [kg]."""
    return mass / (density * 0.25 * pi * diameter**2)


def mean_burden(full: Mapping[str, FloatArray]) -> FloatArray:
    """Burden (n,) averaged over the height of the bench [m]; a dipping face adds rock."""
    added = 0.5 * full["bench_height"] / np.tan(full["face_angle"])
    return np.asarray(full["burden"] + added)


def breakout_width(spacing: FloatArray, burden: FloatArray) -> FloatArray:
    """Full width (n,) of the break-out plane [m] for spacing and mean burden [m].

    The spacing, at most twice the mean burden; see `castblast.burden.geometry.breakout_width`.
    """
    narrow, wide = np.minimum(spacing, 2.0 * burden), np.maximum(spacing, 2.0 * burden)
    return np.asarray(narrow * (1.0 + (narrow / wide) ** _BLEND) ** (-1.0 / _BLEND))


@np.errstate(invalid="ignore", divide="ignore", over="ignore")  # NaN is no fault
def expanded_hole_faults(
    full: Mapping[str, FloatArray], expanded_hole_radius: FloatArray
) -> list[FaultyRows]:
    """Find designs whose hole expands as wide as the rock that was to move, or not at all.

    Parameters
    ----------
    full : mapping of (n,) [SI]
        Completed inputs.
    expanded_hole_radius : (n,) [m]
        NaN: not known, and no fault.

    Returns
    -------
    list of FaultyRows
        Of the burden, the spacing and the charge, in the order of the variable table.
    """
    hole, burden = 2.0 * np.asarray(expanded_hole_radius), mean_burden(full)
    outgrown = hole >= breakout_width(full["spacing"], burden)
    by_spacing = full["spacing"] <= 2.0 * burden
    low_burden = outgrown & (~by_spacing | (2.0 * burden <= hole))
    narrow_spacing = outgrown & (by_spacing | (full["spacing"] <= hole))
    lean = burden - full["burden"]
    least_burden = 0.5 * _least_width(hole, full["spacing"]) - lean
    least_spacing = _least_width(hole, 2.0 * burden)
    return [
        FaultyRows(hole < full["charge_diameter"], partial(_say_closed, full, hole)),
        FaultyRows(low_burden, partial(_say_narrow, "burden", full, hole, least_burden)),
        FaultyRows(narrow_spacing, partial(_say_narrow, "spacing", full, hole, least_spacing)),
    ]


def _least_width(hole: FloatArray, other: FloatArray) -> FloatArray:
    """Width [m] of one limit at which the blend with the other is as wide as the hole.

    Where the other is too narrow itself, that for which both would be equal.
    """
    share = np.minimum(hole / other, 2.0 ** (-1.0 / _BLEND))
    return np.asarray(hole * (1.0 - share**_BLEND) ** (-1.0 / _BLEND))


def _say_narrow(
    name: str, full: Mapping[str, FloatArray], hole: FloatArray, least: FloatArray, row: int
) -> str:
    variable = VARIABLES[name]
    return (
        f"{name} {variable.show(float(full[name][row]))} is too small for a hole of "
        f"{VARIABLES['hole_diameter'].show(float(full['hole_diameter'][row]))} that expands to "
        f"{VARIABLES['hole_diameter'].show(float(hole[row]))}: more than "
        f"{variable.show(float(least[row]))} is needed"
    )


def _say_closed(full: Mapping[str, FloatArray], hole: FloatArray, row: int) -> str:
    shown = {name: VARIABLES[name].show(float(full[name][row]))
             for name in ("charge_diameter", "in_situ_stress")}  # fmt: skip
    return (
        f"charge_diameter {shown['charge_diameter']}: rock under an in_situ_stress of "
        f"{shown['in_situ_stress']} closes the hole to "
        f"{VARIABLES['hole_diameter'].show(float(hole[row]))} about the charge"
    )
