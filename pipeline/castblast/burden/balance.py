"""Balance of mass, momentum and energy of one hole: the right-hand side of the burden motion.

The gas that stays in the hole remains on the isentrope through the CJ point, because gas that
leaves takes its own entropy with it; its state is P_s(V_g rho0 / m). The gas volume is

    V_g = V_h [1 + zeta (1 - exp(-t / tau))] + V_b(x) + A_h s

expanded hole, radial cracks that fill in the time tau = B_m / (2 v_crack), space behind the
burden, and stem of the hole behind the moving stemming. The force on the burden is
(P - P_a) dV_b/dx, so that work and volume agree to round-off. After Furtney, Sellers & Onederra
(2012), who balance expansion work against venting through fractures and stemming; the closed form
is derived by this project. Left out: crack growth between the near field and the motion, cooling
of the gas by rock, and neighbouring holes.
"""

from __future__ import annotations

from math import pi
from typing import Final, NamedTuple

import numpy as np

from castblast.burden.case import BurdenGeometry, BurdenParameters
from castblast.burden.geometry import (
    breakout_width,
    burden_mass,
    explosive_mass,
    mean_burden,
    pressurised_plane,
    rock_volume,
)
from castblast.burden.stemming import leakage_flux, stemming_acceleration
from castblast.burden.venting import ATMOSPHERIC_PRESSURE, fracture_flux, gas_outflow
from castblast.explosive.isentrope import Explosive, ProductIsentrope, gas_state
from castblast.kernel import inline_kernel, kernel
from castblast.types import FloatArray

GRAVITY: Final = 9.80665

# Order of the state vector: first what moves the system (`CORE_SIZE` states), then integrals that
# only the ledger needs.
GAS_MASS: Final = 0
DISPLACEMENT: Final = 1
VELOCITY: Final = 2
PLUG_DISPLACEMENT: Final = 3
PLUG_VELOCITY: Final = 4
CORE_SIZE: Final = 5
FRACTURE_MASS: Final = 5
COLLAR_MASS: Final = 6
BURDEN_WORK: Final = 7
FRACTURE_WORK: Final = 8
PLUG_WORK: Final = 9
VENTED_ENTHALPY: Final = 10
STATE_SIZE: Final = 11


class Balance(NamedTuple):
    """Constants of one case, SI units; made by `make_balance`."""

    isentrope: ProductIsentrope
    explosive_density: float
    gas_mass: float
    hole_volume: float
    storage_volume: float
    storage_time: float
    venting_time: float
    rock_volume: float
    burden_mass: float
    friction_force: float
    charge_length: float
    path: float
    hole_width: float
    full_width: float
    growth_distance: float
    hole_area: float
    stemming_length: float
    wall_rate: float
    stemming_density: float
    porosity: float
    grain_size: float
    collar_discharge: float
    opening_ratio: float
    initial_aperture: float
    fracture_count: float
    friction_factor: float
    viscosity: float


@kernel
def make_balance(
    explosive: Explosive,
    geometry: BurdenGeometry,
    parameters: BurdenParameters,
    expanded_hole_radius: float,
) -> Balance:
    """Work out the constants of a case; the hole radius in m is the end state of the near field."""
    mean = mean_burden(geometry)
    mass = burden_mass(geometry)
    hole_volume = pi * expanded_hole_radius**2 * geometry.charge_length
    return Balance(
        isentrope=explosive.isentrope,
        explosive_density=explosive.density,
        gas_mass=explosive_mass(geometry, explosive.density),
        hole_volume=hole_volume,
        storage_volume=parameters.fracture_storage_ratio * hole_volume,
        storage_time=mean / (2.0 * parameters.crack_velocity),
        venting_time=mean / parameters.gas_front_velocity,
        rock_volume=rock_volume(geometry),
        burden_mass=mass,
        friction_force=parameters.floor_friction * mass * GRAVITY,
        charge_length=geometry.charge_length,
        path=mean,
        hole_width=2.0 * expanded_hole_radius,
        full_width=breakout_width(geometry),
        growth_distance=parameters.pressurised_width_ratio * mean,
        hole_area=pi / 4.0 * geometry.hole_diameter**2,
        stemming_length=geometry.stemming_length,
        wall_rate=4.0 * parameters.stemming_wall_friction / geometry.hole_diameter,
        stemming_density=parameters.stemming_density,
        porosity=parameters.stemming_porosity,
        grain_size=parameters.stemming_grain_ratio * geometry.hole_diameter,
        collar_discharge=parameters.collar_discharge_coefficient,
        opening_ratio=parameters.fracture_opening_ratio,
        initial_aperture=parameters.initial_aperture,
        fracture_count=parameters.fracture_count,
        friction_factor=parameters.fracture_friction_factor,
        viscosity=parameters.gas_viscosity,
    )


