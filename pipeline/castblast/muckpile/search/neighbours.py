"""Who may touch whom: a cell list that sorts the balls, and a pair list that lives for many steps.

The list holds every pair whose straight paths come within a skin of contact before a horizon; it
stays complete as long as no ball is more than half a skin off its own straight path. With a
reference velocity of zero and no horizon this is the list of Verlet (1967); with the true
velocities it is insensitive to common flight, in which most of a cast happens.

Balls are kept in the order of their cells, layer by layer along the longest side of the crowd (a
*slab* is one layer). Each pair belongs to the ball that comes first, and its partner lies in the
same or in the next slab: slabs can be worked on in order, or apart, without two of them touching
the same ball. Everything here is cut into pieces that do not depend on the number of threads.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from castblast.kernel import inline_kernel, lean_kernel, parallel_kernel
from castblast.types import FloatArray, Int32Array, IntArray, RealArray

#: Pieces into which passes over all balls are cut; fixed, so that sums do not depend on threads.
PIECES = 32
#: Cells of the second and third direction are this many to the reach of a pair: few and long runs
#: of balls suit the search.
WIDE, FINE = 1, 2


class Grid(NamedTuple):
    """Cells of a box.

    Attributes
    ----------
    axis1, axis2, axis3 : int
        Axes of space: along slabs, columns and cells.
    low1, low2, low3 : float [m]
        Lower corner.
    per1, per2, per3 : float [m-1]
        Cells per metre.
    n1, n2, n3 : int
        Number of cells.
    """

    axis1: int
    axis2: int
    axis3: int
    low1: float
    low2: float
    low3: float
    per1: float
    per2: float
    per3: float
    n1: int
    n2: int
    n3: int


def make_grid(lower: FloatArray, upper: FloatArray, reach: float, count: int) -> Grid:
    """Cut the box into slabs of at least `reach` [m] and finer cells; at most about 8 per ball."""
    extent = np.maximum(upper - lower, 1e-9)
    axes = np.argsort(-extent, kind="stable")
    extent, low = extent[axes], lower[axes]
    fine = np.array([1.0, WIDE, FINE])
    size = reach
    while True:
        shape = np.maximum(np.floor(np.minimum(fine * extent / size, 1e6)), 1.0)
        if shape.prod() <= 8.0 * count + 64.0:
            break
        size *= 1.25
    per = shape / extent
    return Grid(
        axis1=int(axes[0]),
        axis2=int(axes[1]),
        axis3=int(axes[2]),
        low1=float(low[0]),
        low2=float(low[1]),
        low3=float(low[2]),
        per1=float(per[0]),
        per2=float(per[1]),
        per3=float(per[2]),
        n1=int(shape[0]),
        n2=int(shape[1]),
        n3=int(shape[2]),
    )


@inline_kernel
def _cell(grid: Grid, point: RealArray, i: int, time: float) -> tuple[int, int, int]:
    """Cell of row `i` of `point`, (n, 3) or with velocities (n, 6), after flying for `time`."""
    x, y, z = point[i, grid.axis1] + 0.0, point[i, grid.axis2] + 0.0, point[i, grid.axis3] + 0.0
    if time > 0.0:
        x += time * point[i, grid.axis1 + 3]
        y += time * point[i, grid.axis2 + 3]
        z += time * point[i, grid.axis3 + 3]
    a = min(max(int((x - grid.low1) * grid.per1), 0), grid.n1 - 1)
    b = min(max(int((y - grid.low2) * grid.per2), 0), grid.n2 - 1)
    c = min(max(int((z - grid.low3) * grid.per3), 0), grid.n3 - 1)
    return a, b, c


@parallel_kernel
def sort_by_cell(
    point: RealArray, grid: Grid, time: float = 0.0
) -> tuple[Int32Array, Int32Array, IntArray]:
    """Counting sort of points: their new order (n,), the start of each cell, of each slab.

    Balls of one cell keep their order. First into slabs, then each slab into cells.

    Parameters
    ----------
    point : array (n, 3) or (n, 6), real [m, m s-1]
    grid : Grid
    time : float [s]
        Sort by where the points are after flying for this time.
    """
    count, layer = len(point), grid.n2 * grid.n3
    cell = np.empty(count, np.int32)
    table = np.zeros((PIECES, grid.n1), np.int32)
    for piece in prange(PIECES):
        for n in range(piece * count // PIECES, (piece + 1) * count // PIECES):
            a, b, c = _cell(grid, point, n, time)
            cell[n] = (a * grid.n2 + b) * grid.n3 + c
            table[piece, a] += 1
    slab = np.zeros(grid.n1 + 1, np.int64)
    total = 0
    for a in range(grid.n1):
        for piece in range(PIECES):
            here = table[piece, a]
            table[piece, a] = total
            total += here
        slab[a + 1] = total
    rough = np.empty(count, np.int32)
    for piece in prange(PIECES):
        for n in range(piece * count // PIECES, (piece + 1) * count // PIECES):
            a = cell[n] // layer
            rough[table[piece, a]] = n
            table[piece, a] += 1
    order = np.empty(count, np.int32)
    start = np.empty(grid.n1 * layer + 1, np.int32)
    start[-1] = count
    for a in prange(grid.n1):
        _sort_slab(cell, rough, order, start, slab[a], slab[a + 1], a * layer, layer)
    return order, start, slab


@lean_kernel
def _sort_slab(
    cell: Int32Array,
    rough: Int32Array,
    order: Int32Array,
    start: Int32Array,
    first: int,
    last: int,
    origin: int,
    layer: int,
) -> None:
    """Order the balls rough[first:last] of one slab by cell, and write where its cells start."""
    for c in range(origin, origin + layer):
        start[c] = 0
    for k in range(first, last):
        start[cell[rough[k]]] += 1
    # From the end of each cell down, so that afterwards each entry is the start of its cell.
    end = first
    for c in range(origin, origin + layer):
        end += start[c]
        start[c] = end
    for k in range(last - 1, first - 1, -1):
        n = rough[k]
        start[cell[n]] -= 1
        order[start[cell[n]]] = n
