"""Which thread layer the muckpile runs on."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytest.importorskip("numba.np.ufunc.omppool", reason="this build of Numba has no OpenMP")

RUN = """
import numba
from castblast.muckpile.threads import thread_count

@numba.njit(parallel=True)
def count(number):
    total = 0
    for _ in numba.prange(number):
        total += 1
    return total

with thread_count(2):
    assert count(10) == 10
print(numba.threading_layer())
"""


def layer(**environment):
    result = subprocess.run(
        [sys.executable, "-c", RUN],
        capture_output=True, text=True, check=True, env=os.environ | environment,
    )  # fmt: skip
    return result.stdout.strip()


def test_openmp_comes_first():
    """Under TBB every step starts later than the one before: a run of 4 s takes minutes."""
    assert layer() == "omp"


def test_the_order_set_outside_is_obeyed():
    assert layer(NUMBA_THREADING_LAYER_PRIORITY="workqueue omp tbb") == "workqueue"
