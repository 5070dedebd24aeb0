"""Surfaces as mine tools write them are mended, each repair counted; missing heights end a map."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from castblast.muckpile.ground.facet_table import facet_normals
from castblast.muckpile.ground.mend import WELD, cracks, mend, weld, weld_distance
from castblast.muckpile.ground.terrain import (
    height_faults,
    heightmap,
    missing_heights,
    surface_faults,
)
from castblast.muckpile.ground.walls import floor, ground_height, join, surface

X, Y = np.arange(0.0, 20.0, 2.0), np.arange(-6.0, 9.0, 3.0)
RNG_HEIGHT = np.random.default_rng(3).uniform(0.0, 2.0, (len(Y), len(X)))


def sheet() -> np.ndarray:
    """72 facets of hilly ground."""
    return heightmap(X, Y, RNG_HEIGHT).corner


def done(corner: np.ndarray, towards: np.ndarray | None = None) -> dict[str, list[int]]:
    """Repairs by what was done, with the facets they met."""
    mended = mend(corner, weld_distance(corner), towards)
    assert surface_faults(mended.corner, mended.source) == []
    return {f"{r.done} {r.what}": r.facet.tolist() for r in mended.repairs}


def test_sound_ground_keeps_every_bit():
    good = sheet()
    assert done(good) == {}
    for mended in (mend(good, WELD).corner, weld(good, WELD)[0], surface(good).corner):
        np.testing.assert_array_equal(mended, good)


def test_ground_that_faces_down_is_turned():
    """All of it, or one facet: the surface of the sound one, the facets named."""
    good = sheet()
    assert done(good[:, ::-1]) == {"turned faced away from the balls": list(range(72))}
    assert (facet_normals(mend(good[:, ::-1], WELD).corner)[:, 2] > 0.0).all()
    one = good.copy()
    one[20] = one[20, ::-1]
    assert done(one) == {"turned faced away from the balls": [20]}
    assert surface_faults(one) != []


def test_doubled_and_flat_facets_are_dropped():
    """A facet again, or turned; a needle along an edge; one with two corners at one place."""
    good = sheet()
    again = np.concatenate([good, good[[6]], good[[9]][:, ::-1]])
    assert done(again) == {"dropped lay on another with the same corners": [72, 73]}
    a, b = good[0, 0], good[0, 1]
    needle = np.stack([a, b, 0.5 * (a + b) + [0.0, 0.0, 1e-5]])[None]
    assert done(np.concatenate([good, needle])) == {"dropped had no height": [72]}
    point = np.stack([a, a, b])[None]
    assert done(np.concatenate([point, good])) == {"dropped had no height": [0]}
    mended = mend(np.concatenate([good, needle]), WELD)
    np.testing.assert_array_equal(mended.corner, good)
    np.testing.assert_array_equal(mended.source, np.arange(72))


def test_a_flat_facet_between_two_leaves_no_seam():
    """The neighbour along its long side is split at its tip: the ground stays one, without hole."""
    square = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0], [2, 0, 0]], float)
    south, north = np.array([[0, -4, 0], [4, -4, 0]], float)
    a, b, c, d, tip = square
    # Two facets south of the edge a-b meet at its middle, one north of it does not.
    facets = [[a, b, c], [a, c, d], [a, tip, b], [south, tip, a], [south, north, tip]]
    facets += [[north, b, tip]]
    corner = np.array(facets)
    assert surface_faults(corner) != []
    mended = mend(corner, WELD)
    assert [r.facet.tolist() for r in mended.repairs] == [[2]]
    assert surface_faults(mended.corner) == []
    across = np.cross(
        mended.corner[:, 1] - mended.corner[:, 0], mended.corner[:, 2] - mended.corner[:, 0]
    )
    assert 0.5 * across[:, 2].sum() == pytest.approx(4.0 * 8.0)
    assert sorted(mended.source.tolist()) == [0, 0, 1, 3, 4, 5]


def test_corners_a_fraction_of_a_millimetre_apart_are_joined():
    """Neighbours share their corners again; a gap of 5 mm is reported, not joined."""
    good = sheet()
    rng = np.random.default_rng(0)
    loose = good + rng.uniform(-2e-4, 2e-4, good.shape)
    assert list(done(loose)) == ["joined had corners just beside those of others"]
    joined = surface(loose).corner
    np.testing.assert_allclose(joined, good, atol=2e-4)
    assert len(np.unique(joined.reshape(-1, 3), axis=0)) == X.size * Y.size
    mirror = np.array([2.0 * X[-1] + 0.005, 0.0, 0.0]) + good * [-1.0, 1.0, 1.0]
    count, gap = cracks(np.concatenate([good, mirror]), WELD)
    assert count == 2 * len(Y)
    assert gap == pytest.approx(0.005, rel=1e-6)
    assert cracks(good, WELD) == (0, 0.0)


def test_welding_is_held_to_a_hundredth_of_small_facets():
    small = 1e-3 * sheet()
    assert weld_distance(small) < 1e-4
    np.testing.assert_array_equal(surface(small).corner, small)


def test_closed_bodies_face_outwards_and_walls_the_bench():
    """A box whose facets are turned at random; a vertical wall, seen from either side."""
    corner = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    box = corner[[tri for a, b, c, d in faces for tri in ([a, b, c], [a, c, d])]]
    turned = np.random.default_rng(1).random(12) < 0.5
    box[turned] = box[turned][:, ::-1]
    out = mend(box, WELD).corner
    across = np.cross(out[:, 1] - out[:, 0], out[:, 2] - out[:, 0])
    assert (np.sum(across * (out.mean(axis=1) - 0.5), axis=1) > 0.0).all()
    wall = np.array([[[5, 0, 0], [5, 9, 0], [5, 9, 4]], [[5, 0, 0], [5, 9, 4], [5, 0, 4]]], float)
    for x in (-3.0, 30.0):
        found = facet_normals(mend(wall, WELD, np.array([x, 4.0, 2.0])).corner)
        np.testing.assert_allclose(found, np.tile([np.sign(x - 5.0), 0, 0], (2, 1)), atol=1e-12)
    np.testing.assert_array_equal(mend(wall, WELD).corner, wall)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_any_turned_and_doubled_facets_of_a_sheet_are_mended(seed: int) -> None:
    """The sound sheet comes back, facet by facet, whatever was turned or written twice."""
    rng = np.random.default_rng(seed)
    good = sheet()
    turned = rng.random(len(good)) < rng.uniform(0.0, 1.0)
    bad = good.copy()
    bad[turned] = bad[turned][:, ::-1]
    bad = np.concatenate([bad, bad[rng.integers(0, len(bad), 5)]])
    mended = mend(bad, WELD)
    assert surface_faults(mended.corner) == []
    np.testing.assert_allclose(facet_normals(mended.corner), facet_normals(good), atol=1e-12)


# ------------------------------------------------------------------------------ missing heights
def test_cells_with_a_missing_corner_make_no_facet():
    """The rest is the ground that it was, and ends in a vertical face down to the floor."""
    holed = RNG_HEIGHT.copy()
    holed[0, :2] = holed[1, 0] = np.nan
    assert height_faults(X, Y, holed) == []
    assert missing_heights(holed) == (
        "3 heights missing of 50: 3 of 36 cells have a missing corner and make no facet"
    )
    assert missing_heights(RNG_HEIGHT) == ""
    part, whole = (heightmap(X, Y, z, base=0.0) for z in (holed, RNG_HEIGHT))
    assert np.isfinite(part.corner).all()
    assert surface_faults(part.corner) == []
    x, y = np.meshgrid(np.linspace(0.3, 17.9, 40), np.linspace(-5.9, 5.9, 31))
    left_out = ((x < 4.0) & (y < -3.0)) | ((x < 2.0) & (y < 0.0))
    found, expected = (ground_height(join(floor(), w), x, y) for w in (part, whole))
    np.testing.assert_array_equal(found[left_out], 0.0)
    np.testing.assert_allclose(found[~left_out], expected[~left_out], atol=1e-12)
    # The faces close the ground towards what is missing: a column there is rock no more.
    faces = part.corner[np.ptp(part.corner[..., 0], axis=1) == 0.0]
    assert ((faces[..., 0] == 4.0).all(axis=1) & (faces[..., 1] <= -3.0).all(axis=1)).any()
    normal = facet_normals(faces[(faces[..., 0] == 4.0).all(axis=1)])
    np.testing.assert_allclose(normal, np.tile([-1.0, 0.0, 0.0], (len(normal), 1)), atol=1e-12)


def test_a_hole_inside_is_refused_and_so_is_nothing():
    holed = RNG_HEIGHT.copy()
    holed[2, 4] = np.nan
    assert any("hole, first in row 2, column 4" in fault for fault in height_faults(X, Y, holed))
    strewn = np.where((np.indices(holed.shape).sum(axis=0)) % 2, np.nan, 1.0)
    assert any("no cell has all four corners" in fault for fault in height_faults(X, Y, strewn))
    assert any("no cell" in f for f in height_faults(X, Y, np.full_like(holed, np.inf)))
