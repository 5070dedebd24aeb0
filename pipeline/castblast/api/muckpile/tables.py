"""Tables of a muckpile: surface in section, history, and the movement of every block."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.bench.geometry import Bench, assign_blocks, block_shape
from castblast.muckpile.cast.case import CastCase, CastHistory
from castblast.muckpile.ground.walls import Walls, ground_height
from castblast.muckpile.results.movement import group_movement
from castblast.muckpile.results.profile import (
    HeightField,
    Profile,
    mean_profile,
    section_band,
    surface_height,
)
from castblast.types import FloatArray

X_COLUMN, MEAN_COLUMN, GROUND_COLUMN = "x [m]", "mean_height [m]", "ground [m]"
#: Shares of the length of the bench at which sections are cut, besides the mean.
SECTIONS = (0.25, 0.5, 0.75)
# Balls of a file may lie beside the bench: then the surface is taken over all of them.
_INSIDE_SHARE = 0.9


def lies_inside(balls: Particles, bench: Bench) -> bool:
    """Whether nearly all balls lie between the ends of the bench."""
    along = balls.position[:, 1]
    return bool(((along >= 0.0) & (along <= bench.length)).mean() >= _INSIDE_SHARE)


def pile_surface(before: Particles, after: Particles, bench: Bench, walls: Walls) -> HeightField:
    """Top of the pile, or of the ground where there is none, between the ends of the bench."""
    cell = float(2.0 * after.radius.mean())
    span = (0.0, bench.length) if lies_inside(before, bench) else None
    surface = surface_height(after.position, after.radius, cell=cell, y_range=span)
    ground = ground_height(walls, *np.meshgrid(surface.x, surface.y))
    return surface._replace(height=np.maximum(surface.height, ground))


def pile_sections(surface: HeightField, bench: Bench) -> list[tuple[float, Profile]]:
    """Places y [m] of the cuts and the surface there, averaged over one spacing behind the cut."""
    half = 0.5 * (surface.y[-1] - surface.y[0]) / max(len(surface.y) - 1, 1)
    low, high = surface.y[0] - half, surface.y[-1] + half
    places = [float(low + share * (high - low)) for share in SECTIONS]
    return [(y, section_band(surface, y, y + bench.spacing)) for y in places]


def middle_section(before: Particles, bench: Bench) -> float:
    """Place y [m] of the near side of the column of blocks in the middle of the bench."""
    if not lies_inside(before, bench):
        return float(np.median(before.position[:, 1]))
    _, columns = block_shape(bench)
    return (columns // 2) * bench.spacing


def ground_profile(surface: HeightField, bench: Bench, walls: Walls) -> Profile:
    """Ground in the middle of the bench, at the places of the surface."""
    y = np.full_like(surface.x, 0.5 * bench.length)
    return Profile(surface.x, ground_height(walls, surface.x, y))


def profile_columns(
    surface: HeightField, sections: list[tuple[float, Profile]], ground: Profile
) -> dict[str, FloatArray]:
    """Columns of the mean profile, of the ground and of the sections, in m."""
    mean = mean_profile(surface)
    columns = {X_COLUMN: mean.x, MEAN_COLUMN: mean.height, GROUND_COLUMN: ground.height}
    for y, profile in sections:
        columns[f"height_at_y_{y:.1f}_m [m]"] = profile.height
    return columns


def history_columns(history: CastHistory) -> dict[str, Any]:
    """Columns of energies, centre of mass and number of contacts over time."""
    centre = history.centre_of_mass
    return {
        "time [s]": history.time,
        "translational_energy [J]": history.translational_energy,
        "rotational_energy [J]": history.rotational_energy,
        "centre_x [m]": centre[:, 0],
        "centre_y [m]": centre[:, 1],
        "centre_z [m]": centre[:, 2],
        "contacts": history.contacts,
    }


def block_columns(
    case: CastCase, after: Particles, bench: Bench, label: Sequence[str] = ()
) -> dict[str, Any]:
    """Columns of a row per block that holds balls: plan, place before, movement and its spread.

    `label` is the id of the hole that fires each block, if the holes have any.
    """
    _, columns = block_shape(bench)
    moved = group_movement(case.particles, after, case.particles.block, len(case.block_delay))
    block = np.flatnonzero(moved.balls)
    cell = assign_blocks(moved.start[block], bench)
    table: dict[str, Any] = {
        "block": block,
        **({"hole": [label[k] for k in block.tolist()]} if label else {}),
        "row": cell // columns,
        "column": cell % columns,
        "delay [s]": case.block_delay[block],
        "speed [m/s]": np.linalg.norm(case.block_velocity[block], axis=1),
        "balls": moved.balls[block],
        "mass_share": moved.mass_share[block],
        "throw [m]": moved.throw[block],
        "heave [m]": moved.heave[block],
    }
    for name, values in (
        ("start", moved.start),
        ("moved", moved.displacement),
        ("spread", moved.spread),
    ):
        for axis, letter in enumerate("xyz"):
            table[f"{name}_{letter} [m]"] = values[block, axis]
    return table
