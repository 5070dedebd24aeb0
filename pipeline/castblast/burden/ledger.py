"""From the integrated path to the result: final values, energy ledger and histories."""

from __future__ import annotations

from typing import Final

import numpy as np

from castblast.burden.balance import (
    COLLAR_MASS,
    CORE_SIZE,
    DISPLACEMENT,
    FRACTURE_MASS,
    FRACTURE_WORK,
    GAS_MASS,
    PLUG_WORK,
    VELOCITY,
    VENTED_ENTHALPY,
    Balance,
    rates,
    relative_volume,
)
from castblast.burden.case import BurdenBatch
from castblast.burden.geometry import pressurised_plane
from castblast.burden.integrator import PLUGGED, VENTING, Path
from castblast.burden.runge_kutta import REACHED_VELOCITY, Phase, Work, step_to_event, take_step
from castblast.burden.venting import ATMOSPHERIC_PRESSURE
from castblast.explosive.isentrope import energy, pressure
from castblast.kernel import kernel
from castblast.types import FloatArray

#: A ledger that is open by more than this share of the gas energy fails the run.
LEDGER_TOLERANCE: Final = 1e-6
#: Acceleration counts as over at this share of the final velocity.
_ACCELERATED: Final = 0.95
# Rows of a history.
_HISTORY_TIME, _HISTORY_PRESSURE, _HISTORY_VELOCITY, _HISTORY_DISPLACEMENT = 0, 1, 2, 3


@kernel
def summarise(
    b: Balance, end_time: float, end: FloatArray, gas_energy: float, batch: BurdenBatch, row: int
) -> None:
    """Write final values and ledger into a row of the batch.

    Parameters
    ----------
    b : Balance
    end_time : float [s]
    end : array (11,)
        State at the end.
    gas_energy : float [J]
        Energy in the products at the start.
    batch : BurdenBatch
    row : int
    """
    velocity, displacement = end[VELOCITY], end[DISPLACEMENT]
    left = end[GAS_MASS] / b.explosive_density
    left *= energy(b.isentrope, relative_volume(b, end_time, end))
    kinetic = 0.5 * b.burden_mass * velocity**2
    _, section = pressurised_plane(displacement, b.hole_width, b.full_width, b.growth_distance)
    air = ATMOSPHERIC_PRESSURE * b.charge_length * section
    floor = b.friction_force * displacement
    # The burden's share enters as energies of its end state, not as the integrated work, so that
    # both the energy of the gas and the equation of motion must hold for the ledger to close.
    spent = kinetic + air + floor + end[FRACTURE_WORK] + end[PLUG_WORK] + end[VENTED_ENTHALPY]
    vented = end[FRACTURE_MASS] + end[COLLAR_MASS]
    batch.burden_velocity[row] = velocity
    batch.powder_factor[row] = b.gas_mass / b.rock_volume
    batch.venting_time[row] = b.venting_time
    batch.vented_fraction[row] = vented / b.gas_mass
    batch.collar_fraction[row] = end[COLLAR_MASS] / b.gas_mass
    batch.motion_time[row] = end_time
    batch.burden_kinetic_energy[row] = kinetic
    batch.fracture_work[row] = end[FRACTURE_WORK]
    batch.stemming_work[row] = end[PLUG_WORK]
    batch.vented_enthalpy[row] = end[VENTED_ENTHALPY]
    batch.atmospheric_work[row] = air
    batch.floor_work[row] = floor
    batch.initial_gas_energy[row] = gas_energy
    batch.final_gas_energy[row] = left
    batch.burden_energy_residual[row] = (gas_energy - left - spent) / gas_energy
    batch.mass_residual[row] = (b.gas_mass - end[GAS_MASS] - vented) / b.gas_mass


@kernel
def _restart(b: Balance, i: int, path: Path, work: Work) -> Phase:
    """Go back to point `i` of the path."""
    phase = Phase(path.phases[i, VENTING], path.phases[i, PLUGGED])
    work.state[:CORE_SIZE] = path.states[i]
    rates(b, phase.venting, phase.plugged, path.times[i], work.state, work.stages[0])
    return phase


@kernel
def acceleration_end(b: Balance, path: Path, steps: int, work: Work) -> tuple[float, float]:
    """Time [s] and displacement [m] at 95 percent of the final velocity; 0 if at rest.

    Overwrites the state in `work`.
    """
    target = _ACCELERATED * path.states[steps, VELOCITY]
    if target <= 0.0:
        return 0.0, 0.0
    i = 0
    while path.states[i + 1, VELOCITY] < target:
        i += 1
    step = path.times[i + 1] - path.times[i]
    phase = _restart(b, i, path, work)
    take_step(b, phase, path.times[i], step, work)
    length, _ = step_to_event(b, phase, REACHED_VELOCITY, target, path.times[i], step, work)
    return path.times[i] + length, work.new_state[DISPLACEMENT]


@kernel
def write_history(b: Balance, path: Path, steps: int, work: Work, history: FloatArray) -> None:
    """Fill time, pressure, velocity and displacement, array (4, n); times crowd at the start.

    Overwrites the state in `work`.
    """
    n = history.shape[1]
    times = path.times[: steps + 1]
    for j in range(n):
        share = (j / (n - 1)) ** 2
        time = times[steps] * share
        i = steps if j == n - 1 else np.searchsorted(times, time, side="right") - 1
        phase = _restart(b, i, path, work)
        take_step(b, phase, times[i], time - times[i], work)
        volume = relative_volume(b, time, work.new_state)
        history[_HISTORY_TIME, j] = time
        history[_HISTORY_PRESSURE, j] = pressure(b.isentrope, volume)
        history[_HISTORY_VELOCITY, j] = work.new_state[VELOCITY]
        history[_HISTORY_DISPLACEMENT, j] = work.new_state[DISPLACEMENT]
