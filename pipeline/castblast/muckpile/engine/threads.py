"""How many threads the muckpile uses; the answer never depends on it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

import numba

from castblast.errors import SimulationError

# A thread that waits for the others at the end of a pass must not burn the core that one of them
# needs: on a busy machine the default of libgomp makes a run ten times slower. Read when the
# first parallel kernel starts; whoever sets it outside is obeyed.
os.environ.setdefault("GOMP_SPINCOUNT", "2000")

# A step is five short parallel passes. Under TBB each start takes longer than the one before it
# (its list of observers grows), so that a run of 12,000 steps took 20 s the first time, 115 s the
# second and 346 s the third; OpenMP takes 4 s every time.
if "NUMBA_THREADING_LAYER_PRIORITY" not in os.environ:
    numba.config.THREADING_LAYER_PRIORITY = ["omp", "tbb", "workqueue"]

#: Whether this process is a fork of one whose threads it does not have. GNU OpenMP goes on to count
#: on them: a parallel kernel would wait for ever, or end the process.
_threads_lost = False


def _after_fork() -> None:
    global _threads_lost
    try:
        _threads_lost = _threads_lost or numba.threading_layer() == "omp"
    except ValueError:  # no parallel kernel has run: this process starts threads of its own
        return


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def require_threads() -> None:
    """Refuse parallel kernels in a process that was forked after one had run in its parent.

    Raises
    ------
    SimulationError
        Says how to start processes instead.
    """
    if _threads_lost:
        message = (
            "this process was forked from one that has run a muckpile, and has none of its OpenMP "
            'threads; start processes with multiprocessing.get_context("spawn")'
        )
        raise SimulationError(message)


#: A step of this many balls takes about as long as waking a thread on a busy machine.
BALLS_PER_THREAD = 2000


@contextmanager
def thread_count(threads: int) -> Iterator[int]:
    """Let kernels use `threads` threads (0 or too many: all) for as long as the context lives.

    Raises
    ------
    SimulationError
        As `require_threads`.
    """
    require_threads()
    before = numba.get_num_threads()
    most = int(numba.config.NUMBA_NUM_THREADS)
    number = most if threads <= 0 else min(threads, most)
    numba.set_num_threads(number)
    try:
        yield number
    finally:
        numba.set_num_threads(before)


@contextmanager
def enough_threads(balls: int) -> Iterator[int]:
    """Use no more threads than `balls` give work to; waking the others costs more than it saves."""
    require_threads()
    with thread_count(max(1, min(numba.get_num_threads(), balls // BALLS_PER_THREAD))) as number:
        yield number
