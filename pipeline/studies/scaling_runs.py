"""Builds that are timed: the real program around a simulator that sleeps; workers over TCP.

Every build is made in a process of its own, so that start and memory are those of a build.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import psutil  # type: ignore[import-untyped]

from castblast.dataset.building.process import peak_memory
from castblast.dataset.building.shards import Span, read_shard, write_shard
from castblast.dataset.file.provenance import ExplosiveSource, load_explosives
from castblast.dataset.rows.design import Design, make_design
from castblast.dataset.rows.simulation import BatchResult, BlastSimulator, Columns, blast_simulator
from castblast.design.variables import OUTPUT_NAMES
from castblast.specs.recipe import RecipeSource, load_recipe
from castblast.stages.datasets.generate import produce
from castblast.types import IndexArray

STUDIES = Path(__file__).resolve().parent
RECIPE = STUDIES.parent.parent / "data_specs/recipes/full.yaml"
#: Results that sleeping simulators hand out: as many as a chunk of the file holds, so that the
#: file is compressed no better than one of different rows.
STORE_ROWS = 4096
_ORIGIN = "stand-in"
_START_SECONDS = 60.0


class Order(NamedTuple):
    """A build to be timed: samples, rows of a shard, seconds of sleep per sample, workers.

    An empty `scheduler` stands for threads of the process itself.
    """

    samples: int
    shard_size: int
    sleep: float
    workers: int
    scheduler: str = ""


class Timed(NamedTuple):
    """What a build took.

    Attributes
    ----------
    start, before, shards, after : float [s]
        Until it begins to draw the design; until it has reached its workers; until all shards are
        written; until the process has ended.
    wall : float [s]
        All of it.
    coordinator_cpu, scheduler_cpu : float [s]
        Processor time: of the coordinator while shards ran, of the scheduler in all.
    waiting : float
        Share of the time of the workers, between first and last shard, in which they had none.
    peak, file : float [byte]
        Memory of the coordinator; size of the dataset.
    """

    start: float
    before: float
    shards: float
    after: float
    wall: float
    coordinator_cpu: float
    scheduler_cpu: float
    waiting: float
    peak: float
    file: float


@dataclass(frozen=True)
class SleepingBlast(BlastSimulator):
    """Sleeps so long per row, then hands out results of the real physics, for other rows."""

    store: Path = Path()
    sleep: float = 0.0

    def run(self, inputs: Columns, explosive: IndexArray) -> BatchResult:
        """As many rows of the store, from a place that the inputs decide."""
        results = _stored(self.store)
        time.sleep(self.sleep * len(explosive))
        first = int(1e6 * float(inputs["burden"][0]))
        rows = (first + np.arange(len(explosive))) % len(results.status)
        return BatchResult(
            results.status[rows],
            {name: values[rows] for name, values in results.outputs.items()},
            {name: values[rows] for name, values in results.histories.items()},
        )


class Physics(NamedTuple):
    """Recipe, explosives and simulator of a study."""

    source: RecipeSource
    explosives: tuple[ExplosiveSource, ...]
    simulator: BlastSimulator

    def design(self) -> Design:
        """Rows of the recipe."""
        return make_design(self.source.recipe, self.simulator, str(self.source.path))


def physics(samples: int, shard_size: int = 500) -> Physics:
    """Set up the full recipe at another size."""
    source = load_recipe(RECIPE, samples)
    recipe = source.recipe.model_copy(update={"shard_size": shard_size})
    explosives = load_explosives(source)
    made = tuple(entry.spec.to_explosive() for entry in explosives)
    return Physics(source._replace(recipe=recipe), explosives, blast_simulator(recipe, made))


def store_results(folder: Path, result: BatchResult) -> None:
    """Keep results for `SleepingBlast`."""
    write_shard(folder, Span(0, len(result.status)), _ORIGIN, result)


@cache
def _stored(folder: Path) -> BatchResult:
    return read_shard(folder, Span(0, STORE_ROWS), _ORIGIN, OUTPUT_NAMES)


@contextmanager
def cluster(folder: Path, processes: int, threads: int) -> Iterator[tuple[str, int]]:
    """Run a scheduler and workers as processes of their own; yields address and its process id."""
    note = folder / f"scheduler-{time.monotonic_ns()}.json"
    local = ("--host", "127.0.0.1", "--no-dashboard", "--protocol", "tcp")
    started = [_start("dask_scheduler", *local, "--port", "0", "--scheduler-file", note)]
    try:
        deadline = time.monotonic() + _START_SECONDS
        while not note.exists():
            if time.monotonic() > deadline:
                raise TimeoutError("no scheduler came up")
            time.sleep(0.02)
        address = json.loads(note.read_text(encoding="utf-8"))["address"]
        options = ("--nthreads", threads, "--memory-limit", 0, "--local-directory", folder)
        plain = ("--no-nanny", "--no-dashboard")
        started += [_start("dask_worker", address, *plain, *options) for _ in range(processes)]
        _wait(address, processes)
        yield address, started[0].pid
    finally:
        for process in reversed(started):
            process.kill()
            process.wait()


def timed(folder: Path, order: Order, scheduler_pid: int = 0) -> Timed:
    """Make a build in a process of its own; `folder` holds the stored results.

    Raises
    ------
    RuntimeError
        The build failed.
    """
    cpu = _processor_seconds(scheduler_pid)
    begin = time.time()
    call = f"import scaling_runs; scaling_runs.build_and_tell({str(folder)!r}, {tuple(order)!r})"
    done = subprocess.run(
        [sys.executable, "-c", call],
        capture_output=True, text=True, env=environment(), check=False,
    )  # fmt: skip
    end = time.time()
    if done.returncode:
        raise RuntimeError(done.stderr)
    told = json.loads(done.stdout)
    drawing, reached, last_shard = told["times"]
    return Timed(
        start=drawing - begin,
        before=reached - drawing,
        shards=last_shard - reached,
        after=end - last_shard,
        wall=end - begin,
        coordinator_cpu=told["cpu"][2] - told["cpu"][1],
        scheduler_cpu=_processor_seconds(scheduler_pid) - cpu,
        waiting=told["waiting"],
        peak=told["peak"],
        file=told["file"],
    )


class _Marks:
    """Progress of a build: wall and processor time between its phases."""

    #: Words in the lines that begin a phase: drawing, workers reached, (each) shard written.
    _WORDS = ("drawing", "compiling", " failed ")

    def __init__(self) -> None:
        self.times, self.cpu = [0.0] * len(self._WORDS), [0.0] * len(self._WORDS)

    def __call__(self, share: float, line: str) -> None:
        for k, word in enumerate(self._WORDS):
            if word in line:
                self.times[k], self.cpu[k] = time.time(), time.process_time()


def build_and_tell(store: str, ordered: tuple[int, int, float, int, str]) -> None:
    """Make a build beside the stored results, print what it took as JSON, remove it."""
    order = Order(*ordered)
    made, marks = physics(order.samples, order.shard_size), _Marks()
    real = made.simulator
    simulator = SleepingBlast(
        real.explosives, real.settings, real.solver_inputs, Path(store), order.sleep
    )
    with TemporaryDirectory(dir=store) as folder:
        outcome = produce(
            made.source,
            made.explosives,
            simulator,
            Path(folder) / "data.nc",
            workers=order.workers,
            scheduler=order.scheduler or None,
            progress=marks,
        )
        size = outcome.path.stat().st_size
    share = re.search(r"scheduling ([\d.]+)%", "\n".join(outcome.lines))
    told = {
        "times": marks.times,
        "cpu": marks.cpu,
        "waiting": float(share[1]) / 100.0 if share else 0.0,
        "peak": peak_memory(),
        "file": size,
    }
    print(json.dumps(told))


def environment() -> dict[str, str]:
    """Workers find this module by its name."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(STUDIES), *filter(None, sys.path)])}


def _start(what: str, *arguments: object) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", f"distributed.cli.{what}", *map(str, arguments)],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment(),
    )  # fmt: skip


def _wait(address: str, workers: int) -> None:
    from dask.distributed import Client

    with Client(address, set_as_default=False) as client:
        client.wait_for_workers(workers, timeout=_START_SECONDS)


def _processor_seconds(process: int) -> float:
    if not process:
        return 0.0
    spent = psutil.Process(process).cpu_times()
    return float(spent.user + spent.system)
