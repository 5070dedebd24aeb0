"""The bench in plan: a polygon whose free edges lean back, so that its section shrinks upwards.

An edge runs from its corner to the next one, counter-clockwise seen from above, with the rock on
its left. Free edges are faces that lean back by the face angle; all others are vertical. At the
height z every corner has moved along a straight line, where its two leaning planes meet, so that
one shift per corner describes the whole body. Left out: faces that are not plane, and benches
whose floor or top is not level.
"""

from __future__ import annotations

from math import pi, sin, tan
from typing import NamedTuple

import numpy as np

from castblast.types import FloatArray

FREE, ROCK, OPEN = "free", "rock", "open"
EDGE_KINDS = (FREE, ROCK, OPEN)
#: An edge faces the throw, or away from it, if its normal lies within 60 degrees of it.
_FACING = 0.5


class Outline(NamedTuple):
    """A body between a polygon on the floor and its section at any height; m corners.

    Attributes
    ----------
    corner : array (m, 2) [m]
        On the floor, counter-clockwise.
    lean : array (m, 2) [-]
        Way of each corner per height.
    normal : array (m, 2)
        Of edge k from corner k to corner k + 1, horizontal and outwards.
    sine : array (m,)
        Of the angle of each edge over the horizontal; 1: vertical.
    """

    corner: FloatArray
    lean: FloatArray
    normal: FloatArray
    sine: FloatArray


def default_edges(corner: FloatArray) -> tuple[str, ...]:
    """Kinds of edges (m,): free towards the throw, rock behind the bench, open at its ends."""
    ahead = edge_normals(corner)[:, 0]
    return tuple(FREE if x > _FACING else ROCK if x < -_FACING else OPEN for x in ahead)


def make_outline(corner: FloatArray, edges: tuple[str, ...], face_angle: float) -> Outline:
    """Put together a body whose free edges stand at `face_angle` [rad]; see `check_polygon`."""
    normal = edge_normals(corner)
    leaning = (np.array(edges) == FREE) & (face_angle < pi / 2.0)
    back = np.where(leaning, 1.0 / tan(min(face_angle, 1.57)), 0.0)
    sine = np.where(leaning, sin(face_angle), 1.0)
    return Outline(corner=corner, lean=_corner_shift(normal, back), normal=normal, sine=sine)


def edge_normals(corner: FloatArray) -> FloatArray:
    """Outward unit normals (m, 2) of the edges of a counter-clockwise polygon (m, 2)."""
    along = np.roll(corner, -1, axis=0) - corner
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = along / np.where(length > 0.0, length, 1.0)
    return np.column_stack([along[:, 1], -along[:, 0]])


def _corner_shift(normal: FloatArray, inwards: FloatArray) -> FloatArray:
    """Move (m, 2) of each corner when every edge moves `inwards` (m,) along its normal.

    Corners on a straight line have one condition, twice; the least move that meets it is taken.
    """
    before = np.roll(normal, 1, axis=0)
    shift = np.empty_like(normal)
    for k in range(len(normal)):
        sides = np.stack([before[k], normal[k]])
        shift[k] = np.linalg.pinv(sides, rcond=1e-9) @ -np.array([inwards[k - 1], inwards[k]])
    return shift


def section_at(outline: Outline, height: float) -> FloatArray:
    """Corners (m, 2) [m] of the section at `height` [m]."""
    return np.asarray(outline.corner + height * outline.lean)


def shrink(outline: Outline, distance: float) -> Outline:
    """Move every edge inwards by `distance` [m] in plan."""
    shift = _corner_shift(outline.normal, np.full(len(outline.normal), distance))
    return outline._replace(corner=outline.corner + shift)


def polygon_area(corner: FloatArray) -> float:
    """Area [m2] of a polygon (m, 2), negative if it runs clockwise."""
    following = np.roll(corner, -1, axis=0)
    return float(0.5 * np.sum(corner[:, 0] * following[:, 1] - corner[:, 1] * following[:, 0]))


def outline_volume(outline: Outline, height: float) -> float:
    """Volume [m3] up to `height` [m]; exact, since the area is quadratic in the height."""
    low, middle, high = (
        polygon_area(section_at(outline, share * height)) for share in (0.0, 0.5, 1.0)
    )
    return height * (low + 4.0 * middle + high) / 6.0


