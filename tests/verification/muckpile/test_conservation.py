"""Conservation in a crowd of balls: momentum, angular momentum, energy; and what must not matter.

The crowd: some hundred balls of radii 0.05 to 0.15 m. Nothing a caller may choose freely (order of
balls, skin, kind of list, number of threads, looking at the state) may change the motion.
"""

from __future__ import annotations

import numpy as np
import pytest

from castblast.errors import Status
from castblast.muckpile.balls.contact import ContactLaw
from castblast.muckpile.balls.particles import Particles, ball_inertia, ball_mass, particles_at_rest
from castblast.muckpile.bench.separation import push_apart
from castblast.muckpile.cast.solver import CastCase, run_cast
from castblast.muckpile.engine.simulation import Simulation
from castblast.muckpile.engine.threads import thread_count
from castblast.muckpile.ground.walls import floor, join, plane

LAW = ContactLaw()
FAR = floor(-1e3)


def crowd(count=300, side=1.2, seed=3):
    """Balls without overlap in a box that stands on the floor."""
    rng = np.random.default_rng(seed)
    radius = rng.uniform(0.05, 0.15, count)
    height = 4.0 / 3.0 * np.pi * np.sum(radius**3) / (0.5 * side**2)
    box = join(
        *(plane(p, n) for p, n in (
            ((0, 0, 0), (1, 0, 0)), ((side, 0, 0), (-1, 0, 0)),
            ((0, 0, 0), (0, 1, 0)), ((0, side, 0), (0, -1, 0)),
            ((0, 0, 0), (0, 0, 1)), ((0, 0, height), (0, 0, -1)),
        ))
    )  # fmt: skip
    position = rng.uniform(0.15, [side - 0.15, side - 0.15, height - 0.15], (count, 3))
    return particles_at_rest(push_apart(position, radius, box), radius)


def moving_crowd(speed=2.0):
    balls = crowd()
    rng = np.random.default_rng(5)
    balls.velocity[:] = speed * rng.standard_normal(balls.velocity.shape)
    balls.angular_velocity[:] = 10.0 * rng.standard_normal(balls.velocity.shape)
    return balls


def momenta(balls: Particles):
    mass = ball_mass(balls.radius, LAW.density)[:, None]
    spin = ball_inertia(balls.radius, LAW.density)[:, None] * balls.angular_velocity
    linear = np.sum(mass * balls.velocity, axis=0)
    angular = np.sum(mass * np.cross(balls.position, balls.velocity) + spin, axis=0)
    return linear, angular


def free(balls, **options):
    return Simulation(
        balls, LAW, options.pop("walls", FAR), np.zeros(len(balls.radius), dtype=bool), **options
    )


def test_momentum_and_angular_momentum_of_colliding_balls():
    """No outer force: both are conserved to rounding, the second only with arms R - d/2."""
    balls = moving_crowd()
    run = free(balls, gravity=0.0)
    linear, angular = momenta(balls)
    run.run(0.3, 0.3)
    assert run.dissipated.min() > 0.0
    after_linear, after_angular = momenta(run.state())
    scale = np.sum(ball_mass(balls.radius, LAW.density)[:, None] * np.abs(balls.velocity))
    assert np.abs(after_linear - linear).max() < 1e-12 * scale
    assert np.abs(after_angular - angular).max() < 1e-10 * scale


def collapse(step_safety=0.8, time_step=0.0, **options):
    balls = crowd()
    case = CastCase(
        balls, LAW, floor(), np.empty(0), np.empty((0, 3)),
        step_safety=step_safety, time_step=time_step, max_time=1.0, min_time=1.0, threads=1,
        **options,
    )  # fmt: skip
    return run_cast(case)


def test_energy_of_a_collapse_is_accounted_for():
    """KE + m g z + springs + slip + rolling slip + dashpots stays within 0.5 % of its release."""
    result = collapse()
    ledger = result.ledger
    assert min(ledger.slip, ledger.rolling_slip, ledger.dashpot) > 0.0
    assert abs(ledger.residual) < 0.005
    total = ledger.kinetic + ledger.potential + ledger.spring
    lost = ledger.slip + ledger.rolling_slip + ledger.dashpot
    assert total + lost == pytest.approx(ledger.initial, rel=0.005)


