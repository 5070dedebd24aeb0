"""Wall time and cost of a dataset from what its parts cost: closed forms, no measurement.

A build draws its design, hands shards to workers one after the other, and joins the shards to one
file. Drawing and joining are serial. The i-th shard leaves the coordinator at i c and lasts t on a
worker, so that K equal shards on w workers, which take the next shard when they are free, end after

    r c + m t   when a wave of w shards takes longer to run than to hand out,
    K c + t     when it does not,

with m = ceil(K / w) waves, the last of them of r shards; the larger of both is right. The disk that
all workers write to sets a third bound. Times in seconds, memory and files in bytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, inf
from typing import NamedTuple

#: Shards that may be recommended [rows].
SHARD_SIZES = (100, 200, 500, 1000, 2000, 5000, 10_000, 20_000)
#: A shard that is lost with its worker should cost no more than this [s].
LONGEST_SHARD = 60.0
#: The smallest shard whose wall time exceeds the shortest by this factor at most is recommended.
GOOD_ENOUGH = 1.01


class Costs(NamedTuple):
    """What the parts of a build cost.

    Attributes
    ----------
    start, connect, end : float [s]
        Per build: process and imports, reaching the workers, description of the file and exit.
    warm : float [s]
        Per build: workers load the compiled kernels, all at the same time.
    design, final : float [s]
        Per sample, on the coordinator alone: drawing; reading back, joining, writing, checking.
    final_shard : float [s]
        Per shard, on the coordinator alone, while joining.
    task, send : float [s]
        Per shard and per sample, on the coordinator while workers run.
    gap, shard : float [s]
        Per shard, on a worker: waiting for it; its file, and lanes that idle at its end.
    sample, write : float [s]
        Per sample, on a worker: physics; hashing and writing.
    """

    start: float = 0.0
    connect: float = 0.0
    end: float = 0.0
    warm: float = 0.0
    design: float = 0.0
    final: float = 0.0
    final_shard: float = 0.0
    task: float = 0.0
    send: float = 0.0
    gap: float = 0.0
    shard: float = 0.0
    sample: float = 0.0
    write: float = 0.0


class Sizes(NamedTuple):
    """Bytes: the coordinator by itself and per sample; per sample on disk and on the wire."""

    memory: float = 0.0
    row_memory: float = 0.0
    row_shard: float = 0.0
    row_file: float = 0.0
    row_task: float = 0.0


class Means(NamedTuple):
    """What a build may use.

    Attributes
    ----------
    memory : float [byte]
        Of a coordinator.
    disk_rate : float [byte/s]
        At which all workers together can write.
    price : float
        Of a core-hour.
    """

    memory: float = inf
    disk_rate: float = inf
    price: float = 0.0


class Build(NamedTuple):
    """Samples on workers in shards of so many rows."""

    samples: int
    workers: int
    shard_size: int

    @property
    def shards(self) -> int:
        """Number of shards."""
        return ceil(self.samples / self.shard_size)


class Prediction(NamedTuple):
    """Wall time by phase [s], and what limits it.

    Attributes
    ----------
    before, shards, after : float [s]
        Start to the first task; until the last shard is written; until the file is there.
    limit : str
        "start" (fixed costs), "workers", "scheduler", "disk" or "assembly" (design and file).
    """

    before: float
    shards: float
    after: float
    limit: str

    @property
    def wall(self) -> float:
        """Wall time [s]."""
        return self.before + self.shards + self.after


class Plan(NamedTuple):
    """A build as recommended: `parts` datasets side by side, each with its own coordinator."""

    build: Build
    parts: int
    prediction: Prediction
    core_hours: float
    memory: float


def worker_seconds(costs: Costs, rows: float) -> float:
    """Time of a worker for a shard [s]."""
    return costs.gap + costs.shard + rows * (costs.sample + costs.write)


def predict(costs: Costs, sizes: Sizes, build: Build, disk_rate: float = inf) -> Prediction:
    """Wall time of one dataset.

    The shards are taken as equal: a short last one makes the prediction long by less than a shard.
    """
    n, shards = build.samples, build.shards
    hand_out = costs.task + n / shards * costs.send
    run = worker_seconds(costs, n / shards)
    waves = ceil(shards / build.workers)
    last = shards - (waves - 1) * build.workers
    bounds = {
        "workers": last * hand_out + waves * run,
        "scheduler": shards * hand_out + run,
        "disk": n * sizes.row_shard / disk_rate,
    }
    binding = max(bounds, key=lambda name: bounds[name])
    fixed = costs.start + costs.connect + costs.warm + costs.end
    serial = n * (costs.design + costs.final) + shards * costs.final_shard
    longest = max(("start", fixed), (binding, bounds[binding]), ("assembly", serial), key=_seconds)
    return Prediction(
        before=costs.start + costs.connect + n * costs.design,
        shards=costs.warm + bounds[binding],
        after=n * costs.final + shards * costs.final_shard + costs.end,
        limit=longest[0],
    )


def best_shard_size(
    costs: Costs,
    sizes: Sizes,
    samples: int,
    workers: int,
    disk_rate: float = inf,
    choices: Sequence[int] = SHARD_SIZES,
) -> int:
    """Smallest shard that is as good as any: it loses least when a worker dies."""
    allowed = [s for s in choices if worker_seconds(costs, s) <= LONGEST_SHARD] or [min(choices)]
    walls = {
        s: predict(costs, sizes, Build(samples, workers, min(s, samples)), disk_rate).wall
        for s in allowed
    }
    return min(s for s, wall in walls.items() if wall <= GOOD_ENOUGH * min(walls.values()))


def parts_for_memory(sizes: Sizes, samples: int, memory: float) -> int:
    """Datasets that the samples must be cut into for every coordinator to have room."""
    if memory == inf or sizes.row_memory == 0.0:
        return 1
    if memory <= sizes.memory:
        message = f"a coordinator of {memory:g} bytes cannot start: it needs {sizes.memory:g}"
        raise ValueError(message)
    return ceil(samples * sizes.row_memory / (memory - sizes.memory))


def even_parts(parts: int, workers: int) -> int:
    """Least number, `parts` or more, that the workers can be shared among without a rest.

    A divisor of the workers, or else a multiple of them, of which as many as there are workers
    take their turn at a time.
    """
    divisors = (p for p in range(parts, workers + 1) if workers % p == 0)
    return next(divisors, ceil(parts / workers) * workers)


def plan(
    costs: Costs, sizes: Sizes, means: Means, samples: int, workers: int, parts: int = 0
) -> Plan:
    """Recommend shards and, where `parts` is 0, the fewest even parts that fit into memory.

    Parts share workers and disk evenly and run side by side; when there are fewer workers than
    parts, several parts take turns on one worker.
    """
    parts = parts or even_parts(parts_for_memory(sizes, samples, means.memory), workers)
    together = min(parts, workers)
    rows, each = ceil(samples / parts), workers // together
    rate = means.disk_rate / together
    size = best_shard_size(costs, sizes, rows, each, rate)
    build = Build(rows, each, min(size, rows))
    one = predict(costs, sizes, build, rate)
    turns = ceil(parts / together)
    turn = Prediction(turns * one.before, turns * one.shards, turns * one.after, one.limit)
    return Plan(
        build=build,
        parts=parts,
        prediction=turn,
        core_hours=core_hours(turn, workers, together),
        memory=sizes.memory + rows * sizes.row_memory,
    )


def core_hours(prediction: Prediction, workers: int, coordinators: int = 1) -> float:
    """Core-hours to be paid: workers while there are shards, coordinators from start to end."""
    return (workers * prediction.shards + coordinators * prediction.wall) / 3600.0


def _seconds(pair: tuple[str, float]) -> float:
    return pair[1]
