"""Speed of the muckpile: particle-steps per second of a packed block thrown for half a second."""

import numpy as np
import pytest

from castblast.muckpile.bench import Bench, block_velocities, echelon_delays
from castblast.muckpile.contact import ContactLaw
from castblast.muckpile.packing import fill_bench
from castblast.muckpile.solver import CastCase, run_cast
from castblast.muckpile.walls import bench_walls

BENCH = Bench(12.0, 12.0, 8.0, np.pi / 2, 3.0, 3.0)


@pytest.fixture(scope="module")
def case() -> CastCase:
    packing = fill_bench(BENCH, mean_radius=0.2, seed=1)
    return CastCase(
        particles=packing.particles,
        law=ContactLaw(),
        walls=bench_walls(BENCH),
        block_delay=echelon_delays(4, 4, 0.03),
        block_velocity=block_velocities(12.7, 16),
        max_time=0.5,
    )


@pytest.mark.benchmark(group="muckpile, 16 blocks for 0.5 s")
@pytest.mark.parametrize("threads", [1, 2])
def test_cast(benchmark, case: CastCase, threads: int) -> None:
    """Extra figures: million particle-steps per second and number of balls."""
    case = case._replace(threads=threads)
    run_cast(case._replace(max_time=0.01))
    result = benchmark.pedantic(run_cast, args=(case,), rounds=3)
    steps = result.counters.particle_steps
    benchmark.extra_info["balls"] = len(case.particles.radius)
    benchmark.extra_info["Mps/s"] = steps / benchmark.stats.stats.min * 1e-6
    print(f"{threads} threads: {benchmark.extra_info}")
