"""Surface and profile of piles whose shape is known."""

from __future__ import annotations

from math import isnan, pi, radians, tan

import numpy as np
import pytest

from castblast.muckpile.results.profile import (
    Profile,
    mass_quantile,
    mean_profile,
    repose_angle,
    section,
    section_band,
    surface_height,
)


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


def test_band_of_sections_is_their_mean():
    """Two balls side by side along y, one twice as high: the band holds the mean of both tops."""
    place = np.array([[0.0, 0.25, 1.0], [0.0, 0.75, 3.0]])
    field = surface_height(place, np.array([0.25, 0.25]), cell=0.5)
    assert field.height.shape == (2, 1)
    assert section_band(field, 0.0, 1.0).height[0] == pytest.approx(2.25)
    assert section_band(field, 0.5, 1.0).height[0] == pytest.approx(3.25)
    assert section_band(field, 5.0, 6.0).height[0] == pytest.approx(3.25)  # none: the nearest
