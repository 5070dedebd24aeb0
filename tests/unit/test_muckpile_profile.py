"""Surface, profile and metrics of piles whose shape is known."""

from __future__ import annotations

from math import isnan, nan, pi, radians, sqrt, tan

import numpy as np
import pytest

from castblast.muckpile.bench import Bench
from castblast.muckpile.particles import centre_of_mass, particles_at_rest
from castblast.muckpile.profile import (
    Profile,
    mass_quantile,
    mean_profile,
    pile_metrics,
    repose_angle,
    section,
    surface_height,
)
from castblast.muckpile.walls import floor, join, slope


def test_surface_of_one_ball_is_its_upper_half():
    """Height z + sqrt(r^2 - rho^2) above the ball, 0 elsewhere; volume pi r^2 z + 2/3 pi r^3."""
    r, z = 1.0, 3.0
    field = surface_height(
        np.array([[0.0, 0.0, z]]), np.array([r]), cell=0.01, x_range=(-2, 2), y_range=(-2, 2)
    )
    x, y = np.meshgrid(field.x, field.y)
    square = x**2 + y**2
    exact = np.where(square < r * r, z + np.sqrt(np.maximum(r * r - square, 0.0)), 0.0)
    np.testing.assert_allclose(field.height, exact, atol=1e-12)
    assert field.height.sum() * 1e-4 == pytest.approx(pi * z + 2 / 3 * pi, rel=1e-3)


def test_upper_ball_hides_the_lower():
    place = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 4.0]])
    field = surface_height(place, np.array([1.0, 0.5]), cell=0.1)
    assert field.height.max() == pytest.approx(4.5, abs=0.01)
    assert section(field, 0.05).height.max() == field.height.max()
    np.testing.assert_allclose(mean_profile(field).height, field.height.mean(axis=0))


def test_repose_angle_of_a_wedge():
    x = np.linspace(0.0, 20.0, 400)
    profile = Profile(x, np.maximum(5.0 - np.maximum(x - 4.0, 0.0) * tan(radians(32.0)), 0.0))
    assert repose_angle(profile) == pytest.approx(radians(32.0), rel=1e-6)
    assert isnan(repose_angle(Profile(x[:2], np.array([1.0, 0.0]))))


def test_quantile_is_that_of_mass_not_of_number():
    value, radius = np.array([1.0, 2.0, 3.0]), np.array([1.0, 1.0, 2.0])
    assert mass_quantile(value, radius, 0.2) == 2.0
    assert mass_quantile(value, radius, 0.5) == 3.0


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
    assert not isnan(nan if metrics.cast_fraction is None else metrics.cast_fraction)
