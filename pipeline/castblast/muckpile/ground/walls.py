"""Rigid walls that do not move: planes, rectangles of any extent, and triangulated surfaces.

A wall is a rectangle, possibly without end on any side, that a ball may touch on the side of its
normal. A plane is a rectangle without ends: it holds a ball however deep it is pressed in. At the
rim of a bounded wall the ball touches the nearest point of the rim, so that it rolls over an edge
smoothly; where two walls meet in a convex edge only one of them needs the rim. Facets that share
corners are one surface, see `castblast.muckpile.ground.facets`. Left out: moving walls.
"""

from __future__ import annotations

from math import inf, nan, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from castblast.kernel import inline_kernel
from castblast.muckpile.balls.contact import Vector
from castblast.muckpile.ground.facet_table import make_table
from castblast.muckpile.ground.facets import (
    FACET_FRICTION,
    FACET_ROLLING,
    WallTable,
    facet_distance,
    facet_height,
    near_facets,
)
from castblast.muckpile.ground.mend import weld, weld_distance
from castblast.types import BoolArray, FloatArray, Int32Array

__all__ = ["WallTable", "Walls", "floor", "ground_height", "join", "near_walls"]
__all__ += ["plane", "rectangle", "slope", "surface"]
__all__ += ["wall_distance", "wall_friction", "wall_table"]

#: How many radii behind a surface of facets a ball is still held: less than the thickness of any
#: body over the radius, or the far side would pull it through.
SHEET_DEPTH = 0.5


class Walls(NamedTuple):
    """All walls of a case: w planes and rectangles, and t facets.

    Attributes
    ----------
    origin : array (w, 3) [m]
    axis1, axis2, normal : array (w, 3)
        Right-handed unit vectors; balls are on the side of the normal.
    bounds : array (w, 4) [m]
        Least and largest coordinate along axis1, then along axis2; infinite where there is no end.
    friction, rolling_friction : array (w,)
        NaN: that of the contact law.
    rim : array (w,), bool
        Whether the rim of a bounded wall can be touched.
    corner : array (t, 3, 3) [m]
        Corners of each facet, counter-clockwise seen from the side of the balls.
    facet_friction, facet_rolling_friction : array (t,)
        NaN: that of the contact law.
    facet_depth : array (t,)
        How many radii behind the surface a ball is still held.
    facet_base : array (t,) [m]
        Rims of a surface that lie no higher than this cannot be touched.
    """

    origin: FloatArray
    axis1: FloatArray
    axis2: FloatArray
    normal: FloatArray
    bounds: FloatArray
    friction: FloatArray
    rolling_friction: FloatArray
    rim: BoolArray
    corner: FloatArray = np.zeros((0, 3, 3))
    facet_friction: FloatArray = np.zeros(0)
    facet_rolling_friction: FloatArray = np.zeros(0)
    facet_depth: FloatArray = np.zeros(0)
    facet_base: FloatArray = np.zeros(0)


def rectangle(
    origin: ArrayLike,
    axis1: ArrayLike,
    axis2: ArrayLike,
    bounds: ArrayLike = (-inf, inf, -inf, inf),
    friction: float = nan,
    *,
    rim: bool = True,
) -> Walls:
    """One wall; its normal is axis1 x axis2.

    Parameters
    ----------
    origin : array_like (3,) [m]
    axis1, axis2 : array_like (3,)
        Orthogonal directions, of any length.
    bounds : array_like (4,) [m]
        Extent along axis1, then along axis2, measured from the origin.
    friction : float
        Used for sliding and for rolling; NaN: that of the contact law.
    rim : bool
        Whether the rim can be touched.

    Raises
    ------
    ValueError
        The axes are not orthogonal.
    """
    first = np.asarray(axis1, dtype=np.float64)
    second = np.asarray(axis2, dtype=np.float64)
    first = first / np.linalg.norm(first)
    second = second / np.linalg.norm(second)
    if abs(first @ second) > 1e-9:
        message = "the axes of a wall must be orthogonal"
        raise ValueError(message)
    share = np.array([friction], dtype=np.float64)
    return Walls(
        origin=np.asarray(origin, dtype=np.float64).reshape(1, 3),
        axis1=first.reshape(1, 3),
        axis2=second.reshape(1, 3),
        normal=np.cross(first, second).reshape(1, 3),
        bounds=np.asarray(bounds, dtype=np.float64).reshape(1, 4),
        friction=share,
        rolling_friction=share.copy(),
        rim=np.array([rim]),
    )


