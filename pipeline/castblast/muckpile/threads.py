"""How many threads the muckpile uses; the answer never depends on it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numba


@contextmanager
def thread_count(threads: int) -> Iterator[int]:
    """Let kernels use `threads` threads (0 or too many: all) for as long as the context lives."""
    before = numba.get_num_threads()
    most = int(numba.config.NUMBA_NUM_THREADS)
    number = most if threads <= 0 else min(threads, most)
    numba.set_num_threads(number)
    try:
        yield number
    finally:
        numba.set_num_threads(before)
