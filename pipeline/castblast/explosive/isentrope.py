"""Expansion isentrope of the detonation products through the CJ point.

Two forms with one interface: the Jones-Wilkins-Lee law (Lee, Hornig & Kury 1968, UCRL-50422) and
a table (relative volume, pressure) interpolated by a monotone cubic of ln P over ln V. The
relative volume V is gas volume over initial explosive volume, the pressure P is absolute, the
energy E is per initial explosive volume and zero at infinite expansion. Left out: heat exchange
with the rock, late reaction, and any state off the isentrope.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from castblast.kernel import inline_kernel, kernel
from castblast.types import FloatArray

# Gauss-Legendre nodes on (0, 1): energy between two points of the tabulated isentrope.
_nodes, _weights = np.polynomial.legendre.leggauss(8)
_NODES = tuple(float(x) for x in 0.5 * (_nodes + 1.0))
_WEIGHTS = tuple(float(w) for w in 0.5 * _weights)

#: A tabulated isentrope may be continued by at most this factor beyond its ends.
TABLE_MARGIN = 3.0
#: Exponent beyond which a term of the JWL law has vanished.
_FAR = 600.0


class ProductIsentrope(NamedTuple):
    """Isentrope of the products, ready for kernels.

    Attributes
    ----------
    tabulated : bool
        True: the table below is used; False: the JWL constants.
    a, b, c : float [Pa]
        JWL pressures.
    r1, r2, omega : float [-]
        JWL exponents.
    log_volume : array (n,) [-]
        ln V of the table points, increasing (one dummy point for JWL).
    log_pressure, log_slope : array (n,) [-]
        ln(P / Pa) and d ln P / d ln V at the table points.
    energy : array (n,) [J m-3]
        Energy per initial explosive volume at the table points.
    """

    tabulated: bool
    a: float
    b: float
    c: float
    r1: float
    r2: float
    omega: float
    log_volume: FloatArray
    log_pressure: FloatArray
    log_slope: FloatArray
    energy: FloatArray


class Explosive(NamedTuple):
    """What the physics needs to know of an explosive, in SI units.

    Attributes
    ----------
    density : float [kg m-3]
        Density of the unreacted explosive.
    detonation_velocity : float [m s-1]
        Ideal (CJ) velocity of detonation.
    heat_of_explosion : float [J kg-1]
        Denominator of all reported energy shares.
    total_energy : float [J m-3]
        Energy of detonation E0 per initial volume.
    diameter_coefficient, diameter_exponent : float [-]
        In-hole velocity of detonation: D = D_CJ [1 - coefficient (0.1 m / d)^exponent];
        a coefficient of 0 switches the diameter effect off.
    isentrope : ProductIsentrope
        Expansion isentrope through the CJ point.
    """

    density: float
    detonation_velocity: float
    heat_of_explosion: float
    total_energy: float
    diameter_coefficient: float
    diameter_exponent: float
    isentrope: ProductIsentrope


def jwl_isentrope(
    a: float, b: float, c: float, r1: float, r2: float, omega: float
) -> ProductIsentrope:
    """Make an isentrope from JWL constants: `a`, `b`, `c` in Pa, the others dimensionless."""
    dummy = np.zeros(1)
    return ProductIsentrope(
        tabulated=False,
        a=a,
        b=b,
        c=c,
        r1=r1,
        r2=r2,
        omega=omega,
        log_volume=dummy,
        log_pressure=dummy,
        log_slope=dummy,
        energy=dummy,
    )


def tabulated_isentrope(
    relative_volume: ArrayLike, pressure: ArrayLike, energy: ArrayLike | None = None
) -> ProductIsentrope:
    """Make an isentrope from a table.

    Parameters
    ----------
    relative_volume : array (n,) [-]
        Increasing, positive.
    pressure : array (n,) [Pa]
        Decreasing, positive.
    energy : array (n,) [J m-3], optional
        Used only for its last value (the energy left at the end of the table); the rest follows
        from dE = -P dV, so that pressure and energy are consistent to round-off. Without it the
        last slope is continued to infinity.

    Notes
    -----
    ln P over ln V is a monotone piecewise cubic (Fritsch & Carlson 1980): P decreases and its
    slope, on which choked outflow depends, is continuous.
    """
    from scipy.interpolate import PchipInterpolator

    x = np.log(np.asarray(relative_volume, dtype=np.float64))
    y = np.log(np.asarray(pressure, dtype=np.float64))
    slope = np.asarray(PchipInterpolator(x, y).derivative()(x), dtype=np.float64)
    table = ProductIsentrope(
        tabulated=True,
        a=0.0,
        b=0.0,
        c=0.0,
        r1=1.0,
        r2=1.0,
        omega=1.0,
        log_volume=x,
        log_pressure=y,
        log_slope=slope,
        energy=np.zeros(x.size),
    )
    if energy is None:
        # Beyond the last point P ~ V^slope; the integral of P dV to infinity is finite for k > 1.
        last = float(np.exp(y[-1] + x[-1]) / max(-slope[-1] - 1.0, 1e-6))
    else:
        last = float(np.asarray(energy, dtype=np.float64)[-1])
    steps = [_interval_work(table, i, x[i], x[i + 1]) for i in range(x.size - 1)]
    level = np.append(np.cumsum(np.asarray(steps)[::-1])[::-1], 0.0) + last
    return table._replace(energy=level)


@kernel
def _log_pressure(isentrope: ProductIsentrope, i: int, x: float) -> float:
    """Cubic Hermite value of ln P on interval `i` at ln V = `x`."""
    h = isentrope.log_volume[i + 1] - isentrope.log_volume[i]
    t = (x - isentrope.log_volume[i]) / h
    y0, y1 = isentrope.log_pressure[i], isentrope.log_pressure[i + 1]
    d0, d1 = isentrope.log_slope[i] * h, isentrope.log_slope[i + 1] * h
    return float(
        y0 + t * (d0 + t * (3.0 * (y1 - y0) - 2.0 * d0 - d1 + t * (2.0 * (y0 - y1) + d0 + d1)))
    )


@kernel
def _log_pressure_slope(isentrope: ProductIsentrope, i: int, x: float) -> float:
    """Derivative of the cubic Hermite value: d ln P / d ln V."""
    h = isentrope.log_volume[i + 1] - isentrope.log_volume[i]
    t = (x - isentrope.log_volume[i]) / h
    y0, y1 = isentrope.log_pressure[i], isentrope.log_pressure[i + 1]
    d0, d1 = isentrope.log_slope[i] * h, isentrope.log_slope[i + 1] * h
    return float(
        (d0 + t * (2.0 * (3.0 * (y1 - y0) - 2.0 * d0 - d1) + 3.0 * t * (2.0 * (y0 - y1) + d0 + d1)))
        / h
    )


@kernel
def _interval_work(isentrope: ProductIsentrope, i: int, x0: float, x1: float) -> float:
    """Integral of P dV between ln V = `x0` and `x1`, both inside interval `i`."""
    work = 0.0
    for node, weight in zip(_NODES, _WEIGHTS):  # noqa: B905  (numba has no strict=)
        x = x0 + node * (x1 - x0)
        work += weight * np.exp(_log_pressure(isentrope, i, x) + x)
    return work * (x1 - x0)


@inline_kernel
def jwl_pressure(
    a: float, b: float, c: float, r1: float, r2: float, omega: float, volume: float
) -> float:
    """JWL pressure [Pa] at a relative volume > 0; `a`, `b`, `c` in Pa."""
    return float(a * np.exp(-r1 * volume) + b * np.exp(-r2 * volume) + c * volume ** (-1.0 - omega))


@kernel
def pressure(isentrope: ProductIsentrope, relative_volume: float) -> float:
    """Pressure on the isentrope [Pa] at a relative volume > 0; the table's end slopes continue."""
    if not isentrope.tabulated:
        jwl = isentrope
        return jwl_pressure(jwl.a, jwl.b, jwl.c, jwl.r1, jwl.r2, jwl.omega, relative_volume)
    x = np.log(relative_volume)
    last = isentrope.log_volume.size - 1
    if x <= isentrope.log_volume[0]:
        line = isentrope.log_slope[0] * (x - isentrope.log_volume[0])
        return float(np.exp(isentrope.log_pressure[0] + line))
    if x >= isentrope.log_volume[last]:
        line = isentrope.log_slope[last] * (x - isentrope.log_volume[last])
        return float(np.exp(isentrope.log_pressure[last] + line))
    i = int(np.searchsorted(isentrope.log_volume, x, side="right")) - 1
    return float(np.exp(_log_pressure(isentrope, i, x)))