def is_convex(outline: Outline) -> bool:
    """Whether no corner points into the bench; then each edge is the border of a half-space."""
    turn = _cross(np.roll(outline.normal, 1, axis=0), outline.normal)
    return bool(np.all(turn > -1e-9))


def depth_inside(outline: Outline, position: FloatArray) -> FloatArray:
    """Distance (n,) [m] of points (n, 3) from the nearest side, negative outside.

    Beside an inward corner between leaning faces it is a close lower bound.
    """
    x, y, z = position[:, 0], position[:, 1], position[:, 2]
    best = np.full(len(position), np.inf)
    scaled = np.empty(len(position))
    inside = np.zeros(len(position), dtype=np.bool_)
    count = len(outline.corner)
    for k in range(count):
        n = (k + 1) % count
        ax, ay = (outline.corner[k][:, None] + z * outline.lean[k][:, None])[:2]
        bx, by = (outline.corner[n][:, None] + z * outline.lean[n][:, None])[:2]
        ex, ey = bx - ax, by - ay
        along = np.clip(((x - ax) * ex + (y - ay) * ey) / (ex * ex + ey * ey), 0.0, 1.0)
        distance = np.hypot(x - ax - along * ex, y - ay - along * ey)
        nearer = distance < best
        scaled[nearer] = distance[nearer] * outline.sine[k]
        best = np.minimum(best, distance)
        crosses = (ay > y) != (by > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            inside ^= crosses & (x < ax + (y - ay) * ex / ey)
    return np.where(inside, scaled, -scaled)


def check_polygon(corner: FloatArray, edges: tuple[str, ...], face_angle: float, height: float,
                  ) -> list[str]:  # fmt: skip
    """Return every fault of a bench polygon in words; empty: none."""
    count = len(corner)
    if corner.ndim != 2 or corner.shape[1:] != (2,) or count < 3:
        return ["outline: at least three corners (x, y) are needed"]
    if not np.all(np.isfinite(corner)):
        return ["outline: a corner is not a finite number"]
    faults = [
        f"outline: corners {k + 1} and {(k + 1) % count + 1} are the same point"
        for k in range(count)
        if np.linalg.norm(corner[k] - corner[(k + 1) % count]) < 1e-9
    ]
    if faults:
        return faults
    if crossing := _crossing_edges(corner):
        return [f"outline: edges {crossing[0] + 1} and {crossing[1] + 1} cross"]
    if polygon_area(corner) <= 0.0:
        return ["outline: the corners must run counter-clockwise, seen from above"]
    if len(edges) != count or any(kind not in EDGE_KINDS for kind in edges):
        return [f"edges: one of {', '.join(EDGE_KINDS)} is needed for each of {count} edges"]
    if FREE not in edges:
        faults.append("edges: none of them is free: there is nowhere to throw the rock")
    outline = make_outline(corner, edges, face_angle)
    base = np.roll(corner, -1, axis=0) - corner
    top = section_at(outline, height)
    length = np.sum((np.roll(top, -1, axis=0) - top) * base, axis=1)
    # A flat corner between a leaning and a vertical edge cannot close.
    back = np.where(outline.sine < 1.0, 1.0 / tan(min(face_angle, 1.57)), 0.0)
    open_corner = np.abs(np.sum(outline.lean * outline.normal, axis=1) + back) > 1e-6
    if np.any(length <= 0.0) or np.any(open_corner) or _crossing_edges(top):
        faults.append(
            f"face_angle = {np.degrees(face_angle):.4g} deg: the leaning faces of the outline "
            f"would meet or part below the crest, {height:g} m high"
        )
    return faults


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _crossing_edges(corner: FloatArray) -> tuple[int, int] | None:
    """Numbers of the first two edges that cross or touch without being neighbours."""
    count = len(corner)
    following = np.roll(corner, -1, axis=0)
    for i in range(count):
        for j in range(i + 2, count):
            if (j + 1) % count == i:
                continue
            a, b, c, d = corner[i], following[i], corner[j], following[j]
            parts = _cross(b - a, c - a) * _cross(b - a, d - a)
            whole = _cross(d - c, a - c) * _cross(d - c, b - c)
            if parts <= 0.0 and whole <= 0.0 and _boxes_meet(a, b, c, d):
                return i, j
    return None


def _boxes_meet(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> bool:
    low = np.maximum(np.minimum(a, b), np.minimum(c, d))
    high = np.minimum(np.maximum(a, b), np.maximum(c, d))
    return bool(np.all(low <= high + 1e-12))
