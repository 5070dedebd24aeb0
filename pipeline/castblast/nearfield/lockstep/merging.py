"""Zones of a lane that come and go: rock that the wave reaches, and zones that merge behind it.

The blocks of a lane hold the zones in motion and the first one at rest. Of the rock beyond there
are only the initial radii, which make it; those of the zones in motion stand before them. Merging
does to the blocks of a lane what `castblast.nearfield.rock.body_merging` does to a body, from the
same functions in the same order: see `castblast.nearfield.rock.merging`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from castblast.kernel import inline_kernel, kernel
from castblast.nearfield.lockstep.lanes import (
    AREA,
    AXIAL,
    BLOCK,
    CRUSHED,
    DENSITY,
    FORCE,
    HOOP,
    LAME,
    LAST,
    MEAN,
    OPENED,
    PER_AREA,
    PER_MASS,
    RADIAL,
    RADIUS,
    SHEARED,
    STRAIN,
    TENSION,
    TWICE_SHEAR,
    VELOCITY,
    VISCOUS,
    VISCOUS_WORK,
    WIDTH,
)
from castblast.nearfield.rock.lagrangian import FloatArray
from castblast.nearfield.rock.merging import (
    BoolArray,
    Coarse,
    IntArray,
    Passed,
    Rock,
    elastic_loss,
    first_to_merge,
    merge_radii,
    merged,
    motion,
    node_mass,
    plan_merging,
    pull,
    zone_area,
)


class AtRest(NamedTuple):
    """Rock that no wave has reached.

    Attributes
    ----------
    stress : float [Pa]
        Isotropic, tension positive.
    tension : float [Pa]
    sheared, opened : float [-]
        Minus the strains by which it falls short of yielding.
    """

    stress: float
    tension: float
    sheared: float
    opened: float


@inline_kernel
def _mass(nodes: FloatArray, j: int, density: float) -> float:
    """Mass per radian [kg] of node `j`, which has a zone outside it."""
    inside = zone_area(nodes[j - 1], nodes[j]) if j > 0 else 0.0
    return node_mass(density, inside, zone_area(nodes[j], nodes[j + 1]))


@kernel
def load_at_rest(
    zones: FloatArray, rows: FloatArray, lane: int, j: int, nodes: FloatArray, rest: AtRest
) -> None:
    """Put zone `j` of a lane, which the wave will reach next, and its nodes into its block."""
    here = j * BLOCK + lane
    inner, outer = nodes[j], nodes[j + 1]
    area = zone_area(inner, outer)
    zones[here + RADIUS], zones[here + VELOCITY] = inner, 0.0
    zones[here + BLOCK + RADIUS], zones[here + BLOCK + VELOCITY] = outer, 0.0
    zones[here + BLOCK + FORCE] = 0.0
    zones[here + PER_MASS] = 1.0 / _mass(nodes, j, rows[DENSITY + lane])
    zones[here + WIDTH], zones[here + MEAN] = outer - inner, 0.5 * (outer + inner)
    zones[here + AREA], zones[here + PER_AREA] = area, 1.0 / area
    rock = Rock(
        radial=rest.stress,
        hoop=rest.stress,
        axial=rest.stress,
        viscous=0.0,
        sheared=rest.sheared,
        opened=rest.opened,
        crushed=rest.sheared,
        strain=0.0,
    )
    _fill(zones, here, rock, rest.tension)


@kernel
def merge_lane(
    zones: FloatArray, rows: FloatArray, lane: int, active: int, nodes: FloatArray,
    origin: IntArray, rest: AtRest, coarse: Coarse, passed: Passed, lag: float, load: float,
) -> int:  # fmt: skip
    """Merge the zones of a lane that may; the number left in motion.

    Parameters
    ----------
    zones, rows : array
        See `castblast.nearfield.lockstep.lanes`.
    lane, active : int
    nodes : array [m]
        Initial radii of the lane, changed in place.
    origin : int array
        Numbers of these nodes in the mesh before any merging, changed in place.
    rest : AtRest
    coarse : Coarse
    passed : Passed
    lag : float [s]
        Time by which the velocities lag behind the rest.
    load : float [N]
        Of the pressure on the wall, per radian and metre.
    """
    last = int(rows[LAST + lane])
    first = first_to_merge(nodes, origin, last, active, coarse, passed)
    if first == last:
        return active
    tension = np.empty(active)
    for j in range(active):
        tension[j] = zones[j * BLOCK + lane + TENSION]
    joined = np.zeros(last, np.bool_)
    count = plan_merging(nodes, origin, first, last, active, coarse, passed, tension, joined)
    if count == 0:
        return active
    changed = min(first, active)
    before = _motion(zones, rows, lane, changed, active, nodes, lag)
    moving, lost = _merge_moving(zones, rows, lane, changed, active, joined)
    merge_radii(nodes, origin, first, last, joined)
    rows[LAST + lane] = last - count
    _lay_out(zones, rows, lane, changed, moving, nodes)
    if moving < last - count:
        load_at_rest(zones, rows, lane, moving, nodes, rest)
    _pull_all(zones, lane, changed, moving, load)
    after = _motion(zones, rows, lane, changed, moving, nodes, lag)
    rows[VISCOUS_WORK + lane] += before - after + lost
    return moving


@inline_kernel
def _rock(zones: FloatArray, here: int) -> Rock:
    return Rock(
        radial=zones[here + RADIAL],
        hoop=zones[here + HOOP],
        axial=zones[here + AXIAL],
        viscous=zones[here + VISCOUS],
        sheared=zones[here + SHEARED],
        opened=zones[here + OPENED],
        crushed=zones[here + CRUSHED],
        strain=zones[here + STRAIN],
    )


@inline_kernel
def _fill(zones: FloatArray, here: int, rock: Rock, tension: float) -> None:
    zones[here + RADIAL], zones[here + HOOP] = rock.radial, rock.hoop
    zones[here + AXIAL], zones[here + VISCOUS] = rock.axial, rock.viscous
    zones[here + TENSION], zones[here + SHEARED] = tension, rock.sheared
    zones[here + OPENED], zones[here + CRUSHED] = rock.opened, rock.crushed
    zones[here + STRAIN] = rock.strain


@kernel
def _motion(
    zones: FloatArray, rows: FloatArray, lane: int, first: int, active: int, nodes: FloatArray,
    lag: float,
) -> float:  # fmt: skip
    """Kinetic energy per radian [J/m] of the nodes that merging may change."""
    density, total = rows[DENSITY + lane], 0.0
    for i in range(first, active):
        here = i * BLOCK + lane
        mass = _mass(nodes, i, density)
        total += motion(mass, zones[here + VELOCITY], zones[here + FORCE], lag)
    return total


@kernel
def _merge_moving(
    zones: FloatArray, rows: FloatArray, lane: int, first: int, active: int, joined: BoolArray
) -> tuple[int, float]:
    """Merge rock in motion; how many zones are left of it, and the elastic energy it lost."""
    lame, twice_shear = rows[LAME + lane], rows[TWICE_SHEAR + lane]
    out, lost = first, 0.0
    j = first
    while j < active:
        here, to = j * BLOCK + lane, out * BLOCK + lane
        step = 2 if joined[j] else 1
        rock = _rock(zones, here)
        if joined[j]:
            one, two = zones[here + AREA], zones[here + BLOCK + AREA]
            following = _rock(zones, here + BLOCK)
            lost += elastic_loss(rock, following, one, two, lame, twice_shear)
            rock = merged(rock, following, one, two)
        _fill(zones, to, rock, zones[here + TENSION])
        zones[to + RADIUS], zones[to + VELOCITY] = zones[here + RADIUS], zones[here + VELOCITY]
        out += 1
        j += step
    here, to = active * BLOCK + lane, out * BLOCK + lane
    zones[to + RADIUS], zones[to + VELOCITY] = zones[here + RADIUS], zones[here + VELOCITY]
    return out, lost


@kernel
def _lay_out(
    zones: FloatArray, rows: FloatArray, lane: int, first: int, active: int, nodes: FloatArray
) -> None:
    """Areas, widths and masses of the rock in motion from the radii."""
    density = rows[DENSITY + lane]
    for j in range(first, active):
        here = j * BLOCK + lane
        inner, outer = zones[here + RADIUS], zones[here + BLOCK + RADIUS]
        area = zone_area(nodes[j], nodes[j + 1])
        zones[here + WIDTH], zones[here + MEAN] = outer - inner, 0.5 * (outer + inner)
        zones[here + AREA], zones[here + PER_AREA] = area, 1.0 / area
        zones[here + PER_MASS] = 1.0 / _mass(nodes, j, density)


@kernel
def _pull_all(zones: FloatArray, lane: int, first: int, active: int, load: float) -> None:
    """Forces of the zones that merging may have changed, and of the load on the wall."""
    zones[first * BLOCK + lane + FORCE] = 0.0
    for j in range(max(first - 1, 0), active):
        here = j * BLOCK + lane
        r = pull(_rock(zones, here), zones[here + AREA], zones[here + WIDTH], zones[here + MEAN])
        if j >= first:
            zones[here + FORCE] += r.through - r.around
        zones[here + BLOCK + FORCE] = -r.through - r.around
    if first == 0:
        zones[lane + FORCE] += load
