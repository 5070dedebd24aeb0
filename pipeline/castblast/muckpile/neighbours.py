"""Who may touch whom: a cell list that sorts the balls, and a pair list that lives for many steps.

The list holds every pair whose straight paths come within a skin of contact before a horizon; it
stays complete as long as no ball is more than half a skin off its own straight path. With a
reference velocity of zero and no horizon this is the list of Verlet (1967); with the true
velocities it is insensitive to common flight, in which most of a cast happens.

Balls are kept in the order of their cells, layer by layer along x (a *slab* is one layer). Each
pair belongs to the ball that comes first, and its partner lies in the same or in the next slab:
all even slabs may be worked on at once, then all odd ones, without two of them touching the same
ball, and the sum at a ball is formed in an order that does not depend on the number of threads.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from castblast.kernel import inline_kernel, kernel, parallel_kernel
from castblast.muckpile.contact import ROW, ball_stiffness, wall_stiffness
from castblast.muckpile.particles import FloatArray, IntArray
from castblast.muckpile.walls import wall_distance


class Balls(NamedTuple):
    """State of the balls in the order of their cells, one cache line or less per row.

    Attributes
    ----------
    place : array (n, 4) [m]
        Centre and radius.
    motion : array (n, 8)
        Velocity [m s-1], spin [rad s-1], mass [kg], and 1.0 where the ball is held in place.
    force : array (n, 8)
        Force [N], moment [N m], two unused words.
    reference : array (n, 6)
        Centre and velocity when the list was built.
    identity : array (n,), int64
        Index of the ball in the caller's arrays.
    """

    place: FloatArray
    motion: FloatArray
    force: FloatArray
    reference: FloatArray
    identity: IntArray


class Contacts(NamedTuple):
    """Candidate contacts, those of ball i in ``start[i]:start[i + 1]``, with their memory.

    Attributes
    ----------
    start : array (n + 1,), int64
    partner : array (p,), int32
        Index of the second ball (always larger), or of the wall.
    memory : array (p, 8)
        See `castblast.muckpile.contact`.
    touching : array (p,), uint8
    dash : array (p, 3) or (0, 3) [N]
        Dashpot force of the last step; empty when no ledger is kept.
    """

    start: IntArray
    partner: NDArray[np.int32]
    memory: FloatArray
    touching: NDArray[np.uint8]
    dash: FloatArray


class Grid(NamedTuple):
    """Cells of a box: lower corner [m], cells per metre, number of cells along x, y, z."""

    x: float
    y: float
    z: float
    per_x: float
    per_y: float
    per_z: float
    nx: int
    ny: int
    nz: int


def make_grid(lower: FloatArray, upper: FloatArray, cell: float, count: int) -> Grid:
    """Cut the box into cells of at least `cell` [m]; at most about 8 cells per ball."""
    extent = np.maximum(upper - lower, 1e-9)
    size = cell
    while True:
        shape = np.maximum(np.floor(np.minimum(extent / size, 1e6)), 1.0)
        if shape.prod() <= 8.0 * count + 64.0:
            break
        size *= 1.25
    per = shape / extent
    x, y, z = map(float, lower)
    per_x, per_y, per_z = map(float, per)
    nx, ny, nz = map(int, shape)
    return Grid(x, y, z, per_x, per_y, per_z, nx, ny, nz)


@inline_kernel
def _cell(grid: Grid, x: float, y: float, z: float) -> tuple[int, int, int]:
    i = min(max(int((x - grid.x) * grid.per_x), 0), grid.nx - 1)
    j = min(max(int((y - grid.y) * grid.per_y), 0), grid.ny - 1)
    k = min(max(int((z - grid.z) * grid.per_z), 0), grid.nz - 1)
    return i, j, k


@kernel
def sort_by_cell(point: FloatArray, grid: Grid) -> tuple[IntArray, IntArray, IntArray]:
    """Counting sort of points (n, 3): their new order (n,), the start of each cell, of each slab.

    Balls of one cell keep their order.
    """
    count = len(point)
    cells = grid.nx * grid.ny * grid.nz
    start = np.zeros(cells + 1, np.int64)
    where = np.empty(count, np.int64)
    for n in range(count):
        i, j, k = _cell(grid, point[n, 0], point[n, 1], point[n, 2])
        where[n] = (i * grid.ny + j) * grid.nz + k
        start[where[n] + 1] += 1
    for c in range(cells):
        start[c + 1] += start[c]
    free = start[:-1].copy()
    order = np.empty(count, np.int64)
    for n in range(count):
        order[free[where[n]]] = n
        free[where[n]] += 1
    slab = start[:: grid.ny * grid.nz].copy()
    return order, start, slab


@inline_kernel
def _approach(ref: FloatArray, i: int, j: int, horizon: float) -> float:
    """Square of the least distance [m2] of two straight reference paths before the horizon."""
    dx, dy, dz = ref[j, 0] - ref[i, 0], ref[j, 1] - ref[i, 1], ref[j, 2] - ref[i, 2]
    vx, vy, vz = ref[j, 3] - ref[i, 3], ref[j, 4] - ref[i, 4], ref[j, 5] - ref[i, 5]
    closing = -(dx * vx + dy * vy + dz * vz)
    if closing > 0.0:
        time = min(closing / (vx * vx + vy * vy + vz * vz), horizon)
        dx += vx * time
        dy += vy * time
        dz += vz * time
    return float(dx * dx + dy * dy + dz * dz)


@inline_kernel
def _search(
    place: FloatArray,
    ref: FloatArray,
    cell_start: IntArray,
    grid: Grid,
    skin: float,
    horizon: float,
    i: int,
    found: NDArray[np.int32],
    at: int,
) -> int:
    """Count the partners of ball `i` that come after it; write them to ``found[at:]`` if at >= 0.

    Cells run along z first, so the forward half of the neighbourhood is five runs of balls: the
    rest of the own column, one column beside it, and three columns of the next slab.
    """
    half = 0.5 * horizon
    ci, cj, ck = _cell(
        grid,
        ref[i, 0] + half * ref[i, 3],
        ref[i, 1] + half * ref[i, 4],
        ref[i, 2] + half * ref[i, 5],
    )
    low, high = max(ck - 1, 0), min(ck + 1, grid.nz - 1)
    reach = place[i, 3] + skin
    count = 0
    for run in range(5):
        a = ci if run < 2 else ci + 1
        b = cj + run if run < 2 else cj + run - 3
        if a >= grid.nx or b < 0 or b >= grid.ny:
            continue
        column = (a * grid.ny + b) * grid.nz
        first = i + 1 if run == 0 else cell_start[column + low]
        for j in range(first, cell_start[column + high + 1]):
            limit = reach + place[j, 3]
            if _approach(ref, i, j, horizon) < limit * limit:
                if at >= 0:
                    found[at + count] = j
                count += 1
    return count


@parallel_kernel
def count_partners(
    balls: Balls, cell_start: IntArray, grid: Grid, skin: float, horizon: float
) -> IntArray:
    """Return the number of partners (n,) that each ball owns in the list."""
    number = np.empty(len(balls.place), np.int64)
    nowhere = np.empty(0, np.int32)
    place, ref = balls.place, balls.reference
    for i in prange(len(number)):
        number[i] = _search(place, ref, cell_start, grid, skin, horizon, i, nowhere, -1)
    return number


@parallel_kernel
def fill_partners(
    balls: Balls,
    cell_start: IntArray,
    grid: Grid,
    skin: float,
    horizon: float,
    start: IntArray,
    partner: NDArray[np.int32],
) -> None:
    """Write the partners that `count_partners` counted."""
    place, ref = balls.place, balls.reference
    for i in prange(len(start) - 1):
        _search(place, ref, cell_start, grid, skin, horizon, i, partner, start[i])


@inline_kernel
def _search_walls(
    place: FloatArray,
    ref: FloatArray,
    walls: FloatArray,
    skin: float,
    horizon: float,
    i: int,
    found: NDArray[np.int32],
    at: int,
) -> int:
    """Count the walls that ball `i` may meet; write them to ``found[at:]`` if at >= 0."""
    half = 0.5 * horizon
    x, y, z = (
        ref[i, 0] + half * ref[i, 3],
        ref[i, 1] + half * ref[i, 4],
        ref[i, 2] + half * ref[i, 5],
    )
    speed = np.sqrt(ref[i, 3] ** 2 + ref[i, 4] ** 2 + ref[i, 5] ** 2)
    reach = place[i, 3] + 0.5 * skin + half * speed
    count = 0
    for k in range(len(walls)):
        distance, _ = wall_distance(walls, k, x, y, z, reach)
        if distance < reach:
            if at >= 0:
                found[at + count] = k
            count += 1
    return count


@kernel
def count_walls(balls: Balls, walls: FloatArray, skin: float, horizon: float) -> IntArray:
    """Return the number of walls (n,) that each ball may meet."""
    number = np.empty(len(balls.place), np.int64)
    nowhere = np.empty(0, np.int32)
    place, ref = balls.place, balls.reference
    for i in range(len(number)):
        number[i] = _search_walls(place, ref, walls, skin, horizon, i, nowhere, -1)
    return number


@kernel
def fill_walls(
    balls: Balls,
    walls: FloatArray,
    skin: float,
    horizon: float,
    start: IntArray,
    partner: NDArray[np.int32],
) -> None:
    """Write the walls that `count_walls` counted."""
    place, ref = balls.place, balls.reference
    for i in range(len(start) - 1):
        _search_walls(place, ref, walls, skin, horizon, i, partner, start[i])


@parallel_kernel
def carry_memory(
    balls: Balls,
    new: Contacts,
    old: Contacts,
    old_index: IntArray,
    modulus: float,
    with_walls: bool,
) -> None:
    """Give the contacts of a new list their stiffness and what the old list remembers of them.

    Parameters
    ----------
    balls : Balls
        In the new order.
    new, old : Contacts
    old_index : array (n,)
        Place of each ball of the new order in the old order.
    modulus : float [Pa]
    with_walls : bool
        The partners are walls.
    """
    for i in prange(len(new.start) - 1):
        _carry_ball(balls, new, old, old_index, modulus, with_walls, i)


@inline_kernel
def _carry_ball(
    balls: Balls,
    new: Contacts,
    old: Contacts,
    old_index: IntArray,
    modulus: float,
    with_walls: bool,
    i: int,
) -> None:
    """Do the work of `carry_memory` for the contacts of ball `i`."""
    a = old_index[i]
    for p in range(new.start[i], new.start[i + 1]):
        j = np.int64(new.partner[p])
        mass = balls.motion[i, 6]
        if with_walls:
            kn = wall_stiffness(balls.place[i, 3], modulus)
            first, second = a, j
        else:
            kn = ball_stiffness(balls.place[i, 3], balls.place[j, 3], modulus)
            mass = mass * balls.motion[j, 6] / (mass + balls.motion[j, 6])
            first, second = min(a, old_index[j]), max(a, old_index[j])
        for word in range(ROW - 2):
            new.memory[p, word] = 0.0
        new.memory[p, 6] = kn
        new.memory[p, 7] = 2.0 * np.sqrt(mass * kn)
        new.touching[p] = 0
        for q in range(old.start[first], old.start[first + 1]):
            if old.partner[q] == second:
                if old.touching[q]:
                    # The memory is what the first does to the second.
                    _copy_row(new, p, old, q, 1.0 if first == a else -1.0)
                break


@inline_kernel
def _copy_row(new: Contacts, p: int, old: Contacts, q: int, sign: float) -> None:
    new.touching[p] = 1
    for word in range(ROW - 2):
        new.memory[p, word] = sign * old.memory[q, word]
    if len(old.dash) > 0:
        for word in range(3):
            new.dash[p, word] = sign * old.dash[q, word]


def empty_contacts(start: IntArray, ledger: bool) -> Contacts:
    """Make room for ``start[-1]`` contacts."""
    count = int(start[-1])
    return Contacts(
        start,
        np.empty(count, dtype=np.int32),
        np.empty((count, ROW)),
        np.zeros(count, dtype=np.uint8),
        np.zeros((count if ledger else 0, 3)),
    )


def starts(number: IntArray) -> IntArray:
    """Return the running total (n + 1,) of counts (n,)."""
    start = np.zeros(len(number) + 1, dtype=np.int64)
    np.cumsum(number, out=start[1:])
    return start
