"""Walls as LIGGGHTS takes them: endless planes along the axes, and triangles for all the rest."""

from __future__ import annotations

from math import nan
from typing import NamedTuple

import numpy as np

from castblast.muckpile.ground.walls import Walls
from castblast.types import FloatArray

#: Half side [m] of what stands for an endless wall before it is clipped.
_ENDLESS = 1e6


class WallKind(NamedTuple):
    """All walls of one friction.

    Attributes
    ----------
    friction, rolling_friction : float
        NaN: that of the contact law.
    planes : list of str
        Words of primitive walls, such as ``zplane 0``.
    corner : array (t, 3, 3) [m]
        Triangles.
    """

    friction: float
    rolling_friction: float
    planes: list[str]
    corner: FloatArray


def wall_kinds(walls: Walls, low: FloatArray, high: FloatArray) -> list[WallKind]:
    """Sort walls by friction; triangles end at the corners `low` and `high` (3,) [m] of a box."""
    # No friction is negative: -1 stands for that of the law, for NaN is equal to nothing.
    share = np.nan_to_num(np.column_stack([walls.friction, walls.rolling_friction]), nan=-1.0)
    facet_share = np.nan_to_num(
        np.column_stack([walls.facet_friction, walls.facet_rolling_friction]), nan=-1.0
    )
    kinds = []
    for pair in np.unique(np.vstack([share, facet_share]), axis=0):
        mine = [int(k) for k in np.flatnonzero((share == pair).all(axis=1))]
        planes = {k: _axis_plane(walls, k) for k in mine}
        made = [_triangles(walls, k, low, high) for k in mine if not planes[k]]
        corner = np.concatenate([*made, walls.corner[(facet_share == pair).all(axis=1)]])
        friction, rolling = (float(v) if v >= 0.0 else nan for v in pair)
        kinds.append(WallKind(friction, rolling, [w for w in planes.values() if w], corner))
    return kinds


def _axis_plane(walls: Walls, k: int) -> str:
    """Words of wall `k` if it is an endless plane across an axis; otherwise empty."""
    axis = int(np.argmax(np.abs(walls.normal[k])))
    if not np.isinf(walls.bounds[k]).all() or abs(walls.normal[k, axis]) < 1.0 - 1e-12:
        return ""
    return f"{'xyz'[axis]}plane {walls.origin[k, axis]:.17g}"


def _triangles(walls: Walls, k: int, low: FloatArray, high: FloatArray) -> FloatArray:
    """Triangles (t, 3, 3) [m] of the part of wall `k` that lies in the box."""
    a1, b1, a2, b2 = np.clip(walls.bounds[k], -_ENDLESS, _ENDLESS)
    plan = np.array([[a1, a2], [b1, a2], [b1, b2], [a1, b2]])
    corner = walls.origin[k] + plan[:, :1] * walls.axis1[k] + plan[:, 1:] * walls.axis2[k]
    for axis in range(3):
        corner = _clip(corner, corner[:, axis] - low[axis])
        corner = _clip(corner, high[axis] - corner[:, axis])
    fan = [corner[[0, i, i + 1]] for i in range(1, len(corner) - 1)]
    return np.array(fan).reshape(-1, 3, 3)


def _clip(corner: FloatArray, inside: FloatArray) -> FloatArray:
    """Cut a convex polygon (c, 3) to where `inside` (c,) is not negative (Sutherland, Hodgman)."""
    kept = []
    for k in range(len(corner)):
        before, here = inside[k - 1], inside[k]
        if (before < 0.0) != (here < 0.0):
            share = before / (before - here)
            kept.append(corner[k - 1] + share * (corner[k] - corner[k - 1]))
        if here >= 0.0:
            kept.append(corner[k])
    return np.array(kept).reshape(-1, 3)


def stl_text(corner: FloatArray, name: str) -> str:
    """Text STL of triangles (t, 3, 3) [m]."""
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    lines = [f"solid {name}"]
    for way, points in zip(normal, corner, strict=True):
        lines.append("facet normal " + " ".join(f"{v:.9g}" for v in way))
        lines.append("outer loop")
        lines += ["vertex " + " ".join(f"{v:.12g}" for v in point) for point in points]
        lines.append("endloop\nendfacet")
    return "\n".join([*lines, f"endsolid {name}"]) + "\n"
