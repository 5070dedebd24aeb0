"""The stable step: the rule of the PFC manual, asked at every renewal of the lists.

The least sqrt(m/k) and sqrt(I/k_r) over balls and directions, with the stiffnesses of the contacts
of a ball summed (diagonal terms). The caller multiplies it by a safety factor and by that of the
damping.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import prange

from castblast.kernel import inline_kernel, lean_kernel, parallel_kernel
from castblast.muckpile.balls.columns import (
    MASS,
    RADIUS,
    STIFFNESS,
    VX,
    VY,
    VZ,
    WX,
    WY,
    WZ,
    X,
    Y,
    Z,
)
from castblast.muckpile.balls.contact import Constants, wall_stiffness
from castblast.muckpile.balls.state import Balls, Contacts
from castblast.muckpile.ground.walls import WallTable, wall_distance
from castblast.types import IntArray, RealArray


@parallel_kernel
def stable_step(
    balls: Balls,
    pairs: Contacts,
    touches: Contacts,
    walls: WallTable,
    slab: IntArray,
    chunk: IntArray,
    law: Constants,
) -> float:
    """Return the least sqrt(m/k) or sqrt(I/k_r) [s] over all balls, undamped.

    Every ball is given at least one contact with a wall, since such a contact may form before the
    next check, and a fifth of its radius as the longest way of one step. Passes over slabs and
    chunks as `castblast.muckpile.engine.dynamics.advance` does.
    """
    chunks = len(chunk) - 1
    stiffness = np.zeros((len(balls.place), 6), np.float32)
    least = np.empty(chunks)
    for c in prange(chunks - 1):
        s = chunk[c + 1] - 1
        _add_pairs(balls, pairs, law, slab[s], slab[s + 1], stiffness)
    for c in prange(chunks):
        last = slab[chunk[c + 1] - 1]
        _add_pairs(balls, pairs, law, slab[chunk[c]], last, stiffness)
        if c == chunks - 1:
            _add_pairs(balls, pairs, law, last, slab[chunk[c + 1]], stiffness)
        least[c] = _least_of_balls(
            balls, touches, walls, law, slab[chunk[c]], slab[chunk[c + 1]], stiffness
        )
    return sqrt(least.min())


@lean_kernel
def _add_pairs(
    balls: Balls, pairs: Contacts, law: Constants, first: int, last: int, stiffness: RealArray
) -> None:
    """Add the contacts that the balls first .. last - 1 own to the stiffness of both partners."""
    place, start, partner = balls.place, pairs.start, pairs.partner
    touching, memory = pairs.touching, pairs.memory
    for i in range(first, last):
        radius = place[i, RADIUS]
        for p in range(start[i], start[i + 1]):
            if touching[p]:
                j = partner[p]
                along = (
                    place[j, X] - place[i, X],
                    place[j, Y] - place[i, Y],
                    place[j, Z] - place[i, Z],
                )
                other = place[j, RADIUS]
                effective = radius * other / (radius + other)
                kn = float(memory[p, STIFFNESS])
                _add_stiffness(stiffness, i, along, kn, law.shear_ratio, radius, effective)
                _add_stiffness(stiffness, j, along, kn, law.shear_ratio, other, effective)


@lean_kernel
def _least_of_balls(
    balls: Balls,
    touches: Contacts,
    walls: WallTable,
    law: Constants,
    first: int,
    last: int,
    stiffness: RealArray,
) -> float:
    """Add walls, return the least m/k and I/k_r [s2] of the balls first .. last - 1."""
    place, motion = balls.place, balls.motion
    start, partner = touches.start, touches.partner
    touching, memory = touches.touching, touches.memory
    least = np.inf
    for i in range(first, last):
        mass, radius = motion[i, MASS], place[i, RADIUS]
        for p in range(start[i], start[i + 1]):
            if touching[p]:
                _, normal = wall_distance(
                    walls, partner[p], place[i, X], place[i, Y], place[i, Z], radius
                )
                kn = float(memory[p, STIFFNESS])
                _add_stiffness(stiffness, i, normal, kn, law.shear_ratio, radius, radius)
        alone = wall_stiffness(radius, law.modulus)
        stiffest = max(stiffness[i, X], stiffness[i, Y], stiffness[i, Z], alone)
        turning = max(
            stiffness[i, WX],
            stiffness[i, WY],
            stiffness[i, WZ],
            2.0 * alone * law.shear_ratio * radius * radius,
        )
        speed = motion[i, VX] ** 2 + motion[i, VY] ** 2 + motion[i, VZ] ** 2
        least = min(
            least,
            mass / stiffest,
            0.4 * mass * radius * radius / turning,
            0.04 * radius * radius / speed,
        )
    return least


@inline_kernel
def _add_stiffness(
    stiffness: RealArray,
    i: int,
    along: tuple[float, float, float],
    kn: float,
    shear_ratio: float,
    radius: float,
    effective: float,
) -> None:
    """Add one contact to the diagonal of the stiffness of ball `i`."""
    square = along[0] * along[0] + along[1] * along[1] + along[2] * along[2]
    ks = kn * shear_ratio
    for axis in range(3):
        share = along[axis] * along[axis] / square
        stiffness[i, axis] += (kn - ks) * share + ks
        stiffness[i, axis + WX] += ks * (radius * radius + effective * effective) * (1.0 - share)
