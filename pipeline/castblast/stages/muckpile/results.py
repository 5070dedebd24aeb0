"""What the screen shows of a thrown bench."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from castblast.api.muckpile.document import HEADER, metric_rows, run_document
from castblast.api.muckpile.ore import OreRun
from castblast.api.muckpile.velocity import velocity_remarks, velocity_words
from castblast.errors import Status
from castblast.muckpile.cast.solver import CastResult
from castblast.muckpile.results.metrics import PileMetrics
from castblast.scene.begun import Start
from castblast.specs.bench.bench import BenchSpec
from castblast.stages.outcome import Outcome


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
    plain = run_document(spec, speed, prediction, start, result, metrics, ore)
    faults = plain["faults"]
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
