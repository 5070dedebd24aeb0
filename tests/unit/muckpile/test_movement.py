"""Movement vectors of groups whose movement is known."""

from __future__ import annotations

import numpy as np
import pytest

from castblast.muckpile.balls.particles import particles_at_rest
from castblast.muckpile.results.movement import block_levels, group_movement


def bench_of_balls(seed: int = 1, count: int = 400):
    rng = np.random.default_rng(seed)
    place = rng.uniform([-6.0, 0.0, 0.0], [0.0, 9.0, 5.0], (count, 3))
    return particles_at_rest(place, rng.uniform(0.1, 0.3, count), block=rng.integers(0, 3, count))


def test_a_block_that_is_shifted_moves_by_that_vector_without_spread():
    before = bench_of_balls()
    way = np.array([[7.0, 0.5, -2.0], [1.0, 0.0, 0.3], [0.0, 0.0, 0.0]])
    after = before._replace(position=before.position + way[before.block])
    moved = group_movement(before, after, before.block, 4)
    np.testing.assert_allclose(moved.displacement[:3], way, atol=1e-12)
    np.testing.assert_allclose(moved.spread[:3], 0.0, atol=1e-12)
    np.testing.assert_allclose(moved.throw[:2], [np.hypot(7.0, 0.5), 1.0])
    np.testing.assert_allclose(moved.heave[:3], way[:, 2], atol=1e-12)
    assert np.isnan(moved.displacement[3]).all()
    assert moved.mass_share.sum() == pytest.approx(1.0)
    assert moved.balls.sum() == len(before.radius)


def test_mean_and_spread_are_weighted_by_mass():
    """Masses 1 and 8 move by 9 and 0: mean 1, variance (64 + 8 * 1) / 9 = 8."""
    before = particles_at_rest([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]], [1.0, 2.0], block=[0, 0])
    after = before._replace(position=before.position + np.array([[9.0, 0, 0], [0, 0, 0]]))
    moved = group_movement(before, after, before.block, 1)
    assert moved.displacement[0, 0] == pytest.approx(1.0)
    assert moved.spread[0, 0] == pytest.approx(np.sqrt(8.0))
    assert moved.start[0, 0] == pytest.approx(40.0 / 9.0)


def test_groups_together_move_as_the_whole():
    """Momentum of the parts is that of the whole, whatever the movement."""
    before = bench_of_balls()
    rng = np.random.default_rng(2)
    after = before._replace(position=before.position + rng.normal(size=before.position.shape))
    parts = group_movement(before, after, block_levels(before, 5.0, 2, 3), 6)
    whole = group_movement(before, after, np.zeros(len(before.radius), dtype=np.int64), 1)
    np.testing.assert_allclose(parts.mass_share @ parts.displacement, whole.displacement[0])


def test_levels_are_cut_at_equal_heights():
    before = particles_at_rest(
        [[0, 0, 0.4], [0, 0, 1.2], [0, 0, 2.0], [0, 0, 3.0], [0, 0, 1.0]],
        np.full(5, 0.1), block=[0, 1, 0, 0, -1],
    )  # fmt: skip
    np.testing.assert_array_equal(block_levels(before, 2.0, 2, 3), [0, 4, 3, 3, -1])
