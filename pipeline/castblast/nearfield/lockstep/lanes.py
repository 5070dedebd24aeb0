"""Sixteen annuli in lockstep: the layout of their state and the sweeps that advance it.

One lane is one annulus. Each takes its own step of time, all take it at once: the innermost loops
run over lanes, every lane does the same branch-free arithmetic (`castblast.nearfield.rock.zone`),
and the compiler turns them into vector instructions. The rare zone that one yield plane cannot
return is done lane by lane in between.

**Layout.** One flat array holds all zones; the block of zone j holds its variables row by row, each
a row of `LANES` numbers, so that a zone is one stretch of memory (a layout by variable would map
all variables of a zone to the same cache sets). A second flat array holds what a lane has once:
constants, clocks, sums, scratch. Two arrays and constant offsets are all the compiler has to tell
apart; with one array per variable it would give up.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from castblast.kernel import fused_kernel, kernel, lean_kernel
from castblast.nearfield.rock.lagrangian import Body, FloatArray, Material, after_opening
from castblast.nearfield.rock.mohr_coulomb import IntArray, YieldModel, edge_return
from castblast.nearfield.rock.single_plane import PlaneStrength
from castblast.nearfield.rock.zone import (
    Deformation,
    Squeeze,
    Stress,
    Viscosity,
    deform,
    edge_flow,
    elastic,
    extent,
    hoop_compressive,
    per_area_between,
    resist,
    squeeze_rate,
    try_one_plane,
    viscous_work,
)

LANES: Final = 16

# Rows of a zone; its inner node is counted to it.
_ZONE_ROWS: Final = 17
(
    RADIUS, VELOCITY, FORCE, PER_MASS, WIDTH, MEAN, RADIAL, HOOP, AXIAL, VISCOUS, TENSION, AREA,
    PER_AREA, SHEARED, OPENED, CRUSHED, STRAIN,
) = (row * LANES for row in range(_ZONE_ROWS))  # fmt: skip
#: Numbers in the block of a zone.
BLOCK: Final = _ZONE_ROWS * LANES

# Rows of what a lane has once: constants, the step, sums; then scratch of the zone at hand.
_LANE_ROWS: Final = 46
(
    FRICTION, DILATION, LAME, TWICE_SHEAR, STIFFNESS, SHEAR_COMPLIANCE, TENSILE_COMPLIANCE,
    SHEAR_STRAIN, UCS, DENSITY, LINEAR, QUADRATIC, BRITTLE, ACTIVE, KICK, STEP, PER_SECOND,
    LIMIT, FASTEST, SHEAR_WORK, TENSILE_WORK, VISCOUS_WORK, INNER, NEW_WIDTH, NEW_MEAN,
    NEW_PER_AREA, RADIAL_STRAIN, HOOP_STRAIN, NEW_RADIAL, NEW_HOOP, NEW_AXIAL, FLOW_SHEAR,
    FLOW_OPENING, FLOW_SHEAR_WORK, FLOW_TENSILE_WORK, FLOW_STRAIN, NOW_UCS, NOW_TENSION,
    SHEAR_SHORTFALL, TENSILE_SHORTFALL, UNSOLVED, LAST, BEFORE, HERE,
    KICKED, AHEAD,
) = (row * LANES for row in range(_LANE_ROWS))  # fmt: skip


class EdgeModels(NamedTuple):
    """What returns to edges and corners need of the rock of every lane; see `YieldModel`.

    Attributes
    ----------
    size : int array (LANES, 11)
    inverse : array (LANES, 11, 3, 3) [1/Pa]
    """

    size: IntArray
    inverse: FloatArray


@kernel
def lane_array_sizes(zones: int) -> tuple[int, int]:
    """Lengths of the array of so many zones in motion and of that of the lanes.

    The last zone has an outer node and looks at the compression of a zone beyond it.
    """
    return (zones + 2) * BLOCK, _LANE_ROWS * LANES


@lean_kernel
def kick_and_move(zones: FloatArray, lanes: FloatArray, nodes: int) -> None:
    """Advance the velocity of every node in motion by its kick, then all nodes by the step."""
    for j in range(nodes):
        block = j * BLOCK
        for lane in range(LANES):
            velocity, force = zones[block + VELOCITY + lane], zones[block + FORCE + lane]
            gained = lanes[KICK + lane] * force * zones[block + PER_MASS + lane]
            kicked = velocity + gained
            # The outermost node of a lane with fewer zones has moved with its boundary.
            inside = j < lanes[ACTIVE + lane]
            lanes[KICKED + lane] += force * gained if inside else 0.0
            zones[block + VELOCITY + lane] = kicked if inside else velocity
            zones[block + RADIUS + lane] += lanes[STEP + lane] * kicked if inside else 0.0


@fused_kernel
def _planes(lanes: FloatArray, lane: int) -> PlaneStrength:
    return PlaneStrength(
        lanes[FRICTION + lane], lanes[DILATION + lane], lanes[LAME + lane],
        lanes[TWICE_SHEAR + lane], lanes[STIFFNESS + lane], lanes[SHEAR_COMPLIANCE + lane],
        lanes[TENSILE_COMPLIANCE + lane], lanes[SHEAR_STRAIN + lane],
    )  # fmt: skip


@fused_kernel
def _old_stress(zones: FloatArray, here: int) -> Stress:
    return Stress(zones[here + RADIAL], zones[here + HOOP], zones[here + AXIAL])


@fused_kernel
def _per_area(zones: FloatArray, here: int) -> float:
    return per_area_between(zones[here + RADIUS], zones[here + BLOCK + RADIUS])


@fused_kernel
def _squeeze_rate(zones: FloatArray, here: int, per_area: float) -> float:
    outer = here + BLOCK
    return squeeze_rate(
        zones[here + RADIUS], zones[outer + RADIUS], zones[here + VELOCITY],
        zones[outer + VELOCITY], per_area,
    )  # fmt: skip


@fused_kernel
def _strain_and_return(zones: FloatArray, lanes: FloatArray, j: int) -> int:
    """Strain, elastic trial and return by one plane of zone `j` in all lanes, into scratch.

    Returns
    -------
    int
        0 if that was all; else some lanes are marked `UNSOLVED`.
    """
    unsolved = 0
    block = j * BLOCK
    for lane in range(LANES):
        here = block + lane
        planes = _planes(lanes, lane)
        inner = zones[here + RADIUS]
        d = deform(
            inner, zones[here + BLOCK + RADIUS], lanes[AHEAD + lane], zones[here + WIDTH],
            zones[here + MEAN],
        )  # fmt: skip
        old = _old_stress(zones, here)
        swelling = d.width * d.mean * zones[here + PER_AREA]
        t = try_one_plane(
            planes, elastic(planes, d, old), old, swelling, lanes[UCS + lane],
            zones[here + TENSION],
        )  # fmt: skip
        flow = t.flow
        lanes[INNER + lane] = inner
        lanes[NEW_WIDTH + lane] = d.width
        lanes[NEW_MEAN + lane] = d.mean
        lanes[NEW_PER_AREA + lane] = d.per_area
        lanes[RADIAL_STRAIN + lane] = d.radial
        lanes[HOOP_STRAIN + lane] = d.hoop
        lanes[NEW_RADIAL + lane] = flow.stress.radial
        lanes[NEW_HOOP + lane] = flow.stress.hoop
        lanes[NEW_AXIAL + lane] = flow.stress.axial
        lanes[FLOW_SHEAR + lane] = flow.shear
        lanes[FLOW_OPENING + lane] = flow.opening
        lanes[FLOW_SHEAR_WORK + lane] = flow.shear_work
        lanes[FLOW_TENSILE_WORK + lane] = flow.tensile_work
        lanes[FLOW_STRAIN + lane] = flow.strain
        lanes[NOW_UCS + lane] = t.ucs
        lanes[NOW_TENSION + lane] = t.tension
        lanes[SHEAR_SHORTFALL + lane] = t.shear_shortfall
        lanes[TENSILE_SHORTFALL + lane] = t.tensile_shortfall
        solved = t.solved | (j >= lanes[ACTIVE + lane])
        lanes[UNSOLVED + lane] = 0.0 if solved else 1.0
        unsolved += 0 if solved else 1
    return unsolved


@fused_kernel
def _flow_and_resist(zones: FloatArray, lanes: FloatArray, j: int) -> None:
    """Take over the scratch of zone `j`: flow, viscosity, work and nodal forces."""
    block = j * BLOCK
    for lane in range(LANES):
        here = block + lane
        # A zone not yet reached does not count; beyond the last one there is none.
        reached = j < lanes[ACTIVE + lane]
        d = Deformation(
            lanes[NEW_WIDTH + lane], lanes[NEW_MEAN + lane], lanes[NEW_PER_AREA + lane],
            lanes[RADIAL_STRAIN + lane], lanes[HOOP_STRAIN + lane],
        )  # fmt: skip
        old_width, old_mean, area = zones[here + WIDTH], zones[here + MEAN], zones[here + AREA]
        stress = Stress(lanes[NEW_RADIAL + lane], lanes[NEW_HOOP + lane], lanes[NEW_AXIAL + lane])
        shear, opening = lanes[FLOW_SHEAR + lane], lanes[FLOW_OPENING + lane]
        shear_shortfall = lanes[SHEAR_SHORTFALL + lane]
        crushed = zones[here + CRUSHED]
        zones[here + RADIAL] = stress.radial
        zones[here + HOOP] = stress.hoop
        zones[here + AXIAL] = stress.axial
        zones[here + WIDTH] = d.width
        zones[here + MEAN] = d.mean
        zones[here + SHEARED] = extent(zones[here + SHEARED], shear, shear_shortfall)
        zones[here + OPENED] = extent(
            zones[here + OPENED], opening, lanes[TENSILE_SHORTFALL + lane]
        )
        zones[here + CRUSHED] = (
            extent(crushed, shear, shear_shortfall)
            if hoop_compressive(stress, lanes[NOW_UCS + lane])
            else crushed
        )
        zones[here + STRAIN] += lanes[FLOW_STRAIN + lane]
        zones[here + TENSION] = after_opening(
            lanes[BRITTLE + lane] > 0.0, opening, zones[here + TENSION]
        )
        rate = lanes[HERE + lane]
        ahead = _per_area(zones, here + BLOCK)
        following = (
            _squeeze_rate(zones, here + BLOCK, ahead) if j + 1 < lanes[LAST + lane] else rate
        )
        lanes[AHEAD + lane] = ahead
        r = resist(
            d, stress, lanes[PER_SECOND + lane], Squeeze(lanes[BEFORE + lane], rate, following),
            lanes[STIFFNESS + lane], lanes[DENSITY + lane],
            Viscosity(lanes[LINEAR + lane], lanes[QUADRATIC + lane]), area, lanes[INNER + lane],
        )  # fmt: skip
        lanes[BEFORE + lane], lanes[HERE + lane] = rate, following
        shear_work, tensile_work = lanes[FLOW_SHEAR_WORK + lane], lanes[FLOW_TENSILE_WORK + lane]
        spent = viscous_work(d, old_width, old_mean, zones[here + VISCOUS], r.viscous)
        lanes[SHEAR_WORK + lane] += area * shear_work if reached else 0.0
        lanes[TENSILE_WORK + lane] += area * tensile_work if reached else 0.0
        lanes[VISCOUS_WORK + lane] += spent if reached else 0.0
        zones[here + VISCOUS] = r.viscous if reached else 0.0
        lanes[LIMIT + lane] = min(lanes[LIMIT + lane], r.limit if reached else np.inf)
        fastest = max(abs(d.radial), abs(d.hoop))
        lanes[FASTEST + lane] = max(lanes[FASTEST + lane], fastest if reached else 0.0)
        zones[here + FORCE] += r.through - r.around if reached else 0.0
        zones[here + BLOCK + FORCE] = -r.through - r.around


@kernel
def update_lanes(
    zones: FloatArray, lanes: FloatArray, active: int, edges: EdgeModels, fallbacks: IntArray
) -> None:
    """Update the first `active` zones of all lanes after a move; see `lagrangian.update_zones`.

    `LIMIT` and `FASTEST` hold the bounds of the step afterwards. Zones that a lane has not reached
    are computed along and change nothing.
    """
    for lane in range(LANES):
        zones[FORCE + lane] = 0.0
        lanes[AHEAD + lane] = _per_area(zones, lane)
        lanes[HERE + lane] = _squeeze_rate(zones, lane, lanes[AHEAD + lane])
        lanes[BEFORE + lane] = lanes[HERE + lane]
    for j in range(active):
        if _strain_and_return(zones, lanes, j) > 0:
            _return_to_edges(zones, lanes, j * BLOCK, edges, fallbacks)
        _flow_and_resist(zones, lanes, j)


@kernel
def _return_to_edges(
    zones: FloatArray, lanes: FloatArray, block: int, edges: EdgeModels, fallbacks: IntArray
) -> None:
    """Correct the scratch of the lanes whose zone one plane could not return."""
    for lane in range(LANES):
        if lanes[UNSOLVED + lane] == 0.0:
            continue
        model = YieldModel(_planes(lanes, lane), edges.size[lane], edges.inverse[lane])
        # An unsolved zone has kept its trial stress.
        s = edge_return(
            model, lanes[NEW_RADIAL + lane], lanes[NEW_HOOP + lane], lanes[NEW_AXIAL + lane],
            lanes[NOW_UCS + lane], lanes[NOW_TENSION + lane],
        )  # fmt: skip
        flow = edge_flow(s, _old_stress(zones, block + lane))
        fallbacks[lane] += 1 if s.fallback else 0
        lanes[NEW_RADIAL + lane] = flow.stress.radial
        lanes[NEW_HOOP + lane] = flow.stress.hoop
        lanes[NEW_AXIAL + lane] = flow.stress.axial
        lanes[FLOW_SHEAR + lane] = flow.shear
        lanes[FLOW_OPENING + lane] = flow.opening
        lanes[FLOW_SHEAR_WORK + lane] = flow.shear_work
        lanes[FLOW_TENSILE_WORK + lane] = flow.tensile_work
        lanes[FLOW_STRAIN + lane] = flow.strain


@kernel
def load_lane(
    zones: FloatArray, lanes: FloatArray, edges: EdgeModels, lane: int, body: Body,
    material: Material, model: YieldModel, count: int,
) -> None:  # fmt: skip
    """Put an annulus at time zero into a lane: its constants and its first `count` zones."""
    planes = model.planes
    lanes[FRICTION + lane], lanes[DILATION + lane] = planes.friction, planes.dilation
    lanes[LAME + lane], lanes[TWICE_SHEAR + lane] = planes.lame, planes.twice_shear
    lanes[STIFFNESS + lane] = planes.stiffness
    lanes[SHEAR_COMPLIANCE + lane] = planes.shear_compliance
    lanes[TENSILE_COMPLIANCE + lane] = planes.tensile_compliance
    lanes[SHEAR_STRAIN + lane] = planes.shear_strain
    lanes[UCS + lane], lanes[DENSITY + lane] = material.ucs, material.density
    lanes[LINEAR + lane] = material.linear_viscosity
    lanes[QUADRATIC + lane] = material.quadratic_viscosity
    lanes[BRITTLE + lane] = 1.0 if material.brittle else 0.0
    for row in (SHEAR_WORK, TENSILE_WORK, VISCOUS_WORK):
        lanes[row + lane] = 0.0
    for k in range(model.size.size):
        edges.size[lane, k] = model.size[k]
        for i in range(3):
            for j in range(3):
                edges.inverse[lane, k, i, j] = model.inverse[k, i, j]
    lanes[LAST + lane] = body.width.size
    for j in range(count + 1):
        here = j * BLOCK + lane
        zones[here + RADIUS] = body.radius[j]
        zones[here + VELOCITY] = body.velocity[j]
        zones[here + FORCE] = body.force[j]
        zones[here + PER_MASS] = body.per_mass[j]
        if j == count:
            break
        zones[here + WIDTH], zones[here + MEAN] = body.width[j], body.mean_radius[j]
        zones[here + RADIAL], zones[here + HOOP] = body.radial[j], body.hoop[j]
        zones[here + AXIAL], zones[here + VISCOUS] = body.axial[j], body.viscous[j]
        zones[here + TENSION], zones[here + AREA] = body.tension[j], body.initial_area[j]
        zones[here + PER_AREA] = body.per_initial_area[j]
        zones[here + SHEARED] = body.shear_multiplier[j]
        zones[here + OPENED] = body.tensile_multiplier[j]
        zones[here + CRUSHED] = body.hoop_multiplier[j]
        zones[here + STRAIN] = body.shear_strain[j]


@kernel
def unload_lane(zones: FloatArray, lane: int, active: int, body: Body) -> None:
    """Copy the zones of a lane that are in motion into a body at rest."""
    for j in range(active + 1):
        here = j * BLOCK + lane
        body.radius[j] = zones[here + RADIUS]
        body.velocity[j] = zones[here + VELOCITY]
        body.force[j] = zones[here + FORCE]
        if j == active:
            break
        body.width[j], body.mean_radius[j] = zones[here + WIDTH], zones[here + MEAN]
        body.radial[j], body.hoop[j] = zones[here + RADIAL], zones[here + HOOP]
        body.axial[j], body.viscous[j] = zones[here + AXIAL], zones[here + VISCOUS]
        body.tension[j] = zones[here + TENSION]
        body.shear_multiplier[j] = zones[here + SHEARED]
        body.tensile_multiplier[j] = zones[here + OPENED]
        body.hoop_multiplier[j] = zones[here + CRUSHED]
        body.shear_strain[j] = zones[here + STRAIN]


@kernel
def clear_lane(zones: FloatArray, lanes: FloatArray, lane: int) -> None:
    """Empty a lane: rock of unit size at rest, for which the sweeps do harmless arithmetic."""
    for row in range(_LANE_ROWS):
        lanes[row * LANES + lane] = 0.0
    for row in (FRICTION, DILATION, STIFFNESS, DENSITY, UCS, PER_SECOND):
        lanes[row + lane] = 1.0
    for j in range(zones.size // BLOCK):
        here = j * BLOCK + lane
        for row in range(_ZONE_ROWS):
            zones[here + row * LANES] = 0.0
        zones[here + RADIUS], zones[here + MEAN] = j + 0.5, j + 1.0
        for row in (WIDTH, AREA, PER_AREA):
            zones[here + row] = 1.0
