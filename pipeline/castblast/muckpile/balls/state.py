"""What the engine works on: balls in the order of their cells, and their candidate contacts.

In mixed precision, motion, forces and contact memory are held in single precision, and the law of
a contact between balls is computed in it: a contact then takes half a cache line, twice as many go
into a vector, and a ball takes 124 bytes instead of 188. Positions stay in double precision (a
float32 at 100 m resolves 8e-6 m, a good part of the overlap of a ball at rest); distances and
overlaps are differences of them, formed in double and rounded afterwards.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from castblast.muckpile.balls.contact import ROW
from castblast.types import FloatArray, Int32Array, RealArray

#: Working precisions and the type of what they store beside positions.
PRECISIONS: dict[str, DTypeLike] = {"float64": np.float64, "mixed": np.float32}

#: Peak memory measured by this project: bytes of the interpreter with all kernels, and per ball
#: of a dense bench (at most six pairs a ball, ledger kept, case and result counted).
_BASE = 220e6
_PER_BALL = {"float64": 1100.0, "mixed": 750.0}


def estimate_memory(balls: int, precision: str = "float64") -> int:
    """Return the memory [bytes] that a cast of so many balls needs at most, for a first check."""
    return int(_BASE + balls * _PER_BALL[precision])


class Balls(NamedTuple):
    """State of the balls in the order of their cells, one cache line or less per row.

    Attributes
    ----------
    place : array (n, 4), float64 [m]
        Centre and radius.
    motion : array (n, 8), real
        Velocity [m s-1], spin [rad s-1], mass [kg], and whether the ball is held in place: 1.0.
    force : array (n, 8), real
        Force [N], moment [N m], two unused words. Meaningless where the ball is held.
    paths : array (7, n + 16), float32
        Straight paths from the time when the lists were made, see
        `castblast.muckpile.search.paths`.
    identity : array (n,), int32
        Index of the ball in the caller's arrays.
    """

    place: FloatArray
    motion: RealArray
    force: RealArray
    paths: NDArray[np.float32]
    identity: Int32Array


class Contacts(NamedTuple):
    """Candidate contacts, those of ball i in ``start[i]:start[i + 1]``, with their memory.

    Attributes
    ----------
    start : array (n + 1,), int32
    partner : array (p,), int32
        Index of the second ball (always larger), or of the wall.
    memory : array (p, 8), real
        See `castblast.muckpile.balls.contact`; meaningless until the contact closes.
    touching : array (p,), uint8
    dash : array (p, 3) or (0, 3), real [N]
        Dashpot force of the last step; empty when no ledger is kept.
    """

    start: Int32Array
    partner: Int32Array
    memory: RealArray
    touching: NDArray[np.uint8]
    dash: RealArray


def make_contacts(
    start: Int32Array, partner: Int32Array, real: DTypeLike, ledger: bool
) -> Contacts:
    """Make room for contacts that do not touch yet."""
    count = len(partner)
    return Contacts(
        start=start,
        partner=partner,
        memory=np.empty((count, ROW), dtype=real),
        touching=np.zeros(count, dtype=np.uint8),
        dash=np.empty((count if ledger else 0, 3), dtype=real),
    )


def starts(number: Int32Array) -> Int32Array:
    """Return the running total (n + 1,) of counts (n,)."""
    start = np.zeros(len(number) + 1, dtype=np.int32)
    np.cumsum(number, out=start[1:])
    return start
