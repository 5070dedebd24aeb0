"""The ground under a muckpile, for pictures: a line in a section, points in a view."""

from __future__ import annotations

from typing import Any

import numpy as np

from castblast.muckpile.ground.walls import Walls, ground_height
from castblast.muckpile.results.profile import Profile
from castblast.types import FloatArray

EARTH, INK = "#DDD6CC", "#222222"
_EARTH = np.array([0.867, 0.839, 0.800])
_STEPS = 600
_LIGHT = np.array([-0.45, -0.25, 0.86])


def draw_ground_line(
    axes: Any, walls: Walls, y: float, low: float, high: float, bottom: float
) -> None:
    """Fill the ground between x = low and high [m] in the section at `y`, down to `bottom`."""
    x = np.linspace(low, high, _STEPS)
    draw_ground(axes, Profile(x, ground_height(walls, x, np.full_like(x, y))), bottom)


def draw_ground(axes: Any, ground: Profile, bottom: float) -> None:
    """Fill what is below a ground line, down to `bottom` [m]."""
    axes.fill_between(ground.x, bottom, ground.height, color=EARTH, lw=0.0, zorder=1.0)
    axes.plot(ground.x, ground.height, color=INK, lw=0.8, zorder=1.1)


def ground_points(
    walls: Walls, x_range: tuple[float, float], y_range: tuple[float, float], spacing: float
) -> tuple[FloatArray, FloatArray]:
    """Sample the ground as points (n, 3) [m] with colours (n, 3), light as by the sun.

    Where the height jumps, as at a bench face, points stand above each other without a gap.
    """
    x = np.arange(x_range[0], x_range[1] + spacing, spacing)
    y = np.arange(y_range[0], y_range[1] + spacing, spacing)
    across, along = np.meshgrid(x, y)
    height = ground_height(walls, across, along)
    slope_y, slope_x = np.gradient(height, spacing)
    steep = np.sqrt(1.0 + slope_x**2 + slope_y**2)
    lit = (_LIGHT[2] - slope_x * _LIGHT[0] - slope_y * _LIGHT[1]) / steep
    shade = np.clip(0.62 + 0.42 * lit, 0.5, 1.05)
    padded = np.pad(height, 1, mode="edge")
    lowest = np.minimum.reduce(
        [padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:], height]
    )
    copies = 1 + np.floor((height - lowest) / spacing).astype(np.int64).ravel()
    of_point = np.repeat(np.arange(height.size), copies)
    below = np.arange(len(of_point)) - np.repeat(np.cumsum(copies) - copies, copies)
    place = np.column_stack(
        [
            across.ravel()[of_point],
            along.ravel()[of_point],
            height.ravel()[of_point] - spacing * below,
        ]
    )
    tone = np.where(below > 0, 0.72, shade.ravel()[of_point])
    return place, np.clip(_EARTH * tone[:, None], 0.0, 1.0)
