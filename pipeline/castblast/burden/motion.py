"""How the burden of one hole is set in motion by the gas: the entry point of this package."""

from __future__ import annotations

from math import isfinite, nan, tan
from typing import Final

import numpy as np

from castblast.burden import balance as bal
from castblast.burden.case import BurdenGeometry, BurdenParameters, BurdenResult
from castblast.burden.integrator import MAX_STEPS, Path, integrate
from castblast.burden.ledger import summarise
from castblast.errors import Status
from castblast.explosive.isentrope import (
    TABLE_MARGIN,
    Explosive,
    energy,
    inside_table,
    pressure,
)
from castblast.kernel import kernel

HISTORY_POINTS: Final = 64
#: Limit of time in units of mean burden over the velocity that all gas energy would give; a run
#: ends by itself after about one unit.
_TIME_LIMIT: Final = 500.0
#: Below this pressure [Pa] the products are close to an ideal gas of constant exponent, so that a
#: tabulated isentrope may be continued with its last slope however far.
_NEAR_IDEAL_PRESSURE: Final = 5e6
_MAY_BE_ZERO: Final = frozenset(
    {
        "stemming_length",
        "fracture_opening_ratio",
        "fracture_friction_factor",
        "fracture_storage_ratio",
        "gas_viscosity",
        "initial_aperture",
        "stemming_wall_friction",
        "stemming_porosity",
        "collar_discharge_coefficient",
        "floor_friction",
    }
)


def solve_burden_motion(
    explosive: Explosive,
    geometry: BurdenGeometry,
    parameters: BurdenParameters,
    expanded_hole_radius: float,
) -> BurdenResult:
    """Move the burden of one hole by the gas of its charge.

    Parameters
    ----------
    explosive : Explosive
    geometry : BurdenGeometry
    parameters : BurdenParameters
    expanded_hole_radius : float [m]
        Hole radius at the end of the near field; the gas starts on the isentrope at that volume.

    Returns
    -------
    BurdenResult
        Never raises on physics: failures are in `status`. BAD_INPUT for values that describe no
        case, among them an expanded hole wider than the break-out plane.

    Notes
    -----
    The velocity is taken where the gas stops pushing: at 1 percent above the pressure of the open
    air (plus floor friction). There the acceleration vanishes, so that the velocity does not
    depend on where exactly the run ends; a fixed end time or end pressure would show in it.
    """
    if not _describes_a_case(geometry, parameters, expanded_hole_radius):
        return no_burden_motion(Status.BAD_INPUT)
    return _solve(explosive, geometry, parameters, float(expanded_hole_radius), HISTORY_POINTS)


def no_burden_motion(status: Status) -> BurdenResult:
    """Make the result of a case that could not run: NaN, with the status that says why."""
    numbers = dict.fromkeys(BurdenResult._fields, nan)
    history = np.full(HISTORY_POINTS, nan)
    rest = {name: history for name in BurdenResult._fields if name.startswith("history_")}
    return BurdenResult(**(numbers | rest | {"status": int(status), "n_steps": 0}))  # type: ignore[arg-type]


def _describes_a_case(
    geometry: BurdenGeometry, parameters: BurdenParameters, expanded_hole_radius: float
) -> bool:
    """Say whether all values are finite, of the right sign, and the hole fits the burden."""
    for name, value in (geometry._asdict() | parameters._asdict()).items():
        if not isfinite(value) or value < 0.0 or (value == 0.0 and name not in _MAY_BE_ZERO):
            return False
    if not isfinite(expanded_hole_radius) or geometry.face_angle > 0.5 * np.pi + 1e-9:
        return False
    mean = geometry.burden + 0.5 * geometry.bench_height / tan(geometry.face_angle)
    fits = 2.0 * expanded_hole_radius < min(geometry.spacing, 2.0 * mean)
    return fits and expanded_hole_radius >= 0.5 * geometry.charge_diameter


@kernel
def _solve(
    explosive: Explosive,
    geometry: BurdenGeometry,
    parameters: BurdenParameters,
    expanded_hole_radius: float,
    history_points: int,
) -> BurdenResult:
    b = bal.make_balance(explosive, geometry, parameters, expanded_hole_radius)
    state = np.zeros(bal.STATE_SIZE)
    state[bal.GAS_MASS] = b.gas_mass
    volume = bal.relative_volume(b, 0.0, state)
    gas_energy = b.gas_mass / b.explosive_density * energy(b.isentrope, volume)
    fastest = np.sqrt(2.0 * gas_energy / b.burden_mass)
    scale = np.full(bal.STATE_SIZE, gas_energy)
    scale[bal.GAS_MASS] = b.gas_mass
    scale[bal.FRACTURE_MASS] = b.gas_mass
    scale[bal.COLLAR_MASS] = b.gas_mass
    scale[bal.DISPLACEMENT] = b.hole_width
    scale[bal.VELOCITY] = fastest
    scale[bal.PLUG_DISPLACEMENT] = max(b.stemming_length, b.hole_width)
    scale[bal.PLUG_VELOCITY] = np.sqrt(pressure(b.isentrope, volume) / b.stemming_density)

    path = Path(
        np.empty(MAX_STEPS),
        np.empty((MAX_STEPS, bal.STATE_SIZE)),
        np.empty((MAX_STEPS, bal.STATE_SIZE)),
    )
    status, points, steps, ejection_time = integrate(
        b, state, scale, _TIME_LIMIT * b.path / fastest, path
    )
    end_volume = bal.relative_volume(b, path.times[points - 1], state)
    if status == Status.OK.value and _leaves_table(b, volume, end_volume):
        status = Status.OUT_OF_ISENTROPE.value
    used = Path(path.times[:points], path.states[:points], path.slopes[:points])
    return summarise(b, status, steps, ejection_time, used, gas_energy, history_points)


@kernel
def _leaves_table(b: bal.Balance, start_volume: float, end_volume: float) -> bool:
    """Say whether a tabulated isentrope was continued where that means something."""
    if not inside_table(b.isentrope, start_volume):
        return True
    if inside_table(b.isentrope, end_volume):
        return False
    farthest = TABLE_MARGIN * np.exp(b.isentrope.log_volume[-1])
    return pressure(b.isentrope, farthest) > _NEAR_IDEAL_PRESSURE
