"""Bench geometry, blocks, firing times; walls as a ball sees them; faults in words."""

from __future__ import annotations

from math import inf, nan, pi, radians, sqrt

import numpy as np
import pytest

from castblast.muckpile.balls.contact import ContactLaw, ball_stiffness, check_law, wall_stiffness
from castblast.muckpile.balls.particles import check_particles, particles_at_rest
from castblast.muckpile.bench.geometry import (
    Bench,
    assign_blocks,
    bench_volume,
    block_shape,
    block_velocities,
    check_bench,
    crest_position,
    row_delays,
    v_delays,
)
from castblast.muckpile.bench.surroundings import bench_walls
from castblast.muckpile.ground.walls import (
    Walls,
    floor,
    ground_height,
    join,
    plane,
    rectangle,
    slope,
    wall_distance,
    wall_table,
)


def distance(walls: Walls, point, wall=0, radius=0.1):
    table = wall_table(walls, 0.5, 0.5)
    found, normal = wall_distance(table, wall, *map(float, point), radius)
    return found, np.array(normal)


def test_volume_of_the_published_bench():
    """84 x 24 x 12.5 m are 25,200 m3; at 0.60 of 0.2 m mean radius some 361,000 balls."""
    assert bench_volume(Bench()) == pytest.approx(25200.0)
    solid = 4.0 / 3.0 * pi * 0.2**3 * 1.25
    assert 0.60 * bench_volume(Bench()) / solid == pytest.approx(361e3, rel=0.002)


def test_an_inclined_face_leans_back_from_its_toe():
    bench = Bench(length=10.0, width=20.0, height=10.0, face_angle=radians(45.0))
    assert crest_position(bench) == pytest.approx(-10.0)
    assert bench_volume(bench) == pytest.approx(10.0 * 10.0 * 15.0)


def test_blocks_are_numbered_from_the_face_and_along_it():
    bench = Bench(length=9.0, width=6.0, burden=3.0, spacing=3.0)
    assert block_shape(bench) == (2, 3)
    place = np.array([[-0.1, 0.1, 1.0], [-0.1, 8.9, 1.0], [-3.1, 0.1, 9.0], [0.5, 99.0, 0.0]])
    assert assign_blocks(place, bench).tolist() == [0, 2, 3, 2]
    assert block_shape(Bench()) == (8, 28)


def test_rows_and_v():
    assert row_delays(2, 3, 0.1).tolist() == [0.0, 0.0, 0.0, 0.1, 0.1, 0.1]
    times = v_delays(2, 5, 0.01).reshape(2, 5)
    assert times[0].tolist() == [0.02, 0.01, 0.0, 0.01, 0.02]
    np.testing.assert_allclose(times[1] - times[0], 0.01)
    np.testing.assert_array_equal(v_delays(1, 4, 1.0), [1.0, 0.0, 0.0, 1.0])


def test_block_velocities_point_where_asked():
    found = block_velocities([10.0, 20.0], 2, azimuth=pi / 2, elevation=pi / 6)
    np.testing.assert_allclose(
        found, [[0, 10 * sqrt(0.75), 5], [0, 20 * sqrt(0.75), 10]], atol=1e-9
    )
    np.testing.assert_allclose(block_velocities(12.7, 3), [[12.7, 0, 0]] * 3)


def test_all_faults_of_a_bench_are_named():
    assert check_bench(Bench()) == []
    faults = check_bench(Bench(height=-1.0, burden=nan, face_angle=2.0))
    assert len(faults) == 3
    assert "the face would reach the rear" in check_bench(Bench(width=5.0, face_angle=0.5))[0]


def test_all_faults_of_a_law_are_named():
    assert check_law(ContactLaw()) == []
    bad = ContactLaw(effective_modulus=0.0, friction=-1.0, damping_normal=1.0, dashpot_mode=7)
    assert len(check_law(bad)) == 4


