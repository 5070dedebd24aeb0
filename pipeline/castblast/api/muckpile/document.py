"""What came out of a thrown bench, as a document in SI units and as rows for people."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from castblast.api.muckpile.ore import OreRun, describe_ore, ore_rows
from castblast.api.muckpile.velocity import describe_velocity, velocity_words
from castblast.api.muckpile.verdict import cast_faults
from castblast.disk.plain import as_plain, finite
from castblast.errors import Status
from castblast.identity import digest, file_hash
from castblast.muckpile.cast.solver import CastResult
from castblast.muckpile.results.metrics import UNITS, PileMetrics
from castblast.scene.begun import Start
from castblast.specs.bench.bench import BenchSpec

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


def run_document(
    spec: BenchSpec,
    speed: float,
    prediction: Mapping[str, Any] | None,
    start: Start,
    result: CastResult,
    metrics: PileMetrics,
    ore: OreRun | None = None,
) -> dict[str, Any]:
    """Put the results of a run into a document of plain values; None where nothing is known."""
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
    return plain


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
