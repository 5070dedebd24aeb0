"""Pictures of a muckpile: cross-sections, plan, and energy over time. Lengths are to scale.

Balls are coloured by the blocks they came from; all that are not hidden are painted.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.bench.geometry import Bench
from castblast.report.piles.ball_picture import PLAN_X, PLAN_Y, SECTION, Canvas
from castblast.report.piles.bench_lines import draw_bench_section, draw_faces
from castblast.report.piles.blocks import (
    WIDTH,
    block_colours,
    block_legend,
    left_out_words,
    origin_blocks,
    shown_range,
)
from castblast.report.piles.ground import draw_ground_line
from castblast.report.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    RED,
    finished,
    in_style,
    new_figure,
    save_figure,
)
from castblast.types import FloatArray

if TYPE_CHECKING:
    from castblast.muckpile.cast.solver import CastHistory, EnergyLedger
    from castblast.muckpile.ground.walls import Walls
    from castblast.muckpile.results.profile import Profile

_Limits = tuple[float, float, float, float]


def draw_section(
    path: Path,
    before: Particles,
    after: Particles,
    bench: Bench,
    walls: Walls,
    *,
    y: float,
    mean_profile: Profile,
) -> Path:
    """Draw `section_figure` into a file (PNG or SVG)."""
    figure = section_figure(before, after, bench, walls, y=y, mean_profile=mean_profile)
    return save_figure(figure, path, dpi=180)


@in_style
def section_figure(
    before: Particles,
    after: Particles,
    bench: Bench,
    walls: Walls,
    *,
    y: float,
    mean_profile: Profile,
) -> Figure:
    """Draw the bench and the muckpile in section, one above the other.

    Parameters
    ----------
    before, after : Particles
    bench : Bench
    walls : Walls
        Ground.
    y : float [m]
        Where the section is cut; what lies up to one spacing behind the cut is seen.
    mean_profile : Profile
        Surface of the muckpile averaged along the bench, drawn as a line.
    """
    limits = _section_limits(before, after, bench)
    figure, axes = _section_panels(2, limits)
    colours = block_colours(origin_blocks(before, bench), bench)
    _draw_cut(axes[0], before, colours, bench, walls, y, limits)
    _draw_cut(axes[1], after, colours, bench, walls, y, limits)
    draw_bench_section(axes[1], bench, y)
    axes[1].plot(mean_profile.x, mean_profile.height, color=RED, lw=1.4, label="mean surface")
    axes[0].set_title(f"Before, section at y = {y:.1f} m")
    axes[1].set_title("After" + left_out_words(after, x=limits[:2]))
    block_legend(figure, axes[1], bench)
    return finished(figure)


@in_style
def draw_sections(
    path: Path,
    before: Particles,
    after: Particles,
    bench: Bench,
    walls: Walls,
    sections: Sequence[tuple[float, Profile]],
) -> Path:
    """Draw the muckpile in section at several places along the bench.

    Parameters
    ----------
    path : Path
        Picture to write (PNG or SVG).
    before, after : Particles
    bench : Bench
    walls : Walls
        Ground.
    sections : sequence of (y [m], Profile)
        Place of each cut and the surface there.
    """
    limits = _section_limits(before, after, bench)
    figure, axes = _section_panels(len(sections), limits)
    colours = block_colours(origin_blocks(before, bench), bench)
    for panel, (y, profile) in zip(np.atleast_1d(axes), sections, strict=True):
        _draw_cut(panel, after, colours, bench, walls, y, limits)
        draw_bench_section(panel, bench, y)
        panel.plot(profile.x, profile.height, color=RED, lw=1.2, label="surface")
        panel.set_title(f"y = {y:.1f} m")
    block_legend(figure, np.atleast_1d(axes)[0], bench)
    return save_figure(figure, path, dpi=180)


def _section_limits(before: Particles, after: Particles, bench: Bench) -> _Limits:
    low, high = shown_range(before, after, 0)
    top = 1.1 * max(bench.height, shown_range(before, after, 2)[1])
    return low, high, -0.05 * top, top


def _section_panels(count: int, limits: _Limits) -> tuple[Any, Any]:
    low, high, bottom, top = limits
    each = (WIDTH - 0.8) * (top - bottom) / (high - low) + 0.35
    figure, axes = new_figure(
        count, 1, width=WIDTH, height=min(max(count * each + 0.9, 3.0), 11.0), sharex=True
    )
    for panel in np.atleast_1d(axes):
        panel.set_ylabel("z [m]")
    np.atleast_1d(axes)[-1].set_xlabel("x [m], in front of the toe of the face")
    return figure, axes


def _draw_cut(
    axes: Any,
    balls: Particles,
    colours: FloatArray,
    bench: Bench,
    walls: Walls,
    y: float,
    limits: _Limits,
) -> None:
    """Draw what lies behind the cut at `y`, with the ground."""
    behind = balls.position[:, 1] - y
    seen = (behind >= -balls.radius.mean()) & (behind < bench.spacing)
    draw_ground_line(axes, walls, y, limits[0], limits[1], limits[2])
    canvas = Canvas(SECTION, limits)
    canvas.add(balls.position[seen], balls.radius[seen], colours[seen])
    canvas.show(axes)


def draw_plan(path: Path, before: Particles, after: Particles, bench: Bench) -> Path:
    """Draw `plan_figure` into a file (PNG or SVG)."""
    figure = plan_figure(before, after, bench)
    return save_figure(figure, path, dpi=180)


@in_style
def plan_figure(before: Particles, after: Particles, bench: Bench) -> Figure:
    """Draw bench and muckpile from above, each ball in the colour of its block.

    Parameters
    ----------
    before, after : Particles
    bench : Bench
    """
    x, y = shown_range(before, after, 0), shown_range(before, after, 1)
    across = (y[1] - y[0]) / (x[1] - x[0])
    beside = across < 1.2  # a narrow bench: two panels one above the other would be too flat
    rows, columns = (2, 1) if not beside else (1, 2)
    height = _plan_height(across, beside=beside)
    figure, axes = new_figure(rows, columns, width=WIDTH, height=height, sharex=True, sharey=True)
    colours = block_colours(origin_blocks(before, bench), bench)
    for panel, balls in zip(axes, (before, after), strict=True):
        if beside:
            canvas, shown = Canvas(PLAN_X, (*x, *y), 850), (*x, *y)
        else:
            canvas, shown = Canvas(PLAN_Y, (*y, -x[1], -x[0])), (*y, x[1], x[0])
        canvas.add(balls.position, balls.radius, colours)
        canvas.show(panel, shown)
        draw_faces(panel, bench, along_first=not beside)
    thrown, along = "x [m], direction of throw", "y [m], along the bench"
    if beside and across < 0.5:  # in one line it would be longer than the axis
        along = along.replace(", ", ",\n")
    for panel in axes:
        panel.set(xlabel=thrown if beside else along, ylabel=along if beside else thrown)
        panel.label_outer()
    axes[0].set_title("Before, from above")
    axes[1].set_title("After" + left_out_words(after, x=x, y=y))
    block_legend(figure, axes[0], bench)
    return finished(figure)


def _plan_height(across: float, *, beside: bool) -> float:
    inner = WIDTH - 0.8
    height = 0.5 * inner * across if beside else 2.0 * inner / across
    return min(max(height + 1.1, 3.0), 11.0)


def draw_energy(path: Path, history: CastHistory, ledger: EnergyLedger) -> Path:
    """Draw `energy_figure` into a file (PNG or SVG)."""
    figure = energy_figure(history, ledger)
    return save_figure(figure, path)


@in_style
def energy_figure(history: CastHistory, ledger: EnergyLedger) -> Figure:
    """Draw kinetic energies and the movement of the centre of mass over time, and the budget.

    Parameters
    ----------
    history : CastHistory
        Arrays of shape (k,), centre of mass (k, 3).
    ledger : EnergyLedger
    """
    figure, (left, middle, right) = new_figure(1, 3, width=12.0, height=3.2)
    for values, name, colour in (
        (history.translational_energy, "translation", BLUE),
        (history.rotational_energy, "rotation", ORANGE),
    ):
        shown = np.where(values > 0.0, values * 1e-6, np.nan)
        left.semilogy(history.time, shown, color=colour, label=name)
    left.set(title="Kinetic energy", xlabel="time [s]", ylabel="[MJ]")
    left.legend()
    moved = history.centre_of_mass - history.centre_of_mass[0]
    middle.plot(history.time, moved[:, 0], color=BLUE, label="throw, x")
    middle.plot(history.time, moved[:, 2], color=GREEN, label="drop, z")
    middle.axhline(0.0, color=GREY, lw=0.8)
    middle.set(title="Movement of the centre of mass", xlabel="time [s]", ylabel="[m]")
    middle.legend()
    _draw_budget(right, ledger)
    return finished(figure)


def _draw_budget(axes: Any, ledger: EnergyLedger) -> None:
    """Bars of what was put in and where it went."""
    initial_height = ledger.initial - ledger.potential
    entries = [
        ("fired", ledger.fired, BLUE),
        ("fall of the pile", initial_height, BLUE),
        ("sliding", ledger.slip, RED),
        ("rolling", ledger.rolling_slip, RED),
        ("impact (dashpots)", ledger.dashpot, RED),
        ("still moving or elastic", ledger.kinetic + ledger.spring, GREY),
    ]
    known = [(name, value * 1e-6, colour) for name, value, colour in entries if np.isfinite(value)]
    names, values, colours = zip(*known, strict=True)
    bars = axes.barh(names, values, color=colours)
    words = [f"{v:,.0f}" if abs(v) >= 100.0 else f"{v:.3g}" for v in values]
    axes.bar_label(bars, words, padding=3, fontsize=8)
    axes.margins(x=0.25)
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")
    axes.set(title="Energy put in (blue) and spent (red)", xlabel="[MJ]")