def test_ledger_is_of_second_order_in_the_step():
    """A ball that rocks and bounces in contact: halving the step quarters the open balance."""
    mass, radius, gravity = float(ball_mass(np.array([0.1]), 2600.0)[0]), 0.1, 9.81
    rest = mass * gravity / (np.pi * radius * LAW.effective_modulus)
    residuals = []
    for step in (2e-4, 1e-4, 5e-5):
        balls = particles_at_rest([[0, 0, radius - 1.5 * rest]], [radius])
        balls.velocity[0] = (1e-3, 0, 0)
        run = free(balls, walls=floor(), time_step=step)
        before = _energy(run, gravity)
        run.run(100.5 * 2e-4, 1.0)
        residuals.append(abs(_energy(run, gravity) + run.dissipated.sum() - before))
    orders = np.log2(np.array(residuals[:-1]) / residuals[1:])
    assert np.all(orders > 1.7), (residuals, orders)


def _energy(run, gravity):
    state = run.state()
    mass, inertia = (f(state.radius, 2600.0) for f in (ball_mass, ball_inertia))
    moving = 0.5 * np.sum(mass[:, None] * state.velocity**2)
    spinning = 0.5 * np.sum(inertia[:, None] * state.angular_velocity**2)
    return (
        moving
        + spinning
        + np.sum(mass * state.position[:, 2]) * gravity
        + run.survey_contacts().energy
    )


def after(balls, time=0.06, **options):
    run = free(balls, walls=floor(), time_step=2e-4, **options)
    run.run(time, 9.0)
    return run.state().position


@pytest.mark.parametrize(
    "options",
    [{"skin": 0.005}, {"skin": 0.1}, {"ballistic": False}, {"ballistic": False, "skin": 0.05}],
    ids=str,
)
def test_motion_does_not_depend_on_the_lists(options):
    """Skin, cell size (which follows the skin) and kind of list change nothing but rounding."""
    balls = moving_crowd()
    np.testing.assert_allclose(after(balls, **options), after(balls), atol=1e-9)


def test_motion_does_not_depend_on_the_order_of_the_balls():
    """A permutation of the input permutes the output."""
    balls = moving_crowd()
    order = np.random.default_rng(1).permutation(len(balls.radius))
    shuffled = Particles(*(part[order] for part in balls))
    np.testing.assert_allclose(after(shuffled), after(balls)[order], atol=1e-9)


def test_motion_turns_with_the_frame():
    """A quarter turn about z of the input turns the output: no axis is special to the law."""
    balls = moving_crowd()
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turned = balls._replace(
        **{
            name: np.ascontiguousarray(getattr(balls, name) @ turn.T)
            for name in ("position", "velocity", "angular_velocity")
        }
    )
    np.testing.assert_allclose(after(turned), after(balls) @ turn.T, atol=1e-9)


@pytest.mark.parametrize("precision", ["float64", "mixed"])
def test_number_of_threads_changes_no_bit(precision):
    """A tower of 5,000 balls, cut into many chunks, gives the same bytes on one and two threads."""
    balls = crowd(5000)
    balls.velocity[:] = np.random.default_rng(5).standard_normal(balls.velocity.shape)
    found = set()
    for threads in (1, 2, 2):
        with thread_count(threads):
            run = free(balls, walls=floor(), precision=precision)
            run.run(0.05, 0.05)
            assert run.chunks > 4
            state = run.state()
            assert np.all(np.isfinite(run.dissipated))
            found.add(b"".join(part.tobytes() for part in state) + run.dissipated.tobytes())
    assert len(found) == 1


