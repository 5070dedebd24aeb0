"""Pictures of a muckpile: cross-section, plan, and energy over time. Lengths are to scale.

A ball keeps the colour of the block it came from: the hue tells the row, counted from the face;
neighbouring columns differ in lightness. Balls without a block are grey.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps
from matplotlib.collections import EllipseCollection
from matplotlib.patches import Patch
from numpy.typing import NDArray

from castblast.muckpile.bench import Bench, block_shape, crest_position
from castblast.muckpile.particles import Particles
from castblast.report.style import BLUE, GREEN, GREY, ORANGE, RED, in_style, new_figure, save_figure

if TYPE_CHECKING:
    from castblast.muckpile.profile import Profile
    from castblast.muckpile.solver import CastHistory

_Colours = NDArray[np.float64]
_GREY = (0.62, 0.62, 0.62, 1.0)
_INK = "#222222"
_WIDTH = 10.0
_MARGIN = 0.03
_SHOWN = 0.997  # share of the balls that a picture has to hold; single far rollers stretch it


def block_colours(block: NDArray[np.int64], bench: Bench) -> _Colours:
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


def _row_palette(rows: int) -> _Colours:
    share = np.linspace(0.08, 0.92, rows) if rows > 1 else np.array([0.3])
    return np.asarray(colormaps["viridis"](share), dtype=np.float64)


def _draw_balls(
    axes: Any, horizontal: _Colours, vertical: _Colours, radius: _Colours, colours: _Colours
) -> None:
    """Balls as circles in data units, in the order given (the last on top)."""
    size = 2.0 * radius
    circles = EllipseCollection(
        size,
        size,
        np.zeros_like(size),
        units="xy",
        offsets=np.column_stack([horizontal, vertical]),
        offset_transform=axes.transData,
        facecolors=colours,
        edgecolors=_edges(colours),
        linewidths=0.15,
    )
    circles.set_rasterized(True)
    axes.add_collection(circles)


def _edges(colours: _Colours) -> _Colours:
    edges = colours.copy()
    edges[:, :3] *= 0.55
    return edges


def _legend(figure: Any, axes: Any, bench: Bench) -> None:
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


def _outside(balls: Particles, **limits: tuple[float, float]) -> str:
    """Say how many balls a picture leaves out; empty if none."""
    seen = np.ones(balls.radius.size, dtype=bool)
    for name, (low, high) in limits.items():
        along = balls.position[:, "xyz".index(name)]
        seen &= (along >= low) & (along <= high)
    left_out = int((~seen).sum())
    return f" ({left_out:,} of {seen.size:,} balls lie outside the picture)" if left_out else ""


def _extent(before: Particles, after: Particles, axis: int) -> tuple[float, float]:
    """Range that holds nearly all balls of both states."""
    low, high = np.inf, -np.inf
    for balls in (before, after):
        along = balls.position[:, axis]
        radius = float(balls.radius.max())
        low = min(low, float(np.quantile(along, 1.0 - _SHOWN)) - radius)
        high = max(high, float(np.quantile(along, _SHOWN)) + radius)
    pad = _MARGIN * (high - low)
    return low - pad, high + pad


@in_style
def draw_section(
    path: Path,
    before: Particles,
    after: Particles,
    bench: Bench,
    *,
    y: float,
    mean_profile: Profile,
    slope: tuple[float, float] | None = None,
) -> Path:
    """Draw the bench and the muckpile in section, one above the other.

    Parameters
    ----------
    path : Path
        Picture to write (PNG or SVG).
    before, after : Particles
    bench : Bench
    y : float [m]
        Where the section is cut; balls within one mean diameter of it are drawn in full.
    mean_profile : Profile
        Surface of the muckpile averaged along the bench, drawn as a line.
    slope : (toe x [m], angle [rad]), optional
    """
    low, high = _extent(before, after, 0)
    top = 1.18 * max(bench.height, float(np.quantile(after.position[:, 2], _SHOWN)))
    height = 2.0 * (_WIDTH - 0.8) * (top * 1.06) / (high - low) + 1.6
    figure, axes = new_figure(2, 1, width=_WIDTH, height=min(max(height, 3.4), 9.0), sharex=True)
    for panel, balls, title in (
        (axes[0], before, f"Before, section at y = {y:.1f} m"),
        (axes[1], after, "After"),
    ):
        near = _slab(balls, y)
        order = near[np.argsort(-balls.position[near, 1])]
        _draw_balls(
            panel,
            balls.position[order, 0],
            balls.position[order, 2],
            balls.radius[order],
            block_colours(balls.block[order], bench),
        )
        _draw_ground(panel, low, high, top, slope)
        panel.set(title=title, ylabel="z [m]", xlim=(low, high), ylim=(-0.05 * top, top))
        panel.set_aspect("equal")
    _draw_outline(axes[1], bench)
    axes[1].plot(mean_profile.x, mean_profile.height, color=RED, lw=1.4, label="mean surface")
    axes[1].set_xlabel("x [m], in front of the toe of the face")
    axes[1].set_title("After" + _outside(after, x=(low, high)))
    _legend(figure, axes[1], bench)
    return save_figure(figure, path, dpi=180)


def _slab(balls: Particles, y: float) -> NDArray[np.int64]:
    return np.flatnonzero(np.abs(balls.position[:, 1] - y) < 2.0 * balls.radius.mean())


def _draw_ground(
    axes: Any, low: float, high: float, top: float, slope: tuple[float, float] | None
) -> None:
    axes.axhspan(-0.05 * top, 0.0, color="#DDD6CC", lw=0.0)
    axes.axhline(0.0, color=_INK, lw=0.8)
    if slope is not None:
        toe, angle = slope
        end = max(high, toe)
        rise = (end - toe) * np.tan(angle)
        axes.fill([toe, end, end], [0.0, 0.0, rise], color="#DDD6CC", lw=0.0)
        axes.plot([toe, end], [0.0, rise], color=_INK, lw=0.8)


def _draw_outline(axes: Any, bench: Bench) -> None:
    crest = crest_position(bench)
    axes.plot(
        [-bench.width, -bench.width, crest, 0.0],
        [0.0, bench.height, bench.height, 0.0],
        color=_INK,
        lw=1.0,
        ls=(0, (4, 3)),
        label="bench before",
    )


@in_style
def draw_plan(path: Path, before: Particles, after: Particles, bench: Bench) -> Path:
    """Draw bench and muckpile from above, each ball in the colour of its block.

    Parameters
    ----------
    path : Path
        Picture to write (PNG or SVG).
    before, after : Particles
    bench : Bench
    """
    x_low, x_high = _extent(before, after, 0)
    y_low, y_high = _extent(before, after, 1)
    across = (y_high - y_low) / (x_high - x_low)
    beside = across < 1.2  # a narrow bench: two panels one above the other would be too flat
    rows, columns = (2, 1) if not beside else (1, 2)
    height = _plan_height(across, beside=beside)
    figure, axes = new_figure(rows, columns, width=_WIDTH, height=height, sharex=True, sharey=True)
    for panel, balls, title in ((axes[0], before, "Before, from above"), (axes[1], after, "After")):
        order = _seen_from_above(balls)
        horizontal, vertical = (0, 1) if beside else (1, 0)
        _draw_balls(
            panel,
            balls.position[order, horizontal],
            balls.position[order, vertical],
            balls.radius[order],
            block_colours(balls.block[order], bench),
        )
        _draw_face(panel, bench, beside=beside)
        panel.set_title(title)
        panel.set_aspect("equal")
        limits = {"x": (x_low, x_high), "y": (y_low, y_high)}
        across_name, up_name = ("x", "y") if beside else ("y", "x")
        panel.set(xlim=limits[across_name], ylim=limits[up_name])
    thrown, along = "x [m], direction of throw", "y [m], along the bench"
    for panel in axes:
        panel.set(xlabel=thrown if beside else along, ylabel=along if beside else thrown)
        panel.label_outer()
    axes[1].set_title("After" + _outside(after, x=(x_low, x_high), y=(y_low, y_high)))
    _legend(figure, axes[0], bench)
    return save_figure(figure, path, dpi=180)


def _seen_from_above(balls: Particles) -> NDArray[np.int64]:
    """Balls near the surface from the lowest to the highest; the buried ones are not drawn."""
    size = 2.0 * float(balls.radius.mean())
    cell = np.floor((balls.position[:, :2] - balls.position[:, :2].min(axis=0)) / size)
    column = (cell[:, 0] * (cell[:, 1].max() + 1.0) + cell[:, 1]).astype(np.int64)
    height = balls.position[:, 2]
    highest = np.full(int(column.max()) + 1, -np.inf)
    np.maximum.at(highest, column, height)
    near = np.flatnonzero(height > highest[column] - 3.0 * size)
    return near[np.argsort(height[near])]


def _plan_height(across: float, *, beside: bool) -> float:
    inner = _WIDTH - 0.8
    height = 0.5 * inner * across if beside else 2.0 * inner / across
    return min(max(height + 1.1, 3.0), 11.0)


def _draw_face(axes: Any, bench: Bench, *, beside: bool) -> None:
    face_x, face_y = [0.0, 0.0], [0.0, bench.length]
    first, second = (face_x, face_y) if beside else (face_y, face_x)
    axes.plot(first, second, color=RED, lw=1.2, label="toe of the face")


@in_style
def draw_energy(path: Path, history: CastHistory) -> Path:
    """Draw kinetic energies and the movement of the centre of mass over time.

    Parameters
    ----------
    path : Path
        Picture to write (PNG or SVG).
    history : CastHistory
        Arrays of shape (k,), centre of mass (k, 3).
    """
    figure, (left, right) = new_figure(1, 2, width=_WIDTH, height=3.2)
    for values, name, colour in (
        (history.translational_energy, "translation", BLUE),
        (history.rotational_energy, "rotation", ORANGE),
    ):
        shown = np.where(values > 0.0, values * 1e-6, np.nan)
        left.semilogy(history.time, shown, color=colour, label=name)
    left.set(title="Kinetic energy", xlabel="time [s]", ylabel="[MJ]")
    left.legend()
    moved = history.centre_of_mass - history.centre_of_mass[0]
    right.plot(history.time, moved[:, 0], color=BLUE, label="throw, x")
    right.plot(history.time, moved[:, 2], color=GREEN, label="drop, z")
    right.axhline(0.0, color=GREY, lw=0.8)
    right.set(title="Movement of the centre of mass", xlabel="time [s]", ylabel="[m]")
    right.legend()
    return save_figure(figure, path)
