"""Mesh of the annulus as a function of hole and rock, for many holes at once.

All numbers are smooth functions of the inputs, so that the mesh adds no kink to the targets. What
it costs and what it gets wrong: `pipeline/docs/mesh_study.md`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from castblast.kernel import kernel
from castblast.nearfield.case import FloatArray
from castblast.nearfield.front import passage
from castblast.nearfield.rock.lagrangian import mesh_growth

#: Paper mode: zones, width of those at the wall in hole radii at that number of zones, and share of
#: the largest stable step.
PAPER_ZONES, PAPER_WIDTH, PAPER_COURANT = 256, 0.04, 0.85
#: Equilibrium mode, for rock whose front stays elastic and for rock that yields there: zones to
#: which those of the front merge behind it, and the factor of `wall_width` for those at the wall.
EQUILIBRIUM_ZONES, EQUILIBRIUM_WIDTH = 72, 0.30
FRONT_ZONES, FRONT_WIDTH = 58, 0.25
#: Distance in hole radii over which zones stay fine.
EQUILIBRIUM_REACH = 120.0
#: Zones in the front for one behind it: at the wall of any rock, and far out in either kind.
WALL_SPLIT, ELASTIC_SPLIT, FRONT_SPLIT = 8.0, 3.0, 26.0
#: How much wider a merged zone may be than that mesh asks for.
SLACK = 1.25
#: Numbers I of the front between which the mesh passes from the one rock to the other.
EASING = (0.95, 1.6)
#: Share of the largest stable step in either kind of rock. A sharp front opens the energy balance
#: with the square of it.
ELASTIC_COURANT, FRONT_COURANT = 0.95, 0.85


class Mesh(NamedTuple):
    """Mesh of every hole, as columns (n,): see `lagrangian.graded_radii` and `merging.Coarse`.

    Attributes
    ----------
    zones : array
    first_width, reach : array [m]
    coarse_width, coarse_growth, coarse_reach : array [m, -, m]
        The mesh to which zones merge; a width of 0: they never do.
    courant : array [-]
        Share of the largest stable step.
    """

    zones: FloatArray
    first_width: FloatArray
    reach: FloatArray
    coarse_width: FloatArray
    coarse_growth: FloatArray
    coarse_reach: FloatArray
    courant: FloatArray


def paper_mesh(inner: FloatArray, zones: int) -> Mesh:
    """Geometric series of zones; `zones` of 0: the default."""
    count = zones or PAPER_ZONES
    width = PAPER_WIDTH * PAPER_ZONES / count * inner
    none, far = np.zeros_like(inner), np.full_like(inner, np.inf)
    courant = np.full_like(inner, PAPER_COURANT)
    return Mesh(np.full_like(inner, count), width, far, none, none, none, courant)


def equilibrium_mesh(
    inner: FloatArray,
    outer: FloatArray,
    run: FloatArray,
    front: FloatArray,
    zones: int,
) -> Mesh:
    """Mesh that is as fine as the front of the wave asks for.

    Parameters
    ----------
    inner, outer : array [m]
        Radii of the hole and of the outer boundary.
    run : array [hole radii]
        Travel of the p-wave while the load rises.
    front : array [-]
        The number I of the rock, see `castblast.nearfield.front`.
    zones : int
        Zones of rock whose front stays elastic, 0: the default; all meshes are refined alike.
    """
    fineness = zones / EQUILIBRIUM_ZONES if zones else 1.0
    share = passage(front, EASING)
    width = _between(FRONT_WIDTH, EQUILIBRIUM_WIDTH, share) * wall_width(run) * inner / fineness
    reach, length = EQUILIBRIUM_REACH * inner, outer - inner
    count = fineness * _between(FRONT_ZONES, EQUILIBRIUM_ZONES, share)
    growth = growths(length, count, width, reach)
    slope = growth - width / reach
    first = width / WALL_SPLIT
    fine = slope / _between(FRONT_SPLIT, ELASTIC_SPLIT, share) + first / reach
    return Mesh(
        zones=np.log1p(fine * length / (first + first / reach * length)) / fine,
        first_width=first,
        reach=reach,
        coarse_width=SLACK * width,
        coarse_growth=SLACK * slope,
        coarse_reach=reach,
        courant=_between(FRONT_COURANT, ELASTIC_COURANT, share),
    )


def _between(front: float, usual: float, share: FloatArray) -> FloatArray:
    """Pass from one positive number to another in equal ratios."""
    return np.asarray(front * (usual / front) ** share)


@kernel
def growths(
    lengths: FloatArray, zones: FloatArray, first: FloatArray, reach: FloatArray
) -> FloatArray:
    """Growth of every mesh; see `lagrangian.mesh_growth`."""
    out = np.empty_like(lengths)
    for row in range(lengths.size):
        out[row] = mesh_growth(lengths[row], zones[row], first[row], reach[row])
    return out


def wall_width(run: FloatArray) -> FloatArray:
    """How the width of the zones at the wall goes with the rise of the load [-].

    `run` is how far the p-wave travels while the load rises [hole radii]. What a coarse zone at
    the wall gets wrong is the work during the rise; the longer the wave, the wider it may be.
    """
    return np.asarray((run * run + 0.3**2) ** 0.25 / (1.0 + (run / 6.0) ** 2) ** 0.25)
