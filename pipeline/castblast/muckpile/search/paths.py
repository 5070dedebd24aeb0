"""Straight paths of the balls, from which lists are made and whose loss ends the life of a list.

Search and test use the same single-precision numbers, so that their rounding costs no contact.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numba import prange
from numpy.typing import NDArray

from castblast.kernel import parallel_kernel
from castblast.muckpile.search.neighbours import PIECES
from castblast.types import FloatArray, Int32Array, RealArray

#: Paths axis by axis: centre (3) [m], velocity (3) [m s-1], radius with half of the skin [m].
Paths: TypeAlias = NDArray[np.float32]

#: Balls that a search looks at together; so many empty ones follow the last.
LANES = 16
#: Relative: more than the single precision of a search can lose.
_MARGIN = 1e-6


@parallel_kernel
def straight_paths(
    place: FloatArray, motion: RealArray, life: float
) -> tuple[NDArray[np.float32], FloatArray, FloatArray]:
    """Centre and velocity (n, 6), and the box of the middles of the paths; resting if `life` is 0.

    Parameters
    ----------
    place, motion : arrays
        As in `castblast.muckpile.balls.state.Balls`.
    life : float [s]
        Of the lists that are to be made.
    """
    count = len(place)
    rows = np.empty((count, 6), np.float32)
    lower, upper = np.full((PIECES, 3), np.inf), np.full((PIECES, 3), -np.inf)
    moving = 1.0 if life > 0.0 else 0.0
    for piece in prange(PIECES):
        for i in range(piece * count // PIECES, (piece + 1) * count // PIECES):
            for axis in range(3):
                rows[i, axis] = place[i, axis]
                rows[i, axis + 3] = moving * motion[i, axis]
                middle = place[i, axis] + 0.5 * life * motion[i, axis]
                lower[piece, axis] = min(lower[piece, axis], middle)
                upper[piece, axis] = max(upper[piece, axis], middle)
    low, high = lower[0].copy(), upper[0].copy()
    for piece in range(1, PIECES):
        for axis in range(3):
            low[axis] = min(low[axis], lower[piece, axis])
            high[axis] = max(high[axis], upper[piece, axis])
    return rows, low, high


@parallel_kernel
def lay_out(rows: RealArray, radius: FloatArray, order: Int32Array, skin: float) -> Paths:
    """Paths (7, n + LANES) of the balls ``order``, for a search with this `skin` [m].

    Parameters
    ----------
    rows : array (n, 6), real
        Centre and velocity, as of `straight_paths`.
    radius : array (n,) [m]
    order : array (n,), int32
    skin : float [m]
    """
    count = len(rows)
    paths = np.empty((7, count + LANES), np.float32)
    for piece in prange(PIECES):
        for i in range(piece * count // PIECES, (piece + 1) * count // PIECES):
            n = order[i]
            for axis in range(6):
                paths[axis, i] = rows[n, axis]
            paths[6, i] = (1.0 + _MARGIN) * (radius[n] + 0.5 * skin)
    paths[:, count:] = 0.0
    return paths
