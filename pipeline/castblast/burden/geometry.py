"""Volumes and masses of one hole and the rock in front of it, and where the gas pushes on it.

The gas first loads only the projected width of the hole, as in a hole in intact rock; while the
burden detaches, the gas fills the break-out plane between the holes. The loaded width b is a
function of the displacement x alone,

    b(x) = w0 + (w1 - w0) (1 - exp(-x / x_p)),

so that the volume behind the burden V_b(x), its derivative the loaded area A_p = dV_b/dx, and the
work of the gas are consistent (derived by this project). Left out: rotation and deformation of the
burden, and any motion that is not normal to the break-out plane.
"""

from __future__ import annotations

from math import pi

import numpy as np

from castblast.burden.case import BurdenGeometry
from castblast.kernel import kernel


@kernel
def mean_burden(geometry: BurdenGeometry) -> float:
    """Burden averaged over the bench height [m]; an inclined face adds rock at the toe."""
    return float(geometry.burden + 0.5 * geometry.bench_height / np.tan(geometry.face_angle))


@kernel
def rock_volume(geometry: BurdenGeometry) -> float:
    """Rock broken by one hole [m3]."""
    return geometry.spacing * mean_burden(geometry) * geometry.bench_height


@kernel
def burden_mass(geometry: BurdenGeometry) -> float:
    """Mass of rock that one hole moves [kg]."""
    return geometry.rock_density * rock_volume(geometry)


@kernel
def explosive_mass(geometry: BurdenGeometry, explosive_density: float) -> float:
    """Explosive in one hole [kg]; its density in kg m-3."""
    return explosive_density * pi / 4.0 * geometry.charge_diameter**2 * geometry.charge_length


@kernel
def powder_factor(geometry: BurdenGeometry, explosive_density: float) -> float:
    """Explosive mass per volume of broken rock [kg m-3]."""
    return explosive_mass(geometry, explosive_density) / rock_volume(geometry)


@kernel
def breakout_width(geometry: BurdenGeometry) -> float:
    """Full width of the break-out plane [m]: the spacing, at most twice the mean burden."""
    return min(geometry.spacing, 2.0 * mean_burden(geometry))


@kernel
def pressurised_width(
    displacement: float, hole_width: float, full_width: float, growth_distance: float
) -> float:
    """Loaded width b [m] at a displacement [m], from `hole_width` to `full_width` [m]."""
    return float(hole_width - (full_width - hole_width) * np.expm1(-displacement / growth_distance))


@kernel
def pressurised_section(
    displacement: float, hole_width: float, full_width: float, growth_distance: float
) -> float:
    """Cross-section opened behind the burden [m2]: the integral of `pressurised_width`."""
    lag = displacement + growth_distance * np.expm1(-displacement / growth_distance)
    return float(hole_width * displacement + (full_width - hole_width) * lag)
