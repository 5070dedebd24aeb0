"""Metrics of piles whose shape is known, their bands, and the ballistic estimate."""

from __future__ import annotations

from math import nan, pi, radians, sqrt, tan

import numpy as np
import pytest

from castblast.muckpile.balls.particles import centre_of_mass, particles_at_rest
from castblast.muckpile.bench.geometry import Bench, polygon_bench
from castblast.muckpile.ground.walls import floor, join, slope
from castblast.muckpile.results.ballistic import (
    ballistic_cast,
    block_throw,
    level_reach,
)
from castblast.muckpile.results.metrics import UNITS, PileMetrics, band, pile_metrics
from castblast.muckpile.results.profile import face_line


def two_blocks():
    bench = Bench(length=2.0, width=4.0, height=5.0, burden=2.0, spacing=2.0)
    before = particles_at_rest([[-1.0, 1.0, 5.1], [-3.0, 1.0, 5.1]], [0.1, 0.1], block=[0, 1])
    after = before._replace(position=np.array([[9.0, 1.0, 0.1], [-2.0, 1.5, 0.1]]))
    velocity = np.array([[10.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    return bench, before, after, velocity


def test_metrics_of_two_balls():
    bench, before, after, velocity = two_blocks()
    metrics = pile_metrics(before, after, bench, block_velocity=velocity)
    np.testing.assert_allclose(metrics.throw, [5.5, 0.25, -5.0])
    np.testing.assert_allclose(metrics.throw, centre_of_mass(after) - centre_of_mass(before))
    np.testing.assert_allclose(metrics.block_throw[:2], [[10, 0, -5], [1, 0.5, -5]])
    assert np.all(np.isnan(metrics.block_throw[2]))
    assert metrics.cast_fraction == pytest.approx(0.5)
    assert metrics.runout_99 == 9.0
    assert metrics.maximum_height == pytest.approx(0.2, abs=0.01)


def test_ballistic_estimate_is_that_of_free_fall():
    """Fall of 5 m in 1.0096 s: 10 and 1 m/s go 10.096 and 1.0096 m; only the first comes past."""
    bench, before, after, velocity = two_blocks()
    metrics = pile_metrics(before, after, bench, block_velocity=velocity)
    assert metrics.ballistic_throw == pytest.approx(5.5 * sqrt(2 * 5.0 / 9.81))
    assert metrics.ballistic_cast_fraction == pytest.approx(0.5)


def test_heights_and_volumes_count_from_the_ground():
    """A ball on a slope is as high as its diameter over it, and its hidden volume is not rock."""
    bench, before, after, velocity = two_blocks()
    walls = join(floor(), slope(4.0, radians(30.0)))
    lift = 0.1 / np.cos(radians(30.0)) + 5.0 * tan(radians(30.0))
    on_slope = after._replace(position=np.array([[9.0, 1.0, lift], [-2.0, 1.5, 0.1]]))
    plain = pile_metrics(before, on_slope, bench, block_velocity=velocity)
    metrics = pile_metrics(before, on_slope, bench, block_velocity=velocity, walls=walls)
    assert plain.maximum_height > 2.8
    assert metrics.maximum_height < 0.24
    assert metrics.pile_volume < 0.15 * plain.pile_volume
    assert metrics.swell == pytest.approx(metrics.pile_volume / 40.0)
    assert metrics.rock_swell == pytest.approx(
        metrics.pile_volume / (2 * 4 / 3 * pi * 1e-3), rel=1e-12
    )


def test_a_ball_without_block_is_not_thrown():
    bench, before, after, velocity = two_blocks()
    loose = before._replace(block=np.array([-1, -1]))
    metrics = pile_metrics(loose, after, bench, block_velocity=velocity)
    assert metrics.ballistic_throw == 0.0
    assert np.all(np.isnan(metrics.block_throw))
    assert metrics.cast_fraction == pytest.approx(0.5)


def ridge(angle: float, height: float, length: float, radius: float):
    """Balls on a fine lattice that fill a triangular ridge to its surface."""
    foot = height / tan(angle)
    axes = (np.arange(-foot, foot, radius), np.arange(0.0, length, radius))
    x, y = (axis.ravel() for axis in np.meshgrid(*axes))
    z = height - np.abs(x) * tan(angle) - radius
    inside = z > 0.0
    return particles_at_rest(
        np.column_stack([x, y, z])[inside], np.full(int(inside.sum()), radius), block=None
    )


def test_metrics_of_a_ridge():
    """Triangular ridge: h, volume h^2 L / tan a, mean height over volume 2/3 h, and angle a.

    The balls rise above the chords between their centres by less than a radius.
    """
    angle, height, length, radius = radians(35.0), 4.0, 12.0, 0.05
    pile = ridge(angle, height, length, radius)
    bench = Bench(length=length, width=8.0, height=5.0, burden=4.0, spacing=4.0)
    metrics = pile_metrics(pile, pile, bench, block_velocity=np.zeros((6, 3)))
    assert metrics.maximum_height == pytest.approx(height, abs=radius)
    assert metrics.pile_volume == pytest.approx(height**2 / tan(angle) * length, rel=0.02)
    assert metrics.dig_height == pytest.approx(2.0 / 3.0 * height, abs=radius)
    assert metrics.repose_angle == pytest.approx(angle, abs=radians(0.5))
    assert metrics.swell == pytest.approx(metrics.pile_volume / (12.0 * 8.0 * 5.0))
    np.testing.assert_allclose(metrics.throw, 0.0, atol=1e-12)
    # Half of the area of a triangle lies past its middle.
    assert metrics.cast_fraction == pytest.approx(0.5, abs=0.01)


def test_every_metric_has_a_unit():
    assert set(UNITS) == set(PileMetrics._fields)


def test_band_is_the_scatter_of_a_sample():
    """Mean and deviation (n - 1) of 1, 2, 6: 3 and sqrt(7); an unknown value does not count."""
    found = band([[1.0, 5.0], [2.0, nan], [6.0, nan]])
    np.testing.assert_allclose(found.mean, [3.0, 5.0])
    np.testing.assert_allclose(found.sd, [sqrt(7.0), nan])
    np.testing.assert_array_equal(found.n, [3, 1])


def bench_cast_fraction(speed, width, height):
    """Share of the mass of a bench with a vertical face that comes down past it, thrown level.

    With the reach R of its top, a point `d` behind the face and `z` over the floor comes past if
    d < R sqrt(z / height); the share is that of the area of the section.
    """
    reach = level_reach(speed, height)
    return 2 / 3 * reach / width if reach <= width else 1 - (width / reach) ** 2 / 3


def full_section(width: float, height: float, step: float):
    """Points that fill the section of a bench, as balls without size to speak of."""
    x, z = np.meshgrid(
        np.arange(-width + 0.5 * step, 0.0, step), np.arange(0.5 * step, height, step)
    )
    place = np.column_stack([x.ravel(), np.zeros(x.size), z.ravel()])
    return particles_at_rest(place, np.full(x.size, 1e-6), block=np.zeros(x.size, dtype=np.int64))


@pytest.mark.parametrize("width", [6.0, 40.0])
def test_ballistic_cast_of_a_bench(width):
    """Bench thrown level at 12.7 m/s from 12.5 m: throw 2/3 v sqrt(2h/g), share past the face.

    The top reaches 20.3 m: short of a bench 40 m wide, far beyond one of 6 m.
    """
    height, speed = 12.5, 12.7
    balls = full_section(width, height, 0.05)
    cast = ballistic_cast(balls, np.array([[speed, 0.0, 0.0]]))
    assert level_reach(speed, height) == pytest.approx(20.274, abs=1e-3)
    assert cast.throw[0] == pytest.approx(block_throw(speed, height), rel=1e-3)
    assert cast.block_throw[0, 0] == pytest.approx(cast.throw[0])
    past = float(np.mean(cast.landing[:, 0] > 0.0))
    assert past == pytest.approx(bench_cast_fraction(speed, width, height), abs=2e-3)
    assert cast.flight_time.max() == pytest.approx(sqrt(2.0 * height / 9.81), rel=3e-3)
    assert cast.landing[:, 0].max() < level_reach(speed, height)


def test_ballistic_landing_on_a_slope():
    """Thrown level at v from h, toe at d: lands where h - g x^2 / (2 v^2) = (x - d) tan a.

    With h = 5 m, v = 10 m/s, d = 4 m and 30 degrees that is x = 6.3657 m.
    """
    height, speed, toe, rise = 5.0, 10.0, 4.0, tan(radians(30.0))
    half = rise * speed**2 / 9.81
    exact = -half + sqrt(half**2 + 2.0 * speed**2 / 9.81 * (height + toe * rise))
    ball = particles_at_rest([[0.0, 1.0, height + 1e-6]], [1e-6], block=[0])
    launch = np.array([[speed, 0.0, 0.0]])
    cast = ballistic_cast(ball, launch, walls=join(floor(), slope(toe, radians(30.0))))
    assert cast.throw[0] == pytest.approx(exact, abs=1e-5)
    # The flat floor alone is the closed form without walls.
    flat = ballistic_cast(ball, launch, walls=floor())
    assert flat.throw[0] == pytest.approx(ballistic_cast(ball, launch).throw[0], abs=1e-9)


def test_ballistic_throw_upwards_goes_farther():
    """At 45 degrees from level ground the reach is v^2 / g."""
    ball = particles_at_rest([[0.0, 0.0, 1e-6]], [1e-6], block=[0])
    launch = np.array([[10.0, 0.0, 10.0]]) / sqrt(2.0)
    assert ballistic_cast(ball, launch).throw[0] == pytest.approx(100.0 / 9.81)


def test_face_line_of_a_bench_of_any_shape():
    """Front edge from (-2, 0) to (0, 10), then straight to (0, 20); rear at x = -8."""
    corners = [(-2.0, 0.0), (0.0, 10.0), (0.0, 20.0), (-8.0, 20.0), (-8.0, 0.0)]
    bench = polygon_bench(corners, 5.0)
    y = np.array([-3.0, 0.0, 5.0, 10.0, 15.0, 20.0, 25.0])
    np.testing.assert_allclose(face_line(bench, y), [-2.0, -2.0, -1.0, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(face_line(Bench(), y), np.zeros(7))
    # A ball at x = -0.5 lies past the oblique part and not past the straight one.
    before = particles_at_rest([[-3.0, 5.0, 0.1], [-3.0, 15.0, 0.1]], [0.1, 0.1], block=[0, 0])
    after = before._replace(position=np.array([[-0.5, 5.0, 0.1], [-0.5, 15.0, 0.1]]))
    metrics = pile_metrics(before, after, bench, block_velocity=np.zeros((40, 3)))
    assert metrics.cast_fraction == pytest.approx(0.5)
    assert metrics.runout_99 == pytest.approx(0.5)
    assert metrics.ballistic_cast_fraction == 0.0
