"""Balls at rest sleep: they stand still, and what touches only them is not computed.

Whether a ball may sleep is asked at a renewal of the lists and nowhere else, so the answer depends
neither on threads nor on when somebody looks. A ball is *still* while it is slower than a small
share of sqrt(g d), both at this moment and on average since the last renewal (a ball that rocks or
swings to and fro is never slow at every look, one that creeps covers a distance). It falls asleep
when it has been still for a good part of sqrt(d/g), many times longer than the peak of a flight,
and none of its listed neighbours is *brisk*, i.e. faster than 5 % of sqrt(g d). It wakes as soon
as one is: lists along straight paths hold a ball that comes near before it touches. So what hits
a sleeper meets a ball that is awake, and whatever carries it gives way by moving, which wakes it.
A neighbour that moves more slowly than that finds a sleeper as firm as a wall. Who has just been
woken moves those behind him first and wakes them at the next renewal: a push goes on by one
neighbour per renewal.

Spins do not keep a ball awake, because the law of contact does not stop a ball that spins about its
contact normal. The kinetic energy that is taken from a ball that falls asleep is returned for the
ledger; springs keep theirs, since places and contact memory stay as they are.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from numba import prange

from castblast.kernel import lean_kernel, parallel_kernel
from castblast.muckpile.balls.state import Balls
from castblast.muckpile.search.neighbours import PIECES
from castblast.types import BoolArray, FloatArray, Int32Array, IntArray, RealArray

#: What a ball may do: the last word of its row of motion.
FREE, HELD, ASLEEP = 0.0, 1.0, 2.0
#: Speed of a still ball over sqrt(g d), at one moment and averaged over the life of a list, and
#: the speed from which on a ball disturbs those around it.
_SLOW, _CREEP, _BRISK = 0.01, 0.0025, 0.05
#: Time for which a ball is still before it sleeps, over sqrt(d/g).
_PATIENCE = 0.5

#: Relative: more than a place in single precision is off.
_ROUNDING = 1.2e-7

# Word of the force row that counts for how long [s] a ball has been still; negative: it is brisk.
_STILL = 6


class Drowsiness(NamedTuple):
    """When balls count as still and when they fall asleep.

    Attributes
    ----------
    slow, creep : float [m s-1]
        Speed below which a ball is still, at one moment and on average.
    brisk : float [m s-1]
        Speed above which it keeps others awake.
    patience : float [s]
    """

    slow: float
    creep: float
    brisk: float
    patience: float


def drowsiness(mean_diameter: float, gravity: float) -> Drowsiness:
    """Choose the limits for balls of this size [m]; without gravity [m s-2] nobody sleeps."""
    speed = sqrt(max(gravity, 0.0) * mean_diameter)
    patience = _PATIENCE * mean_diameter / speed if speed > 0.0 else inf
    return Drowsiness(_SLOW * speed, _CREEP * speed, _BRISK * speed, patience)


@parallel_kernel
def note_still(balls: Balls, age: float, limits: Drowsiness) -> None:
    """Note for how long each ball has been still; the lists are `age` [s] old and end here."""
    count = len(balls.place)
    for piece in prange(PIECES):
        first, last = piece * count // PIECES, (piece + 1) * count // PIECES
        _note_piece(balls, age, limits, first, last)


@lean_kernel
def _note_piece(balls: Balls, age: float, limits: Drowsiness, first: int, last: int) -> None:
    place, motion, force, paths = balls.place, balls.motion, balls.force, balls.paths
    far, farther = limits.creep * age, limits.brisk * age
    # However long a list lives: a ball is looked at a few times before it sleeps.
    counted = min(age, 0.25 * limits.patience)
    for i in range(first, last):
        if motion[i, 7] == HELD:
            force[i, _STILL] = 0.0
        if motion[i, 7] != FREE:
            continue
        speed, way = 0.0, 0.0
        for axis in range(3):
            speed += float(motion[i, axis]) ** 2
            # Without an age there are no paths yet; they are rounded to single precision.
            if age > 0.0:
                moved = abs(place[i, axis] - paths[axis, i]) - _ROUNDING * abs(place[i, axis])
                way += max(moved, 0.0) ** 2
        if speed < limits.slow * limits.slow and way <= far * far:
            force[i, _STILL] = max(force[i, _STILL], 0.0) + counted
        elif speed < limits.brisk * limits.brisk and way <= farther * farther:
            force[i, _STILL] = 0.0
        else:
            force[i, _STILL] = -1.0


def settle_balls(
    balls: Balls, start: Int32Array, partner: Int32Array, slab: IntArray, patience: float
) -> tuple[float, Int32Array]:
    """Put balls to sleep, wake others, and bring the partners of those at rest into order.

    Parameters
    ----------
    balls : Balls
        In the order of a new list, stillness noted; motion is changed in place.
    start, partner : arrays
        The new list of pairs; the partners of a ball at rest are put in order in place.
    slab : array (s + 1,)
        First ball of each slab.
    patience : float [s]

    Returns
    -------
    energy : float [J]
        Taken from the balls that fell asleep.
    stop : array (n,), int32
        The pairs of ball i from here to ``start[i + 1]`` are of two balls that stand still.
    """
    brisk = balls.force[:, _STILL] < 0.0
    disturbed = brisk.copy()
    _mark_neighbours(start, partner, slab, brisk, disturbed)
    energy = _change_over(balls, disturbed, patience)
    return float(energy.sum()), _put_waking_first(balls.motion, start, partner)


@parallel_kernel
def _mark_neighbours(
    start: Int32Array,
    partner: Int32Array,
    slab: IntArray,
    source: BoolArray,
    target: BoolArray,
) -> None:
    """Mark in `target` whoever has a ball of `source` in its list, or is in the list of one."""
    slabs = len(slab) - 1
    # A pair reaches from its slab into the next one at most: every other slab is done at a time.
    for odd in range(2):
        for k in prange((slabs + 1 - odd) // 2):
            s = 2 * k + odd
            _mark_piece(start, partner, slab[s], slab[s + 1], source, target)


@lean_kernel
def _mark_piece(
    start: Int32Array,
    partner: Int32Array,
    first: int,
    last: int,
    source: BoolArray,
    target: BoolArray,
) -> None:
    for i in range(first, last):
        for p in range(start[i], start[i + 1]):
            j = partner[p]
            if source[i]:
                target[j] = True
            if source[j]:
                target[i] = True


@parallel_kernel
def _change_over(balls: Balls, disturbed: BoolArray, patience: float) -> FloatArray:
    """Wake and put to sleep; returns the energy [J] taken, by pieces."""
    taken = np.zeros(PIECES)
    count = len(disturbed)
    for piece in prange(PIECES):
        first, last = piece * count // PIECES, (piece + 1) * count // PIECES
        taken[piece] = _change_piece(
            balls.place, balls.motion, balls.force, disturbed, patience, first, last
        )
    return taken


@lean_kernel
def _change_piece(
    place: FloatArray,
    motion: RealArray,
    force: RealArray,
    disturbed: BoolArray,
    patience: float,
    first: int,
    last: int,
) -> float:
    taken = 0.0
    for i in range(first, last):
        if motion[i, 7] == ASLEEP and disturbed[i]:
            motion[i, 7] = FREE
            force[i, _STILL] = 0.0
            # Its neighbours have pushed it since it fell asleep; now that is asked anew.
            for word in range(6):
                force[i, word] = 0.0
        elif motion[i, 7] == FREE and not disturbed[i] and force[i, _STILL] >= patience:
            motion[i, 7] = ASLEEP
            speed, spin = 0.0, 0.0
            for axis in range(3):
                speed += float(motion[i, axis]) ** 2
                spin += float(motion[i, axis + 3]) ** 2
                motion[i, axis] = 0.0
                motion[i, axis + 3] = 0.0
            taken += 0.5 * float(motion[i, 6]) * (speed + 0.4 * place[i, 3] * place[i, 3] * spin)
    return taken


@parallel_kernel
def _put_waking_first(motion: RealArray, start: Int32Array, partner: Int32Array) -> Int32Array:
    """Bring the partners that are free to the front of each ball that is not; where they end."""
    count = len(start) - 1
    stop = np.empty(count, np.int32)
    for piece in prange(PIECES):
        for i in range(piece * count // PIECES, (piece + 1) * count // PIECES):
            end = start[i + 1]
            if motion[i, 7] != FREE:
                end = start[i]
                for p in range(start[i], start[i + 1]):
                    j = partner[p]
                    if motion[j, 7] == FREE:
                        partner[p] = partner[end]
                        partner[end] = j
                        end += 1
            stop[i] = end
    return stop
