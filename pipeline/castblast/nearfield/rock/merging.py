r"""Zones merge behind the front of the wave: fine where it is steep, coarse where it has passed.

Rock that yields in the wave front (see `castblast.nearfield.front`) needs zones there a quarter as
wide as rock whose front stays elastic. Behind the front they are wasted. Every `EVERY` steps
neighbouring zones j and j + 1 therefore become one, if they are the two halves of one in a mesh
with half as many zones and it is no wider than

    min( (w + g y) (1 + y / l),  TRAIL (s - GAP w_j) )

where y is the distance from the wall, s how far the pair lies behind the place that the p-wave from
the wall has reached, and w_j the width of zone j, all in initial radii. The first bound is the
width that a graded mesh has there (see `graded_radii`), the second keeps the front out of it; it no
longer counts once the wall has turned back. `TRAIL` of 0.2, or a gap of 5, falsifies the pressure
by 2 to 5 percent. Only halves of one zone merge, so that where the edges of zones can lie does not
depend on the rock: a surrogate is fitted to the results, and pairs formed from the wall outwards
change all at once with the first of them.

Mass, area and the velocities of the nodes that stay are kept exactly; stress, viscous pressure and
accumulated strains are averages over the initial area. The node between the two loses its motion
and the stresses their difference; both energies are booked as viscous work, so the ledger stays
closed. Rock at rest is made anew from its radii. The outermost zone never merges.
"""

from __future__ import annotations

from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from castblast.kernel import fused_kernel, inline_kernel, kernel
from castblast.nearfield.rock.zone import Resistance

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]

#: Steps between two looks for zones to merge.
EVERY: Final = 8
#: Width of a merged zone over its distance behind the front, and zones in front of it that stay.
TRAIL: Final = 0.09
GAP: Final = 10.0


class Coarse(NamedTuple):
    """Widths up to which zones merge where the front has passed: (first + growth y)(1 + y / reach).

    Attributes
    ----------
    first : float [m]
        Width at the wall; 0: no zones merge.
    growth : float [-]
    reach : float [m]
    """

    first: float
    growth: float
    reach: float


class Passed(NamedTuple):
    """How far the wave has come.

    Attributes
    ----------
    wall : float [m]
        Initial radius of the wall.
    front : float [m]
        Initial radius that the p-wave has reached.
    turned : bool
        The wall has turned back.
    """

    wall: float
    front: float
    turned: bool


class Rock(NamedTuple):
    """What a zone is filled with; see `lagrangian.Body`."""

    radial: float
    hoop: float
    axial: float
    viscous: float
    sheared: float
    opened: float
    crushed: float
    strain: float


@fused_kernel
def may_merge(coarse: Coarse, passed: Passed, inner: float, middle: float, outer: float) -> bool:
    """Say whether two neighbouring zones, by their initial radii [m], become one."""
    y = 0.5 * (inner + outer) - passed.wall
    widest = (coarse.first + coarse.growth * y) * (1.0 + y / coarse.reach)
    behind = passed.front - outer - GAP * (middle - inner)
    trailing = widest if passed.turned else TRAIL * behind
    return outer - inner <= min(widest, trailing)


@fused_kernel
def zone_area(inner: float, outer: float) -> float:
    """Area per radian [m2] of a zone."""
    return (outer - inner) * (0.5 * (outer + inner))


@fused_kernel
def node_mass(density: float, inside: float, outside: float) -> float:
    """Mass per radian [kg] of a node between zones of two initial areas [m2]."""
    return 0.5 * density * inside + 0.5 * density * outside


@fused_kernel
def _extents(one: float, two: float, first: float, second: float) -> float:
    """Mean of two accumulated multipliers; of two zones that never yielded the nearer to it."""
    both = first * max(one, 0.0) + second * max(two, 0.0)
    return both if both > 0.0 else max(one, two)


@fused_kernel
def merged(one: Rock, two: Rock, area_one: float, area_two: float) -> Rock:
    """Two zones as one, by their initial areas [m2]."""
    f = area_one / (area_one + area_two)
    g = 1.0 - f
    return Rock(
        radial=f * one.radial + g * two.radial,
        hoop=f * one.hoop + g * two.hoop,
        axial=f * one.axial + g * two.axial,
        viscous=f * one.viscous + g * two.viscous,
        sheared=_extents(one.sheared, two.sheared, f, g),
        opened=_extents(one.opened, two.opened, f, g),
        crushed=_extents(one.crushed, two.crushed, f, g),
        strain=f * one.strain + g * two.strain,
    )