@inline_kernel
def relative_volume(b: Balance, time: float, state: FloatArray) -> float:
    """Gas volume over the volume that its mass had as explosive [-]."""
    _, section = pressurised_plane(
        state[DISPLACEMENT], b.hole_width, b.full_width, b.growth_distance
    )
    emptiness = np.exp(-time / b.storage_time)
    return _relative_volume(b, emptiness, section, state)


@inline_kernel
def _relative_volume(b: Balance, emptiness: float, section: float, state: FloatArray) -> float:
    """As above, from exp(-t / tau) and the section opened behind the burden [m2]."""
    volume = (
        b.hole_volume
        + b.storage_volume * (1.0 - emptiness)
        + b.charge_length * section
        + b.hole_area * state[PLUG_DISPLACEMENT]
    )
    return float(volume * b.explosive_density / state[GAS_MASS])


@inline_kernel
def loaded_area(b: Balance, displacement: float) -> float:
    """Area on which the gas pushes the burden [m2], at a displacement in m."""
    width, _ = pressurised_plane(displacement, b.hole_width, b.full_width, b.growth_distance)
    return b.charge_length * width


@inline_kernel
def rates(
    b: Balance, venting: bool, plugged: bool, time: float, state: FloatArray, rate: FloatArray
) -> float:
    """Time derivative of the state.

    Parameters
    ----------
    b : Balance
    venting : bool
        The gas front has reached the face.
    plugged : bool
        The stemming is in the hole; afterwards the collar is open and the stem volume constant.
    time : float [s]
    state : array (11,)
        SI units, in the order of the constants above; the first `CORE_SIZE` entries are read.
    rate : array (11,)
        Result.

    Returns
    -------
    float
        Gas pressure [Pa].
    """
    emptiness = np.exp(-time / b.storage_time)
    width, section = pressurised_plane(
        state[DISPLACEMENT], b.hole_width, b.full_width, b.growth_distance
    )
    volume = _relative_volume(b, emptiness, section, state)
    p, k, gas_energy = gas_state(b.isentrope, volume)
    outflow = gas_outflow(p, b.explosive_density / volume, k)
    area = b.charge_length * width

    through_fractures = 0.0
    if venting:
        opening = b.initial_aperture + b.opening_ratio * state[DISPLACEMENT]
        flux = fracture_flux(
            outflow, opening / b.fracture_count, b.path, b.friction_factor, b.viscosity
        )
        through_fractures = opening * b.charge_length * flux
    if plugged:
        moved = state[PLUG_DISPLACEMENT]
        push = stemming_acceleration(p, moved, b.stemming_length, b.wall_rate, b.stemming_density)
        collar_flux = leakage_flux(outflow, b.stemming_length - moved, b.porosity, b.grain_size)
        plug_velocity = state[PLUG_VELOCITY]
    else:
        push = 0.0
        collar_flux = b.collar_discharge * outflow.nozzle_flux
        plug_velocity = 0.0
    through_collar = b.hole_area * collar_flux
    vented = through_fractures + through_collar
    enthalpy = (gas_energy + p * volume) / b.explosive_density

    rate[GAS_MASS] = -vented
    rate[DISPLACEMENT] = state[VELOCITY]
    rate[VELOCITY] = ((p - ATMOSPHERIC_PRESSURE) * area - b.friction_force) / b.burden_mass
    rate[PLUG_DISPLACEMENT] = plug_velocity
    rate[PLUG_VELOCITY] = push
    rate[FRACTURE_MASS] = through_fractures
    rate[COLLAR_MASS] = through_collar
    rate[BURDEN_WORK] = p * area * state[VELOCITY]
    rate[FRACTURE_WORK] = p * b.storage_volume / b.storage_time * emptiness
    rate[PLUG_WORK] = p * b.hole_area * plug_velocity
    rate[VENTED_ENTHALPY] = enthalpy * vented
    return p
