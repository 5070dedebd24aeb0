"""Shards on workers: the only place that knows Dask.

Rows go to workers in shards that last a second or so, so that scheduling costs next to nothing, and
only a few shards per worker are under way at a time, so that neither scheduler nor client grows
with the dataset. Workers write their shard to disk and send a byte per row home; what counts is
which valid shards lie in the work folder, so a run that was killed, or lost a worker, goes on where
it stopped, and the number of workers cannot change a byte. By default workers are threads of this
process (the kernels release the interpreter lock); the address of any running scheduler may be
given instead.
"""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from castblast.cores import available_cores
from castblast.dataset.building.meter import Meter
from castblast.dataset.building.shards import ShardReport, ShardTask, run_shard
from castblast.dataset.building.work import Work
from castblast.errors import DatasetError, SimulationError, SpecError
from castblast.progress import ProgressCallback, silent
from castblast.stopping import interruptible

#: Share of the time of the workers that scheduling may cost before the log remarks on it.
MOST_SCHEDULING = 0.03
#: Shards under way per worker thread: one being simulated, the others ready beside it.
IN_FLIGHT = 3
_CONNECT_SECONDS = 10
_COUNT_SECONDS = 5.0
_RETRIES = 2
_GONE = "the scheduler went away; finished shards are kept: run the same command again to resume"


def build_shards(
    work: Work,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: ProgressCallback = silent,
) -> list[str]:
    """Simulate every row that is in no valid shard yet.

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
    OutputError
        A shard cannot be written.
    DatasetError
        The scheduler went away.
    SimulationError
        A shard brought several workers down.
    """
    valid, aside = work.resume(progress)
    total = len(work.status)
    lines = []
    if valid or aside:
        todo = sum(1 for _ in work.missing())
        note = f", {aside} cut shard{'s' if aside > 1 else ''} moved aside" if aside else ""
        lines.append(f"resume: {valid} of {valid + todo} shards valid{note}, {todo} to do")
    first = next(work.tasks(), None)
    if first is None:
        return lines
    with _quiet_dask(), _client(workers, scheduler) as (client, threads):
        share = work.done / total
        progress(share, "; ".join([*lines, "compiling, once per installation"]))
        if scheduler is None:
            _warm(first)
        meter = Meter()
        for report in _reports(client, work.tasks(), threads):
            work.mark(report.span, report.status)
            meter.add(report)
            progress(work.done / total, _progress_line(work, meter))
        lines += _summary(meter, threads())
    return lines


def _warm(task: ShardTask) -> None:
    """Compile every kernel once, before several threads would want to at the same time."""
    first = {name: values[:1] for name, values in task.inputs.items()}
    interruptible(task.simulator.run, first, task.explosive[:1])


def _reports(
    client: Any, tasks: Iterator[ShardTask], threads: Callable[[], int]
) -> Iterator[ShardReport]:
    """Run tasks on a cluster, a few per worker at a time, and yield their reports as they come.

    A future that was yielded need not be finished: when its worker dies, it goes back to waiting.
    Only "finished" and "error" are taken at their word; lost work is handed out again.
    """
    from dask.distributed import as_completed

    run = os.urandom(4).hex()  # keys of an earlier run must not answer for this one
    running: dict[str, ShardTask] = {}
    waiting = as_completed(loop=client.loop)

    def submit(task: ShardTask) -> None:
        key = f"castblast-{run}-{task.span.begin}"
        running[key] = task
        waiting.add(client.submit(run_shard, task, key=key, retries=_RETRIES, pure=False))

    def fill() -> None:
        for _ in range(IN_FLIGHT * max(1, threads()) - len(running)):
            task = next(tasks, None)
            if task is None:
                return
            submit(task)

    fill()
    for future in waiting:
        if future.status == "finished":
            report = _result(future)
            if not running.pop(future.key).path.exists():
                message = "the workers write to a folder that this machine does not see"
                raise DatasetError(message)
            future.release()
            fill()
            yield report
        elif future.status == "error":
            _result(future)
        elif client.status != "running":
            raise DatasetError(_GONE)
        elif future.status in ("lost", "cancelled"):
            submit(running[future.key])
        else:
            waiting.add(future)


