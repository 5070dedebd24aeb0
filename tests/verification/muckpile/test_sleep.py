"""Balls that sleep: who falls asleep, who wakes, and that nothing else changes by it.

Sleep is a shortcut of the computation, not of the physics: whatever a sleeping run gives must be
what a run without sleep gives, within what the limits of stillness allow.
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
import pytest

from castblast.muckpile.balls.contact import ContactLaw
from castblast.muckpile.balls.particles import Particles, particles_at_rest
from castblast.muckpile.cast.solver import CastCase, run_cast
from castblast.muckpile.engine.simulation import Simulation
from castblast.muckpile.engine.threads import thread_count
from castblast.muckpile.ground.walls import floor

G = 9.81
LAW = ContactLaw()
R = 0.1
#: Depth [m] to which a ball at rest sinks into the floor: m g/(pi R E*).
SUNK = 4.0 / 3.0 * np.pi * R**3 * LAW.density * G / (np.pi * R * LAW.effective_modulus)


def layer(side, spacing=0.21):
    """Balls at rest on the floor, `spacing` [m] apart: a little less than the skin of the lists."""
    x, y = np.meshgrid(*[spacing * (np.arange(side) - side // 2)] * 2, indexing="ij")
    z = np.full(side * side, R - SUNK)
    return np.column_stack([x.ravel(), y.ravel(), z])


def simulation(position, *, velocity=None, held=None, walls=None, sleeping=True, **options):
    """Balls of one size on a floor, or within other walls."""
    balls = particles_at_rest(position, np.full(len(position), R), velocity=velocity)
    still = np.zeros(len(position), dtype=bool) if held is None else held
    return Simulation(balls, LAW, walls or floor(), still, sleeping=sleeping, **options)


def pile(count=300, seed=3):
    """A heap of balls dropped from a loose block, and the blocks of a CastCase that has none."""
    rng = np.random.default_rng(seed)
    side = round(count ** (1.0 / 3.0)) + 1
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    position = 0.3 * grid[:count] + [0.0, 0.0, 0.2] + 0.02 * rng.standard_normal((count, 3))
    return particles_at_rest(position, rng.uniform(0.06, 0.14, count))


def drop_case():
    """Three seconds of the heap, asleep well before."""
    return CastCase(
        pile(), LAW, floor(), np.empty(0), np.empty((0, 3)),
        max_time=3.0, min_time=3.0, threads=1, sleeping=True,
    )  # fmt: skip


@pytest.fixture(scope="module")
def dropped():
    """Outcome of `drop_case`."""
    return run_cast(drop_case())


def test_a_ball_dropped_on_sleepers_wakes_those_around_it():
    """121 balls on a floor, one comes down on the middle of them after 0.6 s.

    Before it arrives all sleep but itself. Afterwards those that it has hit are awake, the far ones
    are not, and sleepers have not moved by a bit.
    """
    position = np.vstack([layer(11), [[0.05, 0.03, 0.5 * G * 0.6**2 + 3.0 * R]]])
    run = simulation(position)
    assert run.run(0.5, inf)
    assert run.asleep()[:-1].all()
    assert not run.asleep()[-1]
    before = run.state().position
    assert run.run(0.66, inf)
    awake = ~run.asleep()
    distance = np.hypot(*(position[:-1, :2] - position[-1, :2]).T)
    assert awake[-1]
    assert awake[:-1][distance < 0.2].all()
    assert not awake[:-1][distance > 1.0].any()
    after = run.state().position
    np.testing.assert_array_equal(after[~awake], before[~awake])
    assert np.abs(after[awake] - before[awake]).max() > 0.01


def test_flight_is_no_sleep():
    """A ball thrown upwards passes its peak, where it is slow for 4 ms, as if there were no sleep.

    So does one that was held for long and is let go without any speed.
    """
    paths = []
    for sleeping in (True, False):
        held = np.array([False, True])
        run = simulation(
            [[0.0, 0.0, 5.0], [3.0, 0.0, 5.0]], velocity=[[0.1, 0.0, 3.0], [0.0, 0.0, 0.0]],
            held=held, walls=floor(-100.0), sleeping=sleeping,
        )  # fmt: skip
        assert run.run(1.0, 1.0)
        run.fire(held, np.zeros((2, 3)))
        assert run.run(2.0, 2.0)
        paths.append(run.state())
    for one, other in zip(*paths, strict=True):
        assert one.tobytes() == other.tobytes()
    assert paths[0].position[1, 2] == pytest.approx(5.0 - 0.5 * G, abs=1e-9)


def test_a_sleeper_falls_when_its_support_goes():
    """A ball rests on a held one that is fired sideways from under it: it wakes and falls."""
    heights = []
    for sleeping in (True, False):
        position = np.array([[0.0, 0.0, R], [0.0, 0.0, 3.0 * R - SUNK]])
        held = np.array([True, False])
        run = simulation(position, held=held, sleeping=sleeping)
        assert run.run(0.6, 0.6)
        assert run.asleep().tolist() == [False, sleeping]
        run.fire(held, np.array([[8.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
        assert not run.asleep().any()
        assert run.run(0.75, 0.75)
        heights.append(run.state().position[1])
    assert heights[0][2] < 2.5 * R
    np.testing.assert_allclose(heights[0], heights[1], atol=2e-3)


def test_creep_keeps_awake():
    """A ball that slides at 0.2 % of sqrt(g d) is asleep soon, one at 0.5 % never is.

    Both are slower than the limit of one moment; without friction nothing slows them down.
    """
    speed = sqrt(G * 2.0 * R)
    slow = ContactLaw(friction=0.0, rolling_friction=0.0)
    position = [[0.0, 0.0, R - SUNK], [3.0, 0.0, R - SUNK]]
    balls = particles_at_rest(
        position, [R, R], velocity=[[0.002 * speed, 0, 0], [0.005 * speed, 0, 0]]
    )
    run = Simulation(balls, slow, floor(), np.zeros(2, dtype=bool), sleeping=True)
    assert run.run(1.0, inf)
    assert run.asleep().tolist() == [True, False]
    assert run.put_to_sleep == pytest.approx(
        0.5 * 4.0 / 3.0 * np.pi * R**3 * slow.density * (0.002 * speed) ** 2, rel=1e-6
    )


def test_a_heap_falls_asleep_with_its_energy_accounted_for(dropped):
    """Nearly all sleep in the end, and the balance is as closed as without sleep.

    What sleep took, below 0.1 % of all that was spent, is spin about contact normals: nothing else
    stops it.
    """
    restless = run_cast(drop_case()._replace(sleeping=False))
    ledger = dropped.ledger
    spent = ledger.slip + ledger.rolling_slip + ledger.dashpot
    assert dropped.counters.asleep > 0.9 * 300
    assert 0.0 < ledger.slept < 1e-3 * spent
    assert ledger.residual == pytest.approx(restless.ledger.residual, abs=5e-4)
    assert abs(ledger.residual) < 0.005
    assert restless.ledger.slept == 0.0
    assert restless.counters.asleep == 0
    assert restless.history.rotational_energy[-1] > 10.0 * dropped.history.rotational_energy[-1]


def test_a_heap_that_is_hit_wakes_and_moves(dropped):
    """Twenty balls thrown into a sleeping heap push it as far as without sleep, within 5 %.

    They set out 6 m away, so that most of the heap sleeps when they come.
    """
    heap = dropped.particles
    heap = particles_at_rest(heap.position, heap.radius)
    low = heap.position.min(axis=0)
    centre = 0.5 * (low + heap.position.max(axis=0))
    grid = np.stack(np.meshgrid(np.arange(5), np.arange(4)), axis=-1).reshape(-1, 2)
    shot = np.column_stack(
        [np.full(20, low[0] - 6.0), centre[1] + 0.3 * (grid[:, 1] - 1.5), 0.2 + 0.3 * grid[:, 0]]
    )
    speed, flight = 10.0, 0.6
    up = 0.5 * G * flight
    thrown = particles_at_rest(shot, np.full(20, 0.14), velocity=np.tile([speed, 0.0, up], (20, 1)))
    balls = Particles(*map(np.concatenate, zip(heap, thrown, strict=True)))
    moved, slept = [], []
    for sleeping in (True, False):
        run = Simulation(balls, LAW, floor(), np.zeros(320, dtype=bool), sleeping=sleeping)
        assert run.run(0.45, inf)
        slept.append(int(run.asleep().sum()))
        assert run.run(2.5, inf)
        moved.append(np.mean(run.state().position[:300, 0] - heap.position[:, 0]))
    assert slept[0] > 200
    assert moved[1] > 0.02
    assert moved[0] == pytest.approx(moved[1], rel=0.05)


def test_threads_change_no_bit_with_sleepers():
    """4,225 balls on a floor, most asleep, a row of others coming down on them."""
    falling = layer(9, 0.5)
    falling[:, 2] += 0.5 * G * 0.3**2
    position = np.vstack([layer(65), falling])
    found = set()
    for threads in (1, 2):
        with thread_count(threads):
            run = simulation(position)
            assert run.run(0.45, inf)
            assert run.chunks > 2
            asleep = run.asleep().sum()
            assert 1000 < asleep < 4225
            state = b"".join(part.tobytes() for part in run.state())
            found.add(state + run.dissipated.tobytes() + np.float64(run.put_to_sleep).tobytes())
    assert len(found) == 1


def test_an_interrupted_run_with_sleepers_ends_in_the_same_bits(tmp_path, dropped):
    """Stopped when many balls sleep; those and what they remember come back from the file."""

    class PlugPulledError(Exception):
        pass

    file, seen = tmp_path / "run.npz", []

    def pull_the_plug(share, line):
        seen.append(share)
        if len(seen) == 90:
            raise PlugPulledError

    with pytest.raises(PlugPulledError):
        run_cast(drop_case(), pull_the_plug, restart=file, restart_interval=0.0)
    with np.load(file) as stored:
        assert np.count_nonzero(stored["_balls.motion"][:, 7] == 2.0) > 50
    resumed = run_cast(drop_case(), restart=file)
    for one, other in zip(dropped.particles, resumed.particles, strict=True):
        assert one.tobytes() == other.tobytes()
    assert dropped.ledger == resumed.ledger
    assert dropped.counters._replace(seconds=0.0) == resumed.counters._replace(seconds=0.0)


@pytest.mark.parametrize("precision", ["float64", "mixed"])
def test_a_lone_ball_far_from_the_origin_stays_put(precision):
    """On a floor at x = 80 m for 10 s; its overlap is 3e-4 of its radius."""
    start = np.array([[80.0, 80.0, R - SUNK]])
    run = simulation(start, sleeping=False, precision=precision)
    assert run.run(10.0, inf)
    assert np.abs(run.state().position - start).max() < 1e-7
