"""The bench as it was, as lines: its section at a place along it, and its faces in plan."""

from __future__ import annotations

from typing import Any

import numpy as np

from castblast.muckpile.bench.geometry import Bench, bench_outline
from castblast.muckpile.bench.outline import FREE, OPEN, ROCK, section_at
from castblast.report.piles.ground import INK
from castblast.report.style import RED
from castblast.types import FloatArray


def bench_sections(bench: Bench, y: float) -> list[FloatArray]:
    """Parts of the section of the bench at `y` [m]: rings (5, 2) of x and z [m]."""
    outline = bench_outline(bench)
    low = _crossings(section_at(outline, 0.0), y)
    high = _crossings(section_at(outline, bench.height), y)
    if len(low) != len(high):  # a leaning end is cut: only its foot is there
        high = low
    return [
        np.array(
            [[low[k], 0.0], [low[k + 1], 0.0], [high[k + 1], bench.height],
             [high[k], bench.height], [low[k], 0.0]]
        )
        for k in range(0, len(low) - 1, 2)
    ]  # fmt: skip


def _crossings(corner: FloatArray, y: float) -> list[float]:
    """Places x, ascending, at which the line at `y` crosses a polygon (m, 2)."""
    after = np.roll(corner, -1, axis=0)
    # Half open: a corner on the line belongs to one of its edges; the last end is let in.
    line = min(max(y, float(corner[:, 1].min())), float(np.nextafter(corner[:, 1].max(), -np.inf)))
    cut = (corner[:, 1] > line) != (after[:, 1] > line)
    (ax, ay), (bx, by) = corner[cut].T, after[cut].T
    return sorted(float(x) for x in ax + (line - ay) * (bx - ax) / (by - ay))


def draw_bench_section(axes: Any, bench: Bench, y: float) -> None:
    """Draw the outline of the bench before the blast in the section at `y` [m]."""
    name = "bench before"
    for ring in bench_sections(bench, y):
        axes.plot(*ring.T, color=INK, lw=1.0, ls=(0, (4, 3)), label=name, zorder=3)
        name = "_" + name  # one entry in the legend


def draw_faces(axes: Any, bench: Bench, *, along_first: bool = False) -> None:
    """Draw the toe of every free face in plan; `along_first`: y is the horizontal axis."""
    corner = bench_outline(bench).corner
    kinds = bench.edges if bench.corners else (FREE, OPEN, ROCK, OPEN)
    named = False
    for k, kind in enumerate(kinds):
        if kind != FREE:
            continue
        edge = corner[[k, (k + 1) % len(corner)]]
        x, y = edge.T
        places = (y, x) if along_first else (x, y)
        axes.plot(*places, color=RED, lw=1.2, label=None if named else "toe of the face", zorder=3)
        named = True