def _result(future: Any) -> Any:
    """Return the report of a future, or raise what its worker raised."""
    from dask.distributed import KilledWorker

    try:
        return future.result()
    except KilledWorker as fault:
        message = (
            f"{fault.allowed_failures + 1} workers died one after the other on one shard "
            f"({future.key}); do they have enough memory? Finished shards are kept"
        )
        raise SimulationError(message) from None


@contextmanager
def _client(workers: int | None, scheduler: str | None) -> Iterator[tuple[Any, Callable[[], int]]]:
    """Connect to `scheduler`, or start threads in this process; yields also the count of threads.

    A user who interrupts does not wait for the shards under way: they are made again.
    """
    from dask.distributed import Client

    if scheduler is not None:
        with _remote(scheduler) as client:
            yield client, _ThreadCount(client)
        return
    count = workers or available_cores()
    stopped: BaseException | None = None
    try:
        with _local_cluster(count) as cluster, Client(cluster, set_as_default=False) as client:
            try:
                yield client, lambda: count
            except BaseException as fault:
                stopped = fault
                raise
    except TimeoutError:  # on a busy machine Dask may not close in time: that is not the news
        if stopped is None:
            raise
        raise stopped from None


@contextmanager
def _remote(scheduler: str) -> Iterator[Any]:
    from dask.distributed import Client
    from distributed.comm import CommClosedError

    try:
        client = Client(scheduler, timeout=_CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError, ImportError) as fault:
        message = f"--scheduler {scheduler}: no Dask scheduler answers there ({fault})"
        raise SpecError(message) from None
    with client:
        if not client.nthreads():
            message = f"--scheduler {scheduler}: it has no workers"
            raise SpecError(message)
        try:
            yield client
        except CommClosedError:
            raise DatasetError(_GONE) from None


@contextmanager
def _local_cluster(count: int) -> Iterator[Any]:
    from dask.distributed import LocalCluster
    from distributed.threadpoolexecutor import ThreadPoolExecutor

    class Threads(ThreadPoolExecutor):  # type: ignore[misc]
        """Threads that are left behind when there is no time to wait for them."""

        abandoned = False

        def shutdown(self, wait: bool = True, timeout: float | None = None) -> None:
            super().shutdown(wait=wait and not self.abandoned, timeout=timeout)

    threads = Threads(count, thread_name_prefix="castblast-worker")
    with LocalCluster(
        n_workers=1,
        threads_per_worker=count,
        executor=threads,
        processes=False,
        memory_limit=0,
        dashboard_address="127.0.0.1:0",  # any free port: a taken one makes Dask complain
        silence_logs=logging.CRITICAL,
    ) as cluster:
        try:
            yield cluster
        except KeyboardInterrupt:
            threads.abandoned = True
            raise


class _ThreadCount:
    """Threads of all workers of a scheduler, asked for now and then: workers come and go."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._count, self._asked = 0, -_COUNT_SECONDS

    def __call__(self) -> int:
        now = time.monotonic()
        if now - self._asked >= _COUNT_SECONDS:
            self._count, self._asked = sum(self._client.nthreads().values()), now
        return self._count


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


def _progress_line(work: Work, meter: Meter) -> str:
    total, done = len(work.status), work.done
    left = round((total - done) / meter.rate)
    eta = f"{left // 3600}:{left // 60 % 60:02d}:{left % 60:02d}"
    rate = f"{meter.rate:.0f} samples/s"
    return f"{done}/{total} failed {work.failed} {rate} {meter.memory} ETA {eta}"


def _summary(meter: Meter, threads: int) -> list[str]:
    """Rate, peak and what the workers did besides simulating."""
    seconds, scheduling = meter.seconds, meter.scheduling_share
    remark = "" if scheduling < MOST_SCHEDULING else " (much: larger shards would help)"
    return [
        f"{meter.rows} samples in {seconds:.1f} s, {meter.rate:.0f} samples/s, {meter.memory}",
        f"of the workers' time: scheduling {scheduling:.1%}{remark}, idle at start and end "
        f"{meter.idle_share(threads):.1%}",
    ]
