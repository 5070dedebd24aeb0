"""Rigid walls that do not move: planes and rectangles of any extent.

A wall is a rectangle, possibly without end on any side, that a ball may touch on the side of its
normal. A plane is a rectangle without ends: it holds a ball however deep it is pressed in. At the
rim of a bounded wall the ball touches the nearest point of the rim, so that it rolls over an edge
smoothly; where two walls meet in a convex edge only one of them needs the rim. Left out: moving
walls and triangulated terrain.
"""

from __future__ import annotations

from math import inf, nan, pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from castblast.kernel import kernel
from castblast.muckpile.bench import Bench
from castblast.muckpile.contact import Vector
from castblast.muckpile.particles import FloatArray


class Walls(NamedTuple):
    """All walls of a case; row k of every array is wall k.

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
    """

    origin: FloatArray
    axis1: FloatArray
    axis2: FloatArray
    normal: FloatArray
    bounds: FloatArray
    friction: FloatArray
    rolling_friction: FloatArray
    rim: NDArray[np.bool_]


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
        np.asarray(origin, dtype=np.float64).reshape(1, 3),
        first.reshape(1, 3),
        second.reshape(1, 3),
        np.cross(first, second).reshape(1, 3),
        np.asarray(bounds, dtype=np.float64).reshape(1, 4),
        share,
        share.copy(),
        np.array([rim]),
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


def slope(toe_x: float, angle: float, length: float = inf) -> Walls:
    """Return a plane that rises with x from its toe on the floor.

    Parameters
    ----------
    toe_x : float [m]
    angle : float [rad]
        Over the horizontal; 30 degrees in the published case.
    length : float [m]
        Along the slope.
    """
    rise = (np.cos(angle), 0.0, np.sin(angle))
    return rectangle((toe_x, 0.0, 0.0), rise, (0.0, 1.0, 0.0), (0.0, length, -inf, inf))


def join(*walls: Walls) -> Walls:
    """Put several walls into one set."""
    return Walls(*(np.concatenate(parts) for parts in zip(*walls, strict=True)))


def bench_walls(
    bench: Bench,
    *,
    rear: bool = True,
    ends: str = "open",
    slope_distance: float | None = None,
    slope_angle: float = pi / 6.0,
) -> Walls:
    """Floor and what stands around a bench.

    Parameters
    ----------
    bench : Bench
    rear : bool
        Intact rock behind the bench, with the ground on top of it.
    ends : {"open", "wall", "mirror"}
        At both ends of the bench: nothing; intact rock beside the bench, as high as it;
        frictionless planes of any extent, i.e. the bench is a slice of a long one.
    slope_distance : float, optional [m]
        From the face to the toe of a slope that faces the bench; None: no slope.
    slope_angle : float [rad]

    Raises
    ------
    ValueError
        `ends` is not one of the three words.
    """
    width, length, height = bench.width, bench.length, bench.height
    parts = [floor()]
    if rear:
        parts.append(
            rectangle((-width, 0, 0), (0, 1, 0), (0, 0, 1), (-inf, inf, -inf, height), rim=False)
        )
        parts.append(rectangle((-width, 0, height), (1, 0, 0), (0, 1, 0), (-inf, 0, -inf, inf)))
    if ends == "wall":
        parts += [_end_rock(0.0, -1.0, height), _end_rock(length, 1.0, height)]
    elif ends == "mirror":
        parts.append(plane((0, 0, 0), (0, 1, 0), friction=0.0))
        parts.append(plane((0, length, 0), (0, -1, 0), friction=0.0))
    elif ends != "open":
        message = f"ends = {ends!r}: must be 'open', 'wall' or 'mirror'"
        raise ValueError(message)
    if slope_distance is not None:
        parts.append(slope(slope_distance, slope_angle))
    return join(*parts)


def _end_rock(y: float, side: float, height: float) -> Walls:
    """Intact rock beyond the end `y` of a bench, outwards along `side` (-1 or 1): three walls."""
    beyond = (-inf, 0.0) if side < 0.0 else (0.0, inf)
    flank = (
        rectangle((0, y, 0), (0, 0, 1), (1, 0, 0), (-inf, height, -inf, 0), rim=False)
        if side < 0.0
        else rectangle((0, y, 0), (1, 0, 0), (0, 0, 1), (-inf, 0, -inf, height), rim=False)
    )
    front = rectangle((0, y, 0), (0, 1, 0), (0, 0, 1), (*beyond, -inf, height))
    top = rectangle((0, y, height), (1, 0, 0), (0, 1, 0), (-inf, 0, *beyond))
    return join(flank, front, top)


def without_nan(walls: Walls, friction: float, rolling_friction: float) -> Walls:
    """Return `walls` with the friction of the law where they have none of their own."""
    return walls._replace(
        friction=np.where(np.isnan(walls.friction), friction, walls.friction),
        rolling_friction=np.where(
            np.isnan(walls.rolling_friction), rolling_friction, walls.rolling_friction
        ),
    )


@kernel
def wall_distance(
    walls: Walls, k: int, x: float, y: float, z: float, radius: float
) -> tuple[float, Vector]:
    """Distance [m] of a ball's centre from wall `k` and the unit vector from the wall to it.

    Over the face the distance has a sign, so that a ball pressed through a plane comes back;
    beside the face it is that to the rim. It is infinite where the ball cannot touch the wall:
    at a rim that must not be touched, and wholly behind a wall that ends somewhere.
    """
    rx, ry, rz = x - walls.origin[k, 0], y - walls.origin[k, 1], z - walls.origin[k, 2]
    s = rx * walls.axis1[k, 0] + ry * walls.axis1[k, 1] + rz * walls.axis1[k, 2]
    t = rx * walls.axis2[k, 0] + ry * walls.axis2[k, 1] + rz * walls.axis2[k, 2]
    h = rx * walls.normal[k, 0] + ry * walls.normal[k, 1] + rz * walls.normal[k, 2]
    over_s = s - min(max(s, walls.bounds[k, 0]), walls.bounds[k, 1])
    over_t = t - min(max(t, walls.bounds[k, 2]), walls.bounds[k, 3])
    if over_s == 0.0 and over_t == 0.0:
        if h < -radius and not np.all(np.isinf(walls.bounds[k])):
            return inf, (0.0, 0.0, 1.0)
        return h, (walls.normal[k, 0], walls.normal[k, 1], walls.normal[k, 2])
    if not walls.rim[k]:
        return inf, (0.0, 0.0, 1.0)
    distance = sqrt(h * h + over_s * over_s + over_t * over_t)
    a, b, c = over_s / distance, over_t / distance, h / distance
    return distance, (
        a * walls.axis1[k, 0] + b * walls.axis2[k, 0] + c * walls.normal[k, 0],
        a * walls.axis1[k, 1] + b * walls.axis2[k, 1] + c * walls.normal[k, 1],
        a * walls.axis1[k, 2] + b * walls.axis2[k, 2] + c * walls.normal[k, 2],
    )
