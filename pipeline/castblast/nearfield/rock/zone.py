r"""One zone through one step: strain, stress, viscosity, forces.

Everything here is branch-free arithmetic on scalars and is compiled into its callers: the march of
one hole calls it zone by zone, the march of many holes in lockstep lane by lane, where the
compiler turns it into vector instructions. One source, hence the same bits.

Per radian and per metre of hole, with width w = r2 - r1 and mean radius m = (r1 + r2) / 2:
see `castblast.nearfield.rock.lagrangian` for the scheme.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from castblast.kernel import fused_kernel
from castblast.nearfield.rock.mohr_coulomb import ReturnedStress
from castblast.nearfield.rock.single_plane import PlaneStrength, single_plane_return

#: The linear viscosity acts over this share of the radius, on however fine or coarse a mesh.
VISCOUS_LENGTH = 0.04
#: Viscosity against grid noise, over the width of a zone: acts on what differs from neighbours.
NOISE_VISCOSITY = 0.03
#: Share of the strength by which the hoop stress must be compressive to count as such.
_COMPRESSIVE = 1e-6


class Deformation(NamedTuple):
    """Shape of a zone after a move and how it got there.

    Attributes
    ----------
    width, mean : float [m]
    per_area : float [m-2]
        1 / (width mean).
    radial, hoop : float [-]
        Logarithmic strain of the step.
    """

    width: float
    mean: float
    per_area: float
    radial: float
    hoop: float


class Stress(NamedTuple):
    """Kirchhoff stress of a zone [Pa], tension positive."""

    radial: float
    hoop: float
    axial: float


class Flow(NamedTuple):
    """Stress after a step and the plastic flow of the step.

    Attributes
    ----------
    stress : Stress
    shear, opening : float [-]
        Plastic multipliers of shear (most compressive direction) and of tension.
    shear_work, tensile_work : float [J m-3]
        Mean of old and new stress times the plastic strain: for a quadratic elastic energy this
        makes elastic plus plastic work equal to the work of the mean stress.
    strain : float [-]
        sqrt(2/3 de:de) of the plastic shear strain.
    """

    stress: Stress
    shear: float
    opening: float
    shear_work: float
    tensile_work: float
    strain: float


class Trial(NamedTuple):
    """Outcome of the elastic trial and of the return by one plane.

    Attributes
    ----------
    flow : Flow
        With the trial stress itself if it is not `solved`.
    ucs, tension : float [Pa]
        Strengths in the measure of the stress.
    shear_shortfall, tensile_shortfall : float [-]
        Excess of the trial over shear and tensile strength as strain, at most 0.
    solved : bool
        False: an edge or a corner of the strength surface is needed.
    """

    flow: Flow
    ucs: float
    tension: float
    shear_shortfall: float
    tensile_shortfall: float
    solved: bool


class Squeeze(NamedTuple):
    """Rate of compression of a zone and of its neighbours [1/s]."""

    before: float
    here: float
    after: float


class Viscosity(NamedTuple):
    """Viscosities of a rock [-]."""

    linear: float
    quadratic: float


class Resistance(NamedTuple):
    """What a zone does to its nodes.

    Attributes
    ----------
    viscous : float [Pa]
        Viscous pressure.
    limit : float [s]
        Largest stable step; negative if the zone has turned inside out.
    through, around : float [N]
        Inner node: + through - around, outer node: - through - around.
    """

    viscous: float
    limit: float
    through: float
    around: float


@fused_kernel
def per_area_between(inner: float, outer: float) -> float:
    """One over the area per radian [m-2] between two radii [m]."""
    return 1.0 / ((outer - inner) * (0.5 * (outer + inner)))


@fused_kernel
def deform(
    inner: float, outer: float, per_area: float, old_width: float, old_mean: float
) -> Deformation:
    """New shape and strain from the radii of both nodes [m] and `per_area_between` them.

    ln(new / old) = 2 artanh((new - old) / (new + old)), by its series: error below 1e-11 at a
    change of 1 percent. One division serves both directions.
    """
    width = outer - inner
    mean = 0.5 * (outer + inner)
    sum_width, sum_mean = width + old_width, mean + old_mean
    per_both = 1.0 / (sum_width * sum_mean)
    y = (width - old_width) * (sum_mean * per_both)
    z = (mean - old_mean) * (sum_width * per_both)
    y2, z2 = y * y, z * z
    return Deformation(
        width,
        mean,
        per_area,
        2.0 * y * (1.0 + y2 * (1.0 / 3.0 + 0.2 * y2)),
        2.0 * z * (1.0 + z2 * (1.0 / 3.0 + 0.2 * z2)),
    )


@fused_kernel
def elastic(planes: PlaneStrength, d: Deformation, old: Stress) -> Stress:
    """Elastic trial stress."""
    pressure = planes.lame * (d.radial + d.hoop)
    return Stress(
        old.radial + pressure + planes.twice_shear * d.radial,
        old.hoop + pressure + planes.twice_shear * d.hoop,
        old.axial + pressure,
    )


@fused_kernel
def try_one_plane(
    planes: PlaneStrength,
    trial: Stress,
    old: Stress,
    swelling: float,
    cauchy_ucs: float,
    cauchy_tension: float,
) -> Trial:
    """Return a trial stress by one plane.

    Parameters
    ----------
    trial, old : Stress
    swelling : float [-]
        Area over initial area, which takes the strengths of the Cauchy stress to those of ours.
    cauchy_ucs, cauchy_tension : float [Pa]
    """
    ucs, tension = swelling * cauchy_ucs, swelling * cauchy_tension
    s = single_plane_return(planes, trial.radial, trial.hoop, trial.axial, ucs, tension)
    radial = 0.5 * (old.radial + s.radial)
    hoop = 0.5 * (old.hoop + s.hoop)
    axial = 0.5 * (old.axial + s.axial)
    return Trial(
        Flow(
            Stress(s.radial, s.hoop, s.axial),
            s.shear,
            s.opening,
            radial * s.shear_radial + hoop * s.shear_hoop + axial * s.shear_axial,
            radial * s.opening_radial + hoop * s.opening_hoop + axial * s.opening_axial,
            s.shear * planes.shear_strain,
        ),
        ucs,
        tension,
        min(planes.shear_compliance * s.shear_excess, 0.0),
        min(planes.tensile_compliance * s.tensile_excess, 0.0),
        s.solved,
    )


@fused_kernel
def edge_flow(s: ReturnedStress, old: Stress) -> Flow:
    """Flow of a zone that was returned to an edge or a corner."""
    radial = 0.5 * (old.radial + s.radial)
    hoop = 0.5 * (old.hoop + s.hoop)
    axial = 0.5 * (old.axial + s.axial)
    e_r, e_h, e_a = s.shear_radial, s.shear_hoop, s.shear_axial
    return Flow(
        Stress(s.radial, s.hoop, s.axial),
        s.multiplier,
        s.opening,
        radial * e_r + hoop * e_h + axial * e_a,
        radial * s.tensile_radial + hoop * s.tensile_hoop + axial * s.tensile_axial,
        np.sqrt(2.0 / 3.0 * (e_r * e_r + e_h * e_h + e_a * e_a)),
    )


@fused_kernel
def extent(before: float, plastic: float, shortfall: float) -> float:
    """Accumulated plastic multiplier of a zone; where it never yielded, minus the shortfall.

    Crossing zero continuously, it lets the edge of a plastic zone be found inside a zone of the
    mesh. `shortfall` (at most 0) is how much strain the trial was away from yield.
    """
    return max(before, 0.0) + plastic if plastic > 0.0 else max(before, shortfall)


@fused_kernel
def hoop_compressive(stress: Stress, ucs: float) -> bool:
    """Say whether the hoop stress is compressive after the step."""
    return stress.hoop < -_COMPRESSIVE * ucs


@fused_kernel
def squeeze_rate(
    inner: float, outer: float, inner_speed: float, outer_speed: float, per_area: float
) -> float:
    """Rate of compression [1/s] of a zone from radii [m] and velocities [m/s] of its nodes."""
    return (inner * inner_speed - outer * outer_speed) * per_area


@fused_kernel
def resist(
    d: Deformation,
    stress: Stress,
    per_second: float,
    squeeze: Squeeze,
    stiffness: float,
    density: float,
    viscosity: Viscosity,
    initial_area: float,
    inner: float,
) -> Resistance:
    """Viscous pressure, stable step and forces of a zone.

    Parameters
    ----------
    per_second : float [1/s]
        One over the step.
    squeeze : Squeeze
    stiffness : float [Pa]
        lambda + 2 G; radial compression adds to it in the Kirchhoff law.
    viscosity : Viscosity
    initial_area : float [m2]
    inner : float [m]
        Radius of the inner node.
    """
    shrinking = initial_area * d.per_area
    modulus = stiffness + abs(stress.radial)
    transit = d.width * np.sqrt(density / modulus)
    rate = -(d.radial + d.hoop) * per_second
    before, here, after = squeeze.before, squeeze.here, squeeze.after
    usual = 0.5 * (before + after)
    # What a smooth compression would be here; the rest of it is a jump.
    smooth = max(0.0, min(2.0 * min(before, after), min(usual, here)))
    jump = max(here - smooth, 0.0)
    # mean / width = mean^2 per_area
    linear = viscosity.linear * (VISCOUS_LENGTH * (d.mean * d.mean * d.per_area))
    shock = viscosity.quadratic * transit * jump
    noise = NOISE_VISCOSITY * (here - usual)
    viscous = modulus * transit * (linear * rate + shock * jump + noise) * shrinking
    # Neighbours that move against each other have twice the noise.
    damping = linear + shock + 2.0 * NOISE_VISCOSITY
    limit = transit * (np.sqrt(1.0 + damping * damping) - damping)
    upright = (d.width > 0.0) & (inner > 0.0)
    return Resistance(
        viscous,
        limit if upright else -1.0,
        (stress.radial * shrinking - viscous) * d.mean,
        0.5 * (stress.hoop * shrinking - viscous) * d.width,
    )


@fused_kernel
def viscous_work(
    d: Deformation, old_width: float, old_mean: float, before: float, after: float
) -> float:
    """Work per radian [J/m] of the viscous pressure [Pa] on the exact change of area.

    Split as the two half kicks of the nodes see it.
    """
    grown, moved = d.width - old_width, d.mean - old_mean
    return -0.5 * (
        before * (old_mean * grown + old_width * moved) + after * (d.mean * grown + d.width * moved)
    )
