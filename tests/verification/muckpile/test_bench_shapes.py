"""Packings of polygon benches and of fragment sizes: fraction, volume, places, same for a seed."""

from __future__ import annotations

from math import pi, radians

import numpy as np
import pytest

from castblast.errors import Status
from castblast.muckpile.bench.fragments import Swebrec, cut_sizes, passing
from castblast.muckpile.bench.geometry import Bench, assign_blocks, bench_outline, polygon_bench
from castblast.muckpile.bench.outline import depth_inside
from castblast.muckpile.bench.packing import (
    Packing,
    count_of,
    fill_bench,
    sizes_for_count,
    solid_volume,
)
from castblast.muckpile.bench.sizes import uniform_sizes

SHAPES = {
    # An inward corner between a leaning face and an upright side.
    "notched": polygon_bench(
        [(0, 0), (0, 5), (-2.5, 5), (-2.5, 9), (-8, 9), (-8, 0)], 5.0, radians(75.0)
    ),
    "convex": polygon_bench([(0, 1), (-1, 8), (-6, 7), (-7, 0)], 5.0, radians(80.0)),
}


@pytest.fixture(scope="module", params=sorted(SHAPES))
def packed(request: pytest.FixtureRequest) -> tuple[Bench, Packing]:
    bench = SHAPES[request.param]
    return bench, fill_bench(
        bench, sizes=sizes_for_count(bench, uniform_sizes(1.0, 0.5), 900), seed=2, threads=1
    )


def test_polygon_is_filled_to_the_fraction_asked_for(packed: tuple[Bench, Packing]) -> None:
    """0.60 inside, to 0.015 (1,000 balls); the balls have the volume that was to be filled.

    The settled top lies at the height of the bench.
    """
    bench, packing = packed
    radius = packing.particles.radius
    assert packing.status == Status.OK
    assert packing.solid_fraction == pytest.approx(0.60, abs=0.015)
    volume = 4.0 / 3.0 * pi * np.sum(radius**3)
    sizes = uniform_sizes(float(np.mean(radius)), 0.5)
    assert volume == pytest.approx(solid_volume(bench, sizes), rel=0.01)
    top = np.quantile(packing.particles.position[:, 2] + radius, 0.95)
    assert top == pytest.approx(bench.height, rel=0.06)


def test_balls_lie_inside_the_polygon(packed: tuple[Bench, Packing]) -> None:
    """No ball stands out of face, sides or floor by more than overlaps under its weight do."""
    bench, packing = packed
    balls = packing.particles
    below = balls.position[:, 2] < bench.height
    depth = depth_inside(bench_outline(bench), balls.position) / balls.radius
    assert depth[below].min() > 0.9
    assert (balls.position[:, 2] / balls.radius).min() > 0.85
    np.testing.assert_array_equal(balls.block, assign_blocks(balls.position, bench))


def test_same_seed_same_packing_of_a_polygon() -> None:
    bench = SHAPES["notched"]
    sizes = sizes_for_count(bench, uniform_sizes(1.0, 0.3), 250)
    first, again, other = (
        fill_bench(bench, sizes=sizes, seed=seed, threads=threads).particles
        for seed, threads in ((1, 1), (1, 2), (2, 1))
    )
    assert first.position.tobytes() == again.position.tobytes()
    assert first.radius.tobytes() == again.radius.tobytes()
    assert first.position.tobytes() != other.position.tobytes()


def test_fragments_are_packed_by_volume() -> None:
    """Sieving the packed balls gives the Swebrec curve between the cuts; the fraction is 0.60."""
    bench = Bench(length=6.0, width=6.0, height=6.0)
    curve = Swebrec(0.45, 1.6, 2.2)
    cut = cut_sizes(curve, 0.35, 1.1)
    packing = fill_bench(bench, sizes=cut.sizes, seed=3, threads=1)
    radius = packing.particles.radius
    assert len(radius) == count_of(bench, cut.sizes)
    assert packing.solid_fraction == pytest.approx(0.60, abs=0.015)
    mesh = np.linspace(0.4, 1.0, 7)
    asked = (passing(curve, mesh) - cut.finer) / (1.0 - cut.finer - cut.coarser)
    sieved = [np.sum(radius[2 * radius < m] ** 3) / np.sum(radius**3) for m in mesh]
    # One of the largest balls is 0.9 % of the volume.
    np.testing.assert_allclose(sieved, asked, atol=0.01)