@kernel
def slope(isentrope: ProductIsentrope, relative_volume: float) -> float:
    """Isentropic exponent k = -d ln P / d ln V [-] at a relative volume > 0."""
    if not isentrope.tabulated:
        v = relative_volume
        e1 = isentrope.a * np.exp(-isentrope.r1 * v)
        e2 = isentrope.b * np.exp(-isentrope.r2 * v)
        e3 = isentrope.c * v ** (-1.0 - isentrope.omega)
        rate = isentrope.r1 * v * e1 + isentrope.r2 * v * e2 + (1.0 + isentrope.omega) * e3
        return float(rate / (e1 + e2 + e3))
    x = np.log(relative_volume)
    last = isentrope.log_volume.size - 1
    if x <= isentrope.log_volume[0]:
        return float(-isentrope.log_slope[0])
    if x >= isentrope.log_volume[last]:
        return float(-isentrope.log_slope[last])
    i = int(np.searchsorted(isentrope.log_volume, x, side="right")) - 1
    return -_log_pressure_slope(isentrope, i, x)


@kernel
def energy(isentrope: ProductIsentrope, relative_volume: float) -> float:
    """Energy per initial explosive volume [J m-3] still in the products; dE = -P dV."""
    if not isentrope.tabulated:
        v = relative_volume
        return float(
            isentrope.a / isentrope.r1 * np.exp(-isentrope.r1 * v)
            + isentrope.b / isentrope.r2 * np.exp(-isentrope.r2 * v)
            + isentrope.c / isentrope.omega * v ** (-isentrope.omega)
        )
    x = np.log(relative_volume)
    last = isentrope.log_volume.size - 1
    if x <= isentrope.log_volume[0]:
        return float(isentrope.energy[0]) - _end_work(isentrope, 0, x)
    if x >= isentrope.log_volume[last]:
        return float(isentrope.energy[last]) - _end_work(isentrope, last, x)
    i = int(np.searchsorted(isentrope.log_volume, x, side="right")) - 1
    rest = _interval_work(isentrope, i, x, isentrope.log_volume[i + 1])
    return float(isentrope.energy[i + 1]) + rest


