"""Shards on workers: the only place that knows Dask.

Rows go to workers in shards that last a second or more, so that scheduling costs next to nothing.
Workers write their shard to disk and send a few numbers home; what counts is which valid shards
lie in the work folder, so a run that was killed, or lost a worker, goes on where it stopped, and
the number of workers cannot change a byte. By default workers are threads of this process (the
kernels release the interpreter lock); the address of any running scheduler may be given instead.
"""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from castblast.dataset.shards import ShardReport, ShardTask, run_shard, split_valid
from castblast.errors import DatasetError, SpecError
from castblast.progress import ProgressCallback, silent

_CONNECT_SECONDS = 10
_RETRIES = 2


def build_shards(
    tasks: list[ShardTask],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: ProgressCallback = silent,
) -> list[str]:
    """Run every task that has no valid shard yet.

    Parameters
    ----------
    workers : int, optional
        Threads of this process; default: one per core it may use.
    scheduler : str, optional
        Address of a running Dask scheduler whose workers see the work folder.

    Returns
    -------
    list of str
        What was resumed and done, for people.

    Raises
    ------
    SpecError
        No scheduler answers at the address, or it has no workers.
    DatasetError
        A shard cannot be written.
    """
    done, todo, aside = split_valid(tasks)
    lines = []
    if done or aside:
        note = f", {aside} cut shard{'s' if aside > 1 else ''} moved aside" if aside else ""
        lines.append(f"resume: {len(done)} of {len(tasks)} shards valid{note}, {len(todo)} to do")
    if not todo:
        return lines
    finished = sum(len(task.sample) for task in done)
    total = finished + sum(len(task.sample) for task in todo)
    fresh = failed = 0
    with _quiet_dask(), _client(workers, scheduler) as client:
        progress(finished / total, "; ".join([*lines, "compiling, once per installation"]))
        _warm(todo[0])
        begin = time.perf_counter()
        for report in _reports(client, todo):
            fresh += report.rows
            failed += report.failed
            rate = fresh / (time.perf_counter() - begin)
            line = _progress_line(finished + fresh, total, failed, rate)
            progress((finished + fresh) / total, line)
        seconds = time.perf_counter() - begin
    return [*lines, f"{fresh} samples in {seconds:.1f} s, {fresh / seconds:.0f} samples/s"]


def _warm(task: ShardTask) -> None:
    """Compile every kernel once, before several threads would want to at the same time."""
    task.simulator.run(
        {name: values[:1] for name, values in task.inputs.items()}, task.explosive[:1]
    )


def _reports(client: Any, tasks: list[ShardTask]) -> Iterator[ShardReport]:
    """Run tasks on a cluster and yield their reports as they come.

    A future that was yielded need not be finished: when its worker dies, it goes back to waiting.
    Only "finished" and "error" are taken at their word; lost work is handed out again.
    """
    from dask.distributed import as_completed

    run = os.urandom(4).hex()  # keys of an earlier run must not answer for this one
    futures = {}

    def submit(task: ShardTask) -> Any:
        future = client.submit(
            run_shard, task, key=f"castblast-{run}-{task.index}", retries=_RETRIES, pure=False
        )
        futures[future.key] = task
        return future

    waiting = as_completed([submit(task) for task in tasks], loop=client.loop)
    for future in waiting:
        if future.status == "finished":
            report = future.result()
            if not futures.pop(future.key).path.exists():
                message = "the workers write to a folder that this machine does not see"
                raise DatasetError(message)
            yield report
        elif future.status == "error":
            future.result()  # raises what the worker raised
        else:
            if future.status in ("lost", "cancelled"):
                future = submit(futures[future.key])
            waiting.add(future)


@contextmanager
def _client(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    """Connect to `scheduler`, or start threads in this process."""
    from dask.distributed import Client, LocalCluster

    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=_CONNECT_SECONDS, set_as_default=False)
        except (OSError, ValueError, ImportError) as fault:
            message = f"--scheduler {scheduler}: no Dask scheduler answers there ({fault})"
            raise SpecError(message) from None
        with client:
            if not client.scheduler_info()["workers"]:
                message = f"--scheduler {scheduler}: it has no workers"
                raise SpecError(message)
            yield client
        return
    cluster = LocalCluster(
        n_workers=1,
        threads_per_worker=workers or _cores(),
        processes=False,
        memory_limit=0,
        dashboard_address="127.0.0.1:0",  # any free port: a taken one makes Dask complain
        silence_logs=logging.CRITICAL,
    )
    with cluster, Client(cluster, set_as_default=False) as client:
        yield client


@contextmanager
def _quiet_dask() -> Iterator[None]:
    """Keep Dask from writing on the screen: what goes wrong reaches us as an exception."""
    import distributed  # noqa: F401  (sets the levels of its loggers when imported)

    loggers = [logging.getLogger(n) for n in logging.root.manager.loggerDict if "distributed" in n]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def _cores() -> int:
    """Cores that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def _progress_line(done: int, total: int, failed: int, rate: float) -> str:
    left = round((total - done) / rate)
    eta = f"{left // 3600}:{left // 60 % 60:02d}:{left % 60:02d}"
    return f"{done}/{total} failed {failed} {rate:.0f} samples/s ETA {eta}"
