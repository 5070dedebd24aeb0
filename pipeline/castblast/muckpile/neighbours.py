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
from numpy.typing import NDArray

from castblast.kernel import inline_kernel, lean_kernel, parallel_kernel
from castblast.muckpile.particles import FloatArray, Int32Array, IntArray, RealArray
from castblast.muckpile.state import starts
from castblast.muckpile.walls import WallTable, near_walls

#: Pieces into which passes over all balls are cut; fixed, so that sums do not depend on threads.
PIECES = 32
#: Cells of the second and third direction are this many to the reach of a pair.
FINE = 2


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
    fine = np.array([1.0, FINE, FINE])
    size = reach
    while True:
        shape = np.maximum(np.floor(np.minimum(fine * extent / size, 1e6)), 1.0)
        if shape.prod() <= 8.0 * count + 64.0:
            break
        size *= 1.25
    axis1, axis2, axis3 = map(int, axes)
    low1, low2, low3 = map(float, low)
    per1, per2, per3 = map(float, shape / extent)
    n1, n2, n3 = map(int, shape)
    return Grid(axis1, axis2, axis3, low1, low2, low3, per1, per2, per3, n1, n2, n3)


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


@inline_kernel
def _may_meet(
    place: FloatArray, ref: RealArray, i: int, j: int, reach: float, horizon: float
) -> bool:
    """Whether two straight paths come within touch and skin (`reach`: R_i + skin) in time."""
    limit = reach + place[j, 3]
    dx = float(ref[j, 0]) - ref[i, 0]
    dy = float(ref[j, 1]) - ref[i, 1]
    dz = float(ref[j, 2]) - ref[i, 2]
    square = dx * dx + dy * dy + dz * dz
    if square < limit * limit:
        return True
    if horizon == 0.0:
        return False
    vx = float(ref[j, 3]) - ref[i, 3]
    vy = float(ref[j, 4]) - ref[i, 4]
    vz = float(ref[j, 5]) - ref[i, 5]
    closing = -(dx * vx + dy * vy + dz * vz)
    if closing <= 0.0:
        return False
    speed = vx * vx + vy * vy + vz * vz
    time = min(closing / speed, horizon)
    return bool(square - time * (2.0 * closing - time * speed) < limit * limit)


@lean_kernel
def _search_slab(
    place: FloatArray,
    ref: RealArray,
    held: NDArray[np.bool_],
    cell_start: Int32Array,
    grid: Grid,
    skin: float,
    horizon: float,
    first: int,
    last: int,
    number: Int32Array,
    found: Int32Array,
    at: int,
    end: int,
) -> int:
    """Partners of the balls first .. last - 1 that come after them, into ``found[at:end]``.

    Returns where they end; beyond `end` they are counted only. The forward half of the
    neighbourhood is the rest of the own column, the columns beside it, and those of the next slab.
    """
    some_held = len(held) > 0
    for i in range(first, last):
        ca, cb, cc = _cell(grid, ref, i, 0.5 * horizon)
        low, high = max(cc - FINE, 0), min(cc + FINE, grid.n3 - 1)
        reach = place[i, 3] + skin
        before = at
        for a in range(ca, min(ca + 2, grid.n1)):
            left = cb if a == ca else max(cb - FINE, 0)
            for b in range(left, min(cb + FINE + 1, grid.n2)):
                column = (a * grid.n2 + b) * grid.n3
                here = a == ca and b == cb
                begin = i + 1 if here else cell_start[column + low]
                for j in range(begin, cell_start[column + high + 1]):
                    if _may_meet(place, ref, i, j, reach, horizon) and not (
                        some_held and held[i] and held[j]
                    ):
                        if at < end:
                            found[at] = j
                        at += 1
        number[i] = at - before
    return at


@parallel_kernel
def _search_pairs(
    place: FloatArray,
    ref: RealArray,
    held: NDArray[np.bool_],
    cell_start: Int32Array,
    slab: IntArray,
    grid: Grid,
    skin: float,
    horizon: float,
    room: IntArray,
    number: Int32Array,
    found: Int32Array,
) -> IntArray:
    """Search all slabs; the pairs of slab s go into ``found[room[s]:room[s + 1]]``.

    Returns the number of pairs of each slab, whether they had room or not.
    """
    slabs = len(slab) - 1
    total = np.empty(slabs, np.int64)
    for s in prange(slabs):
        total[s] = (
            _search_slab(
                place, ref, held, cell_start, grid, skin, horizon,
                slab[s], slab[s + 1], number, found, room[s], room[s + 1],
            )
            - room[s]
        )  # fmt: skip
    return total


