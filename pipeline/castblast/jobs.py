"""Independent pieces of work, some at a time, each in a process of its own on one BLAS thread.

The numbers do not depend on how many run at once: a piece gets its inputs and returns its result,
and results come back in the order of the pieces.
"""

from __future__ import annotations

import multiprocessing
import pickle
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from castblast.cores import available_cores
from castblast.errors import SimulationError
from castblast.progress import ProgressCallback, part, silent


@dataclass(frozen=True)
class Job:
    """One piece of work.

    Attributes
    ----------
    label : str
        For people.
    function : callable
        Importable by its name; called with `arguments`. Runs in another process if there are
        several at a time and the arguments can be pickled; then the result must be, too.
    arguments : tuple
    keep : callable, optional
        Told the result, in this process, as soon as it is there: what is kept survives a stop.
    """

    label: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...] = ()
    keep: Callable[[Any], None] | None = None


def run_jobs(
    jobs: Sequence[Job], workers: int | None = None, progress: ProgressCallback = silent
) -> list[Any]:
    """Run jobs and give their results in order.

    Parameters
    ----------
    jobs : sequence of Job
    workers : int, optional
        Processes at a time; None: the cores there are. With one, everything runs in this process;
        with more, a script needs the usual ``if __name__ == "__main__"``.
    progress : callable
        Told what is under way.

    Raises
    ------
    SimulationError
        A process died.
    Exception
        Whatever a job raises; the others are stopped.
    """
    away = [number for number, job in enumerate(jobs) if _travels(job)]
    count = min(len(away), workers or available_cores())
    if count <= 1:
        away = []
    share = len(away) / max(len(jobs), 1)
    far = _run_away([jobs[number] for number in away], count, part(progress, 0.0, share))
    results = dict(zip(away, far, strict=True))
    here = [number for number in range(len(jobs)) if number not in results]
    for done, number in enumerate(here, start=len(away)):
        progress(done / len(jobs), jobs[number].label)
        results[number] = _run_here(jobs[number])
    return [results[number] for number in range(len(jobs))]


def _travels(job: Job) -> bool:
    """Whether the arguments can be sent to another process; a user's own estimator may not."""
    try:
        pickle.dumps(job.arguments, protocol=5)
    except (pickle.PicklingError, AttributeError, TypeError):
        return False
    return True


def _run_away(jobs: Sequence[Job], count: int, progress: ProgressCallback) -> list[Any]:
    """Run jobs in processes; on a fault or a stop the others are ended."""
    if not jobs:
        return []
    others = set(multiprocessing.active_children())
    with ProcessPoolExecutor(count, multiprocessing.get_context("spawn")) as pool:
        try:
            return _collect(pool, jobs, count, progress)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in set(multiprocessing.active_children()) - others:
                process.terminate()
            raise


@contextmanager
def _interrupts_for_parent_only() -> Iterator[None]:
    """Start processes that never hear Ctrl-C, which reaches all processes of a terminal.

    They inherit that it is blocked; the parent, which hears it afterwards, ends them.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _run_here(job: Job) -> Any:
    result = job.function(*job.arguments)
    if job.keep is not None:
        job.keep(result)
    return result


def _collect(
    pool: ProcessPoolExecutor, jobs: Sequence[Job], count: int, progress: ProgressCallback
) -> list[Any]:
    with _interrupts_for_parent_only():
        futures: dict[Future[Any], int] = {
            pool.submit(job.function, *job.arguments): number for number, job in enumerate(jobs)
        }
    results: list[Any] = [None] * len(jobs)
    left = set(futures)
    while left:
        # Jobs start in order, so those under way are the first ones left.
        under_way = sorted(futures[future] for future in left)[:count]
        labels = ", ".join(jobs[number].label for number in under_way)
        progress(1.0 - len(left) / len(jobs), labels)
        done, left = wait(left, return_when=FIRST_COMPLETED)
        for future in done:
            number = futures[future]
            try:
                results[number] = future.result()
            except BrokenExecutor:
                message = (
                    f"a process died on one of: {labels} (out of memory?); what is finished is "
                    "kept, run again with --workers 1"
                )
                raise SimulationError(message) from None
            keep = jobs[number].keep
            if keep is not None:
                keep(results[number])
    progress(1.0, jobs[-1].label)
    return results
