"""Burden motion of many holes in one compiled loop; one hole is a batch of one row."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import Final

import numpy as np

from castblast.burden import balance as bal
from castblast.burden.case import BurdenBatch, BurdenColumns, BurdenGeometry, BurdenParameters
from castblast.burden.geometry import breakout_width
from castblast.burden.integrator import Path, integrate, make_path
from castblast.burden.ledger import LEDGER_TOLERANCE, acceleration_end, summarise, write_history
from castblast.burden.runge_kutta import Work, make_work
from castblast.errors import Status
from castblast.explosive.isentrope import TABLE_MARGIN, Explosive, energy, inside_table, pressure
from castblast.kernel import kernel
from castblast.types import BoolArray, FloatArray, IntArray

__all__ = ["BurdenBatch", "BurdenColumns", "solve_burden_motions", "solve_with_histories"]

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


def solve_burden_motions(explosives: Sequence[Explosive], columns: BurdenColumns) -> BurdenBatch:
    """Move the burdens of many holes; a row does not know of the other rows.

    Parameters
    ----------
    explosives : sequence of Explosive
    columns : BurdenColumns
        n rows.

    Returns
    -------
    BurdenBatch
        n rows, as `motion.solve_burden_motion` row by row, to the bit. Never raises on physics.
    """
    return solve_with_histories(explosives, columns, np.empty((0, 4, 0)))


def solve_with_histories(
    explosives: Sequence[Explosive], columns: BurdenColumns, histories: FloatArray
) -> BurdenBatch:
    """As `solve_burden_motions`; fill `histories`, array (n, 4, points), with the motion.

    Time, pressure, velocity and displacement at times t_end (i / (points - 1))^2; s, Pa, m s-1, m.
    Rows that fail are left as they are; with no row at all no history is made.
    """
    n = columns.explosive.size
    batch = _empty_batch(n)
    rows = np.flatnonzero(_plausible(columns) & (columns.explosive < len(explosives)))
    for index in np.unique(columns.explosive[rows]):
        chosen = rows[columns.explosive[rows] == index]
        _solve_rows(explosives[index], columns, chosen, batch, histories)
    failed = batch.status != Status.OK
    for name, values in batch._asdict().items():
        if name not in ("status", "n_steps"):
            values[failed] = np.nan
    return batch


def _empty_batch(n: int) -> BurdenBatch:
    arrays: dict[str, IntArray | FloatArray] = {
        name: np.full(n, np.nan) for name in BurdenBatch._fields
    }
    arrays["status"] = np.full(n, Status.BAD_INPUT.value, dtype=np.int64)
    arrays["n_steps"] = np.zeros(n, dtype=np.int64)
    return BurdenBatch(**arrays)  # type: ignore[arg-type]


def _plausible(columns: BurdenColumns) -> BoolArray:
    """Rows, as bool array (n,), whose values are finite and of the right sign."""
    named = columns._asdict()
    may_be_zero = np.array([name in _MAY_BE_ZERO or name == "explosive" for name in named])
    values = np.array(list(named.values()), dtype=np.float64)
    right_sign = (values > 0.0) | ((values == 0.0) & may_be_zero[:, None])
    plausible: BoolArray = np.all(np.isfinite(values) & right_sign, axis=0)
    return plausible


@kernel
def _solve_rows(
    explosive: Explosive,
    columns: BurdenColumns,
    rows: IntArray,
    batch: BurdenBatch,
    histories: FloatArray,
) -> None:
    work, path = make_work(), make_path()
    for row in rows:
        geometry, parameters = _geometry(columns, row), _parameters(columns, row)
        radius = columns.expanded_hole_radius[row]
        if not _fits(geometry, radius):
            continue
        b = bal.make_balance(explosive, geometry, parameters, radius)
        batch.status[row] = _solve(b, work, path, batch, row)
        if histories.shape[0] > 0:
            write_history(b, path, batch.n_steps[row], work, histories[row])


@kernel
def _geometry(c: BurdenColumns, i: int) -> BurdenGeometry:
    return BurdenGeometry(
        burden=c.burden[i],
        spacing=c.spacing[i],
        bench_height=c.bench_height[i],
        face_angle=c.face_angle[i],
        stemming_length=c.stemming_length[i],
        charge_length=c.charge_length[i],
        rock_density=c.rock_density[i],
        hole_diameter=c.hole_diameter[i],
        charge_diameter=c.charge_diameter[i],
    )


@kernel
def _parameters(c: BurdenColumns, i: int) -> BurdenParameters:
    return BurdenParameters(
        pressurised_width_ratio=c.pressurised_width_ratio[i],
        fracture_opening_ratio=c.fracture_opening_ratio[i],
        fracture_count=c.fracture_count[i],
        fracture_friction_factor=c.fracture_friction_factor[i],
        gas_front_velocity=c.gas_front_velocity[i],
        crack_velocity=c.crack_velocity[i],
        fracture_storage_ratio=c.fracture_storage_ratio[i],
        gas_viscosity=c.gas_viscosity[i],
        initial_aperture=c.initial_aperture[i],
        stemming_wall_friction=c.stemming_wall_friction[i],
        stemming_density=c.stemming_density[i],
        stemming_porosity=c.stemming_porosity[i],
        stemming_grain_ratio=c.stemming_grain_ratio[i],
        collar_discharge_coefficient=c.collar_discharge_coefficient[i],
        floor_friction=c.floor_friction[i],
    )


@kernel
def _fits(geometry: BurdenGeometry, expanded_hole_radius: float) -> bool:
    """Say whether the face leans the right way and the hole is between charge and break-out."""
    return (
        geometry.face_angle <= 0.5 * pi + 1e-9
        and 2.0 * expanded_hole_radius < breakout_width(geometry)
        and 2.0 * expanded_hole_radius >= geometry.charge_diameter
    )


@kernel
def _solve(b: bal.Balance, work: Work, path: Path, batch: BurdenBatch, row: int) -> int:
    """Solve one case into a row of the batch and return its status."""
    work.state[:] = 0.0
    work.state[bal.GAS_MASS] = b.gas_mass
    volume = bal.relative_volume(b, 0.0, work.state)
    gas_energy = b.gas_mass / b.explosive_density * energy(b.isentrope, volume)
    fastest = np.sqrt(2.0 * gas_energy / b.burden_mass)
    scale = work.scale
    scale[:] = gas_energy
    scale[bal.GAS_MASS] = b.gas_mass
    scale[bal.FRACTURE_MASS] = b.gas_mass
    scale[bal.COLLAR_MASS] = b.gas_mass
    scale[bal.DISPLACEMENT] = b.hole_width
    scale[bal.VELOCITY] = fastest
    scale[bal.PLUG_DISPLACEMENT] = max(b.stemming_length, b.hole_width)
    scale[bal.PLUG_VELOCITY] = np.sqrt(pressure(b.isentrope, volume) / b.stemming_density)

    status, steps, ejection_time = integrate(b, _TIME_LIMIT * b.path / fastest, work, path)
    batch.n_steps[row] = steps
    batch.ejection_time[row] = ejection_time
    if status != Status.OK.value:
        return status
    end_volume = bal.relative_volume(b, path.times[steps], work.state)
    if _leaves_table(b, volume, end_volume):
        return Status.OUT_OF_ISENTROPE.value
    summarise(b, path.times[steps], work.state, gas_energy, batch, row)
    if not abs(batch.burden_energy_residual[row]) <= LEDGER_TOLERANCE:
        return Status.LEDGER_OPEN.value
    time, distance = acceleration_end(b, path, steps, work)
    batch.acceleration_time[row] = time
    batch.acceleration_distance[row] = distance
    return status


@kernel
def _leaves_table(b: bal.Balance, start_volume: float, end_volume: float) -> bool:
    """Say whether a tabulated isentrope was continued where that means something."""
    if not inside_table(b.isentrope, start_volume):
        return True
    if inside_table(b.isentrope, end_volume):
        return False
    farthest = TABLE_MARGIN * np.exp(b.isentrope.log_volume[-1])
    return pressure(b.isentrope, farthest) > _NEAR_IDEAL_PRESSURE
