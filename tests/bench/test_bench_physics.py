"""Speed of the physics: near field per zone-step, burden motion against it. `make bench` only."""

import pytest

from castblast.blast import BlastCase, make_case
from castblast.burden.motion import solve_burden_motion
from castblast.nearfield.solver import solve_near_field
from castblast.specs.explosive import load_explosive

CASES = {
    "default": {},
    "weak": {"ucs": 1.5e7, "young_modulus": 8e9},
    "strong": {"ucs": 1.9e8, "young_modulus": 4.5e10},
}


@pytest.fixture(scope="module", params=CASES)
def case(request: pytest.FixtureRequest) -> BlastCase:
    made = make_case(load_explosive("anfo").to_explosive(), CASES[request.param])
    solve_near_field(made.explosive, made.rock, made.hole, made.near_field)
    return made


@pytest.mark.benchmark(group="physics, one run")
def test_near_field(benchmark, case: BlastCase) -> None:
    arguments = (case.explosive, case.rock, case.hole, case.near_field)
    result = benchmark(solve_near_field, *arguments)
    benchmark.extra_info["steps"] = result.n_steps
    benchmark.extra_info["us per step"] = benchmark.stats.stats.median / result.n_steps * 1e6


@pytest.mark.benchmark(group="physics, one run")
def test_burden_motion(benchmark, case: BlastCase) -> None:
    """Mark: at most 30 % of the near field of the same case."""
    near = solve_near_field(case.explosive, case.rock, case.hole, case.near_field)
    arguments = (case.explosive, case.geometry, case.parameters, near.expanded_hole_radius)
    solve_burden_motion(*arguments)
    result = benchmark(solve_burden_motion, *arguments)
    benchmark.extra_info["steps"] = result.n_steps
