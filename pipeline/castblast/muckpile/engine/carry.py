"""What contacts remember, carried from an old list to a new one.

Only contacts that touch have something to remember. They are put aside before the new list is
made, so that the old and the new list never stand in memory together.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeVar

import numpy as np
from numba import prange
from numpy.typing import NDArray

from castblast.kernel import lean_kernel, parallel_kernel
from castblast.muckpile.balls.columns import DAMPING, STIFFNESS
from castblast.muckpile.balls.contact import ROW
from castblast.muckpile.balls.state import Contacts, starts
from castblast.muckpile.search.neighbours import PIECES
from castblast.types import Int32Array, RealArray

_Real = TypeVar("_Real", bound=np.floating[Any])


class Memory(NamedTuple):
    """Touching contacts of a list that is given up, those of ball i in ``start[i]:start[i + 1]``.

    Attributes
    ----------
    start : array (n + 1,), int32
    partner : array (m,), int32
    rows : array (m, 8), real
    dash : array (m, 3) or (0, 3), real
    """

    start: Int32Array
    partner: Int32Array
    rows: RealArray
    dash: RealArray


def put_aside(contacts: Contacts) -> Memory:
    """Copy what touches out of a list."""
    number = np.empty(len(contacts.start) - 1, dtype=np.int32)
    _count_touching(contacts.start, contacts.touching, number)
    start = starts(number)
    count = int(start[-1])
    memory = Memory(
        start=start,
        partner=np.empty(count, dtype=np.int32),
        rows=np.empty((count, ROW), dtype=contacts.memory.dtype),
        dash=np.empty((count if len(contacts.dash) else 0, 3), dtype=contacts.dash.dtype),
    )
    _copy_touching(contacts, memory)
    return memory


@parallel_kernel
def _count_touching(start: Int32Array, touching: NDArray[np.uint8], number: Int32Array) -> None:
    for i in prange(len(number)):
        count = 0
        for p in range(start[i], start[i + 1]):
            count += touching[p]
        number[i] = count


@parallel_kernel
def _copy_touching(contacts: Contacts, memory: Memory) -> None:
    count = len(memory.start) - 1
    for piece in prange(PIECES):
        _copy_piece(contacts, memory, piece * count // PIECES, (piece + 1) * count // PIECES)


@lean_kernel
def _copy_piece(contacts: Contacts, memory: Memory, first: int, last: int) -> None:
    partner, touching, rows, dash = (
        contacts.partner, contacts.touching, contacts.memory, contacts.dash,
    )  # fmt: skip
    kept_partner, kept_rows, kept_dash = memory.partner, memory.rows, memory.dash
    with_dash = len(kept_dash) > 0
    m = memory.start[first]
    for p in range(contacts.start[first], contacts.start[last]):
        if touching[p]:
            kept_partner[m] = partner[p]
            for word in range(ROW):
                kept_rows[m, word] = rows[p, word]
            if with_dash:
                for word in range(3):
                    kept_dash[m, word] = dash[p, word]
            m += 1


@parallel_kernel
def restore(
    contacts: Contacts, memory: Memory, order: Int32Array, place_of: Int32Array, with_walls: bool
) -> None:
    """Give a new list what the old one remembered.

    Parameters
    ----------
    contacts : Contacts
        The new list, nothing touching yet; changed in place.
    memory : Memory
        In the old order of the balls.
    order : array (n,), int32
        Place in the old order of each ball of the new order.
    place_of : array (n,), int32
        The inverse of it.
    with_walls : bool
        The partners are walls.
    """
    count = len(order)
    for piece in prange(PIECES):
        _restore_piece(
            contacts, memory, order, place_of, with_walls,
            piece * count // PIECES, (piece + 1) * count // PIECES,
        )  # fmt: skip


@lean_kernel
def _restore_piece(
    contacts: Contacts,
    memory: Memory,
    order: Int32Array,
    place_of: Int32Array,
    with_walls: bool,
    first: int,
    last: int,
) -> None:
    """Do the work of `restore` for the balls first .. last - 1 of the new order."""
    start, partner, touching, rows, dash = (
        contacts.start, contacts.partner, contacts.touching, contacts.memory, contacts.dash,
    )  # fmt: skip
    kept_start, kept_partner, kept_rows, kept_dash = (
        memory.start, memory.partner, memory.rows, memory.dash,
    )  # fmt: skip
    with_dash = len(kept_dash) > 0
    for i in range(first, last):
        a = order[i]
        for m in range(kept_start[a], kept_start[a + 1]):
            owner, other, sign = i, kept_partner[m], 1.0
            if not with_walls:
                other = place_of[kept_partner[m]]
                if other < i:
                    # The memory is what the first does to the second: they have changed places.
                    owner, other, sign = other, i, -1.0
            for p in range(start[owner], start[owner + 1]):
                if partner[p] == other:
                    touching[p] = 1
                    for word in range(ROW - 2):
                        rows[p, word] = sign * kept_rows[m, word]
                    rows[p, STIFFNESS] = kept_rows[m, STIFFNESS]
                    rows[p, DAMPING] = kept_rows[m, DAMPING]
                    if with_dash:
                        for word in range(3):
                            dash[p, word] = sign * kept_dash[m, word]
                    break


@parallel_kernel
def take_rows(rows: NDArray[_Real], order: Int32Array) -> NDArray[_Real]:
    """Return ``rows[order]`` of an array (n, k)."""
    taken = np.empty_like(rows)
    words = rows.shape[1]
    for i in prange(len(order)):
        n = order[i]
        for word in range(words):
            taken[i, word] = rows[n, word]
    return taken


def inverse(order: Int32Array) -> Int32Array:
    """Return the inverse of a permutation."""
    place_of = np.empty_like(order)
    place_of[order] = np.arange(len(order), dtype=np.int32)
    return place_of
