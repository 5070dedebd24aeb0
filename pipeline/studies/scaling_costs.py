"""What the parts of a build cost on this machine: the figures that the scaling law needs.

Processor time is taken where the work is only computing, wall time where it waits for disk, network
or other processes. Builds with a simulator that takes no time are the real program in a process of
its own, with workers over TCP; their costs per build, per sample and per shard come from builds
that differ in one of these.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import NamedTuple

from scaling_law import Costs, Sizes
from scaling_runs import (
    STORE_ROWS,
    Order,
    Physics,
    Timed,
    cluster,
    environment,
    physics,
    store_results,
    timed,
)

from castblast.dataset.building.shards import ShardTask, Span, write_shard
from castblast.dataset.rows.design import Design
from castblast.dataset.rows.simulation import BatchResult
from castblast.types import FloatArray

#: Rows of the shards of physics that are compared: the difference is what a shard costs by itself.
_SHORT_SHARD = 256
_REPEATS = 15
#: Samples of the builds that are compared.
_WIDE, _LONG = 40_000, 160_000
_WARM = """
import time
import distributed.worker
begin = time.perf_counter()
import scaling_runs
made = scaling_runs.physics(1)
design = made.design()
made.simulator.run(design.inputs, design.explosive)
print(time.perf_counter() - begin)
"""


class Measured(NamedTuple):
    """Costs and sizes of the real physics, and the part of them that a sleeping simulator has."""

    costs: Costs
    sizes: Sizes
    without_physics: Costs


class _Physics(NamedTuple):
    """Seconds per sample and per shard, and the results."""

    sample: float
    shard: float
    result: BatchResult


class _Writing(NamedTuple):
    """Seconds per sample and per shard; bytes per sample of a shard and of a task."""

    write: float
    shard: float
    row_shard: float
    row_task: float


def measure(folder: Path, say: Callable[[str], None] = print) -> Measured:
    """Measure everything; `folder` then also holds results for sleeping simulators."""
    made = physics(STORE_ROWS)
    design = made.design()
    say("physics")
    warm = _warm_seconds()
    solved = _physics(made, design)
    store_results(folder, solved.result)
    say("shards on disk")
    writing = _writing(folder, made, design, solved.result)
    say("builds without physics")
    with cluster(folder, processes=2, threads=1) as (address, pid):

        def run(samples: int, shard_size: int, sleep: float = 0.0) -> Timed:
            return timed(folder, Order(samples, shard_size, sleep, 2, address), pid)

        run(1000, 100)  # the workers import what they need
        small, wide, fine, long = (
            run(1000, 500), run(_WIDE, 2000), run(_WIDE, 100), run(_LONG, 2000),
        )  # fmt: skip
        gap = _gap(run(5000, 50, 1e-3), 0.05 + writing.shard + 50 * writing.write)
    bare, sizes = _of_builds(small, wide, fine, long)
    bare = bare._replace(
        design=_design_seconds(), gap=gap, shard=writing.shard, write=writing.write
    )
    costs = bare._replace(warm=warm, sample=solved.sample, shard=writing.shard + solved.shard)
    sizes = sizes._replace(row_shard=writing.row_shard, row_task=writing.row_task)
    return Measured(costs, sizes, bare)


def _of_builds(small: Timed, wide: Timed, fine: Timed, long: Timed) -> tuple[Costs, Sizes]:
    """Costs per build, sample and shard from builds of 1000, `_WIDE`, `_WIDE` and `_LONG` rows.

    In shards of (500, 2000, 100, 2000) rows; `wide` and `fine` differ in the number of shards
    alone.
    """
    shards, samples, more = _WIDE // 100 - _WIDE // 2000, _LONG - _WIDE, (_LONG - _WIDE) // 2000
    final_shard = max(0.0, (fine.after - wide.after) / shards)
    final = (long.after - wide.after - more * final_shard) / samples
    per_shard, per_sample = [], []
    for name in ("coordinator_cpu", "scheduler_cpu"):  # they work side by side: the slower counts
        spent = [getattr(build, name) for build in (wide, fine, long)]
        per_shard.append((spent[1] - spent[0]) / shards)
        per_sample.append(max(0.0, (spent[2] - spent[0] - more * per_shard[-1]) / samples))
    row_memory = (long.peak - wide.peak) / samples
    costs = Costs(
        start=median(build.start for build in (small, wide, fine, long)),
        connect=small.before,
        end=max(0.0, small.after - 1000 * final - 2 * final_shard),
        final=final,
        final_shard=final_shard,
        task=max(per_shard),
        send=max(per_sample),
    )
    sizes = Sizes(
        memory=long.peak - _LONG * row_memory,
        row_memory=row_memory,
        row_file=long.file / _LONG,
    )
    return costs, sizes


def _design_seconds() -> float:
    """Draw many rows and few; seconds per sample."""
    few, many = 5000, 105_000
    seconds = []
    for rows in (few, many):
        made = physics(rows)
        begin = time.perf_counter()
        made.design()
        seconds.append(time.perf_counter() - begin)
    return (seconds[1] - seconds[0]) / (many - few)


def _gap(build: Timed, run: float) -> float:
    """Time [s] that a worker waits between shards that last `run`, from its share of all time."""
    return run * build.waiting / (1.0 - build.waiting)


def _warm_seconds() -> float:
    """Import the physics and load its compiled kernels in a process that is a worker already."""
    for _ in range(2):  # the first may have to compile
        done = subprocess.run(
            [sys.executable, "-c", _WARM],
            capture_output=True, text=True, env=environment(), check=True,
        )  # fmt: skip
    return float(done.stdout)


def _physics(made: Physics, design: Design) -> _Physics:
    """Simulate all rows in one shard and in short ones."""

    def run(rows: slice) -> BatchResult:
        return made.simulator.run(_inputs(design, rows), design.explosive[rows])

    run(slice(0, 1))
    begin = time.thread_time()
    result = run(slice(None))
    middle = time.thread_time()
    for first in range(0, STORE_ROWS, _SHORT_SHARD):
        run(slice(first, first + _SHORT_SHARD))
    end = time.thread_time()
    shard = max(0.0, (end - 2 * middle + begin) / (STORE_ROWS // _SHORT_SHARD - 1))
    return _Physics((middle - begin - shard) / STORE_ROWS, shard, result)


def _writing(folder: Path, made: Physics, design: Design, result: BatchResult) -> _Writing:
    """Write the same shard many times, a short one and a long one; weigh file and task."""
    seconds, files, tasks, counts = [], [], [], (50, 2000)
    for rows in counts:
        part = BatchResult(
            result.status[:rows],
            {name: values[:rows] for name, values in result.outputs.items()},
            {name: values[:rows] for name, values in result.histories.items()},
        )
        times = []
        for _ in range(_REPEATS):
            begin = time.perf_counter()
            path = write_shard(folder, Span(0, rows), "0" * 64, part)
            times.append(time.perf_counter() - begin)
        seconds.append(median(times))
        files.append(path.stat().st_size)
        path.unlink()
        chosen = slice(0, rows)
        task = ShardTask(
            Span(0, rows), folder, "0" * 64, made.simulator,
            _inputs(design, chosen), design.explosive[chosen],
        )  # fmt: skip
        tasks.append(len(pickle.dumps(task)))
    more = counts[1] - counts[0]
    write = max(0.0, (seconds[1] - seconds[0]) / more)
    return _Writing(
        write=write,
        shard=seconds[0] - counts[0] * write,
        row_shard=(files[1] - files[0]) / more,
        row_task=(tasks[1] - tasks[0]) / more,
    )


def _inputs(design: Design, rows: slice) -> dict[str, FloatArray]:
    return {name: values[rows] for name, values in design.inputs.items()}
