"""From the integrated path to the result: final values, energy ledger and histories."""

from __future__ import annotations

import numpy as np

from castblast.burden.balance import (
    COLLAR_MASS,
    DISPLACEMENT,
    FRACTURE_MASS,
    FRACTURE_WORK,
    GAS_MASS,
    PLUG_WORK,
    STATE_SIZE,
    VELOCITY,
    VENTED_ENTHALPY,
    Balance,
    relative_volume,
)
from castblast.burden.case import BurdenResult
from castblast.burden.geometry import pressurised_section
from castblast.burden.integrator import Path
from castblast.burden.venting import ATMOSPHERIC_PRESSURE
from castblast.errors import Status
from castblast.explosive.isentrope import FloatArray, energy, pressure
from castblast.kernel import kernel

#: A ledger that is open by more than this share of the gas energy fails the run.
_LEDGER_TOLERANCE = 1e-6
#: Acceleration counts as over at this share of the final velocity.
_ACCELERATED = 0.95


@kernel
def summarise(
    b: Balance,
    status: int,
    steps: int,
    ejection_time: float,
    path: Path,
    gas_energy: float,
    history_points: int,
) -> BurdenResult:
    """Make the result from the path of the integrator.

    Parameters
    ----------
    b : Balance
    status, steps : int
    ejection_time : float [s]
    path : Path
        Used rows only.
    gas_energy : float [J]
        Energy in the products at the start.
    history_points : int
    """
    end, end_time = path.states[-1], path.times[-1]
    velocity, displacement = end[VELOCITY], end[DISPLACEMENT]
    left = end[GAS_MASS] / b.explosive_density
    left *= energy(b.isentrope, relative_volume(b, end_time, end))
    kinetic = 0.5 * b.burden_mass * velocity**2
    section = pressurised_section(displacement, b.hole_width, b.full_width, b.growth_distance)
    air = ATMOSPHERIC_PRESSURE * b.charge_length * section
    floor = b.friction_force * displacement
    # The burden's share enters as energies of its end state, not as the integrated work, so that
    # both the energy of the gas and the equation of motion must hold for the ledger to close.
    spent = kinetic + air + floor + end[FRACTURE_WORK] + end[PLUG_WORK] + end[VENTED_ENTHALPY]
    residual = (gas_energy - left - spent) / gas_energy
    vented = end[FRACTURE_MASS] + end[COLLAR_MASS]
    if status == Status.OK.value and not abs(residual) <= _LEDGER_TOLERANCE:
        status = Status.LEDGER_OPEN.value
    time95, distance95 = _reach_velocity(_ACCELERATED * velocity, path)
    history = _histories(b, path, history_points)
    return BurdenResult(
        status,
        velocity,
        b.gas_mass / b.rock_volume,
        b.venting_time,
        vented / b.gas_mass,
        end[COLLAR_MASS] / b.gas_mass,
        ejection_time,
        time95,
        distance95,
        end_time,
        kinetic,
        end[FRACTURE_WORK],
        end[PLUG_WORK],
        end[VENTED_ENTHALPY],
        air,
        floor,
        gas_energy,
        left,
        residual,
        (b.gas_mass - end[GAS_MASS] - vented) / b.gas_mass,
        steps,
        history[0],
        history[1],
        history[2],
        history[3],
    )


@kernel
def _interpolate(time: float, i: int, path: Path, j: int) -> float:
    """Cubic Hermite value of state `j` at a time between points `i` and `i + 1`."""
    h = path.times[i + 1] - path.times[i]
    s = (time - path.times[i]) / h
    y0, y1 = path.states[i, j], path.states[i + 1, j]
    d0, d1 = path.slopes[i, j] * h, path.slopes[i + 1, j] * h
    return float(
        y0 + s * (d0 + s * (3.0 * (y1 - y0) - 2.0 * d0 - d1 + s * (2.0 * (y0 - y1) + d0 + d1)))
    )


@kernel
def _reach_velocity(velocity: float, path: Path) -> tuple[float, float]:
    """Time [s] and displacement [m] at which the burden first has a velocity; 0 if at rest."""
    if velocity <= 0.0:
        return 0.0, 0.0
    i = 0
    while path.states[i + 1, VELOCITY] < velocity:
        i += 1
    low, high = path.times[i], path.times[i + 1]
    for _ in range(60):
        middle = 0.5 * (low + high)
        if _interpolate(middle, i, path, VELOCITY) < velocity:
            low = middle
        else:
            high = middle
    return high, _interpolate(high, i, path, DISPLACEMENT)


@kernel
def _histories(b: Balance, path: Path, n: int) -> FloatArray:
    """Time, pressure, velocity and displacement, array (4, n); times crowd at the start."""
    history = np.empty((4, n))
    state = np.empty(STATE_SIZE)
    last = path.times.size - 1
    for j in range(n):
        time = path.times[last] * (j / (n - 1)) ** 2
        if j == n - 1 or last == 0:
            state[:] = path.states[last]
        else:
            i = np.searchsorted(path.times, time, side="right") - 1
            for k in range(STATE_SIZE):
                state[k] = _interpolate(time, i, path, k)
        history[0, j] = time
        history[1, j] = pressure(b.isentrope, relative_volume(b, time, state))
        history[2, j] = state[VELOCITY]
        history[3, j] = state[DISPLACEMENT]
    return history
