"""Which thread layer the muckpile runs on."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytest.importorskip("numba.np.ufunc.omppool", reason="this build of Numba has no OpenMP")

RUN = """
import numba
from castblast.muckpile.engine.threads import thread_count

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


FORK = """
import multiprocessing, sys
from concurrent.futures import ProcessPoolExecutor
import numpy as np
from castblast.errors import CastblastError
from castblast.muckpile.balls.contact import ContactLaw
from castblast.muckpile.balls.particles import particles_at_rest
from castblast.muckpile.cast.solver import CastCase, run_cast
from castblast.muckpile.ground.walls import floor

def job(k):
    balls = particles_at_rest(np.array([[0.0, 0.0, 0.2]]), np.array([0.1]))
    case = CastCase(balls, ContactLaw(), floor(), np.empty(0), np.empty((0, 3)), max_time=0.05)
    try:
        return f"ran {len(run_cast(case).particles.radius)}"
    except CastblastError as fault:
        return str(fault)

def show(context):
    with multiprocessing.get_context(context).Pool(2) as pool:
        print(pool.map_async(job, [1, 2]).get(timeout=240)[0], flush=True)
    with ProcessPoolExecutor(1, multiprocessing.get_context(context)) as pool:
        print(pool.submit(job, 3).result(timeout=240), flush=True)

if __name__ == "__main__":
    if sys.argv[1] == "before":
        show("fork")
    else:
        print(job(0), flush=True)
        show("fork")
        show("spawn")
"""


def forked(folder, when):
    script = folder / "job.py"
    script.write_text(FORK)
    result = subprocess.run(
        [sys.executable, script, when],
        capture_output=True, text=True, check=True, timeout=300,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )  # fmt: skip
    return result.stdout.splitlines()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_fork_after_a_muckpile_says_spawn(tmp_path):
    """GNU OpenMP would end the process without a word, and a pool would wait for ever."""
    first, pool, executor, *spawned = forked(tmp_path, "after")
    assert first == "ran 1"
    for line in (pool, executor):
        assert 'start processes with multiprocessing.get_context("spawn")' in line
    assert spawned == ["ran 1", "ran 1"]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_fork_before_any_muckpile_runs_it(tmp_path):
    assert forked(tmp_path, "before") == ["ran 1", "ran 1"]
