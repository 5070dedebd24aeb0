r"""Exact solutions for a cylindrical hole, against which the solver is verified.

Thick elastic cylinder (Lame); unloaded hole in Mohr-Coulomb rock (Salencon 1969); large-strain
expansion of a cylindrical cavity in dilatant Mohr-Coulomb rock (Yu & Houlsby 1991, Geotechnique
41:173, derived again by this project from the flow rule). Pressures and stresses are positive in
compression here; plane strain, quasi-static.
"""

from __future__ import annotations

from math import exp, log, nan
from typing import NamedTuple

import numpy as np

from castblast.nearfield.rock.lagrangian import FloatArray
from castblast.nearfield.rock.mohr_coulomb import friction_number


def lame_displacement(
    pressure: float, radius: float, inner: float, outer: float, young: float, poisson: float
) -> float:
    """Radial displacement [m] at `radius` [m] of an elastic cylinder under internal pressure [Pa].

    The outer face is free; `outer` may be infinite.
    """
    share = (inner / outer) ** 2
    return (
        pressure * inner**2 * (1.0 + poisson) / (young * (1.0 - share))
        * ((1.0 - 2.0 * poisson) * radius / outer**2 + 1.0 / radius)
    )  # fmt: skip


class UnloadedHole(NamedTuple):
    """Salencon's hole: plastic radius and the stresses inside and outside it.

    Attributes
    ----------
    radius : float [m]
        Radius of the plastic zone.
    boundary_stress : float [Pa]
        Radial stress at that radius.
    """

    radius: float
    boundary_stress: float
    hole_radius: float
    pressure: float
    far_stress: float
    friction: float
    ucs: float

    def stresses(self, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Radial and hoop stress [Pa] at `radius` (n,) [m]."""
        cohesion = self.ucs / (self.friction - 1.0)
        power = (radius / self.hole_radius) ** (self.friction - 1.0)
        plastic_radial = -cohesion + (self.pressure + cohesion) * power
        plastic_hoop = -cohesion + self.friction * (self.pressure + cohesion) * power
        fade = (self.far_stress - self.boundary_stress) * (self.radius / radius) ** 2
        inside = radius < self.radius
        return (
            np.where(inside, plastic_radial, self.far_stress - fade),
            np.where(inside, plastic_hoop, self.far_stress + fade),
        )


def salencon(
    hole_radius: float, pressure: float, far_stress: float, ucs: float, friction_angle: float
) -> UnloadedHole:
    """Hole of `hole_radius` [m] unloaded from the far stress to `pressure` [Pa]."""
    friction = friction_number(friction_angle)
    cohesion = ucs / (friction - 1.0)
    ratio = 2.0 / (friction + 1.0) * (far_stress + cohesion) / (pressure + cohesion)
    return UnloadedHole(
        hole_radius * ratio ** (1.0 / (friction - 1.0)),
        (2.0 * far_stress - ucs) / (friction + 1.0),
        hole_radius,
        pressure,
        far_stress,
        friction,
        ucs,
    )


class CavityRock(NamedTuple):
    """Rock around an expanding cavity.

    Attributes
    ----------
    young_modulus [Pa], poisson_ratio [-], ucs [Pa], friction_angle [rad],
    dilation_angle [rad], in_situ_stress [Pa] : float
        No tension cut-off below the apex; the axial stress is assumed to stay in between.
    """

    young_modulus: float
    poisson_ratio: float
    ucs: float
    friction_angle: float
    dilation_angle: float
    in_situ_stress: float = 0.0


def cavity_plastic_ratio(pressure: float, rock: CavityRock) -> float:
    """Plastic radius over present cavity radius at an internal pressure [Pa] beyond yield."""
    alpha = friction_number(rock.friction_angle)
    strength = rock.ucs + (alpha - 1.0) * rock.in_situ_stress
    ratio = (1.0 + alpha) * (rock.ucs + (alpha - 1.0) * pressure) / (2.0 * alpha * strength)
    return float(ratio ** (alpha / (alpha - 1.0)))


def cavity_expansion(pressure: float, rock: CavityRock) -> float:
    """Present over initial cavity radius at an internal pressure [Pa] beyond first yield.

    NaN at and above the limit pressure, where the cavity grows without bound.
    """
    nu, young = rock.poisson_ratio, rock.young_modulus
    alpha = friction_number(rock.friction_angle)
    beta = friction_number(rock.dilation_angle)
    strength = rock.ucs + (alpha - 1.0) * rock.in_situ_stress
    shear = young / (2.0 * (1.0 + nu))
    ratio = (1.0 + alpha) * (rock.ucs + (alpha - 1.0) * pressure) / (2.0 * alpha * strength)
    delta = strength / (1.0 + alpha) / (2.0 * shear)
    gamma = alpha * (1.0 + beta) / ((alpha - 1.0) * beta)
    eta = exp(
        (1.0 + beta) * (1.0 - 2.0 * nu) * (1.0 + nu) * strength / (young * (alpha - 1.0) * beta)
    )
    xi = (
        2.0 * (1.0 - nu * nu) * strength / (young * (1.0 + alpha) * (alpha - 1.0) * beta)
        * (alpha * beta + 1.0 - nu * (alpha + beta) / (1.0 - nu))
    )  # fmt: skip
    series, term = 0.0, 1.0
    for n in range(200):
        gap = n - gamma
        series += term * (log(ratio) if abs(gap) < 1e-12 else (ratio**gap - 1.0) / gap)
        term *= xi / (n + 1)
        if abs(term) * ratio ** (n + 1) < 1e-18:
            break
    bracket = (1.0 - delta) ** ((1.0 + beta) / beta) - gamma / eta * series
    if bracket <= 0.0:
        return nan
    return float((ratio**-gamma / bracket) ** (beta / (1.0 + beta)))
