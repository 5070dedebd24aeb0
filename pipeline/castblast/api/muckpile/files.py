"""Files of a thrown bench: state, surface, tables, metrics, pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from castblast.api.muckpile.ore import OreRun
from castblast.api.muckpile.tables import (
    block_columns,
    ground_profile,
    history_columns,
    middle_section,
    pile_sections,
    pile_surface,
    profile_columns,
)
from castblast.disk.files import write_csv, write_json, write_with
from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.bench.geometry import Bench
from castblast.muckpile.cast.solver import CastCase, CastResult
from castblast.muckpile.results.profile import HeightField, mean_profile
from castblast.specs.bench.bench import BenchSpec

#: Files that some runs write and others do not: they never stay beside those of another run.
OPTIONAL_FILES = (
    "movement.png",
    "ore.png",
    "animation.gif",
    "animation.mp4",
    "balls.vtkhdf",
    "frames/balls.pvd",
    "frames/balls_[0-9][0-9][0-9][0-9][0-9].vtp",
)


def write_results(
    folder: Path,
    spec: BenchSpec,
    case: CastCase,
    result: CastResult,
    document: Mapping[str, Any],
    ore: OreRun | None = None,
    label: Sequence[str] = (),
) -> list[Path]:
    """Write final state, tables, metrics and pictures into `folder`.

    `label` is the id of the hole of each block, see `Plan`. The files depend on bench file and code
    only: the time on the clock is left out of them.
    """
    bench, before, after = spec.bench.to_bench(), case.particles, result.particles
    surface = pile_surface(before, after, bench, case.walls)
    sections = pile_sections(surface, bench)
    ground = ground_profile(surface, bench, case.walls)
    timeless = {k: v for k, v in document.items() if k not in ("seconds", "packing_reused")}
    files = [
        *write_state(folder, before, after, surface, ore),
        write_csv(folder / "profile.csv", profile_columns(surface, sections, ground)),
        write_csv(folder / "history.csv", history_columns(result.history)),
        write_csv(folder / "blocks.csv", block_columns(case, after, bench, label)),
        write_json(folder / "metrics.json", timeless),
    ]
    return files + _draw(folder, bench, surface, case, result, ore)


def write_state(
    folder: Path, before: Particles, after: Particles, surface: HeightField, ore: OreRun | None
) -> list[Path]:
    """Write balls and surface after the cast as arrays."""
    stored: dict[str, Any] = {
        "x": after.position,
        "r": after.radius,
        "v": after.velocity,
        "w": after.angular_velocity,
        "block": after.block,
        "x_before": before.position,
    }
    if ore:
        stored["polygon"] = ore.moved.polygon
    return [
        write_with(folder / "final_state.npz", lambda name: np.savez_compressed(name, **stored)),
        write_with(folder / "surface.npz", lambda name: np.savez(name, **surface._asdict())),
    ]


def _draw(
    folder: Path,
    bench: Bench,
    surface: HeightField,
    case: CastCase,
    result: CastResult,
    ore: OreRun | None,
) -> list[Path]:
    """Draw all pictures of a run."""
    from castblast.report.piles.movement_figures import draw_movement, draw_ore, draw_profiles
    from castblast.report.piles.muckpile_figures import (
        draw_energy,
        draw_plan,
        draw_section,
        draw_sections,
    )
    from castblast.report.piles.muckpile_view import draw_view

    walls, before, after = case.walls, case.particles, result.particles
    sections = pile_sections(surface, bench)
    mean, y = mean_profile(surface), middle_section(before, bench)
    spread = surface.height.std(axis=0)
    files = [
        draw_section(folder / "section.png", before, after, bench, walls, y=y, mean_profile=mean),
        draw_sections(folder / "sections.png", before, after, bench, walls, sections),
        draw_plan(folder / "plan.png", before, after, bench),
        draw_view(folder / "view.png", before, after, bench, walls),
        draw_profiles(
            folder / "profiles.png",
            {f"y = {place:.1f} m": profile for place, profile in sections},
            bench,
            ground_profile(surface, bench, walls),
            band=(mean, spread),
            band_words="one standard deviation along the bench",
        ),
        draw_energy(folder / "energy.png", result.history, result.ledger),
    ]
    if (before.block >= 0).any():
        files.append(draw_movement(folder / "movement.png", before, after, bench, walls))
    if ore:
        picture = folder / "ore.png"
        files.append(
            draw_ore(picture, before, after, bench, ore.polygons, ore.moved, ore.plan.block)
        )
    return files
