"""Casts: firing at the delay, flight, rest, and the trend of a pile with rolling friction."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest

from castblast.errors import Status
from castblast.muckpile.balls.contact import ContactLaw
from castblast.muckpile.balls.particles import particles_at_rest
from castblast.muckpile.bench.geometry import Bench, block_shape, block_velocities, row_delays
from castblast.muckpile.bench.packing import fill_bench, mean_radius_for_count
from castblast.muckpile.bench.surroundings import bench_walls
from castblast.muckpile.cast.solver import CastCase, check_case, run_cast
from castblast.muckpile.ground.walls import floor
from castblast.muckpile.results.metrics import pile_metrics

G = 9.81


def test_a_block_flies_from_its_delay_on():
    """A held ball 5 m up, fired at 0.123 s with (12.7, 0, 3) m/s, is on its parabola after that.

    The step is fitted to the delay, so the parabola is met to rounding.
    """
    balls = particles_at_rest([[0.0, 0.0, 5.0], [3.0, 0.0, 5.0]], [0.1, 0.1], block=[0, 1])
    seen = {}
    case = CastCase(
        balls, ContactLaw(), floor(-1e3), np.array([0.123, inf]),
        np.array([[12.7, 0.0, 3.0], [1.0, 1.0, 1.0]]), max_time=1.0, snapshot_interval=0.01,
    )  # fmt: skip
    result = run_cast(case, snapshot=lambda time, state: seen.update({time: state}))
    assert result.status == Status.NOT_CONVERGED
    for time, state in seen.items():
        flown = max(time - 0.123, 0.0)
        exact = [12.7 * flown, 0.0, 5.0 + 3.0 * flown - 0.5 * G * flown**2]
        np.testing.assert_allclose(state.position[0], exact, atol=1e-9)
        np.testing.assert_array_equal(state.position[1], [3.0, 0.0, 5.0])


def test_unfired_blocks_fall_when_they_are_not_held():
    balls = particles_at_rest([[0.0, 0.0, 5.0]], [0.1], block=[0])
    case = CastCase(
        balls, ContactLaw(), floor(-1e3), np.array([inf]), np.zeros((1, 3)), max_time=0.5,
        hold_unfired=False,
    )  # fmt: skip
    fallen = run_cast(case).particles.position[0, 2]
    assert fallen == pytest.approx(5.0 - 0.5 * G * 0.25, abs=1e-9)


def test_nothing_to_fire_is_rest():
    balls = particles_at_rest([[0.0, 0.0, 5.0]], [0.1], block=[0])
    result = run_cast(CastCase(balls, ContactLaw(), floor(), np.array([inf]), np.zeros((1, 3))))
    assert result.status == Status.OK
    assert result.time < 0.5


def test_all_faults_of_a_case_are_named():
    balls = particles_at_rest([[0.0, 0.0, 5.0]], [0.1], block=[3])
    case = CastCase(
        balls, ContactLaw(), floor(), np.array([-1.0]), np.zeros((2, 3)), step_safety=2.0
    )
    assert len(check_case(case)) == 4
    with pytest.raises(ValueError, match="belongs to block 3"):
        run_cast(case)


@pytest.fixture(scope="module")
def cast():
    """A slice of a bench of 1,500 balls, 6 m high, thrown row by row with 9 m/s."""
    bench = Bench(length=4.0, width=9.0, height=6.0, burden=3.0, spacing=4.0)
    packing = fill_bench(bench, mean_radius=mean_radius_for_count(bench, 1500), seed=1)
    rows, columns = block_shape(bench)
    case = CastCase(
        packing.particles, ContactLaw(), bench_walls(bench, ends="mirror"),
        row_delays(rows, columns, 0.1), block_velocities(9.0, rows * columns),
    )  # fmt: skip
    return bench, case, run_cast(case)


def test_a_cast_comes_to_rest_with_its_energy_accounted_for(cast):
    _, case, result = cast
    assert result.status == Status.OK
    assert 1.0 < result.time < 12.0
    assert abs(result.ledger.residual) < 0.005
    history = result.history
    assert history.translational_energy[-1] < 1e-4 * history.translational_energy.max()
    mass = 4.0 / 3.0 * np.pi * 2600.0 * np.sum(case.particles.radius**3)
    assert result.ledger.fired == pytest.approx(0.5 * mass * 81.0, rel=0.25)


def test_rows_further_back_are_thrown_less(cast):
    """No more than free flight and sliding to a halt, v^2/(2 mu g); each row less than the last."""
    bench, case, result = cast
    metrics = pile_metrics(
        case.particles, result.particles, bench, block_velocity=case.block_velocity,
        walls=case.walls,
    )  # fmt: skip
    assert 0.0 < metrics.throw[0] < metrics.ballistic_throw + 81.0 / (2.0 * 0.5 * G)
    assert 0.05 < metrics.cast_fraction < 1.0
    assert np.all(np.diff(metrics.block_throw[:, 0]) < 0.0)
    assert metrics.throw[2] < 0.0
    assert 0.0 < metrics.runout_95 < metrics.runout_99
    assert 0.8 < metrics.swell < 1.2  # the bench is rubble as well, as loose as the pile
    assert 1.3 < metrics.rock_swell < 1.9
    assert metrics.maximum_height < 1.2 * bench.height


def test_no_ball_leaves_through_a_wall(cast):
    bench, _, result = cast
    x, y, z = result.particles.position.T
    radius = result.particles.radius
    assert np.all(z > 0.8 * radius)
    assert np.all((y > 0.8 * radius) & (bench.length - y > 0.8 * radius))
    behind = x < -bench.width
    assert np.all(z[behind] > bench.height)


def test_a_pile_is_steeper_with_more_rolling_friction(cast):
    """Ai et al. (2011), Wensrich and Katterfeld (2012): run-out falls with mu_r."""
    _, case, result = cast
    smooth = run_cast(case._replace(law=ContactLaw(rolling_friction=0.05), max_time=4.0))
    far, near = (
        np.sqrt(np.mean(np.maximum(r.particles.position[:, 0], 0.0) ** 2)) for r in (smooth, result)
    )
    assert far > 1.1 * near
