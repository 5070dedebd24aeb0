"""Ground that is no plane: surfaces from a grid of heights, checks, and what a wall cuts.

A grid of heights becomes two facets a cell, split along the diagonal with the smaller rise. Below
such ground is rock everywhere, so that a ball pressed deep into it is still held.
"""

from __future__ import annotations

from math import inf, nan

import numpy as np
from numpy.typing import ArrayLike

from castblast.kernel import kernel
from castblast.muckpile.facet_table import corner_numbers, edge_numbers
from castblast.muckpile.facets import WallTable
from castblast.muckpile.particles import FloatArray, IntArray, Particles
from castblast.muckpile.walls import (
    Walls,
    ground_height,
    join,
    near_walls,
    surface,
    wall_distance,
    wall_table,
)

#: How many radii below ground from heights a ball is still held.
GROUND_DEPTH = 3.0
#: Overlap over radius with a wall from which a ball at the start counts as cut.
CUT_SHARE = 0.10
#: Height over longest side below which a triangle is none.
_THINNEST = 1e-6
_NAMED = 3


def height_faults(x: FloatArray, y: FloatArray, height: FloatArray) -> list[str]:
    """Return every fault of a grid of heights in words; rows and columns count from 0.

    Parameters
    ----------
    x : array (nx,) [m]
    y : array (ny,) [m]
    height : array (ny, nx) [m]
    """
    faults = []
    for name, axis in (("x", x), ("y", y)):
        if axis.ndim != 1 or len(axis) < 2:
            faults.append(f"{name}: shape {axis.shape}; at least two places are needed")
        elif not np.isfinite(axis).all():
            faults.append(f"{name}: place {np.flatnonzero(~np.isfinite(axis))[0]} is not a number")
        elif not (np.diff(axis) > 0.0).all():
            first = np.flatnonzero(~(np.diff(axis) > 0.0))[0]
            faults.append(f"{name}: must rise, place {first + 1} is not above place {first}")
    if height.shape != (len(y), len(x)):
        faults.append(f"height: shape {height.shape}; (ny, nx) = ({len(y)}, {len(x)}) is needed")
    elif not np.isfinite(height).all():
        row, column = np.argwhere(~np.isfinite(height))[0]
        count = int((~np.isfinite(height)).sum())
        faults.append(
            f"height: {count} of {height.size} values are missing or not numbers, "
            f"first in row {row}, column {column}"
        )
    return faults


def heightmap(
    x: ArrayLike,
    y: ArrayLike,
    height: ArrayLike,
    friction: float = nan,
    *,
    base: float = -inf,
) -> Walls:
    """Ground from heights over a rectangular grid.

    Parameters
    ----------
    x, y : array_like (nx,), (ny,) [m]
        Places of the grid, rising.
    height : array_like (ny, nx) [m]
    friction : float
        Used for sliding and for rolling; NaN: that of the contact law.
    base : float [m]
        Level of a floor on which the ground lies: cells no higher than it are left to the floor,
        and the ground goes over into it without a rim. Where it ends higher, it ends in a vertical
        face, so that nothing comes below it from the side. Default: there is no such floor.

    Raises
    ------
    ValueError
        See `height_faults`.
    """
    places, lines = np.array(x, dtype=np.float64), np.array(y, dtype=np.float64)
    z = np.array(height, dtype=np.float64)
    if faults := height_faults(places, lines, z):
        raise ValueError("; ".join(faults))
    point = np.stack([*np.meshgrid(places, lines), z], axis=-1)
    a, b, c, d = point[:-1, :-1], point[:-1, 1:], point[1:, 1:], point[1:, :-1]
    rising = np.abs(a[..., 2] - c[..., 2]) <= np.abs(b[..., 2] - d[..., 2])
    split = rising[..., None, None]
    lower = np.where(split, np.stack([a, b, c], axis=-2), np.stack([a, b, d], axis=-2))
    upper = np.where(split, np.stack([a, c, d], axis=-2), np.stack([b, c, d], axis=-2))
    corner = np.stack([lower, upper], axis=2).reshape(-1, 3, 3)
    above = (corner[:, :, 2] > base).any(axis=1)
    ground = surface(corner[above], friction, depth=GROUND_DEPTH, base=base)
    if base == -inf:
        return ground
    return join(ground, surface(_end_faces(point, base), friction, base=base))