@parallel_kernel
def _close_ranks(found: Int32Array, room: IntArray, base: IntArray, partner: Int32Array) -> None:
    """Copy the pairs of each slab from where they had room to where they belong."""
    for s in prange(len(base) - 1):
        for k in range(base[s + 1] - base[s]):
            partner[base[s] + k] = found[room[s] + k]


def list_pairs(
    place: FloatArray,
    reference: RealArray,
    held: NDArray[np.bool_],
    cell_start: Int32Array,
    slab: IntArray,
    grid: Grid,
    skin: float,
    horizon: float,
    guess: float = 6.0,
) -> tuple[Int32Array, Int32Array]:
    """List the pairs that may meet: start (n + 1,) and partner (p,), as in `Contacts`.

    Parameters
    ----------
    place : array (n, 4) [m]
    reference : array (n, 6), real
    held : array (n,) or (0,), bool
        Two balls that are held are no pair; empty: none is held.
    cell_start, slab : arrays
        From `sort_by_cell`, whose order the balls are in.
    grid : Grid
        Of slabs at least as wide as the reach of a pair.
    skin : float [m]
    horizon : float [s]
    guess : float
        Pairs per ball for which room is made at first.
    """
    number = np.empty(len(place), dtype=np.int32)
    need = np.ceil(guess * np.diff(slab)).astype(np.int64)
    while True:
        room = np.concatenate([[0], np.cumsum(need)])
        found = np.empty(int(room[-1]), dtype=np.int32)
        total = _search_pairs(
            place, reference, held, cell_start, slab, grid, skin, horizon, room, number, found
        )
        if np.all(total <= need):
            break
        need = total
    base = np.concatenate([[0], np.cumsum(total)])
    partner = np.empty(int(base[-1]), dtype=np.int32)
    _close_ranks(found, room, base, partner)
    return starts(number), partner


@inline_kernel
def _search_walls(
    place: FloatArray,
    ref: RealArray,
    walls: WallTable,
    skin: float,
    horizon: float,
    i: int,
    found: Int32Array,
    at: int,
) -> int:
    """Count the walls that ball `i` may meet; write them to ``found[at:]`` if at >= 0."""
    half = 0.5 * horizon
    x, y, z = (
        ref[i, 0] + half * ref[i, 3],
        ref[i, 1] + half * ref[i, 4],
        ref[i, 2] + half * ref[i, 5],
    )
    speed = np.sqrt(float(ref[i, 3] ** 2 + ref[i, 4] ** 2 + ref[i, 5] ** 2))
    reach = place[i, 3] + 0.5 * skin + half * speed
    return near_walls(walls, x, y, z, reach, found, at)


@parallel_kernel
def _count_walls(
    place: FloatArray,
    ref: RealArray,
    held: NDArray[np.bool_],
    walls: WallTable,
    skin: float,
    horizon: float,
    number: Int32Array,
) -> None:
    nowhere = np.empty(0, np.int32)
    for i in prange(len(number)):
        idle = len(held) > 0 and held[i]
        number[i] = 0 if idle else _search_walls(place, ref, walls, skin, horizon, i, nowhere, -1)


@parallel_kernel
def _fill_walls(
    place: FloatArray,
    ref: RealArray,
    walls: WallTable,
    skin: float,
    horizon: float,
    start: Int32Array,
    partner: Int32Array,
) -> None:
    for i in prange(len(start) - 1):
        if start[i] < start[i + 1]:
            _search_walls(place, ref, walls, skin, horizon, i, partner, start[i])


def list_walls(
    place: FloatArray,
    reference: RealArray,
    held: NDArray[np.bool_],
    walls: WallTable,
    skin: float,
    horizon: float,
) -> tuple[Int32Array, Int32Array]:
    """List the walls that each ball may meet; arguments and result as in `list_pairs`."""
    number = np.empty(len(place), dtype=np.int32)
    _count_walls(place, reference, held, walls, skin, horizon, number)
    start = starts(number)
    partner = np.empty(int(start[-1]), dtype=np.int32)
    _fill_walls(place, reference, walls, skin, horizon, start, partner)
    return start, partner
