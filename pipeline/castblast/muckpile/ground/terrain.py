"""Ground that is no plane: surfaces from a grid of heights, checks, and what a wall cuts.

A grid of heights becomes two facets a cell, split along the diagonal with the smaller rise. Below
such ground is rock everywhere, so that a ball pressed deep into it is still held.
"""

from __future__ import annotations

from math import inf, nan

import numpy as np
from numpy.typing import ArrayLike

from castblast.kernel import kernel
from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.ground.facet_table import corner_numbers, edge_numbers
from castblast.muckpile.ground.facets import WallTable
from castblast.muckpile.ground.walls import (
    Walls,
    ground_height,
    join,
    near_walls,
    surface,
    wall_distance,
    wall_table,
)
from castblast.types import BoolArray, FloatArray, IntArray

#: How many radii below ground from heights a ball is still held.
GROUND_DEPTH = 3.0
#: Overlap over radius with a wall from which a ball at the start counts as cut.
CUT_SHARE = 0.10
#: Height over longest side below which a triangle is none.
_THINNEST = 1e-6
_NAMED = 3


def complete_cells(height: FloatArray) -> BoolArray:
    """Cells (ny - 1, nx - 1) of a grid of heights (ny, nx) with a height at all four corners."""
    known = np.isfinite(height)
    return known[:-1, :-1] & known[:-1, 1:] & known[1:, :-1] & known[1:, 1:]


def missing_heights(height: FloatArray) -> str:
    """Say how many heights (ny, nx) are missing and what is left out for it; empty: none."""
    missing = int((~np.isfinite(height)).sum())
    if not missing:
        return ""
    cells = int((~complete_cells(height)).sum())
    return (
        f"{missing} height{'s' if missing > 1 else ''} missing of {height.size}: "
        f"{cells} of {(height.shape[0] - 1) * (height.shape[1] - 1)} cells have a missing corner "
        f"and make no facet"
    )


def _missing_faults(height: FloatArray) -> list[str]:
    """Heights may be missing at the border only, where the surface may end."""
    from scipy.ndimage import label

    known = np.isfinite(height)
    if known.all():
        return []
    row, column = np.argwhere(~known)[0]
    complete = complete_cells(height)
    place = f"first in row {row}, column {column}"
    count = f"height: {(~known).sum()} of {height.size} values are missing or not numbers"
    if not complete.any():
        return [f"{count}, {place}; no cell has all four corners"]
    gap, _ = label(~complete, structure=np.ones((3, 3)))
    outside = np.unique(np.concatenate([gap[0], gap[-1], gap[:, 0], gap[:, -1]]))
    inside = ~np.isin(gap, outside) & ~complete
    if not inside.any():
        return []
    # Any cell of a hole has a missing corner; name the first of them.
    around = np.zeros(height.shape, np.bool_)
    for i in (0, 1):
        for j in (0, 1):
            around[i : i + inside.shape[0], j : j + inside.shape[1]] |= inside
    row, column = np.argwhere(around & ~known)[0]
    return [
        f"{count}; they leave a hole, first in row {row}, column {column}: fill it, since balls "
        f"would fall to the floor in it"
    ]


def height_faults(x: FloatArray, y: FloatArray, height: FloatArray) -> list[str]:
    """Return every fault of a grid of heights in words; rows and columns count from 0.

    A height that is no number is missing: no fault at the border, see `missing_heights`.

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
    elif min(height.shape) > 1:
        faults += _missing_faults(height)
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
        NaN where it is missing: cells with such a corner make no facet.
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
    complete = complete_cells(z)
    above = (corner[:, :, 2] > base).any(axis=1) & np.repeat(complete.ravel(), 2)
    ground = surface(corner[above], friction, depth=GROUND_DEPTH, base=base, welded=True)
    if base == -inf:
        return ground
    ends = _end_faces(*_border(point, complete), base)
    return join(ground, surface(ends, friction, base=base, welded=True))


def _border(point: FloatArray, complete: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Starts and ends (k, 3) [m] of the edges around the cells of a grid (ny, nx, 3) that are."""
    ring = np.concatenate([point[0, :-1], point[:-1, -1], point[-1, :0:-1], point[:0:-1, 0]])
    cells = [complete[0], complete[:, -1], complete[-1, ::-1], complete[::-1, 0]]
    there = np.concatenate(cells)
    start, end = [ring[there]], [np.roll(ring, -1, axis=0)[there]]
    # Edges inside the grid, as those of its rim counter-clockwise around the cell that is there.
    up, right = complete[:-1] & ~complete[1:], complete[:, :-1] & ~complete[:, 1:]
    down, left = complete[1:] & ~complete[:-1], complete[:, 1:] & ~complete[:, :-1]
    west, east = point[1:-1, :-1], point[1:-1, 1:]
    south, north = point[:-1, 1:-1], point[1:, 1:-1]
    start += [west[down], south[right], east[up], north[left]]
    end += [east[down], north[right], west[up], south[left]]
    return np.concatenate(start), np.concatenate(end)


