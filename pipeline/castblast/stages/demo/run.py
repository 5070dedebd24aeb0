"""The whole chain at a small size: dataset, surrogate, export, prediction, muckpile, report.

Every step leaves its result in a folder of its own and takes the others' from theirs, so that a
second run reuses what is still valid.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from castblast.identity import make_key
from castblast.errors import SpecError, StaleResultError
from castblast.extras import is_installed
from castblast.progress import ProgressCallback
from castblast.disk.resources import resource
from castblast.disk.note import read_note, write_note
from castblast.api.training.judging import DEMO
from castblast.specs.bench.bench import load_bench
from castblast.stages.comparison.run import compare
from castblast.stages.datasets.generate import generate
from castblast.stages.demo.prediction import compare_with_physics
from castblast.stages.demo.report import write_demo_report
from castblast.stages.export import export
from castblast.stages.muckpile.run import run_muckpile

RECIPE = "data_specs/recipes/quickstart.yaml"
BENCH = "data_specs/benches/demo.yaml"
MODELS = ("reference_mlp", "wide_mlp_log", "levenberg")


@dataclass(frozen=True)
class Demo:
    """Where a demo lives and how it runs.

    Attributes
    ----------
    out : path
    workers : int, optional
        Threads; None: all cores.
    restart : bool
        Reuse nothing.
    recipe, bench : path
        What is generated and thrown.
    """

    out: Path
    workers: int | None = None
    restart: bool = False
    recipe: Path = Path()
    bench: Path = Path()

    @property
    def dataset(self) -> Path:
        """The generated dataset."""
        return self.out / "dataset" / "data.nc"

    @property
    def network(self) -> Path:
        """The exported network."""
        return self.out / "export" / "network.json"


def make_demo(
    out: str | Path,
    *,
    workers: int | None = None,
    restart: bool = False,
    recipe: str | Path | None = None,
    bench: str | Path | None = None,
) -> Demo:
    """Set up a demo with the shipped recipe and bench unless others are given.

    Raises
    ------
    SpecError
        `out` is a file.
    """
    out = Path(out)
    recipe = None if recipe is None else Path(recipe)
    bench = None if bench is None else Path(bench)
    if out.exists() and not out.is_dir():
        message = f"{out}: is a file, not a folder for results"
        raise SpecError(message)
    return Demo(out=out, workers=workers, restart=restart, recipe=recipe or resource(RECIPE), bench=bench or resource(BENCH))


def _make_dataset(demo: Demo, progress: ProgressCallback) -> list[str]:
    make = partial(generate, demo.recipe, demo.dataset, workers=demo.workers, progress=progress)
    try:
        outcome = make(restart=demo.restart)
    except StaleResultError:
        # The folder is the demo's own: what an older castblast left there is made again.
        outcome = make(restart=True)
    return outcome.lines


def _train(demo: Demo, progress: ProgressCallback) -> list[str]:
    folder = demo.out / "models"
    specs = [resource(f"models/specs/{name}.yaml") for name in MODELS]
    key = make_key(dataset=demo.dataset, **{spec.stem: spec for spec in specs})
    if not demo.restart and read_note(folder) == key:
        return [f"{folder}: still valid, reused"]
    outcome = compare(
        demo.dataset,
        specs,
        folder,
        fits=demo.out / "fits",
        extent=DEMO,
        workers=demo.workers,
        tracking=is_installed("mlflow"),
        runs=demo.out / "runs",
        progress=progress,
    )
    write_note(folder, key)
    return [_league_line(row) for row in outcome.rows] + outcome.lines


def _league_line(row: Sequence[str]) -> str:
    """Model, physics gate, R² and 95 % error of the burden velocity."""
    name, gate, _, r_squared, error, *_ = row
    return f"{name:22s} {gate:8s} burden velocity R², 95 % error: {r_squared}, {error}"


def _export(demo: Demo, progress: ProgressCallback) -> list[str]:
    progress(0.0, "writing and verifying")
    targets = ("json", "onnx", "web")
    return export(
        demo.out / "models", demo.network.parent, targets=targets, histories=demo.dataset
    ).lines


def _predict(demo: Demo, progress: ProgressCallback) -> list[str]:
    folder = demo.out / "prediction"
    key = make_key(network=demo.network)
    if not demo.restart and read_note(folder) == key:
        return [f"{folder}: still valid, reused"]
    lines = compare_with_physics(demo.network, folder, progress)
    write_note(folder, key)
    return lines


def _throw(demo: Demo, progress: ProgressCallback) -> list[str]:
    folder = demo.out / "muckpile"
    answers = json.loads((demo.out / "prediction" / "comparison.json").read_text(encoding="utf-8"))
    velocity = f"{answers['predicted']['burden_velocity']:.6g} m/s"
    named = {name: demo.bench.parent / name for name in load_bench(demo.bench).files()}
    key = make_key(bench=demo.bench, velocity=velocity, **named)
    if not demo.restart and read_note(folder) == key:
        return [f"{folder}: still valid, reused"]
    outcome = run_muckpile(
        demo.bench, folder, velocity=velocity, threads=demo.workers, progress=progress
    )
    if not outcome.faults:
        write_note(folder, key)
    lines = [f"{name}: {value} {unit}" for name, value, unit in outcome.rows[:6]]
    return lines + [f"not ok: {fault}" for fault in outcome.faults]


def _report(demo: Demo, progress: ProgressCallback) -> list[str]:
    progress(0.0, "writing the report")
    return [f"wrote {write_demo_report(demo.out)}"]


class DemoStep(NamedTuple):
    """One step: its title, and what runs it and returns lines for people."""

    title: str
    run: Callable[[Demo, ProgressCallback], list[str]]


STEPS = (
    DemoStep("dataset", _make_dataset),
    DemoStep("surrogate", _train),
    DemoStep("export", _export),
    DemoStep("prediction against physics", _predict),
    DemoStep("muckpile", _throw),
    DemoStep("report", _report),
)


def next_commands(demo: Demo) -> list[str]:
    """Commands worth trying after the demo."""
    network = demo.network.as_posix()
    return [
        "castblast web",
        f'castblast predict --network {network} --explosive anfo --burden "4 m" --ucs "80 MPa"',
        'castblast simulate --explosive gassed_emulsion --set burden="4 m" --out simulation',
        f"castblast dataset describe {demo.dataset.as_posix()}",
        "castblast muckpile data_specs/benches/bench_20k.yaml --out muckpile",
    ]


def summarise(demo: Demo) -> dict[str, Any]:
    """Headline figures of a finished demo, for programs."""
    comparison = json.loads((demo.out / "models" / "comparison.json").read_text(encoding="utf-8"))
    prediction = json.loads(
        (demo.out / "prediction" / "comparison.json").read_text(encoding="utf-8")
    )
    metrics = json.loads((demo.out / "muckpile" / "metrics.json").read_text(encoding="utf-8"))
    return {
        "report": str(demo.out / "report.html"),
        "chosen_model": comparison["chosen"],
        "league": comparison["league"],
        "prediction": prediction,
        "muckpile": metrics,
    }
