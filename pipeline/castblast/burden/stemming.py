"""The stemming: a granular column that locks against the wall, leaks, and may be ejected.

Column under gas pressure P at its foot and the open air at the collar, wall shear proportional to
the axial stress sigma (Janssen 1895): d(sigma)/dy = -kappa sigma - rho_s a, kappa = 4 mu k0 / d.
Integrated over the part still in the hole, with the part already out carried as plain mass (it
stays in contact because the column accelerates), this gives the acceleration a (derived by this
project). For kappa l << 1 it is a frictionless piston, for kappa l >> 1 the plug is exponentially
locked. Left out: weight and cohesion of the stemming, crushing of its grains, and friction while
it coasts.
"""

from __future__ import annotations

import numpy as np

from castblast.burden.venting import ATMOSPHERIC_PRESSURE, Outflow
from castblast.kernel import inline_kernel


@inline_kernel
def stemming_acceleration(
    pressure: float, displacement: float, length: float, wall_rate: float, density: float
) -> float:
    """Acceleration of the stemming [m s-2]; 0 while wall friction holds it.

    Parameters
    ----------
    pressure : float [Pa]
    displacement, length : float [m]
        How far the column has moved out of the hole, and its full length.
    wall_rate : float [m-1]
        kappa = 4 mu k0 / d.
    density : float [kg m-3]
        Bulk density of the stemming.
    """
    inside = length - displacement
    lock = wall_rate * inside
    loss = -np.expm1(-lock)  # share of the gas pressure that the wall carries
    moving_length = displacement + (loss / wall_rate if abs(lock) > 1e-12 else inside)
    push = pressure * (1.0 - loss) - ATMOSPHERIC_PRESSURE
    return float(max(push, 0.0) / (density * moving_length))


@inline_kernel
def push_margin(pressure: float, displacement: float, length: float, wall_rate: float) -> float:
    """Positive while the gas pushes the stemming, negative while wall friction holds it [-]."""
    return float(np.log(pressure / ATMOSPHERIC_PRESSURE) - wall_rate * (length - displacement))


@inline_kernel
def leakage_flux(outflow: Outflow, inside: float, porosity: float, grain_size: float) -> float:
    """Gas flux through stemming in place [kg m-2 s-1], per cross-section of the hole.

    Parameters
    ----------
    outflow : Outflow
        Of the gas in the hole.
    inside : float [m]
        Length of the column still in the hole.
    porosity : float [-]
    grain_size : float [m]

    Notes
    -----
    Inertial term of Ergun (1952): -dP/dy = beta G^2 / rho, beta = 1.75 (1 - n) / (n^3 d_s), in
    series with the nozzle of the pore section n G0.
    """
    if outflow.nozzle_flux <= 0.0 or porosity <= 0.0:
        return 0.0
    resistance = 1.75 * (1.0 - porosity) / (porosity**3 * grain_size) * max(inside, 0.0)
    pore_flux = porosity * outflow.nozzle_flux
    return float(1.0 / np.sqrt(1.0 / pore_flux**2 + resistance / outflow.friction_integral))
