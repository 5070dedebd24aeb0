"""A stand-in for the physics: the real inputs and rules, a closed form instead of a simulation.

Lets the machinery of datasets be tested in a moment.
"""

import time
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import yaml

from castblast.dataset.building.produce import build_dataset
from castblast.dataset.file.provenance import load_explosives
from castblast.dataset.file.schema import HISTORIES, plausible_range
from castblast.dataset.rows.design import make_design
from castblast.dataset.rows.simulation import BatchResult, BlastSimulator, blast_simulator
from castblast.design.variables import OUTPUT_NAMES
from castblast.errors import Status
from castblast.specs.recipe import load_recipe
from castblast.stages.datasets.generate import GenerateOutcome, generated

RECIPE = {
    "name": "small",
    "version": "1.2.0",
    "title": "A small dataset",
    "size": 60,
    "seed": 7,
    "explosives": ["anfo", "heavy_anfo", "doped_emulsion"],
    "variables": {
        "ucs": {"lower": "10 MPa", "upper": "200 MPa", "distribution": "log_uniform"},
        "burden": {"lower": "1 m", "upper": "15 m"},
        "charge_length": {"lower": "1 m", "upper": "9 m"},
        "bench_height": "10 m",
    },
    "solver": {"history_points": 6},
    "shard_size": 12,
    "max_failed_share": 0.0,
}


@dataclass(frozen=True)
class FakeBlast(BlastSimulator):
    """Outputs that are smooth in the inputs; fails on strong rock, or breaks down on demand."""

    fail_above: float = float("inf")  # ucs [Pa]
    broken: tuple[float, ...] = ()  # break down in batches that begin with one of these burdens
    seconds: float = 0.0  # per batch

    def run(self, inputs, explosive):
        if self.seconds:
            time.sleep(self.seconds)
        if inputs["burden"][0] in self.broken:
            message = "the simulator broke down"
            raise RuntimeError(message)
        ucs, burden = inputs["ucs"], inputs["burden"]
        status = np.where(ucs > self.fail_above, Status.NOT_CONVERGED, Status.OK).astype(np.int8)
        outputs = {}
        for number, name in enumerate(OUTPUT_NAMES):
            low, high = plausible_range(name)
            share = (np.sin(number + burden) ** 2 + explosive) / 5.0
            outputs[name] = np.where(status == 0, low + share * (high - low), np.nan)
        points = np.linspace(0.0, 1.0, self.settings.history_points)
        histories = {
            name: np.where(status[:, None] == 0, ucs[:, None] * points * (k + 1), np.nan)
            for k, name in enumerate(HISTORIES)
        }
        return BatchResult(status, outputs, histories)


def write_recipe(path: Path, **changes) -> Path:
    """Write the small recipe with some keys changed (None: left out)."""
    content = {k: v for k, v in {**RECIPE, **changes}.items() if v is not None}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return path


def fake_simulator(recipe: Path, *, break_at: int | None = None, **settings) -> FakeBlast:
    """Simulator for a recipe file; breaks down in all shards from number `break_at` on."""
    source = load_recipe(recipe)
    real = blast_simulator(
        source.recipe, tuple(entry.spec.to_explosive() for entry in load_explosives(source))
    )
    if break_at is not None:
        burden = make_design(source.recipe, real, "").columns["burden"]
        settings["broken"] = tuple(burden[:: source.recipe.shard_size][break_at:].tolist())
    return FakeBlast(**{f.name: getattr(real, f.name) for f in fields(real)}, **settings)


def fake_generate(recipe: Path, path: Path, *, simulator=None, **options) -> GenerateOutcome:
    """Build the dataset of a recipe file without physics."""
    source = load_recipe(recipe)
    simulator = simulator or fake_simulator(recipe)
    return generated(build_dataset(source, path, simulator, **options))
