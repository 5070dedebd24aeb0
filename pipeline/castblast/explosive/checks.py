"""Checks whether the numbers of an explosive belong together: JWL sets.

JWL constants are often pasted from sources that mix sets, units or detonation states. The checks
hold a set against the relations that tie the isentrope to the detonation: tangency to the Rayleigh
line, the Hugoniot, the CJ state that the equation of state itself predicts (Fickett & Davis 1979),
and against sanity of the curve. Tables have checks of their own in `table_checks`.
"""

from __future__ import annotations

import math

import numpy as np

from castblast.explosive.cj import (
    CjState,
    CompleteJwl,
    JwlSet,
    complete_jwl,
    energy_behind,
    own_cj_state,
    volume_at_pressure,
)
from castblast.explosive.finding import (
    Finding,
    judge_deviation,
    judge_flag,
    judge_range,
    rejected,
)
from castblast.explosive.isentrope import ProductIsentrope, energy, pressure, slope

#: Relative volume up to which the isentrope is held to be positive and convex.
LARGEST_VOLUME = 2000.0
#: Fields of an explosive file, as messages name them.
_SHAPE_FIELDS = "jwl.A, B, R1, R2, omega"
_STATE_FIELDS = "density, detonation_velocity"
#: Pressure [Pa] down to which the work of the products is held against the heat of explosion.
AMBIENT_PRESSURE = 1e5


def check_jwl(jwl: JwlSet, heat_of_explosion: float) -> list[Finding]:
    """Hold a JWL set against every relation that ties it together.

    Parameters
    ----------
    jwl : JwlSet
        As stated by its source.
    heat_of_explosion : float [J kg-1]

    Returns
    -------
    list of Finding
        In order of the checks; the set is usable if none is rejected.
    """
    signs = _jwl_signs(jwl)
    if rejected(signs):
        return signs
    complete = complete_jwl(jwl)
    if complete is None:
        limit = "a state below V = 1 on the Rayleigh line of D"
        between = f"{_stated_by(jwl)} against {_STATE_FIELDS}"
        return [*signs, judge_flag("CJ state", 0.0, limit, False, "", between)]
    c = complete.isentrope.c
    between = f"{_SHAPE_FIELDS}, E0 against {_STATE_FIELDS}"
    if jwl.c is not None or jwl.cj_pressure is not None:
        between = "jwl.C" if jwl.c is not None else f"{_SHAPE_FIELDS} against cj_pressure"
    name = "C positive (units of A, B, C)"
    findings = [*signs, judge_flag(name, c * 1e-9, "> 0", c > 0.0, "GPa", between)]
    findings += _cj_findings(complete.isentrope, complete.cj, jwl)
    findings += _jwl_energy(jwl, complete)
    if c > 0.0:
        findings += _shape(complete.isentrope, complete.cj.relative_volume)
        findings += check_work(
            complete.isentrope, complete.total_energy / jwl.density, heat_of_explosion, jwl.density
        )
    return findings


def _stated_by(jwl: JwlSet) -> str:
    """Field that the CJ state of a set comes from, as in `complete_jwl`."""
    if jwl.cj_pressure is not None:
        return "cj_pressure"
    return f"{_SHAPE_FIELDS}, {'C' if jwl.c is not None else 'E0'}"


def _jwl_signs(jwl: JwlSet) -> list[Finding]:
    smallest = min(jwl.a, jwl.b)
    ratio = jwl.r1 / jwl.r2 if jwl.r2 else math.inf
    ordered, bounded = jwl.r1 > jwl.r2 > 0.0, 0.0 < jwl.omega < 1.0
    fields = "jwl.A, jwl.B"
    return [
        judge_flag("A and B positive", smallest * 1e-9, "> 0", smallest > 0.0, "GPa", fields),
        judge_flag("R1 above R2", ratio, "R1 > R2 > 0", ordered, "", "jwl.R1 against jwl.R2"),
        judge_flag("omega", jwl.omega, "between 0 and 1", bounded, "", "jwl.omega"),
    ]


