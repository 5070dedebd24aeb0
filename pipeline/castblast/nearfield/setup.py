"""From rock, hole and settings to the numbers of an annulus, for one hole or many.

The formulas work on arrays: a single hole is a column of length one. Which numbers an annulus is
made of is said once, in `HoleParameters`.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from castblast.explosive.isentrope import Explosive, ProductIsentrope
from castblast.kernel import kernel
from castblast.nearfield.case import (
    EndMode,
    FloatArray,
    NearFieldColumns,
    NearFieldSettings,
    TensionMode,
)
from castblast.nearfield.front import front_number, regularised_share
from castblast.nearfield.march import Annulus, WallLoad
from castblast.nearfield.mesh import Mesh, equilibrium_mesh, paper_mesh
from castblast.nearfield.outcome import WINDOW
from castblast.nearfield.rock.lagrangian import Material
from castblast.nearfield.rock.merging import Coarse
from castblast.nearfield.rock.mohr_coulomb import apex_tension, friction_number

#: Outer radius of the published model [m].
PAPER_RADIUS = 5.5
#: Share of the travel time of the p-wave to the outer boundary at which it ends.
PAPER_END = 0.9
#: Outer radius of the equilibrium mode in hole radii. Zones that no wave has reached cost nothing;
#: only in the weakest dilatant rock does anything beyond 250 hole radii matter.
EQUILIBRIUM_RADII = 1000.0
MAX_STEPS = 300_000
_MOST_DECOUPLED = 100.0


class HoleParameters(NamedTuple):
    """Numbers of an annulus that differ from hole to hole, as columns (n,); see `Annulus`.

    `total_energy` [J m-3] is the energy of detonation of the explosive.
    """

    density: FloatArray
    bulk_modulus: FloatArray
    shear_modulus: FloatArray
    ucs: FloatArray
    tension: FloatArray
    friction: FloatArray
    dilation: FloatArray
    inner_radius: FloatArray
    outer_radius: FloatArray
    mesh: Mesh
    linear_viscosity: FloatArray
    in_situ_stress: FloatArray
    charge_radius: FloatArray
    rise_time: FloatArray
    end_time: FloatArray
    total_energy: FloatArray


class CommonParameters(NamedTuple):
    """What all holes of a batch share; see `Annulus` and `Material`."""

    brittle: bool
    quadratic_viscosity: float


def possible(
    explosives: Sequence[Explosive], columns: NearFieldColumns, settings: NearFieldSettings
) -> NDArray[np.bool_]:
    """Say for every row whether its inputs describe a case at all."""
    c, s = columns, settings
    finite = np.array([isfinite(e.total_energy + sum(e.isentrope[1:7])) for e in explosives])
    good = finite[c.explosive]
    for values in c[1:]:
        good &= np.isfinite(values)
    good &= (c.density > 0.0) & (c.young_modulus > 0.0) & (c.ucs > 0.0)
    good &= (c.poisson_ratio >= 0.0) & (c.poisson_ratio < 0.5)
    good &= (c.friction_angle > 0.0) & (c.friction_angle < 0.5 * np.pi)
    good &= (c.dilation_angle >= 0.0) & (c.dilation_angle <= c.friction_angle)
    good &= (c.tensile_strength >= 0.0) & (c.rise_time >= 0.0) & (c.in_situ_stress >= 0.0)
    good &= (c.charge_diameter > 0.0) & (c.charge_diameter <= c.diameter)
    good &= c.diameter <= _MOST_DECOUPLED * c.charge_diameter
    good &= (s.outer_radius == 0.0) | (s.outer_radius > 0.5 * c.diameter)
    settable = (
        isfinite(s.outer_radius + s.quadratic_viscosity + s.linear_viscosity)
        and (s.zones == 0 or s.zones >= 8)
        and s.quadratic_viscosity >= 0.0
        and s.linear_viscosity >= 0.0
        and s.history_points >= 2
        and s.mode in tuple(EndMode)
        and s.tension in tuple(TensionMode)
    )
    return good & settable


def hole_parameters(
    explosives: Sequence[Explosive], columns: NearFieldColumns, settings: NearFieldSettings
) -> HoleParameters:
    """Numbers of every annulus; the tensile strength never lies beyond the apex of the cone."""
    c = columns
    friction = friction_number(c.friction_angle)
    bulk = c.young_modulus / (3.0 * (1.0 - 2.0 * c.poisson_ratio))
    shear = c.young_modulus / (2.0 * (1.0 + c.poisson_ratio))
    apex = apex_tension(c.ucs, c.friction_angle)
    tension = apex if settings.tension == TensionMode.NONE else np.minimum(c.tensile_strength, apex)
    inner = 0.5 * c.diameter
    paper = settings.mode == EndMode.PAPER
    outer = np.full_like(inner, settings.outer_radius)
    if settings.outer_radius == 0.0:
        outer = np.full_like(inner, PAPER_RADIUS) if paper else EQUILIBRIUM_RADII * inner
    wave_speed = np.sqrt((bulk + 4.0 / 3.0 * shear) / c.density)
    front = front_number(friction, c.poisson_ratio)
    share = regularised_share(front)
    run = wave_speed * c.rise_time / inner
    mesh = (
        paper_mesh(inner, settings.zones)
        if paper
        else equilibrium_mesh(inner, outer, run, front, settings.zones)
    )
    end = PAPER_END * (outer - inner) / wave_speed if paper else np.zeros_like(inner)
    energies = np.array([e.total_energy for e in explosives])
    return HoleParameters(
        density=c.density,
        bulk_modulus=bulk,
        shear_modulus=shear,
        ucs=c.ucs,
        tension=tension,
        friction=friction,
        dilation=friction_number(c.dilation_angle),
        inner_radius=inner,
        outer_radius=outer,
        mesh=mesh,
        linear_viscosity=share * settings.linear_viscosity,
        in_situ_stress=c.in_situ_stress,
        charge_radius=0.5 * c.charge_diameter,
        rise_time=c.rise_time,
        end_time=end,
        total_energy=energies[c.explosive],
    )


def common_parameters(settings: NearFieldSettings) -> CommonParameters:
    """Numbers that the settings give to all holes."""
    return CommonParameters(
        bool(settings.tension == TensionMode.BRITTLE),
        float(settings.quadratic_viscosity),
    )


@kernel
def make_annulus(
    holes: HoleParameters, row: int, common: CommonParameters, isentrope: ProductIsentrope
) -> Annulus:
    """Annulus of one row."""
    h = holes
    material = Material(
        h.density[row], h.bulk_modulus[row], h.shear_modulus[row], h.ucs[row], h.tension[row],
        common.brittle, common.quadratic_viscosity, h.linear_viscosity[row],
    )  # fmt: skip
    in_situ = h.in_situ_stress[row]
    load = WallLoad(
        gas=True, isentrope=isentrope, charge_radius=h.charge_radius[row], start_pressure=in_situ,
        target_pressure=0.0, rise_time=h.rise_time[row],
    )  # fmt: skip
    m = h.mesh
    inner, outer = h.inner_radius[row], h.outer_radius[row]
    return Annulus(
        material=material, friction=h.friction[row], dilation=h.dilation[row], inner_radius=inner,
        outer_radius=outer, first_width=m.first_width[row], reach=m.reach[row], zones=m.zones[row],
        coarse=Coarse(
            first=m.coarse_width[row], growth=m.coarse_growth[row], reach=m.coarse_reach[row]
        ),
        in_situ_stress=in_situ, quiet=True, load=load, end_time=h.end_time[row],
        settling_factor=WINDOW[1], courant=m.courant[row], max_steps=MAX_STEPS,
    )  # fmt: skip
