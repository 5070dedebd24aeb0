"""Which walls each ball may meet before its list is renewed."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import prange

from castblast.kernel import inline_kernel, lean_kernel, parallel_kernel
from castblast.muckpile.balls.state import starts
from castblast.muckpile.ground.walls import WallTable, near_walls
from castblast.muckpile.search.neighbours import PIECES
from castblast.muckpile.search.paths import LANES, Paths
from castblast.types import BoolArray, Int32Array


@inline_kernel
def _search_walls(
    paths: Paths,
    walls: WallTable,
    horizon: float,
    i: int,
    found: Int32Array,
    at: int,
) -> int:
    """Count the walls that ball `i` may meet; write them to ``found[at:]`` if at >= 0."""
    half = 0.5 * horizon
    u, v, w = float(paths[3, i]), float(paths[4, i]), float(paths[5, i])
    x, y, z = paths[0, i] + half * u, paths[1, i] + half * v, paths[2, i] + half * w
    reach = paths[6, i] + half * sqrt(u * u + v * v + w * w)
    return near_walls(walls, x, y, z, reach, found, at)


@lean_kernel
def _count_piece(
    paths: Paths,
    held: BoolArray,
    walls: WallTable,
    horizon: float,
    first: int,
    last: int,
    nowhere: Int32Array,
    number: Int32Array,
) -> None:
    for i in range(first, last):
        idle = len(held) > 0 and held[i]
        number[i] = 0 if idle else _search_walls(paths, walls, horizon, i, nowhere, -1)


@parallel_kernel
def _count_walls(
    paths: Paths,
    held: BoolArray,
    walls: WallTable,
    horizon: float,
    number: Int32Array,
) -> None:
    count, nowhere = len(number), np.empty(0, np.int32)
    for piece in prange(PIECES):
        first, last = piece * count // PIECES, (piece + 1) * count // PIECES
        _count_piece(paths, held, walls, horizon, first, last, nowhere, number)


@lean_kernel
def _fill_piece(
    paths: Paths,
    walls: WallTable,
    horizon: float,
    first: int,
    last: int,
    start: Int32Array,
    partner: Int32Array,
) -> None:
    for i in range(first, last):
        if start[i] < start[i + 1]:
            _search_walls(paths, walls, horizon, i, partner, start[i])


@parallel_kernel
def _fill_walls(
    paths: Paths, walls: WallTable, horizon: float, start: Int32Array, partner: Int32Array
) -> None:
    count = len(start) - 1
    for piece in prange(PIECES):
        first, last = piece * count // PIECES, (piece + 1) * count // PIECES
        _fill_piece(paths, walls, horizon, first, last, start, partner)


def list_walls(
    paths: Paths,
    held: BoolArray,
    walls: WallTable,
    horizon: float,
) -> tuple[Int32Array, Int32Array]:
    """List the walls that each ball may meet; arguments and result as in `list_pairs`."""
    number = np.empty(paths.shape[1] - LANES, dtype=np.int32)
    _count_walls(paths, held, walls, horizon, number)
    start = starts(number)
    partner = np.empty(int(start[-1]), dtype=np.int32)
    _fill_walls(paths, walls, horizon, start, partner)
    return start, partner