def _end_faces(point: FloatArray, base: float) -> FloatArray:
    """Vertical facets (t, 3, 3) [m] below the border of a grid (ny, nx, 3) [m], to below `base`.

    They hold little more than their face: behind them balls may lie in a hollow of the ground.
    """
    border = np.concatenate([point[0, :-1], point[:-1, -1], point[-1, :0:-1], point[:0:-1, 0]])
    foot = border.copy()
    foot[:, 2] = min(base, border[:, 2].min()) - 1.0
    after, foot_after = np.roll(border, -1, axis=0), np.roll(foot, -1, axis=0)
    facets = np.stack(
        [
            np.stack([foot, foot_after, after], axis=1),
            np.stack([foot, after, border], axis=1),
        ],
        axis=1,
    )
    rises = np.maximum(border[:, 2], after[:, 2]) > base
    return np.asarray(facets[rises].reshape(-1, 3, 3))


def surface_faults(corner: FloatArray) -> list[str]:
    """Return every fault of facets (t, 3, 3) [m] in words; facets count from 0.

    Facets must be triangles, meet along whole edges, two at most, be turned alike, and leave no
    hole: a surface may end, but its rim must be one.
    """
    if not len(corner):
        return ["there is no facet"]
    bad = np.flatnonzero(~np.isfinite(corner).all(axis=(1, 2)))
    if len(bad):
        return [_line(bad, "have a corner that is not a number")]
    side = np.linalg.norm(corner - np.roll(corner, -1, axis=1), axis=2).max(axis=1)
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    bad = np.flatnonzero(~(np.linalg.norm(across, axis=1) > _THINNEST * side**2))
    if len(bad):
        return [_line(bad, "have no area")]
    number, _ = corner_numbers(corner)
    edge, _, meeting = edge_numbers(number)
    faults = []
    bad = np.flatnonzero((meeting > 2)[edge].any(axis=1))
    if len(bad):
        faults.append(_line(bad, "share an edge with more than one other facet"))
    forward = number < np.roll(number, -1, axis=1)
    turns = np.zeros(len(meeting), dtype=np.int64)
    np.add.at(turns, edge.ravel(), np.where(forward, 1, -1).ravel())
    bad = np.flatnonzero(((meeting == 2) & (turns != 0))[edge].any(axis=1))
    if len(bad):
        faults.append(_line(bad, "are turned the other way than a neighbour"))
    if not faults:
        faults += _hole_faults(edge, number, meeting)
    return faults


