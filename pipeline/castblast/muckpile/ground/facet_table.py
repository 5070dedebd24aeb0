"""Preparation of triangulated surfaces: neighbours, normals of edges and corners, search grid."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from castblast.kernel import kernel
from castblast.muckpile.ground.facets import (
    FACET_DEPTH,
    FACET_FRICTION,
    FACET_ROLLING,
    FACET_WORDS,
    GRID_REACH,
    LEVEL,
    LEVEL_COSINE,
    WallTable,
)
from castblast.types import FloatArray, Int32Array, IntArray

#: Corners at both ends of the edges ab, bc, ca.
EDGES = ((0, 1), (1, 2), (2, 0))
#: Height over the plane of a facet, over its size, from which a neighbour counts as rising.
_RISE = 1e-9
_MOST_CELLS_PER_FACET = 4.0


def facet_normals(corner: FloatArray) -> FloatArray:
    """Unit normals (t, 3) of facets (t, 3, 3), counter-clockwise corners seen from their tips."""
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))


def corner_numbers(corner: FloatArray) -> tuple[IntArray, int]:
    """Number (t, 3) of each corner, equal for equal places, and how many there are."""
    places, number = np.unique(corner.reshape(-1, 3), axis=0, return_inverse=True)
    return number.reshape(-1, 3).astype(np.int64), len(places)


def edge_numbers(number: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Number (t, 3) of each edge, its ends (e, 2), and how many facets meet there (e,)."""
    both = np.stack([number[:, list(ends)] for ends in EDGES], axis=1)
    ends, edge, facets = np.unique(
        np.sort(both.reshape(-1, 2), axis=1), axis=0, return_inverse=True, return_counts=True
    )
    return edge.reshape(-1, 3).astype(np.int64), ends, facets


def make_table(
    plane: FloatArray,
    corner: FloatArray,
    friction: FloatArray,
    rolling_friction: FloatArray,
    depth: FloatArray,
    base: FloatArray,
) -> WallTable:
    """Prepare walls for kernels.

    Parameters
    ----------
    plane : array (w, 20)
    corner : array (t, 3, 3) [m]
    friction, rolling_friction : array (t,)
    depth : array (t,)
        How many radii behind the surface a ball is still held.
    base : array (t,) [m]
        Rims no higher than this cannot be touched.
    """
    count = len(corner)
    row = np.zeros((count, FACET_WORDS))
    if count == 0:
        none, empty = np.zeros(1, np.int64), np.zeros(0, np.int32)
        return WallTable(
            plane=plane,
            facet=row,
            start=none,
            around=empty,
            shared=empty.astype(np.uint8),
            cell_start=none,
            cell=empty,
            span=np.zeros((0, 2), np.int32),
            grid=np.zeros(7),
        )
    normal = facet_normals(corner)
    number, places = corner_numbers(corner)
    row[:, 0:9] = corner.reshape(count, 9)
    row[:, 9:12] = normal
    edge_normal, corner_normal = _feature_normals(corner, normal, number, places, base)
    row[:, 12:21] = edge_normal.reshape(count, 9)
    row[:, 21:30] = corner_normal.reshape(count, 9)
    row[:, FACET_FRICTION], row[:, FACET_ROLLING] = friction, rolling_friction
    row[:, FACET_DEPTH] = depth
    start, around, shared = _neighbours(corner, normal, number, places)
    plan = corner[:, :, 0:2]
    cell_start, cell, span, grid = _lay_grid(plan.min(axis=1), plan.max(axis=1))
    # Behind a slope of 45 degrees the nearest point lies 0.7 of the depth aside.
    grid[GRID_REACH] = max(1.0, 0.7 * float(depth.max()))
    return WallTable(
        plane=plane,
        facet=row,
        start=start,
        around=around,
        shared=shared,
        cell_start=cell_start,
        cell=cell,
        span=span,
        grid=grid,
    )


