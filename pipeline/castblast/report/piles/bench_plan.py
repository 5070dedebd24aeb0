"""A bench before the blast in plan: its outline, blocks, firing times and directions."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from castblast.muckpile.bench.geometry import Bench, bench_outline
from castblast.report.piles.bench_lines import draw_faces
from castblast.report.piles.blocks import WIDTH
from castblast.report.piles.ground import INK
from castblast.report.style import finished, in_style, new_figure
from castblast.types import FloatArray

#: Length of the longest arrow as a share of the distance of two blocks: one ends before the next.
_ARROW = 0.6


@in_style
def bench_figure(
    title: str, bench: Bench, place: FloatArray, delay: FloatArray, velocity: FloatArray
) -> Figure:
    """Draw a bench in plan.

    Parameters
    ----------
    title : str
    bench : Bench
    place : array (b, 2) [m]
        Middle of each block, or its hole.
    delay : array (b,) [s]
        Infinite for what is never fired.
    velocity : array (b, 3) [m s-1]
    """
    corner = bench_outline(bench).corner
    ring = np.concatenate([corner, corner[:1]])
    margin = 0.5 * bench.spacing
    low, high = corner.min(axis=0) - margin, corner.max(axis=0) + margin
    across = float((high[0] - low[0]) / (high[1] - low[1]))
    figure, axes = new_figure(width=WIDTH, height=min(max(0.8 * WIDTH * across + 1.3, 2.6), 10.0))
    axes.plot(ring[:, 1], ring[:, 0], color=INK, lw=1.0)
    draw_faces(axes, bench, along_first=True)
    fired = np.isfinite(delay)
    points = axes.scatter(
        place[fired, 1], place[fired, 0], c=delay[fired] * 1e3, cmap="viridis", s=36, zorder=3
    )
    if not fired.all():
        axes.plot(place[~fired, 1], place[~fired, 0], "x", color=INK, label="not fired")
    fastest = float(np.linalg.norm(velocity[fired], axis=1).max()) if fired.any() else 0.0
    if fastest > 0.0:
        arrow = velocity[fired] * (_ARROW * min(bench.burden, bench.spacing) / fastest)
        axes.quiver(
            place[fired, 1], place[fired, 0], arrow[:, 1], arrow[:, 0],
            angles="xy", scale_units="xy", scale=1.0, width=0.003, color=INK, zorder=4,
        )  # fmt: skip
        figure.colorbar(points, ax=axes, label="fired at [ms]")
    axes.set(xlim=(low[1], high[1]), ylim=(low[0], high[0]))
    axes.set_aspect("equal")
    axes.grid(visible=False)
    axes.set(title=title, xlabel="y [m], along the bench", ylabel="x [m], direction of throw")
    figure.legend(loc="outside lower center", ncols=2)
    return finished(figure)
