"""What comes out of a thrown bench: a document in SI units, tables, and pictures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from castblast.disk.files import write_csv, write_json, write_with
from castblast.disk.plain import as_plain, finite
from castblast.errors import Status
from castblast.identity import digest, file_hash
from castblast.muckpile.cast.solver import CastCase, CastResult
from castblast.muckpile.results.metrics import UNITS, PileMetrics
from castblast.muckpile.results.profile import mean_profile
from castblast.report.piles.movement_figures import draw_movement, draw_ore, draw_profiles
from castblast.report.piles.muckpile_figures import (
    draw_energy,
    draw_plan,
    draw_section,
    draw_sections,
)
from castblast.report.piles.muckpile_view import draw_view
from castblast.scene.begun import Start
from castblast.specs.bench.bench import BenchSpec
from castblast.stages.muckpile.ore import OreRun, describe_ore, ore_rows
from castblast.stages.muckpile.tables import (
    block_columns,
    ground_profile,
    history_columns,
    middle_section,
    pile_sections,
    pile_surface,
    profile_columns,
)
from castblast.stages.muckpile.velocity import describe_velocity, velocity_remarks, velocity_words
from castblast.stages.muckpile.verdict import cast_faults
from castblast.stages.outcome import Outcome

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
#: Unit of every number in the document; "1": none.
DOCUMENT_UNITS = {
    "geometry": "m, face_angle rad",
    "mean_radius": "m",
    "solid_fraction": "1",
    "initial_velocity": "m s-1",
    "prediction_band": "m s-1",
    "simulated_time": "s",
    **UNITS,
    "ledger": "J, residual 1",
    "counters": "1, steps in s",
    "ore": "m, m2, kg; grades as given",
    "seconds": "s",
}
#: Head of the table of a run.
HEADER = ("quantity", "value", "unit")


def describe_run(
    spec: BenchSpec,
    speed: float,
    prediction: Mapping[str, Any] | None,
    start: Start,
    result: CastResult,
    metrics: PileMetrics,
    ore: OreRun | None = None,
) -> Outcome:
    """Put the results of a run into a document and rows for people; NaN where nothing is known."""
    counters = result.counters._asdict()
    seconds = counters.pop("seconds")
    faults = cast_faults(result)
    document = {
        "bench": spec.name,
        "seed": spec.seed,
        "geometry": spec.bench.to_bench()._asdict(),
        "status": Status(result.status).name.lower(),
        "ok": not faults,
        "faults": faults,
        "balls": len(start.balls.radius),
        "mean_radius": float(start.balls.radius.mean()),
        "solid_fraction": start.solid_fraction,
        "packing_settled": start.settled,
        "packing_reused": start.reused,
        **describe_velocity(speed, prediction),
        "surrogate": dict(prediction) if prediction else None,
        "simulated_time": result.time,
        **metrics._asdict(),
        "ore": describe_ore(ore) if ore else None,
        "units": DOCUMENT_UNITS,
        "numerics": spec.numerics.model_dump(),
        "ledger": result.ledger._asdict(),
        "counters": counters,
        "seconds": seconds,
    }
    plain: dict[str, Any] = as_plain(document)
    title = (
        f"{spec.name}: {plain['balls']:,} balls, {velocity_words(plain)} m/s, "
        f"{result.time:.1f} s simulated"
    )
    if Status(result.status) is Status.NOT_CONVERGED:
        title += " (longest time reached before the pile came to rest)"
    remarks = velocity_remarks(prediction)
    return Outcome(
        document=plain,
        title=title,
        header=HEADER,
        rows=metric_rows(plain),
        remarks=remarks,
        faults=faults,
        ok=not faults,
    )


def bench_content(spec: BenchSpec, beside: Path) -> dict[str, Any]:
    """Hash of all that a bench file says, the content of the files that it names included."""
    named = {name: file_hash(beside / name) for name in spec.files()}
    contents = (f" {name} {content}" for name, content in named.items())
    return {"bench_sha256": digest(spec.sha256(), *contents), "bench_files": named}


def metric_rows(document: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Headline metrics of a run for people: name, value, unit."""
    throw = document["throw"]
    entries = (
        ("throw of the centre of mass", throw[0], "m"),
        ("drop of the centre of mass", -throw[2], "m"),
        ("cast fraction", _scaled(document["cast_fraction"], 100.0), "%"),
        ("run-out of 95 % of the mass", document["runout_95"], "m"),
        ("run-out of 99 % of the mass", document["runout_99"], "m"),
        ("maximum height", document["maximum_height"], "m"),
        ("dig height", document["dig_height"], "m"),
        ("swell: pile over bench volume", document["swell"], "1"),
        ("pile volume over volume of the balls", document["rock_swell"], "1"),
        ("mean slope of the pile", _scaled(document["repose_angle"], 180.0 / math.pi), "deg"),
        ("throw in free flight", document["ballistic_throw"], "m"),
        ("cast fraction in free flight", _scaled(document["ballistic_cast_fraction"], 100.0), "%"),
        ("open energy balance", _scaled(document["ledger"]["residual"], 100.0), "%"),
        ("time on the clock", document.get("seconds"), "s"),
    )
    rows = [("burden velocity", velocity_words(document), "m/s")]
    rows += [
        (name, "-" if value is None else f"{value:.3g}", unit)
        for name, value, unit in entries
        if name != "time on the clock" or value is not None
    ]
    return rows + (ore_rows(finite(document["ore"])) if document.get("ore") else [])


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else factor * value


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
    timeless = {k: v for k, v in document.items() if k not in ("seconds", "packing_reused")}
    files = [
        write_with(folder / "final_state.npz", lambda name: np.savez_compressed(name, **stored)),
        write_with(folder / "surface.npz", lambda name: np.savez(name, **surface._asdict())),
        write_csv(folder / "profile.csv", profile_columns(surface, sections, ground)),
        write_csv(folder / "history.csv", history_columns(result.history)),
        write_csv(folder / "blocks.csv", block_columns(case, after, bench, label)),
        write_json(folder / "metrics.json", timeless),
    ]
    return files + _draw(folder, spec, case, result, ore)


def _draw(
    folder: Path, spec: BenchSpec, case: CastCase, result: CastResult, ore: OreRun | None
) -> list[Path]:
    """Draw all pictures of a run."""
    bench, walls = spec.bench.to_bench(), case.walls
    before, after = case.particles, result.particles
    surface = pile_surface(before, after, bench, walls)
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
