"""Bench and muckpile on their ground, seen from above and aside; also the scene of an animation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.bench.geometry import Bench
from castblast.report.piles.ball_picture import Canvas, oblique
from castblast.report.piles.blocks import (
    WIDTH,
    block_colours,
    block_legend,
    origin_blocks,
    shown_range,
)
from castblast.report.piles.ground import INK, ground_points
from castblast.report.style import finished, in_style, new_figure, save_figure
from castblast.types import FloatArray

if TYPE_CHECKING:
    from castblast.muckpile.ground.walls import Walls

_VIEW_AZIMUTH, _VIEW_ELEVATION = np.radians(32.0), np.radians(30.0)


def draw_view(path: Path, before: Particles, after: Particles, bench: Bench, walls: Walls) -> Path:
    """Draw `view_figure` into a file (PNG or SVG)."""
    figure = view_figure(before, after, bench, walls)
    return save_figure(figure, path, dpi=180)


@in_style
def view_figure(before: Particles, after: Particles, bench: Bench, walls: Walls) -> Figure:
    """Draw bench and muckpile on their ground, from above and aside.

    Parameters
    ----------
    before, after : Particles
    bench : Bench
    walls : Walls
        Ground.
    """
    colours = block_colours(origin_blocks(before, bench), bench)
    scene = Scene(shown_range(before, after, 0), shown_range(before, after, 1), bench, walls)
    left, right, bottom, top = scene.extent
    height = 2.0 * WIDTH * (top - bottom) / (right - left) + 0.9
    figure, axes = new_figure(2, 1, width=WIDTH, height=min(height, 14.0))
    for panel, balls, title in ((axes[0], before, "Before"), (axes[1], after, "After")):
        scene.canvas(balls, colours).show(panel)
        panel.set_title(title)
        panel.set_axis_off()
    _draw_scale(axes[0], scene.extent)
    block_legend(figure, axes[0], bench)
    return finished(figure)


class Scene:
    """A view of bench and muckpile from above and aside, with the ground they lie on.

    Parameters
    ----------
    x, y : (float, float) [m]
        What the picture shows in plan.
    bench : Bench
    walls : Walls
    pixels : int
        Along the width.
    """

    def __init__(
        self,
        x: tuple[float, float],
        y: tuple[float, float],
        bench: Bench,
        walls: Walls,
        pixels: int = 1600,
    ) -> None:
        self.pixels = pixels
        self.view = oblique(_VIEW_AZIMUTH, _VIEW_ELEVATION)
        corners = np.array([[a, b, c] for a in x for b in y for c in (0.0, 1.05 * bench.height)])
        seen = self.view.project(corners)
        self.extent = (
            float(seen[:, 0].min()),
            float(seen[:, 0].max()),
            float(seen[:, 1].min()),
            float(seen[:, 1].max()),
        )
        self._spacing = 1.5 * (self.extent[1] - self.extent[0]) / pixels
        self._ground = ground_points(walls, x, y, self._spacing)

    def canvas(self, balls: Particles, colours: FloatArray) -> Canvas:
        """Paint ground and balls, in `colours` (n, 3 or 4)."""
        canvas = Canvas(self.view, self.extent, self.pixels)
        place, tones = self._ground
        radius = 0.9 * self._spacing
        canvas.add(place, np.full(len(place), radius), tones, flat=True)
        canvas.add(balls.position, balls.radius, colours)
        return canvas


def _draw_scale(axes: Any, extent: tuple[float, float, float, float]) -> None:
    """Draw a bar of a round length in the lower left corner."""
    left, right, bottom, top = extent
    length = 10.0 ** np.floor(np.log10(0.25 * (right - left)))
    length *= max(k for k in (1, 2, 5) if k * length <= 0.25 * (right - left))
    x, y = left + 0.03 * (right - left), bottom + 0.06 * (top - bottom)
    axes.plot([x, x + length], [y, y], color=INK, lw=2.0, zorder=3)
    axes.text(x + 0.5 * length, y, f"{length:g} m across", va="bottom", ha="center", fontsize=8)
