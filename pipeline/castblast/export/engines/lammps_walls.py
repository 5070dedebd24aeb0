"""Walls as LAMMPS regions: endless planes, and boxes of rock put together from their faces.

A bounded wall stands for the face of a body. LAMMPS knows bodies only, so the walls along the axes
are joined into boxes that reach without end behind them; a box must have a wall for every face.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from castblast.muckpile.ground.walls import Walls
from castblast.types import FloatArray


class WallRegion(NamedTuple):
    """A region as LAMMPS defines it.

    Attributes
    ----------
    name : str
    words : str
        Style and arguments of the ``region`` command.
    friction, rolling_friction : float
        NaN: that of the contact law.
    """

    name: str
    words: str
    friction: float
    rolling_friction: float


def wall_regions(walls: Walls) -> tuple[list[WallRegion], list[str]]:
    """Return the regions of all planes and boxes, and what cannot be one, in words."""
    regions: list[WallRegion] = []
    boxes: dict[tuple[float, ...], list[int]] = {}
    faults = []
    for k in range(len(walls.origin)):
        if np.isinf(walls.bounds[k]).all():
            place = " ".join(f"{v:.17g}" for v in (*walls.origin[k], *walls.normal[k]))
            regions.append(_region(walls, k, f"plane {place}"))
        elif (box := _box_behind(walls, k)) is None:
            faults.append(f"wall {k} is bounded and does not stand along the axes")
        else:
            boxes.setdefault(tuple(box.ravel()), []).append(k)
    for ends, faces in boxes.items():
        if len(faces) != np.isfinite(ends).sum():
            named = ", ".join(map(str, faces))
            faults.append(f"wall {named}: other faces of the rock behind it are missing")
            continue
        shown = " ".join("INF" if np.isinf(v) else f"{v:.17g}" for v in ends)
        regions.append(_region(walls, faces[0], f"block {shown} side out"))
    return regions, faults


def _region(walls: Walls, k: int, words: str) -> WallRegion:
    return WallRegion(f"wall{k}", words, float(walls.friction[k]), float(walls.rolling_friction[k]))


def _box_behind(walls: Walls, k: int) -> FloatArray | None:
    """Ends (3, 2) [m] of the box of which wall `k` is a face; None if it has no such box."""
    axes = np.stack([walls.axis1[k], walls.axis2[k], walls.normal[k]])
    direction = np.argmax(np.abs(axes), axis=1)
    sign = np.sign(axes[np.arange(3), direction])
    if not np.allclose(np.abs(axes).max(axis=1), 1.0, atol=1e-12):
        return None
    ends = np.array([*walls.bounds[k].reshape(2, 2), [-np.inf, 0.0]])
    box = np.empty((3, 2))
    for row, axis in enumerate(direction):
        box[axis] = np.sort(walls.origin[k, axis] + sign[row] * ends[row])
    return box + 0.0