def test_mixed_precision_changes_nothing_but_rounding():
    """Single precision of motion and memory: paths part by 1e-5 m, energy stays in balance."""
    balls = moving_crowd()
    apart = after(balls, 0.02, precision="mixed") - after(balls, 0.02)
    assert 0.0 < np.abs(apart).max() < 1e-5
    ledger = collapse(precision="mixed").ledger
    assert abs(ledger.residual) < 0.005
    assert ledger.residual == pytest.approx(collapse().ledger.residual, abs=5e-4)


def test_looking_changes_no_bit_and_equal_runs_are_equal():
    """Pictures are taken between steps; two equal runs give the same bytes."""
    seen = []
    plain = collapse()
    balls = crowd()
    case = CastCase(
        balls, LAW, floor(), np.empty(0), np.empty((0, 3)),
        max_time=1.0, min_time=1.0, threads=1, snapshot_interval=0.0137,
    )  # fmt: skip
    watched = run_cast(case, snapshot=lambda time, state: seen.append((time, state)))
    assert len(seen) > 70
    assert seen[0][0] == 0.0
    assert seen[-1][0] == watched.time
    for one, other in zip(plain.particles, watched.particles, strict=True):
        assert one.tobytes() == other.tobytes()
    assert plain.ledger == watched.ledger


@pytest.mark.parametrize("precision", ["float64", "mixed"])
def test_balls_that_slide_do_not_feel_a_firing_elsewhere(precision):
    """Forces are looked at anew when a block is fired; who slips goes on slipping, v0 - mu g t.

    A contact that slips holds its spring at the limit but for rounding. Taken for one that sticks,
    it would have its shear dashpot for half a step, which takes 1 to 2 % of its speed here.
    """
    radius = np.full(60, 0.1)
    kn = np.pi * 0.1**2 * LAW.effective_modulus / 0.1  # of a ball on the floor
    sunk = ball_mass(0.1, LAW.density) * 9.81 / kn
    x = np.arange(60.0)
    balls = particles_at_rest(np.column_stack([0.0 * x, x, 0.0 * x + 0.1 - sunk]), radius)
    balls.velocity[:-1, 0] = np.linspace(3.0, 6.0, 59)
    last = np.arange(60) == 59
    run = Simulation(balls, LAW, floor(), last, precision=precision, time_step=2e-4)
    run.run(0.02, 0.02)
    start = run.state().velocity[:-1, 0].copy()
    run.fire(last, np.full((60, 3), [0.0, 1.0, 0.0]))
    run.run(0.04, 0.04)
    end = run.state().velocity[:-1, 0]
    np.testing.assert_allclose(start - end, LAW.friction * 9.81 * 0.02, rtol=2e-3)


def test_a_run_that_is_thrown_apart_names_ball_and_time():
    """A step far above stability ends as UNSTABLE_STEP, not as numbers."""
    result = collapse(time_step=0.02)
    assert result.status == Status.UNSTABLE_STEP
    assert 0 <= result.failed_ball < 300
    assert 0.0 < result.failed_time <= 1.0


def test_a_state_that_is_not_finite_names_the_ball():
    balls = crowd()
    balls.velocity[17, 1] = np.nan
    result = run_cast(CastCase(balls, LAW, floor(), np.empty(0), np.empty((0, 3))))
    assert result.status == Status.UNSTABLE_STEP
    assert result.failed_ball == 17


@pytest.mark.parametrize("precision", ["float64", "mixed"])
def test_a_lone_ball_far_from_the_origin_stays_put(precision):
    """On a floor at x = 80 m for 10 s; its overlap is 3e-4 of its radius."""
    kn = np.pi * 0.1 * LAW.effective_modulus
    sunk = ball_mass(0.1, LAW.density) * 9.81 / kn
    start = np.array([[80.0, 80.0, 0.1 - sunk]])
    balls = particles_at_rest(start, np.full(1, 0.1))
    run = Simulation(balls, LAW, floor(), np.zeros(1, dtype=bool), precision=precision)
    assert run.run(10.0, np.inf)
    assert np.abs(run.state().position - start).max() < 1e-7
