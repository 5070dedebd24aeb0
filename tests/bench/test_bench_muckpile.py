"""Speed of the muckpile: a packed block whose front third is thrown, on all cores.

Printed per precision: million particle-steps per second, core time per contact, pairs per ball.
The marks are ratios to LIGGGHTS (same law, same cores): 1.8 in double, 2.7 in mixed precision.
"""

from math import inf
from time import perf_counter

import numpy as np
import pytest

from castblast.muckpile.bench import Bench
from castblast.muckpile.contact import ContactLaw
from castblast.muckpile.packing import fill_bench
from castblast.muckpile.particles import Particles
from castblast.muckpile.simulation import Simulation
from castblast.muckpile.threads import thread_count
from castblast.muckpile.walls import bench_walls

BENCH = Bench(12.0, 12.0, 8.0, np.pi / 2, 3.0, 3.0)


@pytest.fixture(scope="module")
def balls() -> Particles:
    packed = fill_bench(BENCH, mean_radius=0.2, seed=1).particles
    packed.velocity[packed.position[:, 0] > -4.0, 0] = 12.7
    return packed


@pytest.mark.benchmark(group="muckpile, front third thrown, 200 steps")
@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("precision", ["float64", "mixed"])
def test_cast(benchmark, balls: Particles, precision: str, threads: int) -> None:
    """Extra figures: speed over everything, renewals of the lists included."""
    count, held = len(balls.radius), np.zeros(len(balls.radius), dtype=np.bool_)

    def throw() -> tuple[int, float, int, int]:
        run = Simulation(
            balls, ContactLaw(), bench_walls(BENCH), held, keep_ledger=False, precision=precision
        )
        run.run(0.005, inf)
        before, began = run.steps, perf_counter()
        run.run(0.135, inf)
        seconds = perf_counter() - began
        return run.steps - before, seconds, run.survey_contacts().contacts, run.rebuilds

    with thread_count(threads) as used:
        throw()
        found = [throw() for _ in range(3)]
        benchmark.pedantic(throw, rounds=1)
    steps, seconds, contacts, rebuilds = min(found, key=lambda row: row[1])
    benchmark.extra_info |= {
        "balls": count,
        "Mps/s": round(count * steps / seconds * 1e-6, 2),
        "core ns per contact": round(used * seconds / (steps * contacts) * 1e9, 1),
        "contacts per ball": round(contacts / count, 2),
        "renewals": rebuilds,
    }
    print(f"{precision}, {threads} threads: {benchmark.extra_info}")
