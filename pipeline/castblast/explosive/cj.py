"""Chapman-Jouguet state of an explosive and energies along its isentrope.

The CJ state is where the isentrope of the products touches the Rayleigh line
P = rho0 D^2 (1 - V) and meets the Hugoniot (Fickett & Davis 1979, Detonation, ch. 2). From it
follow the constants that a JWL set leaves out (Lee, Hornig & Kury 1968, UCRL-50422). Left out:
non-ideal (partially reacted, curved) detonation, which only enters the velocity in the hole.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from castblast.explosive.isentrope import (
    Explosive,
    ProductIsentrope,
    energy,
    jwl_isentrope,
    pressure,
    slope,
)

# Relative volumes between which a CJ state of a condensed explosive lies: gamma 0.7 to 30.
_CJ_BRACKET = (0.42, 0.97)


class CjState(NamedTuple):
    """Chapman-Jouguet state.

    Attributes
    ----------
    relative_volume : float [-]
        V_J, gas volume over initial volume; below 1.
    pressure : float [Pa]
        P_J on the Rayleigh line.
    gamma : float [-]
        rho0 D^2 / P_J - 1.
    """

    relative_volume: float
    pressure: float
    gamma: float


class JwlSet(NamedTuple):
    """JWL constants and detonation state as stated by a source; None where it is silent.

    Attributes
    ----------
    density [kg m-3], detonation_velocity [m s-1] : float
    a, b : float [Pa]
    r1, r2, omega : float [-]
    c : float or None [Pa]
    total_energy : float or None [J m-3]
        E0, the work to infinite expansion.
    cj_pressure : float or None [Pa]
    """

    density: float
    detonation_velocity: float
    a: float
    b: float
    r1: float
    r2: float
    omega: float
    c: float | None = None
    total_energy: float | None = None
    cj_pressure: float | None = None


def cj_from_pressure(density: float, detonation_velocity: float, cj_pressure: float) -> CjState:
    """CJ state on the Rayleigh line at a stated pressure [Pa]."""
    share = cj_pressure / (density * detonation_velocity**2)
    return CjState(1.0 - share, cj_pressure, 1.0 / share - 1.0)


def touching_state(
    isentrope: ProductIsentrope, density: float, detonation_velocity: float
) -> CjState | None:
    """State on the Rayleigh line where the isentrope runs parallel to it; None: nowhere.

    For a consistent set that is the CJ state. The crossing of the two curves is no measure: they
    touch, so that rounded constants leave no crossing or two.
    """
    from scipy.optimize import brentq

    steepness = density * detonation_velocity**2

    def excess(volume: float) -> float:
        return slope(isentrope, volume) * pressure(isentrope, volume) / volume / steepness - 1.0

    low, high = _CJ_BRACKET
    if not excess(low) > 0.0 > excess(high):
        return None
    volume = float(brentq(excess, low, high, xtol=1e-12))
    return cj_from_pressure(density, detonation_velocity, steepness * (1.0 - volume))


def own_cj_state(jwl: JwlSet, total_energy: float) -> tuple[CjState, float] | None:
    """CJ state and velocity [m s-1] that the JWL equation of state itself predicts.

    The slowest Rayleigh line that reaches the Hugoniot of the equation of state with energy E0
    (the CJ condition); None where the Hugoniot has no such point. C does not enter.
    """
    from scipy.optimize import minimize_scalar

    def squared_velocity(volume: float) -> float:
        lost = _jwl_hugoniot_pressure(jwl, total_energy, volume)
        return lost / (jwl.density * (1.0 - volume)) if lost > 0.0 else math.inf

    best = minimize_scalar(
        squared_velocity, bounds=_CJ_BRACKET, method="bounded", options={"xatol": 1e-10}
    )
    volume = float(best.x)
    at_edge = min(volume - _CJ_BRACKET[0], _CJ_BRACKET[1] - volume) < 1e-6
    if at_edge or not 0.0 < best.fun < math.inf:
        return None
    velocity = math.sqrt(best.fun)
    own_pressure = _jwl_hugoniot_pressure(jwl, total_energy, volume)
    return cj_from_pressure(jwl.density, velocity, own_pressure), velocity


def _jwl_hugoniot_pressure(jwl: JwlSet, total_energy: float, volume: float) -> float:
    """Pressure [Pa] on the detonation Hugoniot E = E0 + P (1 - V) / 2 of the JWL law."""
    cold = sum(
        p * (1.0 - jwl.omega / (r * volume)) * math.exp(-r * volume)
        for p, r in ((jwl.a, jwl.r1), (jwl.b, jwl.r2))
    )
    share = jwl.omega / volume
    return float((cold + share * total_energy) / (1.0 - share * (1.0 - volume) / 2.0))


def jwl_constant_volume_pressure(jwl: JwlSet, total_energy: float) -> float:
    """Pressure [Pa] of the products at V = 1 with their full energy E0, off the isentrope."""
    return _jwl_hugoniot_pressure(jwl, total_energy, 1.0)


def c_through(jwl: JwlSet, state: CjState) -> float:
    """Constant C [Pa] that leads the JWL isentrope through a state."""
    volume = state.relative_volume
    rest = jwl.a * math.exp(-jwl.r1 * volume) + jwl.b * math.exp(-jwl.r2 * volume)
    return float((state.pressure - rest) * volume ** (1.0 + jwl.omega))


def energy_behind(isentrope: ProductIsentrope, state: CjState) -> float:
    """Energy of detonation E0 [J m-3] that puts a state of the isentrope on the Hugoniot."""
    compression = 1.0 - state.relative_volume
    return energy(isentrope, state.relative_volume) - 0.5 * state.pressure * compression


class CompleteJwl(NamedTuple):
    """A JWL set with what its source leaves out worked out from the rest.

    Attributes
    ----------
    isentrope : ProductIsentrope
    cj : CjState
    total_energy : float [J m-3]
    """

    isentrope: ProductIsentrope
    cj: CjState
    total_energy: float


def complete_jwl(jwl: JwlSet) -> CompleteJwl | None:
    """Work out CJ state, C and E0 of a JWL set; None where it has no CJ state.

    The CJ state comes from the stated pressure, else from where the isentrope with the stated C
    touches the Rayleigh line, else from the Hugoniot with the stated E0. A stated C or E0 is kept;
    a missing one follows from the CJ state.
    """
    state: CjState | None = None
    if jwl.cj_pressure is not None:
        state = cj_from_pressure(jwl.density, jwl.detonation_velocity, jwl.cj_pressure)
        if not 0.0 < state.relative_volume < 1.0:
            return None
    elif jwl.c is not None:
        stated = jwl_isentrope(jwl.a, jwl.b, jwl.c, jwl.r1, jwl.r2, jwl.omega)
        state = touching_state(stated, jwl.density, jwl.detonation_velocity)
    elif jwl.total_energy is not None:
        own = own_cj_state(jwl, jwl.total_energy)
        state = own[0] if own else None
    if state is None:
        return None
    c = c_through(jwl, state) if jwl.c is None else jwl.c
    isentrope = jwl_isentrope(jwl.a, jwl.b, c, jwl.r1, jwl.r2, jwl.omega)
    total = jwl.total_energy
    return CompleteJwl(
        isentrope, state, energy_behind(isentrope, state) if total is None else total
    )


def volume_at_pressure(isentrope: ProductIsentrope, wanted: float) -> float:
    """Relative volume [-] at which the isentrope has fallen to a pressure [Pa]."""
    from scipy.optimize import brentq

    def excess(log_volume: float) -> float:
        return math.log(pressure(isentrope, math.exp(log_volume)) / wanted)

    return math.exp(float(brentq(excess, math.log(0.3), math.log(1e9), xtol=1e-12)))


def work_to_pressure(explosive: Explosive, wanted: float) -> float:
    """Work [J kg-1] that the products can do until they have fallen to a pressure [Pa].

    W(p) = [E0 - E_s(V(p))] / rho0.
    """
    volume = volume_at_pressure(explosive.isentrope, wanted)
    left = energy(explosive.isentrope, volume)
    return (explosive.total_energy - left) / explosive.density
