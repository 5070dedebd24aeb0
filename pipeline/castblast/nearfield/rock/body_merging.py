"""Merge zones of one body; the rule and its reasons: `castblast.nearfield.rock.merging`."""

from __future__ import annotations

import numpy as np

from castblast.kernel import inline_kernel, kernel
from castblast.nearfield.rock.lagrangian import Body, FloatArray, first_zones
from castblast.nearfield.rock.ledger import VISCOUS
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
from castblast.nearfield.rock.single_plane import PlaneStrength


@kernel
def merge_body(
    body: Body, origin: IntArray, active: int, coarse: Coarse, passed: Passed, lag: float,
    load: float, density: float, planes: PlaneStrength, work: FloatArray,
) -> tuple[Body, int]:  # fmt: skip
    """Merge the zones of a body that may.

    Parameters
    ----------
    body : Body
        Changed in place.
    origin : int array
        Numbers of its nodes in the mesh before any merging, changed in place.
    active : int
        Zones in motion.
    coarse : Coarse
    passed : Passed
    lag : float [s]
        Time by which the velocities lag behind the rest.
    load : float [N]
        Of the pressure on the wall, per radian and metre.
    density : float [kg m-3]
    planes : PlaneStrength
    work : array (6,)
        The ledger; what the merging costs is viscous work.

    Returns
    -------
    body : Body
        Its remaining zones.
    active : int
        Those in motion.
    """
    last = body.width.size
    first = first_to_merge(body.initial_radius, origin, last, active, coarse, passed)
    if first == last:
        return body, active
    joined = np.zeros(last, np.bool_)
    nodes = body.initial_radius
    count = plan_merging(nodes, origin, first, last, active, coarse, passed, body.tension, joined)
    if count == 0:
        return body, active
    changed = min(first, active)
    before = _motion(body, changed, active, lag)
    moving, lost = _merge_moving(body, changed, active, joined, planes)
    merge_radii(nodes, origin, first, last, joined)
    mass, tension, at_rest = body.mass[last], body.tension[last - 1], _rock(body, last - 1)
    body = first_zones(body, last - count)
    for j in range(moving, last - count):
        _rest(body, j, at_rest, tension)
    _lay_out(body, changed, density, mass)
    _pull_all(body, changed, moving, load)
    work[VISCOUS] += before - _motion(body, changed, moving, lag) + lost
    return body, moving


@inline_kernel
def _rock(body: Body, j: int) -> Rock:
    return Rock(
        radial=body.radial[j],
        hoop=body.hoop[j],
        axial=body.axial[j],
        viscous=body.viscous[j],
        sheared=body.shear_multiplier[j],
        opened=body.tensile_multiplier[j],
        crushed=body.hoop_multiplier[j],
        strain=body.shear_strain[j],
    )


@inline_kernel
def _fill(body: Body, j: int, rock: Rock, tension: float) -> None:
    body.radial[j], body.hoop[j], body.axial[j] = rock.radial, rock.hoop, rock.axial
    body.viscous[j], body.tension[j] = rock.viscous, tension
    body.shear_multiplier[j] = rock.sheared
    body.tensile_multiplier[j] = rock.opened
    body.hoop_multiplier[j] = rock.crushed
    body.shear_strain[j] = rock.strain


@kernel
def _motion(body: Body, first: int, active: int, lag: float) -> float:
    """Kinetic energy per radian [J/m] of the nodes that merging may change."""
    total = 0.0
    for i in range(first, active):
        total += motion(body.mass[i], body.velocity[i], body.force[i], lag)
    return total


@kernel
def _merge_moving(
    body: Body, first: int, active: int, joined: BoolArray, planes: PlaneStrength
) -> tuple[int, float]:
    """Merge rock in motion; how many zones are left of it, and the elastic energy it lost."""
    out, lost = first, 0.0
    j = first
    while j < active:
        step = 2 if joined[j] else 1
        rock = _rock(body, j)
        if joined[j]:
            one, two = body.initial_area[j], body.initial_area[j + 1]
            following = _rock(body, j + 1)
            lost += elastic_loss(rock, following, one, two, planes.lame, planes.twice_shear)
            rock = merged(rock, following, one, two)
        _fill(body, out, rock, body.tension[j])
        body.radius[out], body.velocity[out] = body.radius[j], body.velocity[j]
        out += 1
        j += step
    body.radius[out], body.velocity[out] = body.radius[active], body.velocity[active]
    return out, lost


@inline_kernel
def _rest(body: Body, j: int, rock: Rock, tension: float) -> None:
    """Rock that the wave has not reached, between two nodes of the mesh."""
    nodes = body.initial_radius
    _fill(body, j, rock, tension)
    body.radius[j], body.velocity[j] = nodes[j], 0.0
    body.radius[j + 1], body.velocity[j + 1] = nodes[j + 1], 0.0
    body.force[j + 1] = 0.0


@kernel
def _lay_out(body: Body, first: int, density: float, outer_mass: float) -> None:
    """Areas, widths and masses from the radii."""
    last = body.width.size
    nodes = body.initial_radius
    for j in range(first, last):
        body.width[j] = body.radius[j + 1] - body.radius[j]
        body.mean_radius[j] = 0.5 * (body.radius[j + 1] + body.radius[j])
        body.initial_area[j] = zone_area(nodes[j], nodes[j + 1])
        body.per_initial_area[j] = 1.0 / body.initial_area[j]
        inside = body.initial_area[j - 1] if j > 0 else 0.0
        body.mass[j] = node_mass(density, inside, body.initial_area[j])
        body.per_mass[j] = 1.0 / body.mass[j]
    body.mass[last] = outer_mass
    body.per_mass[last] = 1.0 / outer_mass


@kernel
def _pull_all(body: Body, first: int, active: int, load: float) -> None:
    """Forces of the zones that merging may have changed, and of the load on the wall."""
    body.force[first] = 0.0
    for j in range(max(first - 1, 0), active):
        r = pull(_rock(body, j), body.initial_area[j], body.width[j], body.mean_radius[j])
        if j >= first:
            body.force[j] += r.through - r.around
        body.force[j + 1] = -r.through - r.around
    if first == 0:
        body.force[0] += load
