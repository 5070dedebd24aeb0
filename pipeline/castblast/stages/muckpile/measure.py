"""A muckpile that another engine threw: throw, profile and ore from its balls before and after."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from castblast.api.muckpile.document import DOCUMENT_UNITS, HEADER, metric_rows
from castblast.api.muckpile.files import OPTIONAL_FILES, write_state
from castblast.api.muckpile.ore import OreRun, describe_ore
from castblast.api.muckpile.tables import (
    block_columns,
    ground_profile,
    middle_section,
    pile_sections,
    pile_surface,
    profile_columns,
)
from castblast.api.muckpile.velocity import describe_velocity, velocity_remarks
from castblast.disk.files import staged, tried, write_csv, write_json
from castblast.disk.locks import LOCK_NAME, only_writer
from castblast.disk.plain import as_plain
from castblast.disk.resources import find_spec
from castblast.errors import SpecError
from castblast.identity import file_hash
from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.bench.geometry import Bench
from castblast.muckpile.cast.case import CastCase
from castblast.muckpile.results.metrics import pile_metrics
from castblast.muckpile.results.movement import group_movement
from castblast.muckpile.results.ore import move_ore
from castblast.muckpile.results.profile import HeightField, Profile, mean_profile
from castblast.report.piles.movement_figures import draw_movement, draw_ore, draw_profiles
from castblast.report.piles.muckpile_figures import draw_plan, draw_section
from castblast.scene.build import read_site
from castblast.scene.plan import Plan
from castblast.specs.bench.balls.files import read_balls
from castblast.specs.bench.bench import BenchSpec, load_bench
from castblast.stages.muckpile.extras import Extras, read_extras
from castblast.stages.outcome import Outcome

#: Where decks of castblast keep the balls before firing, beside the final state.
_START_OF_DECK = "balls.data"
#: Radii of both states, as engines print them.
_SAME_RADIUS = 1e-4
_ENERGY_ROW = "open energy balance"
#: What a run of our own may have left there, and no file of balls can tell.
_REPLACED = (*OPTIONAL_FILES, "history.csv", "energy.png")
#: Not the folder in which a stopped run keeps its frames.
_SCRATCH = ".measured"


class _Measured(NamedTuple):
    spec: BenchSpec
    bench: Bench
    case: CastCase
    after: Particles
    plan: Plan
    surface: HeightField
    sections: list[tuple[float, Profile]]
    ground: Profile
    ore: OreRun | None


def measure_muckpile(
    bench: str | Path,
    final: str | Path,
    out: str | Path | None = None,
    *,
    start: str | Path | None = None,
    extras: Extras = Extras(),  # noqa: B008 - a record of constants
) -> Outcome:
    """Measure the pile that another engine made of a bench, as if it were our own run.

    Parameters
    ----------
    bench : str or path
        Bench file, or the name of one that comes with castblast.
    final : path
        Balls at the end: ``final.dump`` of a deck, or any other file of balls.
    out : path, optional
        Folder of the results; default ``runs/NAME``.
    start : path, optional
        The same balls before firing, in the same order or with the same ids. Default: those of
        the bench file, or ``balls.data`` beside `final`.
    extras : Extras
        Ore and how it is dug.

    Returns
    -------
    Outcome
        Its folder has ``metrics.json``, ``profile.csv``, ``blocks.csv``, the surface, the state
        and pictures, as `compare-muckpiles` takes them; no history and no energies, which no file
        of balls holds.

    Raises
    ------
    SpecError
        Faults of the files, or balls that are not the same.
    OutputError
        The folder cannot be written to, or the disk is full.
    LockedError
        Another run writes into the folder.
    """
    final = Path(final)
    out = None if out is None else Path(out)
    start = None if start is None else Path(start)
    path = find_spec(bench, "bench")
    spec = load_bench(path)
    geometry = spec.bench.to_bench()
    ore_of_bench = path.parent / spec.ore if spec.ore else None
    wanted = read_extras(extras, geometry, ore_of_bench, spec.frame)
    site = read_site(spec, path.parent)
    walls, plan = site.walls, site.plan
    before_file = _start_file(spec, path.parent, final, start)
    law = spec.contact.to_law()
    before, after = read_balls(before_file, law), read_balls(final, law)
    _require_same(before, after, before_file, final)
    block = plan.blocks_of(before.position, geometry)
    if spec.firing.pattern == "none":
        block = np.full_like(block, -1)
    before, after = before._replace(block=block), after._replace(block=block)
    case = CastCase(
        particles=before,
        law=law,
        walls=walls,
        block_delay=plan.delay,
        block_velocity=plan.velocity,
    )
    ore = None
    if wanted.ore:
        moved = move_ore(before, after, wanted.ore, density=law.density, plan=wanted.plan)
        ore = OreRun(wanted.ore, wanted.plan, moved)
    surface = pile_surface(before, after, geometry, walls)
    found = _Measured(
        spec=spec,
        bench=geometry,
        case=case,
        after=after,
        plan=plan,
        surface=surface,
        sections=pile_sections(surface, geometry),
        ground=ground_profile(surface, geometry, walls),
        ore=ore,
    )
    document = _document(found, {"start": before_file, "final": final})
    if site.ground.remarks:
        document |= {"ground_remarks": list(site.ground.remarks)}
    folder = Path("runs") / spec.name if out is None else out
    with (
        tried(folder),
        only_writer(folder / LOCK_NAME, folder),
        staged(folder, replaces=_REPLACED, name=_SCRATCH) as scratch,
    ):
        files = [folder / name.relative_to(scratch) for name in _write(scratch, found, document)]
    rows = metric_rows(document | {"ledger": {"residual": None}})
    return Outcome(
        document=document,
        title=f"{spec.name}: {len(after.radius):,} balls of {final.name}",
        header=HEADER,
        rows=[row for row in rows if row[0] != _ENERGY_ROW],
        files=files,
        remarks=[*site.ground.remarks, *velocity_remarks(plan.prediction)],
    )


def _start_file(spec: BenchSpec, beside: Path, final: Path, start: Path | None) -> Path:
    if start is not None:
        return start
    if spec.balls.file is not None:
        return beside / spec.balls.file
    deck = final.parent / _START_OF_DECK
    if deck.is_file():
        return deck
    message = (
        f"{final}: the balls before firing are needed too: --start FILE, or beside it the "
        f"{_START_OF_DECK} of its deck"
    )
    raise SpecError(message)


def _require_same(before: Particles, after: Particles, start: Path, final: Path) -> None:
    """Refuse states of other balls, or one from which balls were lost."""
    if len(before.radius) != len(after.radius):
        message = (
            f"{final}: {len(after.radius):,} balls; {start} has {len(before.radius):,}: all of "
            f"them are needed, in the same order or with the same ids"
        )
        raise SpecError(message)
    other = ~np.isclose(before.radius, after.radius, rtol=_SAME_RADIUS)
    if other.any():
        k = int(np.argmax(other))
        message = (
            f"{final}: ball {k} has a radius of {after.radius[k]:.4g} m, in {start} "
            f"{before.radius[k]:.4g} m: the order differs, or these are other balls"
        )
        raise SpecError(message)


def _document(found: _Measured, files: Mapping[str, Path]) -> dict[str, Any]:
    before = found.case.particles
    metrics = pile_metrics(
        before,
        found.after,
        found.bench,
        block_velocity=found.case.block_velocity,
        walls=found.case.walls,
    )
    document: dict[str, Any] = as_plain(
        {
            "bench": found.spec.name,
            "measured_from": {key: path.name for key, path in files.items()},
            "measured_sha256": {key: file_hash(path) for key, path in files.items()},
            "geometry": found.bench._asdict(),
            "balls": len(before.radius),
            "mean_radius": float(before.radius.mean()),
            **describe_velocity(found.plan.speed, found.plan.prediction),
            "surrogate": dict(found.plan.prediction) if found.plan.prediction else None,
            **metrics._asdict(),
            "ore": describe_ore(found.ore) if found.ore else None,
            "units": DOCUMENT_UNITS,
        }
    )
    return document


def _write(folder: Path, found: _Measured, document: Mapping[str, Any]) -> Sequence[Path]:
    """Write state, tables, metrics and pictures."""
    before, after = found.case.particles, found.after
    surface = found.surface
    profiles = profile_columns(surface, found.sections, found.ground)
    files = [
        *write_state(folder, before, after, surface, found.ore),
        write_csv(folder / "profile.csv", profiles),
        write_json(folder / "metrics.json", document),
    ]
    moved = group_movement(before, after, before.block, len(found.plan.delay))
    if moved.balls.any():
        blocks = block_columns(found.case, after, found.bench, found.plan.label)
        files.append(write_csv(folder / "blocks.csv", blocks))
    return files + _draw(folder, found)


def _draw(folder: Path, found: _Measured) -> list[Path]:
    before, after, bench, walls = found.case.particles, found.after, found.bench, found.case.walls
    mean, y = mean_profile(found.surface), middle_section(before, bench)
    files = [
        draw_section(folder / "section.png", before, after, bench, walls, y=y, mean_profile=mean),
        draw_plan(folder / "plan.png", before, after, bench),
        draw_profiles(
            folder / "profiles.png",
            {f"y = {place:.1f} m": profile for place, profile in found.sections},
            bench,
            found.ground,
            band=(mean, found.surface.height.std(axis=0)),
            band_words="one standard deviation along the bench",
        ),
    ]
    if (before.block >= 0).any():
        files.append(draw_movement(folder / "movement.png", before, after, bench, walls))
    if found.ore:
        run = found.ore
        picture = folder / "ore.png"
        files.append(
            draw_ore(picture, before, after, bench, run.polygons, run.moved, run.plan.block)
        )
    return files