@kernel
def _end_work(isentrope: ProductIsentrope, i: int, x: float) -> float:
    """Integral of P dV from end point `i` of the table to ln V = `x` on the continued slope."""
    work_exponent = isentrope.log_slope[i] + 1.0
    scale = np.exp(isentrope.log_pressure[i] + isentrope.log_volume[i])
    return float(scale * np.expm1(work_exponent * (x - isentrope.log_volume[i])) / work_exponent)


@inline_kernel
def gas_state(isentrope: ProductIsentrope, relative_volume: float) -> tuple[float, float, float]:
    """Pressure [Pa], exponent k [-] and energy [J m-3] at a relative volume > 0, at one go.

    The same laws as `pressure`, `slope` and `energy`; a JWL law shares its exponentials.
    """
    if isentrope.tabulated:
        return (
            pressure(isentrope, relative_volume),
            slope(isentrope, relative_volume),
            energy(isentrope, relative_volume),
        )
    v = relative_volume
    # Results that underflow take the slow way through the mathematical library.
    first = isentrope.a * np.exp(-min(isentrope.r1 * v, _FAR))
    second = isentrope.b * np.exp(-min(isentrope.r2 * v, _FAR))
    tail = isentrope.c * np.exp(-isentrope.omega * np.log(v))
    p = first + second + tail / v
    stiffness = v * (isentrope.r1 * first + isentrope.r2 * second) + (1.0 + isentrope.omega) * (
        tail / v
    )
    left = first / isentrope.r1 + second / isentrope.r2 + tail / isentrope.omega
    return p, stiffness / p, left


@kernel
def inside_table(isentrope: ProductIsentrope, relative_volume: float) -> bool:
    """Say whether a relative volume lies within the table, up to `TABLE_MARGIN` beyond its ends."""
    if not isentrope.tabulated:
        return True
    x = np.log(relative_volume)
    margin = np.log(TABLE_MARGIN)
    last = isentrope.log_volume.size - 1
    return bool(isentrope.log_volume[0] - margin <= x and x <= isentrope.log_volume[last] + margin)


def in_hole_velocity(explosive: Explosive, hole_diameter: float) -> float:
    """Velocity of detonation [m s-1] in a hole of `hole_diameter` [m] in rock.

    Power-law fit 1 - D/D_CJ = coefficient (0.1 m / d)^exponent of the curved-front eigenvalue
    model (Wood & Kirkwood 1954); never below 0.4 D_CJ, where that model has no steady solution.
    """
    deficit = explosive.diameter_coefficient * (0.1 / hole_diameter) ** explosive.diameter_exponent
    return float(explosive.detonation_velocity * (1.0 - min(deficit, 0.6)))