def plane(point: ArrayLike, normal: ArrayLike, friction: float = nan) -> Walls:
    """Return an endless plane through `point` (3,) [m]; balls are where `normal` (3,) points."""
    up = np.asarray(normal, dtype=np.float64)
    up = up / np.linalg.norm(up)
    helper = np.zeros(3)
    helper[np.argmin(np.abs(up))] = 1.0
    first = np.cross(helper, up)
    return rectangle(point, first, np.cross(up, first), friction=friction)


def floor(height: float = 0.0) -> Walls:
    """Return the endless level floor at z = height [m]."""
    return plane((0.0, 0.0, height), (0.0, 0.0, 1.0))


def surface(
    corner: ArrayLike,
    friction: float = nan,
    *,
    depth: float = SHEET_DEPTH,
    base: float = -inf,
    welded: bool = False,
) -> Walls:
    """Facets of one surface; corners within `mend.weld_distance` become one.

    Parameters
    ----------
    corner : array_like (t, 3, 3) [m]
        Corners of each facet, counter-clockwise seen from the side of the balls.
        `castblast.muckpile.ground.terrain.surface_faults` tells whether they can be used.
    friction : float
        Used for sliding and for rolling; NaN: that of the contact law.
    depth : float [-]
        How many radii behind the surface a ball is still held.
    base : float [m]
        Rims of the surface that lie no higher than this cannot be touched: a surface that ends on
        a floor at this height goes over into it.
    welded : bool
        Neighbours are known to share their corners to the last bit.
    """
    corners = np.array(corner, dtype=np.float64).reshape(-1, 3, 3)
    corners = corners if welded else weld(corners, weld_distance(corners))[0]
    share = np.full(len(corners), friction)
    none = np.zeros((0, 3))
    return Walls(
        origin=none,
        axis1=none,
        axis2=none,
        normal=none,
        bounds=np.zeros((0, 4)),
        friction=np.zeros(0),
        rolling_friction=np.zeros(0),
        rim=np.zeros(0, dtype=np.bool_),
        corner=corners,
        facet_friction=share,
        facet_rolling_friction=share.copy(),
        facet_depth=np.full(len(share), depth),
        facet_base=np.full(len(share), base),
    )


def slope(toe_x: float, angle: float, length: float = inf) -> Walls:
    """Return a plane that rises with x from its toe on the floor.

    Parameters
    ----------
    toe_x : float [m]
    angle : float [rad]
        Over the horizontal; 30 degrees in the published case.
    length : float [m]
        Along the slope.

    Notes
    -----
    It goes on below the floor, where no ball can be, so that the floor before it is free of the
    rim that it would have there.
    """
    rise = (np.cos(angle), 0.0, np.sin(angle))
    return rectangle((toe_x, 0.0, 0.0), rise, (0.0, 1.0, 0.0), (-inf, length, -inf, inf))


def join(*walls: Walls) -> Walls:
    """Put several walls into one set."""
    return Walls(*(np.concatenate(parts) for parts in zip(*walls, strict=True)))


def ground_height(walls: Walls, x: FloatArray, y: FloatArray) -> FloatArray:
    """Height (n,) [m] of the highest wall that faces up at the places x (n,), y (n,) in plan.

    0 where there is none.
    """
    height = np.zeros(np.shape(x))
    for k in np.flatnonzero(walls.normal[:, 2] > 1e-9):
        normal, origin = walls.normal[k], walls.origin[k]
        rx, ry = x - origin[0], y - origin[1]
        rz = -(normal[0] * rx + normal[1] * ry) / normal[2]
        along = [rx * a[0] + ry * a[1] + rz * a[2] for a in (walls.axis1[k], walls.axis2[k])]
        low1, high1, low2, high2 = walls.bounds[k]
        over = (along[0] >= low1) & (along[0] <= high1)
        over &= (along[1] >= low2) & (along[1] <= high2)
        height = np.where(over, np.maximum(height, rz + origin[2]), height)
    height = np.array(height, dtype=np.float64)
    if len(walls.corner):
        table = wall_table(walls, 0.0, 0.0)
        flat = [np.ascontiguousarray(np.broadcast_to(v, height.shape), float) for v in (x, y)]
        facet_height(table, flat[0].ravel(), flat[1].ravel(), height.reshape(-1))
    return height


