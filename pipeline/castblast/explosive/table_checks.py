"""Checks of a tabulated isentrope: order, shape, coverage, and how it meets the detonation."""

from __future__ import annotations

import numpy as np

from castblast.explosive.checks import check_work
from castblast.explosive.cj import energy_behind, touching_state
from castblast.explosive.finding import (
    Finding,
    judge_deviation,
    judge_flag,
    judge_range,
    rejected,
)
from castblast.explosive.isentrope import ProductIsentrope, pressure, tabulated_isentrope
from castblast.types import BoolArray, FloatArray

#: Pressure [Pa] down to which a table has to reach.
TABLE_END_PRESSURE = 5e6
SMALLEST_TABLE = 12


def check_table(
    relative_volume: FloatArray,
    pressures: FloatArray,
    energies: FloatArray | None,
    *,
    density: float,
    detonation_velocity: float,
    heat_of_explosion: float,
    cj_pressure: float | None = None,
) -> list[Finding]:
    """Hold a tabulated isentrope against what an isentrope of products has to be.

    Parameters
    ----------
    relative_volume : array (n,) [-]
    pressures : array (n,) [Pa]
    energies : array (n,) [J m-3] or None
    density [kg m-3], detonation_velocity [m s-1], heat_of_explosion [J kg-1] : float
    cj_pressure : float or None [Pa]

    Returns
    -------
    list of Finding
        The table is usable if none is rejected.
    """
    findings = _table_rows(relative_volume, pressures)
    if rejected(findings):
        return findings
    findings += _table_shape(relative_volume, pressures)
    table = tabulated_isentrope(relative_volume, pressures, energies)
    if energies is not None:
        findings.append(_energy_column(table, energies))
    state = touching_state(table, density, detonation_velocity)
    if state is None:
        limit = "a point that touches the Rayleigh line of D (units of the pressure column?)"
        return [*findings, judge_flag("CJ state", float(pressures[0]), limit, False, "Pa")]
    total_energy = energy_behind(table, state)
    reference = state.pressure if cj_pressure is None else cj_pressure
    if cj_pressure is not None:
        findings.append(
            judge_deviation(
                "touching point of the Rayleigh line against P_CJ",
                state.pressure / cj_pressure - 1.0,
                0.05,
                0.20,
            )
        )
    ratio = pressure(table, 1.0) / reference
    hard = (0.35, 0.50) if cj_pressure is not None else (0.25, 0.65)
    findings.append(judge_range("P_s(1) over P_CJ", ratio, (0.35, 0.50), hard))
    findings += check_work(table, total_energy / density, heat_of_explosion, density)
    return findings


def _table_rows(volume: FloatArray, pressures: FloatArray) -> list[Finding]:
    """Length, signs and order; the value is the row at fault, counted from 1."""
    enough = volume.size >= SMALLEST_TABLE
    findings = [judge_flag("rows of the table", volume.size, f"at least {SMALLEST_TABLE}", enough)]
    positive = (volume > 0.0) & (pressures > 0.0)
    for relation, good in (
        ("V and P positive, first fault in row", positive),
        ("V rising from row to row, first fault in row", _after_first(np.diff(volume) > 0.0)),
        ("P falling from row to row, first fault in row", _after_first(np.diff(pressures) < 0.0)),
    ):
        row = int(np.argmin(good)) + 1 if not good.all() else 0
        findings.append(judge_flag(relation, row, "no fault (0)", bool(good.all())))
    return findings


def _after_first(good: BoolArray) -> BoolArray:
    return np.concatenate(([True], good))


def _table_shape(volume: FloatArray, pressures: FloatArray) -> list[Finding]:
    """Exponent, convexity and coverage."""
    exponent = -np.diff(np.log(pressures)) / np.diff(np.log(volume))
    low, high = float(exponent.min()), float(exponent.max())
    chord = np.diff(pressures) / np.diff(volume)
    bend = float((np.diff(chord) / np.abs(chord[:-1])).min())
    first, last = float(volume[0]), float(pressures[-1])
    return [
        judge_flag("smallest exponent -dlnP/dlnV", low, "> 1 (finite energy)", low > 1.0),
        judge_flag("largest exponent -dlnP/dlnV", high, "< 6", high < 6.0),
        judge_flag("convex pressure (smallest change of slope)", bend, "> 0", bend > 0.0),
        judge_flag("first relative volume", first, "at most 1", first <= 1.0),
        judge_flag(
            "last pressure",
            last * 1e-6,
            f"at most {TABLE_END_PRESSURE * 1e-6:g} MPa",
            last <= TABLE_END_PRESSURE,
            "MPa",
        ),
    ]


def _energy_column(table: ProductIsentrope, energies: FloatArray) -> Finding:
    """Worst deviation of the energy column from the integral of P dV, over the whole integral."""
    off = (energies - table.energy) / (table.energy[0] - table.energy[-1])
    worst = float(off[np.argmax(np.abs(off))])
    return judge_deviation("energy column against the integral of P dV", worst, 0.01, 0.02)
