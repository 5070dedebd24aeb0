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

from typing import Final, NamedTuple

import numpy as np

from castblast.kernel import inline_kernel

#: Pressure of the open air [Pa].
ATMOSPHERIC_PRESSURE: Final = 101_325.0


class Outflow(NamedTuple):
    """What the gas state alone says of outflow into the open air; made by `gas_outflow`.

    Attributes
    ----------
    nozzle_flux : float [kg m-2 s-1]
        Flux G0 of a short opening, choked or not; 0 if the gas is not above the open air.
    friction_integral : float [Pa kg m-3]
        Integral I of rho dP from the open air to the gas state.
    """

    nozzle_flux: float
    friction_integral: float


@inline_kernel
def gas_outflow(pressure: float, density: float, exponent: float) -> Outflow:
    """Work out nozzle flux and friction integral of a gas state.

    Parameters
    ----------
    pressure : float [Pa]
    density : float [kg m-3]
    exponent : float [-]
        Isentropic exponent, above 1.
    """
    if not pressure > ATMOSPHERIC_PRESSURE:
        return Outflow(0.0, 0.0)
    k = exponent
    log_ratio = np.log(ATMOSPHERIC_PRESSURE / pressure)
    exit_share = np.exp((k + 1.0) / k * log_ratio)
    integral = pressure * density * k / (k + 1.0) * (1.0 - exit_share)
    log_critical = np.log(2.0 / (k + 1.0))
    if _choke_margin(k, log_ratio, log_critical) > 0.0:
        choked = np.exp((k + 1.0) / (k - 1.0) * log_critical)
        return Outflow(np.sqrt(k * pressure * density * choked), integral)
    drop = np.exp(2.0 / k * log_ratio) - exit_share
    return Outflow(np.sqrt(2.0 * k / (k - 1.0) * pressure * density * drop), integral)


@inline_kernel
def _choke_margin(exponent: float, log_ratio: float, log_critical: float) -> float:
    return exponent * log_critical - (exponent - 1.0) * log_ratio


@inline_kernel
def choke_margin(pressure: float, exponent: float) -> float:
    """Positive while a nozzle into the open air is choked [-]; smooth in the gas state."""
    log_ratio = np.log(ATMOSPHERIC_PRESSURE / pressure)
    return _choke_margin(exponent, log_ratio, np.log(2.0 / (exponent + 1.0)))


@inline_kernel
def fracture_flux(
    outflow: Outflow, aperture: float, path: float, friction_factor: float, viscosity: float
) -> float:
    """Flux through one fracture with parallel walls.

    Parameters
    ----------
    outflow : Outflow
        Of the gas in the hole.
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
    if outflow.nozzle_flux <= 0.0 or aperture <= 0.0:
        return 0.0
    hydraulic_diameter = 2.0 * aperture
    slenderness = path / (2.0 * outflow.friction_integral * hydraulic_diameter)
    square = 1.0 / outflow.nozzle_flux**2 + friction_factor * slenderness
    half_linear = 48.0 * viscosity / hydraulic_diameter * slenderness
    return float(1.0 / (half_linear + np.sqrt(half_linear**2 + square)))
