"""Gas flow out of the hole to the open air, per cross-section of flow path [kg m-2 s-1].

The gas expands along its isentrope with the local exponent k = -d ln P / d ln V, which falls from
about 2.5 to 1.35 while the products expand; a real-gas law, not an ideal-gas temperature, gives
density and exponent.

- Nozzle: isentropic flow from rest, choked as soon as the exit reaches the speed of sound
  (textbook gas dynamics, e.g. Shapiro 1953).
- Long rough path: G^2 = 2 I / K with I the integral of rho dP over the path and K the friction
  number f L / D_h.
- Both in series: 1/G^2 = 1/G0^2 + K / (2 I), exact in both limits (derived by this project).

Left out: heat exchange with the rock and the speed of the gas before it enters the path.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from castblast.kernel import kernel

#: Pressure of the open air [Pa].
ATMOSPHERIC_PRESSURE: Final = 101_325.0


@kernel
def nozzle_flux(pressure: float, density: float, exponent: float) -> float:
    """Flux G0 of a short opening into the open air, choked or not.

    Parameters
    ----------
    pressure : float [Pa]
    density : float [kg m-3]
    exponent : float [-]
        Isentropic exponent, above 1.
    """
    if pressure <= ATMOSPHERIC_PRESSURE:
        return 0.0
    k = exponent
    ratio = ATMOSPHERIC_PRESSURE / pressure
    if ratio < (2.0 / (k + 1.0)) ** (k / (k - 1.0)):
        choked = (2.0 / (k + 1.0)) ** ((k + 1.0) / (2.0 * (k - 1.0)))
        return float(np.sqrt(k * pressure * density) * choked)
    drop = ratio ** (2.0 / k) - ratio ** ((k + 1.0) / k)
    return float(np.sqrt(2.0 * k / (k - 1.0) * pressure * density * drop))


@kernel
def friction_integral(pressure: float, density: float, exponent: float) -> float:
    """Integral I of rho dP from the open air to the gas state [Pa kg m-3]."""
    if pressure <= ATMOSPHERIC_PRESSURE:
        return 0.0
    ratio = ATMOSPHERIC_PRESSURE / pressure
    share = 1.0 - ratio ** ((exponent + 1.0) / exponent)
    return float(pressure * density * exponent / (exponent + 1.0) * share)


@kernel
def fracture_flux(
    pressure: float,
    density: float,
    exponent: float,
    aperture: float,
    path: float,
    friction_factor: float,
    viscosity: float,
) -> float:
    """Flux through one fracture with parallel walls.

    Parameters
    ----------
    pressure, density, exponent : float
        Gas state as in `nozzle_flux`.
    aperture, path : float [m]
        Opening of the fracture and its length to the face.
    friction_factor : float [-]
        Darcy factor of fully rough turbulent flow.
    viscosity : float [Pa s]

    Notes
    -----
    f = friction_factor + 96 viscosity / (G D_h) with D_h = 2 aperture gives the cubic law of
    laminar flow for thin fractures; G then solves a quadratic equation in 1/G.
    """
    if pressure <= ATMOSPHERIC_PRESSURE or aperture <= 0.0:
        return 0.0
    hydraulic_diameter = 2.0 * aperture
    slenderness = path / (2.0 * friction_integral(pressure, density, exponent) * hydraulic_diameter)
    square = 1.0 / nozzle_flux(pressure, density, exponent) ** 2 + friction_factor * slenderness
    half_linear = 48.0 * viscosity / hydraulic_diameter * slenderness
    return float(1.0 / (half_linear + np.sqrt(half_linear**2 + square)))
