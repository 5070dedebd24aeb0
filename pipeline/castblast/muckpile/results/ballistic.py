"""The ballistic estimate: every ball flies freely and stays where it first meets the ground.

It is the sanity row beside a simulated cast. Contacts in flight hold the rear blocks back, sliding
and rolling after landing carry the front on; so for a front row the estimate is near the truth,
and for a whole bench it bounds the cast from above unless the pile runs out far. Beside the
estimate from the balls stand closed forms for a block and for a bench thrown level, against which
it is tested. Derived by this project from free fall.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.ground.walls import Walls, ground_height
from castblast.muckpile.results.movement import group_movement
from castblast.types import FloatArray

_BISECTIONS = 40


class BallisticCast(NamedTuple):
    """Where free flight would carry the mass.

    Attributes
    ----------
    throw : array (3,) [m]
        Displacement of the centre of mass.
    block_throw : array (b, 3) [m]
        The same for each block; NaN for a block without balls.
    landing : array (n, 3) [m]
        Centre of each ball where it comes down.
    flight_time : array (n,) [s]
    """

    throw: FloatArray
    block_throw: FloatArray
    landing: FloatArray
    flight_time: FloatArray


def level_reach(speed: float, height: float, gravity: float = 9.81) -> float:
    """Way [m] of a point thrown level with `speed` [m s-1] from `height` [m] over the floor."""
    return speed * sqrt(2.0 * height / gravity)


def block_throw(speed: float, height: float, gravity: float = 9.81) -> float:
    """Mean way [m] of a block thrown level from the floor up to `height` [m]: 2/3 of its reach."""
    return 2.0 / 3.0 * level_reach(speed, height, gravity)


def ballistic_cast(
    before: Particles,
    block_velocity: FloatArray,
    *,
    walls: Walls | None = None,
    gravity: float = 9.81,
) -> BallisticCast:
    """Let every ball fly from its place with the velocity of its block, without contacts.

    Parameters
    ----------
    before : Particles
        Balls without a block fall straight down.
    block_velocity : array (b, 3) [m s-1]
    walls : Walls, optional
        Ground to land on; None: the level z = 0. The landing is found by halving the time of
        flight, which is exact for ground that rises along the path no less and less steeply.
    gravity : float [m s-2]
    """
    end, time = _landing(before, block_velocity, walls, gravity)
    landed = before._replace(position=end)
    every = group_movement(before, landed, np.zeros(len(end), dtype=np.int64), 1)
    blocks = group_movement(before, landed, before.block, len(block_velocity))
    return BallisticCast(
        throw=every.displacement[0],
        block_throw=blocks.displacement,
        landing=end,
        flight_time=time,
    )


def _landing(
    before: Particles, velocity: FloatArray, walls: Walls | None, gravity: float
) -> tuple[FloatArray, FloatArray]:
    """Place (n, 3) [m] and time (n,) [s] at which each ball is one radius above the ground."""
    start, radius = before.position, before.radius
    launch = np.where(before.block[:, None] >= 0, velocity[before.block], 0.0)
    up = launch[:, 2]
    fall = np.maximum(start[:, 2] - radius, 0.0)
    late = (up + np.sqrt(up**2 + 2.0 * gravity * fall)) / gravity

    def place(time: FloatArray) -> FloatArray:
        flown = start + launch * time[:, None]
        flown[:, 2] -= 0.5 * gravity * time**2
        return flown

    if walls is None:
        return place(late), late
    early = np.zeros_like(late)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (early + late)
        at = place(middle)
        above = at[:, 2] - radius > ground_height(walls, at[:, 0], at[:, 1])
        early = np.where(above, middle, early)
        late = np.where(above, late, middle)
    return place(late), late
