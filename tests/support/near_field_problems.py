"""Explosives, designs and bare annuli shared by the near-field tests."""

import numpy as np

from castblast.explosive.isentrope import Explosive, jwl_isentrope
from castblast.nearfield.case import Hole, NearFieldSettings, Rock
from castblast.nearfield.march import Annulus, WallLoad
from castblast.nearfield.rock.lagrangian import Material
from castblast.nearfield.rock.merging import Coarse
from castblast.nearfield.rock.mohr_coulomb import apex_tension, friction_number
from castblast.nearfield.solver import NearFieldResult, solve_near_field


def explosive(density, velocity, jwl, energy):
    """Make an explosive whose velocity does not depend on the diameter; JWL pressures in GPa."""
    a, b, c, r1, r2, omega = jwl
    isentrope = jwl_isentrope(a * 1e9, b * 1e9, c * 1e9, r1, r2, omega)
    return Explosive(density, velocity, 3.75e6, energy * 1e9, 0.0, 1.0, isentrope)


ANFO = explosive(800.0, 4806.0, (141.731, 2.4178, 0.8586, 5.4081, 1.2931, 0.3510), 3.2938)
HEAVY_ANFO = explosive(950.0, 5391.0, (272.005, 4.3544, 1.0629, 5.6736, 1.4765, 0.4294), 3.5953)
EMULSION = explosive(1150.0, 6129.0, (563.384, 6.7052, 0.7578, 5.7557, 1.4798, 0.3898), 3.6304)
DOPED = explosive(1280.0, 6845.0, (822.822, 8.7125, 0.8673, 5.7618, 1.4683, 0.4020), 4.4260)

BASE_ROCK = Rock(
    density=2600.0,
    young_modulus=2e10,
    poisson_ratio=0.25,
    ucs=1e8,
    friction_angle=np.radians(45.0),
    dilation_angle=0.0,
    tensile_strength=0.0,
)
QUADRATIC = NearFieldSettings().quadratic_viscosity
#: In-hole velocity of detonation of ANFO at 150 mm [m/s].
IN_HOLE_VELOCITY = 4084.0


def base_hole(diameter=0.15, **changes):
    """Fully coupled hole with a rise time of one diameter over the in-hole velocity."""
    hole = Hole(diameter, diameter, diameter / IN_HOLE_VELOCITY, 0.0)
    return hole._replace(**changes)


def rock(**changes):
    """Base rock with changes; angles in degrees."""
    for name in ("friction_angle", "dilation_angle"):
        if name in changes:
            changes[name] = float(np.radians(changes[name]))
    return BASE_ROCK._replace(**changes)


def blast(product=ANFO, of=BASE_ROCK, hole=None, **settings) -> NearFieldResult:
    """Solve one near field."""
    return solve_near_field(product, of, hole or base_hole(), NearFieldSettings(**settings))


def annulus(
    of=BASE_ROCK, *, inner=1.0, outer=30.0, zones=100, first=0.05, start=0.0, target=1e5,
    rise=0.0, end, in_situ=0.0, quiet=True, linear=0.15, courant=0.85, elastic=False,
    quadratic=QUADRATIC,
):  # fmt: skip
    """Annulus under a prescribed wall pressure, tension carried up to the apex of the cone."""
    ucs = 1e18 if elastic else of.ucs
    material = Material(
        of.density,
        of.young_modulus / (3.0 * (1.0 - 2.0 * of.poisson_ratio)),
        of.young_modulus / (2.0 * (1.0 + of.poisson_ratio)),
        ucs,
        float(apex_tension(ucs, of.friction_angle)),
        False,
        quadratic,
        linear,
    )
    load = WallLoad(False, ANFO.isentrope, inner, start, target, rise)
    return Annulus(
        material, float(friction_number(of.friction_angle)),
        float(friction_number(of.dilation_angle)), inner, outer, first, np.inf, float(zones),
        Coarse(first=0.0, growth=0.0, reach=1.0), in_situ, quiet, load, end, 1.8, courant,
        5_000_000,
    )  # fmt: skip


def wave_speed(of):
    """Speed of the p-wave [m/s]."""
    nu = of.poisson_ratio
    stiffness = of.young_modulus * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))
    return float(np.sqrt(stiffness / of.density))
