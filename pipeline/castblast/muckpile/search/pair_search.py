"""Which balls may meet before the list is renewed: the search through the cells.

The candidates of a ball lie in a few runs of consecutive balls, one run per column of cells. A run
is tested in rows of `LANES` balls at once, without a branch, on paths laid out axis by axis in
single precision: the one form in which this loop becomes vector code. Whoever passes is written
down afterwards, one by one.
"""

from __future__ import annotations

import numpy as np
from numba import prange
from numpy.typing import NDArray

from castblast.kernel import fused_kernel, inline_kernel, lean_kernel, parallel_kernel
from castblast.muckpile.balls.state import starts
from castblast.muckpile.search.neighbours import FINE, WIDE, Grid
from castblast.muckpile.search.paths import LANES, Paths
from castblast.types import BoolArray, Int32Array, IntArray

#: Candidates of a ball that are collected before the close ones among them are written down.
CANDIDATES = 256


@fused_kernel
def _test_row(
    paths: Paths,
    i: int,
    j: int,
    horizon: NDArray[np.float32],
    gap: NDArray[np.float32],
    who: Int32Array,
    slab: int,
    at: int,
) -> None:
    """Write for balls j .. j + LANES - 1 how far their paths stay off ball `i`; negative: close.

    The measure is the square of the least distance less that of the distance allowed [m2].
    """
    x, y, z = paths[0, i], paths[1, i], paths[2, i]
    u, v, w, reach = paths[3, i], paths[4, i], paths[5, i], paths[6, i]
    longest, tiny, zero = horizon[0], horizon[1], horizon[2]
    for k in range(LANES):
        # Indices without a sign: those with one may count from the end, and then nothing is known
        # to be side by side.
        n, m = np.uint64(j + k), np.uint64(at + k)
        dx, dy, dz = paths[0, n] - x, paths[1, n] - y, paths[2, n] - z
        du, dv, dw = paths[3, n] - u, paths[4, n] - v, paths[5, n] - w
        opening = dx * du + dy * dv + dz * dw
        speed = du * du + dv * dv + dw * dw
        time = min(max(-opening / max(speed, tiny), zero), longest)
        dx, dy, dz = dx + time * du, dy + time * dv, dz + time * dw
        limit = reach + paths[6, n]
        gap[slab, m] = dx * dx + dy * dy + dz * dz - limit * limit
        who[slab, m] = j + k


@inline_kernel
def _keep_close(
    gap: NDArray[np.float32],
    who: Int32Array,
    slab: int,
    count: int,
    held: BoolArray,
    i: int,
    found: Int32Array,
    at: int,
    end: int,
) -> int:
    """Write the close ones of `count` candidates to ``found[at:end]``, or count them only."""
    is_held = len(held) > 0 and held[i]
    if is_held or at + count > end:
        for k in range(count):
            if gap[slab, k] < 0.0 and not (is_held and held[who[slab, k]]):
                if at < end:
                    found[at] = who[slab, k]
                at += 1
        return at
    for k in range(count):
        found[at] = who[slab, k]
        at += gap[slab, k] < 0.0
    return at


@lean_kernel
def _search_slab(
    paths: Paths,
    held: BoolArray,
    cell_start: Int32Array,
    grid: Grid,
    horizon: NDArray[np.float32],
    slab: int,
    number: Int32Array,
    found: Int32Array,
    at: int,
    end: int,
    gap: NDArray[np.float32],
    who: Int32Array,
) -> int:
    """Partners of the balls of a slab that come after them, into ``found[at:end]``.

    Returns where they end; beyond `end` they are counted only. The forward half of the
    neighbourhood is the rest of the own column, the columns beside it, and those of the next slab.
    """
    for cb in range(grid.n2):
        for cc in range(grid.n3):
            low, high = max(cc - FINE, 0), min(cc + FINE, grid.n3 - 1)
            here = (slab * grid.n2 + cb) * grid.n3 + cc
            for i in range(cell_start[here], cell_start[here + 1]):
                before, count = at, 0
                for a in range(slab, min(slab + 2, grid.n1)):
                    left = cb if a == slab else max(cb - WIDE, 0)
                    for b in range(left, min(cb + WIDE + 1, grid.n2)):
                        column = (a * grid.n2 + b) * grid.n3
                        begin = i + 1 if a == slab and b == cb else cell_start[column + low]
                        stop = cell_start[column + high + 1]
                        for j in range(begin, stop, LANES):
                            if count + LANES > CANDIDATES:
                                at = _keep_close(gap, who, slab, count, held, i, found, at, end)
                                count = 0
                            _test_row(paths, i, j, horizon, gap, who, slab, count)
                            count += min(LANES, stop - j)
                at = _keep_close(gap, who, slab, count, held, i, found, at, end)
                number[i] = at - before
    return at


@parallel_kernel
def _search_pairs(
    paths: Paths,
    held: BoolArray,
    cell_start: Int32Array,
    grid: Grid,
    horizon: NDArray[np.float32],
    room: IntArray,
    number: Int32Array,
    found: Int32Array,
) -> IntArray:
    """Search all slabs; the pairs of slab s go into ``found[room[s]:room[s + 1]]``.

    Returns the number of pairs of each slab, whether they had room or not.
    """
    slabs = len(room) - 1
    total = np.empty(slabs, np.int64)
    gap = np.empty((slabs, CANDIDATES), np.float32)
    who = np.empty((slabs, CANDIDATES), np.int32)
    for s in prange(slabs):
        end = _search_slab(
            paths, held, cell_start, grid, horizon, s, number, found, room[s], room[s + 1],
            gap, who,
        )  # fmt: skip
        total[s] = end - room[s]
    return total


@parallel_kernel
def _close_ranks(found: Int32Array, room: IntArray, base: IntArray, partner: Int32Array) -> None:
    """Copy the pairs of each slab from where they had room to where they belong."""
    for s in prange(len(base) - 1):
        for k in range(base[s + 1] - base[s]):
            partner[base[s] + k] = found[room[s] + k]


def list_pairs(
    paths: Paths,
    held: BoolArray,
    cell_start: Int32Array,
    slab: IntArray,
    grid: Grid,
    horizon: float,
    guess: float = 6.0,
) -> tuple[Int32Array, Int32Array]:
    """List the pairs that may meet: start (n + 1,) and partner (p,), as in `Contacts`.

    Parameters
    ----------
    paths : array (7, n + LANES)
        From `castblast.muckpile.search.paths.lay_out`.
    held : array (n,) or (0,), bool
        Two balls that are held are no pair; empty: none is held.
    cell_start, slab : arrays
        From `sort_by_cell`, whose order the balls are in.
    grid : Grid
        Of slabs at least as wide as the reach of a pair.
    horizon : float [s]
    guess : float
        Pairs per ball for which room is made at first.
    """
    number = np.empty(int(slab[-1]), dtype=np.int32)
    # Numbers of the vector loop, in its type.
    times = np.array([horizon, 1e-30, 0.0], dtype=np.float32)
    need = np.ceil(guess * np.diff(slab)).astype(np.int64) + CANDIDATES
    while True:
        room = np.concatenate([[0], np.cumsum(need)])
        found = np.empty(int(room[-1]), dtype=np.int32)
        total = _search_pairs(paths, held, cell_start, grid, times, room, number, found)
        if np.all(total <= need):
            break
        need = total + CANDIDATES
    base = np.concatenate([[0], np.cumsum(total)])
    partner = np.empty(int(base[-1]), dtype=np.int32)
    _close_ranks(found, room, base, partner)
    return starts(number), partner
