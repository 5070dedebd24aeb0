"""What would mend an inconsistent JWL set: single changes after which all of it fits.

Sets are spoilt in few ways: a detonation velocity or a density measured elsewhere beside constants
of the ideal detonation, a factor of ten, an energy per mass for one per volume, a sign, two numbers
that changed places. Each is tried; what makes the whole set pass its checks is offered. It is a
hint where to look in the source, and no reason to write a number that the source does not have.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from castblast.explosive.checks import check_jwl
from castblast.explosive.cj import JwlSet, own_cj_state
from castblast.explosive.finding import rejected, warned

#: Slips of units between Pa, bar, kbar and Mbar, and of a decimal point.
_FACTORS = (0.1, 10.0, 0.01, 100.0, 1e-3, 1e3)
_MOST = 3
#: Two energies closer than this are one number, written with four digits.
_SAME = 2e-3
#: How far from the stated value another may lie and still be that of the same product: velocities
#: and densities vary by diameter and by pouring, energies by what is counted.
_KIN_VELOCITY, _KIN_DENSITY, _KIN_ENERGY = 1.1, 1.25, 2.0


class _Remedy(NamedTuple):
    """A changed set, and what was changed, in words."""

    jwl: JwlSet
    words: str


def remedies(jwl: JwlSet, heat_of_explosion: float) -> list[str]:
    """Say what would make a rejected set pass, the likeliest first, or what is known of it.

    Parameters
    ----------
    jwl : JwlSet
        A set that `check_jwl` rejects.
    heat_of_explosion : float [J kg-1]
    """
    fitting: list[str] = []
    for make in (_left_out, _changed_places, _other_states, _scaled):
        found = []
        for remedy in make(jwl):
            findings = check_jwl(remedy.jwl, heat_of_explosion)
            if not rejected(findings):
                found.append((len(warned(findings)), remedy.words))
        fitting = [f"would fit: {words}" for _, words in sorted(found, key=lambda e: e[0])]
        if fitting:
            break
    about_energy = any("E0" in f.fields for f in rejected(check_jwl(jwl, heat_of_explosion)))
    known = _energy_per_mass(jwl, heat_of_explosion) if about_energy else []
    return known + (fitting[:_MOST] or _of_another(jwl))


def _of_another(jwl: JwlSet) -> list[str]:
    """Say how the constants detonate where no single change helps."""
    own = None if jwl.total_energy is None else own_cj_state(jwl, jwl.total_energy)
    if own is None:
        return []
    return [
        f"jwl: at a density of {jwl.density:g} kg/m3 these constants detonate at {own[1]:.4g} m/s, "
        f"not at {jwl.detonation_velocity:g} m/s; are they those of another explosive?"
    ]


def _energy_per_mass(jwl: JwlSet, heat_of_explosion: float) -> list[str]:
    """E0 that is the heat of explosion: per volume, or per mass and read as a pressure."""
    if jwl.total_energy is None:
        return []
    stated = _gpa(jwl.total_energy)
    for heat, words in (
        (heat_of_explosion * jwl.density, "heat_of_explosion x density"),
        (heat_of_explosion, "heat_of_explosion, per mass instead of per volume"),
    ):
        if abs(jwl.total_energy / heat - 1.0) < _SAME:
            fit = "E0 belongs to the fit of A, B, R1, R2 and omega"
            return [f"jwl.E0: {stated} is {words}; {fit}: take that of the source"]
    return []


def _left_out(jwl: JwlSet) -> list[_Remedy]:
    """Without the CJ pressure, which is measured or rounded while C and E0 belong to the fit."""
    if jwl.cj_pressure is None or (jwl.c is None and jwl.total_energy is None):
        return []
    words = "the file without cj_pressure, which then follows from the rest"
    return [_Remedy(jwl._replace(cj_pressure=None), words)]


def _changed_places(jwl: JwlSet) -> list[_Remedy]:
    swapped = jwl._replace(r1=jwl.r2, r2=jwl.r1)
    found = [_Remedy(swapped, f"jwl.R1 {jwl.r2:g} and jwl.R2 {jwl.r1:g}, changed places")]
    if jwl.omega > 1.0:
        less = jwl.omega - 1.0
        words = f"jwl.omega {less:.4g} instead of 1 + omega = {jwl.omega:g}"
        found.append(_Remedy(jwl._replace(omega=less), words))
    return found


def _other_states(jwl: JwlSet) -> list[_Remedy]:
    """Velocity, density or energy with which the equation of state detonates as stated.

    Its own Rayleigh line fixes rho0 D^2 only.
    """
    found = []
    if jwl.total_energy is not None:
        own = own_cj_state(jwl, jwl.total_energy)
        if own is not None:
            _, velocity = own
            density = jwl.density * (velocity / jwl.detonation_velocity) ** 2
            if _kin(velocity, jwl.detonation_velocity, _KIN_VELOCITY):
                words = f"detonation_velocity {velocity:.4g} m/s with density {jwl.density:g} kg/m3"
                found.append(_Remedy(jwl._replace(detonation_velocity=velocity), words))
            if _kin(density, jwl.density, _KIN_DENSITY):
                words = f"density {density:.4g} kg/m3 with detonation_velocity "
                words += f"{jwl.detonation_velocity:g} m/s"
                found.append(_Remedy(jwl._replace(density=density), words))
        energy = _fitting_energy(jwl)
        if energy is not None:
            found.append(_Remedy(jwl._replace(total_energy=energy), f"jwl.E0 {_gpa(energy)}"))
    return found


def _fitting_energy(jwl: JwlSet) -> float | None:
    """E0 [J m-3] with which the set detonates at its stated velocity; None: none near it."""
    from scipy.optimize import brentq

    stated = jwl.total_energy or math.nan

    def excess(energy: float) -> float:
        own = own_cj_state(jwl, energy)
        return math.nan if own is None else own[1] / jwl.detonation_velocity - 1.0

    low, high = stated / _KIN_ENERGY, stated * _KIN_ENERGY
    # NaN where the Hugoniot has no CJ point: then nothing is known.
    if not excess(low) < 0.0 < excess(high):
        return None
    return float(brentq(excess, low, high, rtol=1e-4))


def _scaled(jwl: JwlSet) -> list[_Remedy]:
    names = {
        "a": "jwl.A",
        "b": "jwl.B",
        "c": "jwl.C",
        "total_energy": "jwl.E0",
        "cj_pressure": "cj_pressure",
    }
    return [
        _Remedy(jwl._replace(**{key: factor * value}), f"{name} {_gpa(factor * value)}")
        for key, name in names.items()
        if (value := getattr(jwl, key)) is not None
        for factor in (-1.0, *_FACTORS)
        if factor > 0.0 or key in ("a", "b")
    ]


def _kin(value: float, stated: float, factor: float) -> bool:
    return stated / factor <= value <= stated * factor


def _gpa(value: float) -> str:
    return f"{value * 1e-9:.4g} GPa"