def test_stiffness_of_the_deformability_method():
    """A E*/L: two equal balls pi R E*/2, a wall pi R E*; the smaller ball gives the area."""
    assert ball_stiffness(0.2, 0.2, 1e7) == pytest.approx(pi * 0.2 * 1e7 / 2)
    assert ball_stiffness(0.1, 0.3, 1e7) == pytest.approx(pi * 0.01 * 1e7 / 0.4)
    assert wall_stiffness(0.2, 1e7) == pytest.approx(pi * 0.2 * 1e7)


def test_a_plane_has_a_signed_distance():
    walls = plane((0, 0, 1), (0, 3, 4))
    found, normal = distance(walls, (7.0, 3.0, 5.0))
    assert found == pytest.approx(5.0)
    np.testing.assert_allclose(normal, [0, 0.6, 0.8], atol=1e-15)
    assert distance(walls, (7.0, -3.0, -3.0))[0] == pytest.approx(-5.0)


def test_a_bounded_wall_is_touched_at_its_rim():
    walls = rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), (-1, 1, -2, 2))
    assert distance(walls, (0.5, 1.0, 0.05))[0] == pytest.approx(0.05)
    found, normal = distance(walls, (1.3, 0.0, 0.4))
    assert found == pytest.approx(0.5)
    np.testing.assert_allclose(normal, [0.6, 0.0, 0.8])
    assert distance(walls, (0.0, 0.0, -0.2))[0] == inf
    assert distance(walls._replace(rim=np.array([False])), (1.3, 0.0, 0.4))[0] == inf


def test_axes_must_be_orthogonal():
    with pytest.raises(ValueError, match="orthogonal"):
        rectangle((0, 0, 0), (1, 0, 0), (1, 1, 0))


def test_walls_around_a_bench():
    """Rear face and ground on top meet in one edge that is touched once."""
    bench = Bench(length=10.0, width=6.0, height=5.0)
    walls = bench_walls(bench, ends="wall")
    assert len(walls.origin) == 3 + 6
    at_rear = [distance(walls, (-5.95, 5.0, 2.0), k)[0] for k in range(len(walls.origin))]
    assert np.flatnonzero(np.array(at_rear) < 0.1).tolist() == [1]
    over_edge = [distance(walls, (-5.97, 5.0, 5.03), k)[0] for k in range(len(walls.origin))]
    assert np.flatnonzero(np.array(over_edge) < 0.1).tolist() == [2]
    beside = [distance(walls, (-3.0, 0.05, 2.0), k)[0] for k in range(len(walls.origin))]
    assert np.flatnonzero(np.array(beside) < 0.1).tolist() == [3]
    with pytest.raises(ValueError, match="'open', 'wall' or 'mirror'"):
        bench_walls(bench, ends="closed")
    assert np.all(bench_walls(bench, ends="mirror").friction[-2:] == 0.0)


def test_ground_of_slope_and_terrace():
    walls = join(floor(), slope(2.0, pi / 4), rectangle((-1, 0, 3), (1, 0, 0), (0, 1, 0),
                 (-inf, 0, -inf, inf)))  # fmt: skip
    x = np.array([-2.0, 0.0, 2.0, 5.0])
    np.testing.assert_allclose(ground_height(walls, x, np.zeros(4)), [3.0, 0.0, 0.0, 3.0])


def test_balls_are_checked_all_at_once():
    good = particles_at_rest([[0, 0, 0], [0.191, 0, 0], [5, 0, 0]], [0.1, 0.1, 0.3])
    assert check_particles(good) == []
    close = particles_at_rest([[0, 0, 0], [0.17, 0, 0]], [0.1, 0.1])
    assert "balls 0 and 1 by 30 %" in check_particles(close)[0]
    bad = particles_at_rest([[0, 0, nan], [1, 0, 0]], [0.1, -0.1])
    assert len(check_particles(bad)) == 2
