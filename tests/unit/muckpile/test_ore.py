"""Ore polygons through movements that are known: what is lost, what is diluted, where ore lies."""

from __future__ import annotations

import numpy as np
import pytest

from castblast.muckpile.balls.particles import particles_at_rest
from castblast.muckpile.results.ore import (
    METHODS,
    DigPlan,
    OrePolygon,
    area_size,
    densest_area,
    move_ore,
    ore_of_balls,
)

STEP = 0.25
NORTH = OrePolygon("north", np.array([[-6.0, 6.0], [0.0, 6.0], [0.0, 12.0], [-6.0, 12.0]]), 2.0)
SOUTH = OrePolygon("south", np.array([[-6.0, 0.0], [-3.0, 0.0], [-3.0, 6.0], [-6.0, 6.0]]), 1.0)


def bench():
    """Equal balls on a lattice over -12 < x < 0, 0 < y < 12, two layers."""
    axis = np.arange(0.5 * STEP, 12.0, STEP)
    x, y, z = (a.ravel() for a in np.meshgrid(axis - 12.0, axis, [0.2, 1.2]))
    return particles_at_rest(np.column_stack([x, y, z]), np.full(x.size, 0.12))


def shifted(balls, way):
    return balls._replace(position=balls.position + np.asarray(way))


def results(moved):
    return {(r.polygon, r.method): r for r in moved.results}


def test_each_ball_belongs_to_the_polygon_that_holds_it():
    balls = bench()
    owner = ore_of_balls(balls.position, [NORTH, SOUTH])
    x, y = balls.position[:, 0], balls.position[:, 1]
    np.testing.assert_array_equal(owner == 0, (x > -6) & (y > 6))
    np.testing.assert_array_equal(owner == 1, (x > -6) & (x < -3) & (y < 6))
    assert (owner == -1).sum() == 2 * (48 * 48 - 24 * 24 - 12 * 24)


def test_a_bench_that_moves_as_a_whole_loses_nothing():
    """Moved by (9, 3, 1) m, three dig blocks: translated polygons and dig blocks take all ore."""
    before = bench()
    moved = move_ore(before, shifted(before, [9.0, 3.0, 1.0]), [NORTH, SOUTH], density=2600.0)
    np.testing.assert_allclose(moved.movement.displacement, [[9, 3, 1]] * 2, atol=1e-12)
    np.testing.assert_allclose(moved.movement.spread, 0.0, atol=1e-12)
    np.testing.assert_allclose(moved.translated[0][0][0], NORTH.corners + np.array([9.0, 3.0]))
    found = results(moved)
    for name, grade in (("north", 2.0), ("south", 1.0)):
        for method in ("translated", "dig_blocks"):
            result = found[name, method]
            assert result.loss == pytest.approx(0.0, abs=1e-12)
            assert result.dilution == pytest.approx(0.0, abs=1e-12)
            assert result.dug == pytest.approx(result.mass)
            assert result.grade == pytest.approx(grade)
    ball = 2600.0 * 4 / 3 * np.pi * 0.12**3
    assert found["north", "translated"].mass == pytest.approx(2 * 24 * 24 * ball)
    # Dug where it was drawn: all of it has left.
    assert found["north", "as_planned"].loss == pytest.approx(1.0)


def test_digging_as_planned_loses_what_moved_out():
    """North moved by 2 m of its 6 m with all rock: a third is lost, a third of the dug is other.

    What came in from behind is waste without grade, so the grade of the dug falls to 2/3.
    """
    before = bench()
    found = results(move_ore(before, shifted(before, [2.0, 0.0, 0.0]), [NORTH]))
    result = found["north", "as_planned"]
    assert result.loss == pytest.approx(1.0 / 3.0)
    assert result.dilution == pytest.approx(1.0 / 3.0)
    assert result.grade == pytest.approx(2.0 * 2.0 / 3.0)
    assert result.other_ore == 0.0


def test_dilution_by_other_ore_is_told_apart_from_waste():
    """South moved 6 m along y onto north's place: half of north's area is dug as both."""
    before = bench()
    owner = ore_of_balls(before.position, [NORTH, SOUTH])
    way = np.where(owner[:, None] == 1, [0.0, 6.0, 3.0], [0.0, 0.0, 0.0])
    result = results(move_ore(before, shifted(before, way), [NORTH, SOUTH]))["north", "as_planned"]
    assert result.loss == pytest.approx(0.0, abs=1e-12)
    assert result.dilution == pytest.approx(1.0 / 3.0)  # 2 parts north, 1 part south
    assert result.other_ore == pytest.approx(1.0 / 3.0)
    assert result.grade == pytest.approx((2 * 2.0 + 1 * 1.0) / 3)