def _end_faces(border: FloatArray, after: FloatArray, base: float) -> FloatArray:
    """Vertical facets (t, 3, 3) [m] below edges from `border` to `after` (k, 3), to below `base`.

    They hold little more than their face: behind them balls may lie in a hollow of the ground.
    """
    foot, foot_after = border.copy(), after.copy()
    foot[:, 2] = foot_after[:, 2] = min(base, border[:, 2].min()) - 1.0
    facets = np.stack(
        [
            np.stack([foot, foot_after, after], axis=1),
            np.stack([foot, after, border], axis=1),
        ],
        axis=1,
    )
    rises = np.maximum(border[:, 2], after[:, 2]) > base
    return np.asarray(facets[rises].reshape(-1, 3, 3))


def surface_faults(corner: FloatArray, source: IntArray | None = None) -> list[str]:
    """Return every fault of facets (t, 3, 3) [m] in words; facets count from 0.

    Facets must be triangles, meet along whole edges, two at most, be turned alike, and leave no
    hole: a surface may end, but its rim must be one. Facets are named by `source` (t,), if given.
    """
    named = np.arange(len(corner)) if source is None else source

    def line(bad: IntArray, what: str) -> str:
        return f"facets {what}: {named_facets(named[bad])}"

    if not len(corner):
        return ["there is no facet"]
    bad = np.flatnonzero(~np.isfinite(corner).all(axis=(1, 2)))
    if len(bad):
        return [line(bad, "have a corner that is not a number")]
    side = np.linalg.norm(corner - np.roll(corner, -1, axis=1), axis=2).max(axis=1)
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    bad = np.flatnonzero(~(np.linalg.norm(across, axis=1) > _THINNEST * side**2))
    if len(bad):
        return [line(bad, "have no area")]
    number, _ = corner_numbers(corner)
    edge, _, meeting = edge_numbers(number)
    faults = []
    bad = np.flatnonzero((meeting > 2)[edge].any(axis=1))
    if len(bad):
        faults.append(line(bad, "share an edge with more than one other facet"))
    forward = number < np.roll(number, -1, axis=1)
    turns = np.zeros(len(meeting), dtype=np.int64)
    np.add.at(turns, edge.ravel(), np.where(forward, 1, -1).ravel())
    bad = np.flatnonzero(((meeting == 2) & (turns != 0))[edge].any(axis=1))
    if len(bad):
        faults.append(line(bad, "are turned the other way than a neighbour"))
    if not faults:
        holes = _holes(edge, number, meeting)
        faults += [line(holes, "lie at the rim of a hole")] if len(holes) else []
    return faults


def _holes(edge: IntArray, number: IntArray, meeting: IntArray) -> IntArray:
    """A facet of each hole: rims beyond the longest of every connected surface."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ends = np.stack([number, np.roll(number, -1, axis=1)], axis=-1)
    at_rim = (meeting == 1)[edge]
    if not at_rim.any():
        return np.zeros(0, np.int64)
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
        return np.zeros(0, np.int64)
    # The longest rim of a piece is its outside; name a facet of the others.
    length = np.bincount(rim[starts])[pairs[:, 1]]
    order = np.lexsort((-length, pairs[:, 0]))
    later = np.flatnonzero(np.diff(pairs[order, 0]) == 0) + 1
    return np.sort(facet[first[order[later]]])


def named_facets(bad: IntArray) -> str:
    """Write the first of some numbers of facets: ``facet 3, 7, 8 and 12 more``."""
    named = ", ".join(str(k) for k in bad[:_NAMED])
    more = f" and {len(bad) - _NAMED} more" if len(bad) > _NAMED else ""
    return f"facet {named}{more}"


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
        `castblast.muckpile.bench.given.pressed_share`.
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
