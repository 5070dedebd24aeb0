"""Painted balls: size, place, what hides what, and that no view is a mirror image."""

from __future__ import annotations

from math import pi, radians

import numpy as np
import pytest

from castblast.muckpile.bench.geometry import Bench, polygon_bench
from castblast.muckpile.bench.surroundings import bench_walls
from castblast.report.piles.ball_picture import PLAN_X, PLAN_Y, SECTION, Canvas, oblique
from castblast.report.piles.bench_lines import bench_sections
from castblast.report.piles.ground import ground_points

WHITE, RED, BLUE = np.ones((1, 3)), np.array([[1.0, 0, 0]]), np.array([[0, 0, 1.0]])


def painted(view, balls, extent=(-5.0, 5.0, -5.0, 5.0), pixels=200):
    canvas = Canvas(view, extent, pixels)
    for position, radius, colour in balls:
        canvas.add(np.array([position], dtype=float), np.array([radius]), colour)
    return canvas.image()


@pytest.mark.parametrize("view", [PLAN_X, PLAN_Y, SECTION, oblique(0.5, 0.6), oblique(-2.0, 1.2)])
def test_views_are_rotations(view):
    """Right, up, towards the viewer: orthonormal and right-handed, or the picture is mirrored."""
    np.testing.assert_allclose(view.axes @ view.axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(view.axes) == pytest.approx(1.0)
    # Up in space is never down in the picture.
    assert view.axes[1, 2] >= 0.0


def test_oblique_view_from_the_zenith_and_from_the_side():
    np.testing.assert_allclose(oblique(0.0, radians(90)).axes, PLAN_X.axes, atol=1e-12)
    np.testing.assert_allclose(oblique(0.0, 0.0).axes, SECTION.axes, atol=1e-12)


def test_a_ball_covers_the_area_of_its_disc_around_its_centre():
    """Cover of a disc of radius 2 in a picture 10 m wide: pi 4 m2, centred at (1, -1)."""
    image = painted(PLAN_X, [((1.0, -1.0, 7.0), 2.0, WHITE)])
    cover = image[:, :, 3] / 255.0
    pixel = (10.0 / 200) ** 2
    assert cover.sum() * pixel == pytest.approx(pi * 4.0, rel=2e-3)
    place = (np.arange(200) + 0.5) * 10.0 / 200 - 5.0
    assert cover.sum(axis=0) @ place / cover.sum() == pytest.approx(1.0, abs=0.01)
    assert cover.sum(axis=1) @ place / cover.sum() == pytest.approx(-1.0, abs=0.01)


def test_the_nearer_ball_hides_the_other_in_any_order():
    """A small blue ball above a large red one is seen from above; from below it would not be."""
    low, high = ((0.0, 0.0, 0.0), 2.0, RED), ((0.0, 0.0, 4.0), 1.0, BLUE)
    one, two = painted(PLAN_X, [low, high]), painted(PLAN_X, [high, low])
    np.testing.assert_array_equal(one, two)
    middle, beside = one[100, 100], one[100, 130]
    assert middle[2] > 100
    assert middle[0] == 0
    assert beside[0] > 100
    assert beside[2] == 0
    hidden = painted(PLAN_X, [((0.0, 0.0, 4.0), 2.0, RED), ((0.0, 0.0, 0.0), 1.0, BLUE)])
    assert hidden[:, :, 2].max() == 0


def test_balls_that_cross_are_cut_where_they_meet():
    """Equal balls at equal depth meet half way between their centres."""
    image = painted(SECTION, [((-1.0, 0, 0), 2.0, RED), ((1.0, 0, 0), 2.0, BLUE)])
    row = image[100]
    assert row[97, 0] > row[97, 2]
    assert row[103, 2] > row[103, 0]


def test_a_ball_smaller_than_a_pixel_still_shows():
    assert painted(PLAN_X, [((0.01, 0.02, 0.0), 1e-3, WHITE)])[:, :, 3].max() > 0


def test_balls_outside_are_cut_off():
    assert painted(PLAN_X, [((50.0, 0.0, 0.0), 1.0, WHITE)]).max() == 0
    assert painted(PLAN_X, [((5.0, 5.0, 0.0), 2.0, WHITE)])[:, :, 3].max() == 255


def test_ground_has_no_gap_at_a_face():
    """Points at the rock behind a bench stand at most one spacing above each other."""
    bench = Bench(length=6.0, width=4.0, height=5.0)
    place, colours = ground_points(bench_walls(bench), (-8.0, 8.0), (0.0, 6.0), 0.5)
    assert len(place) == len(colours)
    face = place[(place[:, 0] > -4.3) & (place[:, 0] < -3.9) & (np.abs(place[:, 1] - 3.0) < 0.1)]
    heights = np.sort(face[:, 2])
    assert heights[-1] == pytest.approx(5.0)
    assert np.diff(heights).max() <= 0.5 + 1e-9
    assert heights[0] <= 0.5
    # Ahead of the bench the floor is level.
    np.testing.assert_allclose(place[place[:, 0] > 0.1, 2], 0.0, atol=1e-12)


def test_section_of_a_bench_with_a_leaning_face():
    """Face of 45 degrees, 5 m high: the crest lies 5 m behind the toe, the rear is vertical."""
    bench = Bench(length=6.0, width=9.0, height=5.0, face_angle=radians(45))
    for y in (0.0, 3.0, 6.0):
        (ring,) = bench_sections(bench, y)
        np.testing.assert_allclose(ring, [[-9, 0], [0, 0], [-5, 5], [-9, 5], [-9, 0]], atol=1e-6)


def test_section_of_a_bench_with_a_bay():
    """U shape with a bay from the rear at 4 < y < 6, where only the front bar is cut."""
    corners = [(0, 0), (0, 10), (-8, 10), (-8, 6), (-3, 6), (-3, 4), (-8, 4), (-8, 0)]
    bench = polygon_bench(corners, 4.0)
    (ring,) = bench_sections(bench, 5.0)
    assert sorted(set(ring[:, 0])) == [-3.0, 0.0]
    (ring,) = bench_sections(bench, 2.0)
    assert sorted(set(ring[:, 0])) == [-8.0, 0.0]