def test_flitches_part_what_lies_above_each_other():
    """South moved on top of north: blocks over the full height mix them, flitches do not."""
    before = bench()
    owner = ore_of_balls(before.position, [NORTH, SOUTH])
    way = np.where(owner[:, None] == 1, [0.0, 6.0, 3.0], [0.0, 0.0, 0.0])
    after = shifted(before, way)
    # 1 of south's 2 rows of blocks lies over north, which has as much rock: a tie, north wins.
    mixed = results(move_ore(before, after, [NORTH, SOUTH], plan=DigPlan(block=3.0)))
    parted = results(move_ore(before, after, [NORTH, SOUTH], plan=DigPlan(block=3.0, flitch=3.0)))
    assert mixed["south", "dig_blocks"].loss == pytest.approx(1.0)
    assert parted["south", "dig_blocks"].loss == pytest.approx(0.0, abs=1e-12)
    assert parted["north", "dig_blocks"].dilution == pytest.approx(0.0, abs=1e-12)


def test_smaller_dig_blocks_never_do_worse_when_they_divide_the_larger():
    """Halving the blocks refines the choice: rock that is rightly assigned cannot grow less."""
    before = bench()
    rng = np.random.default_rng(3)
    after = shifted(before, rng.normal(0.0, 1.5, before.position.shape))
    right = []
    for block in (6.0, 3.0, 1.5):
        moved = move_ore(before, after, [NORTH, SOUTH], plan=DigPlan(block=block))
        dug = [r for r in moved.results if r.method == "dig_blocks"]
        # Rightly assigned rock of all kinds, up to the mass of all waste.
        ore = sum(r.mass * (1 - r.loss) for r in dug)
        waste_as_ore = sum(r.dug * (r.dilution - r.other_ore) for r in dug)
        right.append(ore - waste_as_ore)
    assert right == sorted(right)


@pytest.mark.parametrize("share", [0.5, 0.9])
def test_outline_holds_its_share_and_follows_a_shift(share):
    """Gaussian cloud: the smallest area that holds `share` is a disc of area -2 pi s^2 ln(1 - p).

    The smoothing flattens the density but moves no ball, so it does not change the area.
    """
    rng = np.random.default_rng(5)
    sigma, cell = 2.0, 0.25
    place = np.column_stack([rng.normal(0.0, sigma, (200_000, 2)), np.zeros(200_000)])
    radius = np.full(len(place), 0.1)
    area = densest_area(place, radius, share, cell)
    exact = -2.0 * np.pi * sigma**2 * np.log(1.0 - share)
    assert area_size(area) == pytest.approx(exact, rel=0.02)
    moved = densest_area(place + np.array([8.0, -4.0, 0.0]), radius, share, cell)
    assert len(moved) == len(area)
    np.testing.assert_allclose(moved[0][0], area[0][0] + [8.0, -4.0], atol=1e-9)


def test_outline_of_few_balls_holds_its_share_too():
    """Digging the outline of 90 % loses 10 %, up to interpolation and parts that are left out."""
    before = bench()
    rng = np.random.default_rng(7)
    after = shifted(before, rng.normal(0.0, 2.0, before.position.shape))
    for polygon in (NORTH, SOUTH):
        moved = move_ore(before, after, [polygon], plan=DigPlan(cell=1.0))
        assert results(moved)[polygon.name, "outlined"].loss == pytest.approx(0.1, abs=0.02)


def test_outline_has_a_hole_where_there_is_no_ore():
    angle = np.random.default_rng(6).uniform(0, 2 * np.pi, 20_000)
    ring = np.column_stack([5 * np.cos(angle), 5 * np.sin(angle), np.zeros_like(angle)])
    area = densest_area(ring, np.full(len(ring), 0.1), 0.9, 0.5)
    assert [len(part) for part in area] == [2]
    assert densest_area(ring[:0], np.zeros(0), 0.9, 0.5) == []


def test_a_polygon_without_balls_and_without_grade():
    before = bench()
    empty = OrePolygon("empty", NORTH.corners + np.array([100.0, 0.0]))
    moved = move_ore(before, before, [empty, NORTH._replace(grade=np.nan)])
    found = results(moved)
    assert [r.method for r in moved.results] == [*METHODS, *METHODS]
    assert np.isnan(found["empty", "translated"].loss)
    assert np.isnan(found["north", "as_planned"].grade)
    assert found["north", "as_planned"].loss == 0.0
