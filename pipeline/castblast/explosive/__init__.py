"""Detonation products: the expansion isentrope and the checks an explosive has to pass."""

from castblast.explosive.isentrope import (
    Explosive,
    ProductIsentrope,
    in_hole_velocity,
    jwl_isentrope,
    tabulated_isentrope,
)

__all__ = [
    "Explosive",
    "ProductIsentrope",
    "in_hole_velocity",
    "jwl_isentrope",
    "tabulated_isentrope",
]
