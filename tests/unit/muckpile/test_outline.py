"""Benches of any shape in plan: volumes and depths in closed form, faults in words."""

from __future__ import annotations

from math import cos, pi, radians, sin, tan

import numpy as np
import pytest

from castblast.muckpile.bench.enclosure import holding_walls, rock_walls
from castblast.muckpile.bench.geometry import (
    Bench,
    bench_outline,
    bench_volume,
    block_centres,
    check_bench,
    polygon_bench,
)
from castblast.muckpile.bench.outline import (
    depth_inside,
    is_convex,
    outline_volume,
    polygon_area,
    section_at,
    shrink,
)

NOTCHED = [(0, 0), (0, 6), (-3, 6), (-3, 10), (-9, 10), (-9, 0)]


def test_rectangle_as_a_polygon() -> None:
    """The same volume and the same edges as the bench of four numbers."""
    angle = radians(70.0)
    plain = Bench(10.0, 9.0, 6.0, angle)
    same = polygon_bench([(0, 0), (0, 10), (-9, 10), (-9, 0)], 6.0, angle)
    assert same.edges == ("free", "open", "rock", "open")
    assert (same.length, same.width) == (10.0, 9.0)
    assert bench_volume(same) == pytest.approx(bench_volume(plain), rel=1e-14)
    assert bench_volume(plain) == pytest.approx(10 * 6 * (9 - 0.5 * 6 / tan(angle)))


def test_volume_between_leaning_faces() -> None:
    """A square with four faces is the frustum h/3 (A + a + sqrt(A a)); a notch is taken off."""
    square = polygon_bench([(0, 0), (0, 10), (-10, 10), (-10, 0)], 3.0, pi / 4, edges=("free",) * 4)
    assert bench_volume(square) == pytest.approx(3.0 / 3.0 * (100 + 16 + 40))
    assert bench_volume(polygon_bench(NOTCHED, 6.0)) == pytest.approx(6 * (90 - 12))
    # Both faces of the notched bench lean: each loses a prism of h^2/2 cot(angle) per metre.
    angle = radians(75.0)
    leaning = polygon_bench(NOTCHED, 6.0, angle)
    lost = 0.5 * 36.0 / tan(angle) * 10.0
    assert bench_volume(leaning) == pytest.approx(6 * 78 - lost)


def test_sections_keep_their_faces_in_the_plane() -> None:
    bench = polygon_bench([(0, 2), (-1, 11), (-8, 9), (-7, 0)], 6.0, radians(60.0))
    outline = bench_outline(bench)
    top = section_at(outline, 6.0)
    face = outline.normal[0]
    for k in (0, 1):
        assert (top[k] - outline.corner[k]) @ face == pytest.approx(-6.0 / tan(radians(60.0)))
    assert polygon_area(top) < polygon_area(outline.corner)
    assert outline_volume(shrink(outline, 0.5), 6.0) < bench_volume(bench)


def test_depth_is_the_distance_from_the_nearest_side() -> None:
    angle = radians(75.0)
    bench = polygon_bench(NOTCHED, 6.0, angle)
    place = np.array([
        (-1.0, 3.0, 1.0),  # near the leaning face
        (-8.5, 5.0, 3.0),  # near the rear
        (-1.0, 8.0, 1.0),  # in the notch, outside
        (-2.5, 5.8, 0.0),  # near the side of the notch
    ])  # fmt: skip
    depth = depth_inside(bench_outline(bench), place)
    assert depth[0] == pytest.approx(1.0 * sin(angle) - 1.0 * cos(angle))
    assert depth[1] == pytest.approx(0.5)
    assert depth[2] < -1.5
    assert depth[3] == pytest.approx(0.2)


def test_convex_benches_are_told_from_others() -> None:
    assert is_convex(bench_outline(Bench()))
    assert not is_convex(bench_outline(polygon_bench(NOTCHED, 6.0)))
    assert len(holding_walls(Bench(), 0.2).origin) == 5


def test_rock_stands_where_the_edges_say() -> None:
    """Floor, rear, and no wall at open ends; rock beside a face goes on in line with it."""
    square = [(0, 0), (0, 6), (-6, 6), (-6, 0)]
    assert len(rock_walls(polygon_bench(square, 4.0)).origin) == 2
    closed = rock_walls(polygon_bench(square, 4.0, edges=("free", "rock", "rock", "rock")))
    assert len(closed.origin) == 1 + 3 + 2
    np.testing.assert_allclose(closed.normal.sum(axis=0)[2], 1.0)
    beside = [k for k in range(6) if np.allclose(closed.normal[k], (1, 0, 0))]
    assert len(beside) == 3


def test_centres_of_cut_blocks() -> None:
    bench = Bench(length=7.0, width=5.0, burden=3.0, spacing=3.0)
    assert block_centres(bench)[[0, 2, 5]].tolist() == [[-1.5, 1.5], [-1.5, 6.5], [-4.0, 6.5]]


@pytest.mark.parametrize(
    ("corners", "change", "line"),
    [
        (NOTCHED[::-1], {}, "counter-clockwise"),
        ([(0, 0), (-9, 10), (0, 10), (-9, 0)], {}, "edges 1 and 3 cross"),
        ([(0, 0), (0, 0), (-4, 6)], {}, "corners 1 and 2 are the same point"),
        ([(5, 2), (5, 9), (0, 9), (0, 2)], {}, "move all corners by (-5, -2) m"),
        (NOTCHED, {"face_angle": radians(40.0)}, "would meet or part below the crest, 6 m high"),
        (NOTCHED, {"edges": ("rock",) * 6}, "none of them is free"),
        (NOTCHED, {"edges": ("free",)}, "is needed for each of 6 edges"),
        (
            [(0, 0), (0, 5), (0, 9), (-6, 9), (-6, 0)],
            {"edges": ("free", "rock", "open", "rock", "open"), "face_angle": 1.2},
            "would meet or part",
        ),
    ],
)
def test_faulty_polygons(corners: list[tuple[float, float]], change: dict, line: str) -> None:
    bench = polygon_bench(corners, 6.0, **change)
    faults = check_bench(bench)
    assert any(line in fault for fault in faults), faults