def _cj_findings(isentrope: ProductIsentrope, state: CjState, jwl: JwlSet) -> list[Finding]:
    """Gamma, and how the isentrope meets the Rayleigh line of D.

    A state stated by its pressure is held against slope and pressure of the curve. A state made
    from a stated C is where the two slopes agree; what can fail there is that the curves meet.
    """
    volume = state.relative_volume
    steepness = jwl.density * jwl.detonation_velocity**2
    on_curve = pressure(isentrope, volume)
    gap = on_curve / state.pressure - 1.0
    bend = slope(isentrope, volume) * on_curve / volume / steepness - 1.0
    stated, against = _stated_by(jwl), f"against {_STATE_FIELDS}"
    name, fields = "gamma at the CJ state", f"{stated} {against}"
    findings = [judge_range(name, state.gamma, (1.8, 4.0), (1.5, 5.0), fields)]
    if jwl.cj_pressure is None and jwl.c is not None:
        name = "tangency (P_s where it runs parallel to the Rayleigh line of D, against that line)"
        findings.append(judge_deviation(name, gap, 0.02, 0.05, fields))
    else:
        name = "tangency (slope at the CJ state against rho0 D^2)"
        also = ", cj_pressure" if jwl.cj_pressure is not None else ""
        fields = f"{_SHAPE_FIELDS if also else stated} {against}{also}"
        findings.append(judge_deviation(name, bend, 0.02, 0.05, fields))
        if jwl.c is not None:
            name = "P_s(V_J) with the stated C against P_CJ"
            fields = f"{_SHAPE_FIELDS}, C against cj_pressure"
            findings.append(judge_deviation(name, gap, 0.02, 0.05, fields))
    ratio = pressure(isentrope, 1.0) / state.pressure
    fields = f"{_SHAPE_FIELDS} {against}"
    findings.append(judge_range("P_s(1) over P_CJ", ratio, (0.35, 0.50), (0.0, 1.0), fields))
    return findings


def _jwl_energy(jwl: JwlSet, complete: CompleteJwl) -> list[Finding]:
    """Hugoniot, and the CJ state that the equation of state itself predicts."""
    findings = []
    if jwl.total_energy is not None:
        implied = energy_behind(complete.isentrope, complete.cj) / jwl.total_energy - 1.0
        name = "Hugoniot (E_s(V_J) - P_J (1 - V_J)/2 against E0)"
        against = "cj_pressure" if jwl.cj_pressure is not None else _stated_by(jwl)
        fields = f"jwl.E0 against {against}"
        findings.append(judge_deviation(name, implied, 0.02, 0.10, fields))
    stated = ", E0" if jwl.total_energy is not None else ", C" if jwl.c is not None else ""
    fields = f"{_SHAPE_FIELDS}{stated} against {_STATE_FIELDS}"
    own = own_cj_state(jwl, complete.total_energy)
    if own is None:
        limit = "a slowest Rayleigh line that reaches the Hugoniot"
        name = "CJ state of the equation of state"
        return [*findings, judge_flag(name, 0.0, limit, False, "", fields)]
    state, velocity = own
    faster = velocity / jwl.detonation_velocity - 1.0
    higher = state.pressure / complete.cj.pressure - 1.0
    return [
        *findings,
        judge_deviation("velocity of the own CJ state against D", faster, 0.01, 0.02, fields),
        judge_deviation("pressure of the own CJ state against P_CJ", higher, 0.02, 0.05, fields),
    ]


def _shape(isentrope: ProductIsentrope, first_volume: float) -> list[Finding]:
    """Positive, falling, convex pressure from the CJ state to `LARGEST_VOLUME`."""
    volume = np.geomspace(first_volume, LARGEST_VOLUME, 200)
    curve = np.array([pressure(isentrope, float(v)) for v in volume])
    lowest = float(curve.min())
    chord = np.diff(curve) / np.diff(volume)
    # Change of the chord slope over the slope: negative where the curve bends down.
    bend = float((np.diff(chord) / np.abs(chord[:-1])).min())
    return [
        judge_flag("pressure positive", lowest, "> 0", lowest > 0.0, "Pa", "jwl"),
        judge_flag(
            "convex pressure (smallest change of slope)", bend, "> 0", bend > 0.0, "", "jwl"
        ),
    ]


def check_work(
    isentrope: ProductIsentrope, energy_per_mass: float, heat: float, density: float
) -> list[Finding]:
    """Work down to the atmosphere against the heat of explosion.

    The heat of explosion is stated with water as vapour. The condensing water of ammonium nitrate
    products adds 0.3 (ANFO) to 0.55 (emulsions) of it (derived by this project from the reaction
    balance), so that work beyond 1.55 of it cannot be.
    """
    fields = "energy of the isentrope against heat_of_explosion"
    try:
        volume = volume_at_pressure(isentrope, AMBIENT_PRESSURE)
    except ValueError:
        limit = "the isentrope reaches 0.1 MPa"
        return [judge_flag("work down to 0.1 MPa", math.nan, limit, False, "", fields)]
    share = (energy_per_mass - energy(isentrope, volume) / density) / heat
    name = "work down to 0.1 MPa over heat of explosion"
    return [judge_range(name, share, (0.5, 1.2), (0.2, 1.55), fields)]