def _feature_normals(
    corner: FloatArray, normal: FloatArray, number: IntArray, places: int, base: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Normals (t, 3, 3) of the edges and of the corners of each facet, see `FACET_WORDS`."""
    edge, ends, facets = edge_numbers(number)
    at_edge = np.zeros((len(facets), 3))
    np.add.at(at_edge, edge.ravel(), np.repeat(normal, 3, axis=0))
    at_corner = np.zeros((places, 3))
    for a in range(3):
        one = corner[:, (a + 1) % 3] - corner[:, a]
        two = corner[:, (a + 2) % 3] - corner[:, a]
        cosine = np.sum(one * two, axis=1)
        cosine /= np.linalg.norm(one, axis=1) * np.linalg.norm(two, axis=1)
        angle = np.arccos(np.clip(cosine, -1.0, 1.0))
        np.add.at(at_corner, number[:, a], angle[:, None] * normal)
    height = np.empty(places)
    height[number] = corner[:, :, 2]
    low = np.full(len(facets), -np.inf)
    np.maximum.at(low, edge.ravel(), np.repeat(base, 3))
    rim = facets == 1
    closed = rim & (height[ends] <= low[:, None]).all(axis=1)
    at_edge[rim] = 0.0
    at_edge[closed] = np.nan
    # Corners of a rim: free where any of their rims is, since a ball comes there along it.
    at_corner[ends[closed].ravel()] = np.nan
    at_corner[ends[rim & ~closed].ravel()] = 0.0
    return at_edge[edge], at_corner[number]


def _neighbours(
    corner: FloatArray, normal: FloatArray, number: IntArray, places: int
) -> tuple[IntArray, Int32Array, NDArray[np.uint8]]:
    """Facets that share corners with each facet, see `WallTable`."""
    from scipy.sparse import csr_array

    count = len(corner)
    own = np.arange(count)
    member: Any = csr_array(
        (np.ones(3 * count, np.int64), (np.repeat(own, 3), number.ravel())), (count, places)
    ).T.tocsr()
    bits = np.tile(np.array([1, 2, 4], np.int64), count)
    corners = csr_array((bits, (np.repeat(own, 3), number.ravel())), (count, places))
    pairs = (corners @ member).tocoo()
    other = pairs.row != pairs.col
    k, j, shared = pairs.row[other], pairs.col[other], pairs.data[other]
    order = np.lexsort((j, k))
    k, j, shared = k[order], j[order], shared[order]
    size = np.linalg.norm(corner[:, 1] - corner[:, 0], axis=1)
    rise = np.einsum("pca,pa->pc", corner[j] - corner[k][:, :1], normal[k]).max(axis=1)
    level = np.einsum("pa,pa->p", normal[k], normal[j]) > LEVEL_COSINE
    level &= rise > _RISE * size[k]
    start = np.searchsorted(k, np.arange(count + 1)).astype(np.int64)
    return start, j.astype(np.int32), (shared + LEVEL * level).astype(np.uint8)


def _lay_grid(
    low: FloatArray, high: FloatArray
) -> tuple[IntArray, Int32Array, Int32Array, FloatArray]:
    """Grid over facets that reach from `low` to `high` (t, 2) [m] in plan, see `WallTable`."""
    corner, far = low.min(axis=0), high.max(axis=0)
    extent = np.maximum(far - corner, 1e-6)
    side = max(float(np.mean(high - low)), 1e-9)
    side = max(side, float(np.sqrt(extent.prod() / (_MOST_CELLS_PER_FACET * len(low)))))
    shape = np.clip(np.ceil(extent / side), 1, 1e6).astype(np.int64)
    per = shape / extent
    span = np.clip(np.floor((low - corner) * per), 0, shape - 1).astype(np.int32)
    last = np.clip(np.floor((high - corner) * per), 0, shape - 1).astype(np.int32)
    cell_start, cell = _fill_cells(span, last, int(shape[0]), int(shape[1]))
    return cell_start, cell, span, np.concatenate([corner, per, shape, [1.0]])


@kernel
def _fill_cells(
    span: Int32Array, last: Int32Array, nx: int, ny: int
) -> tuple[IntArray, Int32Array]:
    """Facets of every cell, by number."""
    start = np.zeros(nx * ny + 1, np.int64)
    for k in range(len(span)):
        for i in range(span[k, 0], last[k, 0] + 1):
            for j in range(span[k, 1], last[k, 1] + 1):
                start[i * ny + j + 1] += 1
    for c in range(nx * ny):
        start[c + 1] += start[c]
    free = start[:-1].copy()
    cell = np.empty(start[nx * ny], np.int32)
    for k in range(len(span)):
        for i in range(span[k, 0], last[k, 0] + 1):
            for j in range(span[k, 1], last[k, 1] + 1):
                cell[free[i * ny + j]] = k
                free[i * ny + j] += 1
    return start, cell
