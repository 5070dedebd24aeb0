"""FloatArray of blocks and what the pictures of a muckpile have in common.

A ball keeps the colour of the place it came from, burden by spacing: the hue tells the row, counted
from the face; neighbouring columns differ in lightness. So the colours are those of the blocks,
and still tell rows where balls are fired by the nearest hole. Balls without a block are grey.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.patches import Patch

from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.bench.geometry import Bench, assign_blocks, block_shape
from castblast.types import FloatArray, IntArray

#: Width [inch] of a picture.
WIDTH = 10.0
_GREY = (0.62, 0.62, 0.62, 1.0)
_MARGIN = 0.03
_SHOWN = 0.997  # share of the balls that a picture has to hold; single far rollers stretch it


def origin_blocks(before: Particles, bench: Bench) -> IntArray:
    """Block of the grid (n,) that each ball lies in before the blast; -1: it is never fired."""
    return np.where(before.block >= 0, assign_blocks(before.position, bench), -1)


def block_colours(block: IntArray, bench: Bench) -> FloatArray:
    """RGBA (n, 4) of each ball: hue by row, lightness by column, grey without a block."""
    rows, columns = block_shape(bench)
    row, column = np.divmod(block, columns)
    palette = _row_palette(rows)
    colours = palette[np.clip(row, 0, rows - 1)]
    # Lighter every other column, so that the edges of the blocks can be followed.
    pale = (column % 2 == 1)[:, None]
    colours[:, :3] = np.where(pale, 0.62 * colours[:, :3] + 0.38, colours[:, :3])
    colours[block < 0] = _GREY
    return np.asarray(colours)


def _row_palette(rows: int) -> FloatArray:
    share = np.linspace(0.08, 0.92, rows) if rows > 1 else np.array([0.3])
    return np.asarray(colormaps["viridis"](share), dtype=np.float64)


def block_legend(figure: Any, axes: Any, bench: Bench) -> None:
    """Name some rows by their colours, and the lines of `axes` that carry a label."""
    rows, _ = block_shape(bench)
    shown = range(rows) if rows <= 4 else sorted({0, rows // 3, 2 * rows // 3, rows - 1})
    palette = _row_palette(rows)
    names = {0: "row 1 (face)", rows - 1: f"row {rows} (rear)"}
    handles: list[Any] = [
        Patch(color=palette[i], label=names.get(i, f"row {i + 1}")) for i in shown
    ]
    handles += axes.get_legend_handles_labels()[0]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), handlelength=1.4)


def left_out_words(balls: Particles, **limits: tuple[float, float]) -> str:
    """Say how many balls a picture leaves out; empty if none."""
    seen = np.ones(balls.radius.size, dtype=bool)
    for name, (low, high) in limits.items():
        along = balls.position[:, "xyz".index(name)]
        seen &= (along >= low) & (along <= high)
    left_out = int((~seen).sum())
    return f" ({left_out:,} of {seen.size:,} balls lie outside the picture)" if left_out else ""


def shown_range(before: Particles, after: Particles, axis: int) -> tuple[float, float]:
    """Range that holds nearly all balls of both states."""
    low, high = np.inf, -np.inf
    for balls in (before, after):
        along = balls.position[:, axis]
        radius = float(balls.radius.max())
        low = min(low, float(np.quantile(along, 1.0 - _SHOWN)) - radius)
        high = max(high, float(np.quantile(along, _SHOWN)) + radius)
    pad = _MARGIN * (high - low)
    return low - pad, high + pad
