"""How much of a bench its balls fill, away from walls and top, where packings are looser."""

from __future__ import annotations

import numpy as np

from castblast.kernel import kernel
from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.bench.geometry import Bench, bench_outline, crest_position
from castblast.muckpile.bench.outline import depth_inside, polygon_area, section_at
from castblast.types import BoolArray, FloatArray, IntArray

#: Most nodes of the lattice, and its spacing over the mean radius where fewer are enough.
_MOST_NODES, _FINE = 3e6, 0.2871


def solid_fraction(particles: Particles, bench: Bench, margin: float = 0.0) -> float:
    """Share of the volume inside the settled bench that balls fill.

    Parameters
    ----------
    particles : Particles
    bench : Bench
    margin : float [m]
        Kept from walls, face and top; 0: two mean diameters, or a quarter of the shortest side.

    Notes
    -----
    Counts the nodes of a lattice (about seven to the mean diameter, three million at most) that
    lie in a ball.
    """
    radius = particles.radius
    mean = float(np.mean(radius))
    top = float(np.quantile(particles.position[:, 2] + radius, 0.99))
    keep = margin or min(4.0 * mean, 0.25 * min(_narrowest(bench), top))
    low = np.array([-bench.width + keep, keep, keep])
    high = np.array([-keep, bench.length - keep, top - keep])
    finest = (float(np.prod(high - low)) / _MOST_NODES) ** (1.0 / 3.0)
    size = np.maximum(np.ceil((high - low) / max(_FINE * mean, finest)), 1.0).astype(np.int64)
    spacing = (high - low) / size
    first = low + 0.5 * spacing
    inside = _nodes_inside(bench, first, spacing, size, keep)
    covered = _count_covered(particles.position, radius, first, spacing, inside)
    return covered / max(int(inside.sum()), 1)


def _narrowest(bench: Bench) -> float:
    """Shortest side [m] of the bench in plan; of a polygon twice its area over its perimeter."""
    if not bench.corners:
        return min(bench.length, bench.width + crest_position(bench))
    top = section_at(bench_outline(bench), bench.height)
    perimeter = float(np.sum(np.linalg.norm(np.roll(top, -1, axis=0) - top, axis=1)))
    return 2.0 * polygon_area(top) / perimeter


def _nodes_inside(
    bench: Bench, first: FloatArray, spacing: FloatArray, size: IntArray, keep: float
) -> BoolArray:
    """Lattice nodes (nx, ny, nz) that lie deep enough in the bench."""
    outline = bench_outline(bench)
    x, y, z = (first[axis] + spacing[axis] * np.arange(size[axis]) for axis in range(3))
    plan = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    inside = np.empty(tuple(size), dtype=np.bool_)
    for k, height in enumerate(z):
        level = np.column_stack([plan, np.full(len(plan), height)])
        inside[:, :, k] = (depth_inside(outline, level) >= keep - 1e-9).reshape(size[0], size[1])
    return inside


@kernel
def _count_covered(
    position: FloatArray,
    radius: FloatArray,
    low: FloatArray,
    spacing: FloatArray,
    inside: BoolArray,
) -> int:
    """Number of the nodes `inside` that lie in a ball, once for each ball: they hardly overlap."""
    covered = 0
    size = inside.shape
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for n in range(len(radius)):
        for axis in range(3):
            middle = (position[n, axis] - low[axis]) / spacing[axis]
            reach = radius[n] / spacing[axis]
            first[axis] = max(int(np.ceil(middle - reach)), 0)
            last[axis] = min(int(np.floor(middle + reach)), size[axis] - 1)
        for i in range(first[0], last[0] + 1):
            x = low[0] + i * spacing[0] - position[n, 0]
            for j in range(first[1], last[1] + 1):
                y = low[1] + j * spacing[1] - position[n, 1]
                for k in range(first[2], last[2] + 1):
                    z = low[2] + k * spacing[2] - position[n, 2]
                    if inside[i, j, k] and x * x + y * y + z * z < radius[n] ** 2:
                        covered += 1
    return covered
