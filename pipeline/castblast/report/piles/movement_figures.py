"""Pictures of what moved where: vectors of blocks, surfaces of several runs, ore."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import EllipseCollection, PatchCollection
from matplotlib.patches import Patch, Rectangle

from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.bench.geometry import Bench, block_shape
from castblast.muckpile.results.movement import block_levels, group_movement
from castblast.report.piles.ball_picture import PLAN_X, Canvas
from castblast.report.piles.bench_lines import draw_bench_section, draw_faces
from castblast.report.piles.blocks import WIDTH, origin_blocks, shown_range
from castblast.report.piles.ground import INK, draw_ground, draw_ground_line
from castblast.report.style import CYCLE, GREY, in_style, new_figure, save_figure
from castblast.types import FloatArray, IntArray

if TYPE_CHECKING:
    from castblast.muckpile.ground.walls import Walls
    from castblast.muckpile.results.ore import Area, OreMovement, OrePolygon
    from castblast.muckpile.results.profile import Profile

LEVELS = 3
_WASTE = (0.80, 0.80, 0.80)
_METHOD_WORDS = {
    "as_planned": "as planned",
    "translated": "polygon moved\nas a whole",
    "outlined": "outline of\nits rock",
    "dig_blocks": "dig blocks",
}


@in_style
def draw_movement(
    path: Path, before: Particles, after: Particles, bench: Bench, walls: Walls
) -> Path:
    """Draw movement vectors: of each block in plan, of each row and level in section.

    A block is what fires as one: a cell of the grid, or the rock nearest to a hole. Vectors are to
    scale, from the centre of mass before to that after; an ellipse at the head has
    half axes of one standard deviation of the displacements within the block.

    Parameters
    ----------
    path : Path
        Picture to write (PNG or SVG).
    before, after : Particles
    bench : Bench
    walls : Walls
        Ground of the section, taken at the middle of the bench.
    """
    rows, columns = block_shape(bench)
    x, y = shown_range(before, after, 0), shown_range(before, after, 1)
    z_top = 1.15 * bench.height
    rises = [(y[1] - y[0]) / (x[1] - x[0]), 1.05 * z_top / (x[1] - x[0])]
    inner = min(WIDTH - 1.0, 10.0 / sum(rises))  # long benches: narrower, not higher
    figure, (plan, side) = new_figure(
        2, 1, width=inner + 1.0, height=inner * sum(rises) + 2.2, sharex=True, height_ratios=rises
    )
    origin = origin_blocks(before, bench)
    count = max(rows * columns, int(before.block.max()) + 1)
    blocks = group_movement(before, after, before.block, count)
    arrows = _draw_vectors(plan, blocks.start, blocks.displacement, blocks.spread, (0, 1))
    if (origin == before.block).all():
        _draw_block_lines(plan, bench, blocks.balls)
    draw_faces(plan, bench)
    plan.set(title="Movement of the blocks, from above", ylabel="y [m], along the bench", ylim=y)
    figure.colorbar(
        arrows, ax=side, label="throw, horizontal [m]", location="bottom", aspect=40, shrink=0.8
    )

    row = np.where(origin >= 0, origin // columns, -1)
    group = block_levels(before._replace(block=row), bench.height, LEVELS, rows)
    levels = group_movement(before, after, group, LEVELS * rows)
    _draw_vectors(side, levels.start, levels.displacement, levels.spread, (0, 2), arrows.norm)
    draw_bench_section(side, bench, 0.5 * bench.length)
    draw_ground_line(side, walls, 0.5 * bench.length, *x, -0.05 * z_top)
    side.set(
        title=f"Rows in {LEVELS} levels of the bench, averaged along it",
        xlabel="x [m], in front of the toe of the face",
        ylabel="z [m]",
        xlim=x,
        ylim=(-0.05 * z_top, z_top),
    )
    for panel in (plan, side):
        panel.set_aspect("equal")
    return save_figure(figure, path, dpi=160)


def _draw_vectors(
    axes: Any,
    start: FloatArray,
    way: FloatArray,
    spread: FloatArray,
    seen: tuple[int, int],
    norm: Any = None,
) -> Any:
    """Arrows to scale in two of the three directions, coloured by horizontal length."""
    known = np.isfinite(way[:, 0])
    start, way, spread = start[known], way[known], spread[known]
    head = (start + way)[:, seen]
    axes.add_collection(
        EllipseCollection(
            2.0 * spread[:, seen[0]], 2.0 * spread[:, seen[1]], np.zeros(len(way)), units="xy",
            offsets=head, offset_transform=axes.transData, facecolors="none",
            edgecolors=GREY, linewidths=0.4, alpha=0.7,
        )
    )  # fmt: skip
    throw = np.hypot(way[:, 0], way[:, 1])
    options = {} if norm is None else {"norm": norm}
    return axes.quiver(
        start[:, seen[0]], start[:, seen[1]], way[:, seen[0]], way[:, seen[1]], throw,
        angles="xy", scale_units="xy", scale=1.0, width=0.0022, cmap="viridis", zorder=3,
        **options,
    )  # fmt: skip


def _draw_block_lines(axes: Any, bench: Bench, balls: IntArray) -> None:
    rows, columns = block_shape(bench)
    burden, spacing = bench.burden, bench.spacing
    boxes = [
        Rectangle((-(row + 1) * burden, column * spacing), burden, spacing)
        for row in range(rows)
        for column in range(columns)
        if balls[row * columns + column]
    ]
    axes.add_collection(
        PatchCollection(boxes, facecolor="none", edgecolor="#CCCCCC", linewidths=0.5)
    )


@in_style
def draw_profiles(
    path: Path,
    profiles: Mapping[str, Profile],
    bench: Bench,
    ground: Profile,
    *,
    band: tuple[Profile, FloatArray] | None = None,
    band_words: str = "",
    title: str = "Surface of the muckpile",
) -> Path:
    """Draw surfaces of several runs, or of several places, over each other, to scale.

    Parameters
    ----------
    path : Path
        Picture to write (PNG or SVG).
    profiles : mapping of name to Profile
    bench : Bench
    ground : Profile
    band : (Profile, half width (nx,) [m]), optional
        Drawn as a line with a band around it.
    band_words : str
        Name of the band.
    title : str
    """
    every = [*profiles.values(), *([band[0]] if band else [])]
    piles = [(p.x, p.height - np.interp(p.x, ground.x, ground.height)) for p in every]
    seen = [x[height > 0.02 * height.max()] for x, height in piles]
    low = min(-1.05 * bench.width, *(float(x.min(initial=0.0)) for x in seen))
    high = max(float(x.max(initial=0.0)) for x in seen)
    high += 0.05 * (high - low)
    top = 1.1 * max(bench.height, *(float(p.height[p.x <= high].max()) for p in every))
    height = (WIDTH - 0.8) * top / (high - low) + 1.4
    figure, axes = new_figure(1, 1, width=WIDTH, height=max(height, 2.8))
    draw_ground(axes, ground, -0.05 * top)
    draw_bench_section(axes, bench, 0.5 * bench.length)
    if band is not None:
        mean, half = band
        lower = np.maximum(mean.height - half, np.interp(mean.x, ground.x, ground.height))
        axes.fill_between(mean.x, lower, mean.height + half, color=GREY, alpha=0.35, lw=0.0,
                          label=band_words, zorder=2)  # fmt: skip
        axes.plot(mean.x, mean.height, color=INK, lw=1.8, label="mean", zorder=4)
    for (name, profile), colour in zip(profiles.items(), _cycle(len(profiles)), strict=True):
        axes.plot(profile.x, profile.height, color=colour, lw=1.1, label=name, zorder=3)
    axes.set(title=title, xlabel="x [m], in front of the toe of the face", ylabel="z [m]",
             xlim=(low, high), ylim=(-0.05 * top, top), aspect="equal")  # fmt: skip
    figure.legend(loc="outside lower center", ncols=4)
    return save_figure(figure, path, dpi=160)


def _cycle(count: int) -> Sequence[str]:
    return [CYCLE[k % len(CYCLE)] for k in range(count)]


@in_style
def draw_ore(
    path: Path,
    before: Particles,
    after: Particles,
    bench: Bench,
    polygons: Sequence[OrePolygon],
    moved: OreMovement,
    block: float,
) -> Path:
    """Draw ore before and after in plan, and loss and dilution of each way of digging.

    Parameters
    ----------
    path : Path
        Picture to write (PNG or SVG).
    before, after : Particles
    bench : Bench
    polygons : sequence of OrePolygon
    moved : OreMovement
    block : float [m]
        Side of a dig block.
    """
    x, y = shown_range(before, after, 0), shown_range(before, after, 1)
    ratio = (y[1] - y[0]) / (x[1] - x[0])
    colours = _cycle(len(polygons))
    panel = min(0.5 * (WIDTH - 0.8) * ratio, 9.0)
    figure, axes = new_figure(2, 2, width=WIDTH, height=panel + 4.0, height_ratios=[panel, 2.4])
    for axis, balls, title in ((axes[0, 0], before, "Before"), (axes[0, 1], after, "After")):
        canvas = Canvas(PLAN_X, (*x, *y), 900)
        canvas.add(balls.position, balls.radius, _ore_colours(moved.polygon, colours))
        canvas.show(axis)
        draw_faces(axis, bench)
        axis.set(title=title, xlabel="x [m], direction of throw", ylabel="y [m], along the bench")
    for k, (polygon, colour) in enumerate(zip(polygons, colours, strict=True)):
        _draw_area(axes[0, 0], [[polygon.corners]], INK, "-")
        _draw_area(axes[0, 1], moved.translated[k], INK, "--")
        _draw_area(axes[0, 1], moved.outlined[k], INK, "-")
        _draw_dig_blocks(axes[0, 1], moved, k, block, colour)
    _draw_bars(axes[1, 0], polygons, moved, "loss", "Ore loss")
    _draw_bars(axes[1, 1], polygons, moved, "dilution", "Dilution")
    handles: list[Any] = [
        Patch(color=colour, label=polygon.name)
        for polygon, colour in zip(polygons, colours, strict=True)
    ]
    handles += [
        Patch(color=_WASTE, label="waste"),
        axes[0, 1].plot([], [], color=INK, label="outline of the rock of a polygon")[0],
        axes[0, 1].plot([], [], color=INK, ls="--", label="polygon moved as a whole")[0],
        Patch(facecolor="none", edgecolor=INK, lw=0.4, label="dig blocks"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return save_figure(figure, path, dpi=160)


def _ore_colours(owner: IntArray, colours: Sequence[str]) -> FloatArray:
    from matplotlib.colors import to_rgb

    palette = np.array([*(to_rgb(colour) for colour in colours), _WASTE])
    return np.asarray(palette[owner])  # waste is -1, the last


def _draw_area(axes: Any, area: Area, colour: str, style: str) -> None:
    for ring in (ring for part in area for ring in part):
        axes.plot(*np.vstack([ring, ring[:1]]).T, color=colour, ls=style, lw=1.3, zorder=4)


def _draw_dig_blocks(axes: Any, moved: OreMovement, polygon: int, side: float, colour: str) -> None:
    places = {key[:2] for key, owner in moved.blocks.items() if owner == polygon}
    boxes = [Rectangle((i * side, j * side), side, side) for i, j in sorted(places)]
    axes.add_collection(
        PatchCollection(
            boxes, facecolor=colour, edgecolor=INK, alpha=0.35, linewidths=0.4, zorder=3
        )
    )


def _draw_bars(
    axes: Any, polygons: Sequence[OrePolygon], moved: OreMovement, quantity: str, title: str
) -> None:
    width = 0.8 / len(polygons)
    for k, colour in enumerate(_cycle(len(polygons))):
        own = [result for result in moved.results if result.polygon == polygons[k].name]
        places = np.arange(len(own)) + (k - 0.5 * (len(polygons) - 1)) * width
        values = [100.0 * getattr(result, quantity) for result in own]
        bars = axes.bar(places, values, 0.9 * width, color=colour)
        axes.bar_label(bars, fmt="%.0f", fontsize=7)
    axes.set_xticks(range(len(_METHOD_WORDS)), list(_METHOD_WORDS.values()), fontsize=8)
    axes.grid(visible=False, axis="x")
    axes.set(title=title, ylabel="[% of mass]", ylim=(0, 109))
