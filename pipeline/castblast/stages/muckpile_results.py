"""What comes out of a thrown bench: a document in SI units, tables, and pictures."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from castblast.errors import Status
from castblast.files import write_csv, write_text, write_with
from castblast.muckpile.bench import Bench, block_shape
from castblast.muckpile.metrics import PileMetrics
from castblast.muckpile.particles import Particles
from castblast.muckpile.profile import (
    HeightField,
    Profile,
    mean_profile,
    section,
    surface_height,
)
from castblast.muckpile.solver import CastCase, CastHistory, CastResult
from castblast.muckpile.walls import Walls, ground_height
from castblast.specs.bench import BenchSpec

#: Shares of the length of the bench at which the profile is written, besides the mean.
SECTIONS = (0.25, 0.5, 0.75)
# Balls of a file may lie beside the bench: then the surface is taken over all of them.
_INSIDE_SHARE = 0.9


@dataclass(frozen=True)
class MuckpileOutcome:
    """What a run found: a document in SI units, the same for people, and the files written."""

    document: dict[str, Any]
    title: str
    rows: list[tuple[str, str, str]]
    files: list[Path] = field(default_factory=list)


class Start(NamedTuple):
    """Balls before firing and how they came about.

    Attributes
    ----------
    balls : Particles
    solid_fraction : float [-]
        Reached by the packing; NaN for a file of balls.
    settled : bool
        The packing came to rest before it was fired; True for a file of balls, as given.
    reused : bool
        The packing is that of an earlier run.
    """

    balls: Particles
    solid_fraction: float = math.nan
    settled: bool = True
    reused: bool = False


def describe_run(
    spec: BenchSpec,
    speed: float,
    prediction: Mapping[str, Any] | None,
    start: Start,
    result: CastResult,
    metrics: PileMetrics,
) -> MuckpileOutcome:
    """Put the results of a run into a document and rows for people; NaN where nothing is known."""
    counters = result.counters._asdict()
    seconds = counters.pop("seconds")
    document = {
        "bench": spec.name,
        "bench_sha256": spec.sha256(),
        "status": Status(result.status).name.lower(),
        "balls": len(start.balls.radius),
        "mean_radius": float(start.balls.radius.mean()),
        "solid_fraction": start.solid_fraction,
        "packing_settled": start.settled,
        "packing_reused": start.reused,
        "initial_velocity": speed,
        "surrogate": dict(prediction) if prediction else None,
        "simulated_time": result.time,
        **metrics._asdict(),
        "ledger": result.ledger._asdict(),
        "counters": counters,
        "seconds": seconds,
    }
    plain = {key: _plain(value) for key, value in document.items()}
    title = f"{spec.name}: {plain['balls']:,} balls, {speed:.3g} m/s, {result.time:.1f} s simulated"
    if Status(result.status) is Status.NOT_CONVERGED:
        title += " (longest time reached before the pile came to rest)"
    return MuckpileOutcome(plain, title, metric_rows(plain))


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
        ("swell: pile over bench volume", document["swell"], "1"),
        ("pile volume over volume of the balls", document["rock_swell"], "1"),
        ("mean slope of the pile", _scaled(document["repose_angle"], 180.0 / math.pi), "deg"),
        ("throw in free flight", document["ballistic_throw"], "m"),
        ("open energy balance", _scaled(document["ledger"]["residual"], 100.0), "%"),
        ("time on the clock", document.get("seconds"), "s"),
    )
    return [
        (name, "-" if value is None else f"{value:.3g}", unit)
        for name, value, unit in entries
        if name != "time on the clock" or value is not None
    ]


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else factor * value


def write_results(
    folder: Path,
    spec: BenchSpec,
    case: CastCase,
    result: CastResult,
    document: Mapping[str, Any],
) -> list[Path]:
    """Write final state, profile, history, metrics and pictures into `folder`.

    The files depend on bench file and code only: the time on the clock is left out of them.
    """
    from castblast.report.muckpile_figures import draw_energy, draw_plan, draw_section

    bench, before, after = spec.bench.to_bench(), case.particles, result.particles
    surface = _surface(before, after, bench, case.walls)
    mean = mean_profile(surface)
    stored: dict[str, Any] = {
        "x": after.position,
        "r": after.radius,
        "v": after.velocity,
        "w": after.angular_velocity,
        "block": after.block,
        "x_before": before.position,
    }
    slope = (spec.slope.distance, spec.slope.angle) if spec.slope else None
    timeless = {k: v for k, v in document.items() if k not in ("seconds", "packing_reused")}
    return [
        write_with(folder / "final_state.npz", lambda name: np.savez_compressed(name, **stored)),
        write_csv(folder / "profile.csv", _profile_columns(surface, mean)),
        write_csv(folder / "history.csv", _history_columns(result.history)),
        write_text(folder / "metrics.json", json.dumps(_finite(timeless), indent=2) + "\n"),
        draw_section(
            folder / "section.png",
            before,
            after,
            bench,
            y=_section_place(before, bench),
            mean_profile=mean,
            slope=slope,
        ),
        draw_plan(folder / "plan.png", before, after, bench),
        draw_energy(folder / "energy.png", result.history),
    ]


def _inside(balls: Particles, bench: Bench) -> bool:
    along = balls.position[:, 1]
    return bool(((along >= 0.0) & (along <= bench.length)).mean() >= _INSIDE_SHARE)


def _surface(before: Particles, after: Particles, bench: Bench, walls: Walls) -> HeightField:
    """Top of the pile, or of the ground where there is none."""
    cell = float(2.0 * after.radius.mean())
    span = (0.0, bench.length) if _inside(before, bench) else None
    surface = surface_height(after.position, after.radius, cell=cell, y_range=span)
    ground = ground_height(walls, *np.meshgrid(surface.x, surface.y))
    return surface._replace(height=np.maximum(surface.height, ground))


def _section_place(before: Particles, bench: Bench) -> float:
    """Middle of the column of blocks nearest to the middle of the bench."""
    if not _inside(before, bench):
        return float(np.median(before.position[:, 1]))
    _, columns = block_shape(bench)
    return min((columns // 2 + 0.5) * bench.spacing, bench.length)


def _profile_columns(surface: HeightField, mean: Profile) -> dict[str, Any]:
    columns: dict[str, Any] = {"x [m]": mean.x, "mean_height [m]": mean.height}
    half = 0.5 * (surface.y[-1] - surface.y[0]) / max(len(surface.y) - 1, 1)
    low, high = surface.y[0] - half, surface.y[-1] + half
    for share in SECTIONS:
        y = low + share * (high - low)
        columns[f"height_at_y_{y:.1f}_m [m]"] = section(surface, y).height
    return columns


def _history_columns(history: CastHistory) -> dict[str, Any]:
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


def _plain(value: Any) -> Any:
    """Arrays and NumPy scalars as Python lists and numbers."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def _finite(value: Any) -> Any:
    """NaN and infinity as null, which JSON can hold."""
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
