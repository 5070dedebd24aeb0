"""Explosives, benches and parameters of the tests of the burden motion."""

from __future__ import annotations

from math import log, pi

from scipy.optimize import brentq

from castblast.burden.case import BurdenGeometry, BurdenParameters, BurdenResult
from castblast.burden.motion import solve_burden_motion
from castblast.design.variables import BURDEN_PARAMETER_SETS, VARIABLES
from castblast.explosive.isentrope import (
    Explosive,
    jwl_isentrope,
    pressure,
)

AIR = 101_325.0


# density, CJ velocity, heat of explosion, E0; A, B, C [GPa], R1, R2, omega. Derived by this
# project from a BKW-type thermochemical fit.
PRODUCTS = {
    "anfo": (800.0, 4806.0, 3.75e6, 3.2938e9, 141.731, 2.4178, 0.8586, 5.4081, 1.2931, 0.3510),
    "heavy_anfo": (950.0, 5391.0, 3.53e6, 3.5953e9, 272.005, 4.3544, 1.0629, 5.6736, 1.4765,
                   0.4294),
    "emulsion": (1150.0, 6129.0, 2.62e6, 3.6304e9, 563.384, 6.7052, 0.7578, 5.7557, 1.4798,
                 0.3898),
    "doped": (1280.0, 6845.0, 2.96e6, 4.4260e9, 822.822, 8.7125, 0.8673, 5.7618, 1.4683, 0.4020),
}  # fmt: skip


def explosive(name: str = "anfo") -> Explosive:
    density, velocity, heat, total, a, b, c, r1, r2, omega = PRODUCTS[name]
    isentrope = jwl_isentrope(a * 1e9, b * 1e9, c * 1e9, r1, r2, omega)
    return Explosive(density, velocity, heat, total, 0.211, 0.84, isentrope)


def parameters(parameter_set: str = "field", **changes: float) -> BurdenParameters:
    values = {name: VARIABLES[name].default for name in BurdenParameters._fields}
    values |= BURDEN_PARAMETER_SETS[parameter_set] | changes
    return BurdenParameters(**{name: float(value) for name, value in values.items()})


def geometry(
    d: float = 0.102,
    B: float = 3.0,
    S: float = 3.0,
    H: float = 12.5,
    stem: float = 0.7,
    face: float = 90.0,
    rho: float = 2600.0,
) -> BurdenGeometry:
    return BurdenGeometry(B, S, H, face * pi / 180.0, stem * B, H - stem * B, rho, d, d)


def hole_radius(product: Explosive, p: float, d: float) -> float:
    """Radius of a hole that has opened to gas pressure `p` from diameter `d`."""
    ratio = brentq(lambda q: log(pressure(product.isentrope, q * q) / p), 1.0, 6.0, xtol=1e-13)
    return 0.5 * d * ratio


def base(changes: dict[str, float] | None = None, **model: float) -> BurdenResult:
    """ANFO in a 102 mm hole, 3 m x 3 m x 12.5 m, equilibrium pressure 249 MPa."""
    bench = geometry(**(changes or {}))
    product = explosive()
    radius = hole_radius(product, 249e6, bench.hole_diameter)
    return solve_burden_motion(product, bench, parameters(**model), radius)


SEALED = {"fracture_opening_ratio": 0.0, "stemming_wall_friction": 1.0, "stemming_porosity": 0.0}