# Columns of `WallTable.plane`: origin, axes, normal, bounds along both axes, and the rest.
_OX, _OY, _OZ, _UX, _UY, _UZ, _VX, _VY, _VZ, _NX, _NY, _NZ = range(12)
_LOW_U, _HIGH_U, _LOW_V, _HIGH_V = 12, 13, 14, 15
_FRICTION, _ROLLING, _RIM, _ENDLESS = 16, 17, 18, 19


def wall_table(walls: Walls, friction: float, rolling_friction: float) -> WallTable:
    """Return `walls` as kernels read them; the friction of the law takes the place of none."""

    def own(values: FloatArray, law: float) -> FloatArray:
        return np.where(np.isnan(values), law, values)

    plane = [
        walls.origin,
        walls.axis1,
        walls.axis2,
        walls.normal,
        walls.bounds,
        own(walls.friction, friction),
        own(walls.rolling_friction, rolling_friction),
        walls.rim,
        np.all(np.isinf(walls.bounds), axis=1),
    ]
    return make_table(
        np.column_stack(plane).astype(np.float64),
        walls.corner,
        own(walls.facet_friction, friction),
        own(walls.facet_rolling_friction, rolling_friction),
        walls.facet_depth,
        walls.facet_base,
    )


@inline_kernel
def wall_distance(
    table: WallTable, k: int, x: float, y: float, z: float, radius: float
) -> tuple[float, Vector]:
    """Distance [m] of a ball's centre from wall `k` and the unit vector from the wall to it.

    Infinite where the ball cannot touch it. `table` is that of `wall_table`.
    """
    planes = len(table.plane)
    if k < planes:
        return _plane_distance(table.plane, k, x, y, z, radius)
    return facet_distance(table, k - planes, x, y, z, radius)


@inline_kernel
def wall_friction(table: WallTable, k: int) -> tuple[float, float]:
    """Friction and rolling friction of wall `k`."""
    planes = len(table.plane)
    if k < planes:
        return table.plane[k, _FRICTION], table.plane[k, _ROLLING]
    return table.facet[k - planes, FACET_FRICTION], table.facet[k - planes, FACET_ROLLING]


@inline_kernel
def near_walls(
    table: WallTable,
    x: float,
    y: float,
    z: float,
    reach: float,
    found: Int32Array,
    at: int,
) -> int:
    """Count the walls within `reach` of a point; write them to ``found[at:]`` if at >= 0."""
    count = 0
    planes = len(table.plane)
    for k in range(planes):
        distance, _ = _plane_distance(table.plane, k, x, y, z, reach)
        if distance < reach:
            if at >= 0:
                found[at + count] = k
            count += 1
    more = at + count if at >= 0 else -1
    return count + near_facets(table, x, y, z, reach, found, more)


@inline_kernel
def _plane_distance(
    table: FloatArray, k: int, x: float, y: float, z: float, radius: float
) -> tuple[float, Vector]:
    """Distance from plane or rectangle `k`, as in `wall_distance`.

    Over the face the distance has a sign, so that a ball pressed through a plane comes back;
    beside the face it is that to the rim. It is infinite where the ball cannot touch the wall:
    at a rim that must not be touched, and wholly behind a wall that ends somewhere.
    """
    rx, ry, rz = x - table[k, _OX], y - table[k, _OY], z - table[k, _OZ]
    s = rx * table[k, _UX] + ry * table[k, _UY] + rz * table[k, _UZ]
    t = rx * table[k, _VX] + ry * table[k, _VY] + rz * table[k, _VZ]
    h = rx * table[k, _NX] + ry * table[k, _NY] + rz * table[k, _NZ]
    over_s = s - min(max(s, table[k, _LOW_U]), table[k, _HIGH_U])
    over_t = t - min(max(t, table[k, _LOW_V]), table[k, _HIGH_V])
    if over_s == 0.0 and over_t == 0.0:
        if h < -radius and table[k, _ENDLESS] == 0.0:
            return inf, (0.0, 0.0, 1.0)
        return h, (table[k, _NX], table[k, _NY], table[k, _NZ])
    if table[k, _RIM] == 0.0:
        return inf, (0.0, 0.0, 1.0)
    distance = sqrt(h * h + over_s * over_s + over_t * over_t)
    a, b, c = over_s / distance, over_t / distance, h / distance
    return distance, (
        a * table[k, _UX] + b * table[k, _VX] + c * table[k, _NX],
        a * table[k, _UY] + b * table[k, _VY] + c * table[k, _NY],
        a * table[k, _UZ] + b * table[k, _VZ] + c * table[k, _NZ],
    )