@fused_kernel
def elastic_loss(
    one: Rock, two: Rock, area_one: float, area_two: float, lame: float, twice_shear: float
) -> float:
    """Elastic energy [J/m per radian] that two zones lose with the difference of their stresses."""
    radial, hoop, axial = one.radial - two.radial, one.hoop - two.hoop, one.axial - two.axial
    mean = (radial + hoop + axial) / 3.0
    r, h, a = radial - mean, hoop - mean, axial - mean
    bulk = lame + twice_shear / 3.0
    density = mean * mean / (2.0 * bulk) + (r * r + h * h + a * a) / (2.0 * twice_shear)
    return area_one * area_two / (area_one + area_two) * density


@fused_kernel
def pull(rock: Rock, area: float, width: float, mean: float) -> Resistance:
    """Forces of a zone on its nodes; see `zone.resist`."""
    shrinking = area * (1.0 / (width * mean))
    return Resistance(
        viscous=rock.viscous,
        limit=0.0,
        through=(rock.radial * shrinking - rock.viscous) * mean,
        around=0.5 * (rock.hoop * shrinking - rock.viscous) * width,
    )


@fused_kernel
def motion(mass: float, velocity: float, force: float, lag: float) -> float:
    """Kinetic energy per radian [J/m] of a node, as the leapfrog keeps it.

    That is half the mass times the velocities in the middle of the last and of the next step.
    """
    return 0.5 * mass * velocity * (velocity + 2.0 * lag * force / mass)


@inline_kernel
def _halves(origin: IntArray, j: int) -> bool:
    """Say whether zones `j` and `j + 1` are the halves of one of a mesh with half the zones."""
    fine = origin[j + 1] - origin[j]
    return bool(origin[j + 2] - origin[j + 1] == fine and origin[j] % (2 * fine) == 0)


@inline_kernel
def _mergeable(
    nodes: FloatArray, origin: IntArray, j: int, active: int, coarse: Coarse, passed: Passed
) -> bool:
    """Say whether zones `j` and `j + 1` become one; rock in motion and at rest stay apart."""
    if j + 1 == active or not _halves(origin, j):
        return False
    return may_merge(coarse, passed, nodes[j], nodes[j + 1], nodes[j + 2])


@kernel
def first_to_merge(
    nodes: FloatArray, origin: IntArray, last: int, active: int, coarse: Coarse, passed: Passed
) -> int:
    """First zone that may merge with the next; `last` if there is none."""
    for j in range(last - 2):
        if nodes[j] > passed.front and not passed.turned:
            break
        if _mergeable(nodes, origin, j, active, coarse, passed):
            return j
    return last


@kernel
def plan_merging(
    nodes: FloatArray, origin: IntArray, first: int, last: int, active: int, coarse: Coarse,
    passed: Passed, tension: FloatArray, joined: BoolArray,
) -> int:  # fmt: skip
    """Mark the zones that merge with the next one.

    Rock of unlike tensile strength stays apart.

    Parameters
    ----------
    nodes : array (last + 1,) [m]
        Initial radii.
    origin : int array (last + 1,)
        Numbers of these nodes in the mesh before any merging.
    first : int
        No zone before it merges.
    last, active : int
        Zones, and those in motion.
    tension : array (active,) [Pa]
    joined : bool array (last,)
        Filled.

    Returns
    -------
    int
        How many zones merge with the next one.
    """
    count = 0
    joined[:last] = False
    j = first
    while j < last - 2 and (passed.turned or nodes[j] < passed.front):
        if j >= active or tension[j] == tension[min(j + 1, active - 1)]:
            joined[j] = _mergeable(nodes, origin, j, active, coarse, passed)
        if joined[j]:
            count += 1
            j += 1
        j += 1
    return count


@kernel
def merge_radii(
    nodes: FloatArray, origin: IntArray, first: int, last: int, joined: BoolArray
) -> None:
    """Take the nodes inside of merged zones out of the initial radii, in place."""
    out = first
    for j in range(first, last + 1):
        if j == first or not joined[j - 1]:
            nodes[out], origin[out] = nodes[j], origin[j]
            out += 1