def _hole_faults(edge: IntArray, number: IntArray, meeting: IntArray) -> list[str]:
    """Holes: rims beyond the first of every connected surface."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ends = np.stack([number, np.roll(number, -1, axis=1)], axis=-1)
    at_rim = (meeting == 1)[edge]
    if not at_rim.any():
        return []
    size = int(number.max()) + 1

    def label(pairs: IntArray) -> IntArray:
        ones = np.ones(len(pairs), dtype=np.int8)
        graph = coo_array((ones, (pairs[:, 0], pairs[:, 1])), (size, size))
        return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)

    piece, rim = label(ends.reshape(-1, 2)), label(ends[at_rim])
    facet, corner = np.nonzero(at_rim)
    starts = number[facet, corner]
    pairs, first = np.unique(
        np.column_stack([piece[starts], rim[starts]]), axis=0, return_index=True
    )
    holes = len(pairs) - len(np.unique(pairs[:, 0]))
    if holes == 0:
        return []
    # The longest rim of a piece is its outside; name a facet of the others.
    length = np.bincount(rim[starts])[pairs[:, 1]]
    order = np.lexsort((-length, pairs[:, 0]))
    later = np.flatnonzero(np.diff(pairs[order, 0]) == 0) + 1
    return [_line(np.sort(facet[first[order[later]]]), "lie at the rim of a hole")]


def _line(bad: IntArray, what: str) -> str:
    named = ", ".join(str(k) for k in bad[:_NAMED])
    more = f" and {len(bad) - _NAMED} more" if len(bad) > _NAMED else ""
    return f"facets {what}: facet {named}{more}"


def wall_faults(
    walls: Walls, particles: Particles, share: float | FloatArray = CUT_SHARE
) -> list[str]:
    """Say which walls cut into balls, or lie above balls, at the start; empty: none.

    What counts is the overlap that the simulation would feel, rims of walls and edges of facets
    included.

    Parameters
    ----------
    walls : Walls
    particles : Particles
    share : float or array (n,) [-]
        Largest overlap of a ball with a wall over its radius; see
        `castblast.muckpile.initial_state.pressed_share`.
    """
    table = wall_table(walls, 0.0, 0.0)
    place = np.ascontiguousarray(np.column_stack([particles.position, particles.radius]))
    cut, deepest = _cuts(table, place)
    planes = len(walls.origin)
    bad = deepest > share
    faults = []
    for k in np.unique(cut[bad]):
        touched = np.flatnonzero((cut == k) & bad)
        worst = int(touched[np.argmax(deepest[touched])])
        name = f"wall {k}" if k < planes else f"facet {k - planes}"
        depth = deepest[worst] * particles.radius[worst]
        faults.append(
            f"{name} cuts {_counted(touched)} of the packing; worst: ball {worst} at "
            f"{_place(particles, worst)}, {depth:.2g} m deep with a radius of "
            f"{particles.radius[worst]:.2g} m"
        )
        if len(faults) == _NAMED:
            faults.append("more walls cut balls")
            break
    under = np.flatnonzero(~bad & (particles.position[:, 2] < _ground(walls, particles)))
    if len(under):
        faults.append(
            f"{_counted(under)} of the packing below the ground; first: ball {under[0]} at "
            f"{_place(particles, int(under[0]))}"
        )
    return faults


def _ground(walls: Walls, particles: Particles) -> FloatArray:
    """Height (n,) [m] of the rock below which no ball can be; a sheet of facets is no such rock."""
    sheet = walls.facet_depth < GROUND_DEPTH
    rock = walls._replace(
        **{
            name: getattr(walls, name)[~sheet]
            for name in walls._fields
            if name == "corner" or name.startswith("facet_")
        }
    )
    lowest = (particles.position[:, 2] - particles.radius).min()
    height = ground_height(rock, particles.position[:, 0], particles.position[:, 1])
    # `ground_height` says 0 where there is nothing.
    return np.where(height == 0.0, min(lowest, 0.0), height)


def _counted(balls: IntArray) -> str:
    return f"{len(balls)} ball{'s' if len(balls) > 1 else ''}"


def _place(particles: Particles, ball: int) -> str:
    x, y, z = particles.position[ball]
    return f"({x:.2f}, {y:.2f}, {z:.2f}) m"


@kernel
def _cuts(table: WallTable, place: FloatArray) -> tuple[IntArray, FloatArray]:
    """Wall that cuts deepest into each ball and by what share of the radius; -1: none."""
    count = len(place)
    wall = np.full(count, -1)
    deepest = np.zeros(count)
    found = np.empty(len(table.plane) + len(table.facet), np.int32)
    for i in range(count):
        x, y, z, radius = place[i, 0], place[i, 1], place[i, 2], place[i, 3]
        for q in range(near_walls(table, x, y, z, radius, found, 0)):
            distance, _ = wall_distance(table, found[q], x, y, z, radius)
            overlap = (radius - distance) / radius
            if overlap > deepest[i]:
                wall[i], deepest[i] = found[q], overlap
    return wall, deepest
