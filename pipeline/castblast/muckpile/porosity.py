"""How much of a bench its balls fill, away from walls and top, where packings are looser."""

from __future__ import annotations

from math import cos, sin

import numpy as np

from castblast.kernel import kernel
from castblast.muckpile.bench import Bench, crest_position
from castblast.muckpile.particles import FloatArray, Particles


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
    Counts the nodes of a lattice (about seven to the mean diameter) that lie in a ball.
    """
    radius = particles.radius
    mean = float(np.mean(radius))
    top = float(np.quantile(particles.position[:, 2] + radius, 0.99))
    sides = min(bench.length, bench.width + crest_position(bench), top)
    keep = margin or min(4.0 * mean, 0.25 * sides)
    low = np.array([-bench.width + keep, keep, keep])
    high = np.array([-keep, bench.length - keep, top - keep])
    size = np.maximum(np.ceil((high - low) / (0.2871 * mean)), 1.0).astype(np.int64)
    spacing = (high - low) / size
    face = np.array([float(sin(bench.face_angle)), float(cos(bench.face_angle)), keep])
    first = low + 0.5 * spacing
    covered, nodes = _count_nodes(particles.position, radius, first, spacing, size, face)
    return covered / max(nodes, 1)


@kernel
def _count_nodes(
    position: FloatArray,
    radius: FloatArray,
    low: FloatArray,
    spacing: FloatArray,
    size: np.ndarray[tuple[int], np.dtype[np.int64]],
    face: FloatArray,
) -> tuple[int, int]:
    """Lattice nodes in balls, and all of them, far enough behind the face (sine, cosine, margin).

    Balls hardly overlap, so each node is counted for each ball.
    """
    covered, nodes = 0, 0
    for i in range(size[0]):
        for k in range(size[2]):
            x, z = low[0] + i * spacing[0], low[2] + k * spacing[2]
            if -x * face[0] - z * face[1] >= face[2]:
                nodes += size[1]
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for n in range(len(radius)):
        for axis in range(3):
            middle = (position[n, axis] - low[axis]) / spacing[axis]
            reach = radius[n] / spacing[axis]
            first[axis] = max(int(np.ceil(middle - reach)), 0)
            last[axis] = min(int(np.floor(middle + reach)), size[axis] - 1)
        for i in range(first[0], last[0] + 1):
            x = low[0] + i * spacing[0]
            for k in range(first[2], last[2] + 1):
                z = low[2] + k * spacing[2]
                if -x * face[0] - z * face[1] < face[2]:
                    continue
                square = (x - position[n, 0]) ** 2 + (z - position[n, 2]) ** 2
                for j in range(first[1], last[1] + 1):
                    y = low[1] + j * spacing[1]
                    if square + (y - position[n, 1]) ** 2 < radius[n] ** 2:
                        covered += 1
    return covered, nodes
