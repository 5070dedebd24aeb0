"""Movement of parts of a bench: mean displacement of the balls of a block, and how it scatters.

A movement vector is what a transmitter in a hole of the blast would report on average over the
part of the bench around it. The spread says how well one vector stands for the part; within a
block it is mostly the difference between top and toe. Movement is resolved over height by levels.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from castblast.muckpile.balls.particles import Particles
from castblast.types import FloatArray, IntArray


class GroupMovement(NamedTuple):
    """Movement of g groups of balls, weighted by mass; NaN for a group without balls.

    Attributes
    ----------
    start : array (g, 3) [m]
        Centre of mass before.
    displacement : array (g, 3) [m]
        Of the centre of mass.
    spread : array (g, 3) [m]
        Standard deviation of the displacements within the group.
    mass_share : array (g,) [-]
        Of the mass of all balls.
    balls : array (g,), int64
    """

    start: FloatArray
    displacement: FloatArray
    spread: FloatArray
    mass_share: FloatArray
    balls: IntArray

    @property
    def throw(self) -> FloatArray:
        """Horizontal length (g,) [m] of the displacement."""
        return np.asarray(np.hypot(self.displacement[:, 0], self.displacement[:, 1]))

    @property
    def heave(self) -> FloatArray:
        """Rise (g,) [m] of the centre of mass; negative for what came down."""
        return self.displacement[:, 2]


def group_movement(
    before: Particles, after: Particles, group: IntArray, groups: int
) -> GroupMovement:
    """Gather the movement of the balls by group.

    Parameters
    ----------
    before, after : Particles
        The same n balls in the same order.
    group : array (n,), int
        0 to `groups` - 1; a ball with a negative number is in none.
    groups : int
    """
    chosen = group >= 0
    number = group[chosen]
    mass = before.radius[chosen] ** 3
    place = before.position[chosen]
    way = after.position[chosen] - place
    total = np.bincount(number, mass, minlength=groups)
    filled = np.where(total > 0.0, total, np.nan)

    def mean(values: FloatArray) -> FloatArray:
        sums = [np.bincount(number, mass * column, minlength=groups) for column in values.T]
        return np.asarray(np.column_stack(sums) / filled[:, None])

    displacement = mean(way)
    # Differences to the mean first: the square of a long way would hide a small spread.
    spread = np.sqrt(mean((way - displacement[number]) ** 2))
    return GroupMovement(
        start=mean(place),
        displacement=displacement,
        spread=spread,
        mass_share=total / np.sum(before.radius**3),
        balls=np.bincount(number, minlength=groups).astype(np.int64),
    )


def block_levels(before: Particles, height: float, levels: int, blocks: int) -> IntArray:
    """Group (n,) of each ball by level and block: level * blocks + block; -1 without a block.

    Parameters
    ----------
    before : Particles
    height : float [m]
        Of the bench; it is cut into `levels` of equal height, the lowest first. Balls above the
        top count to the highest level.
    levels, blocks : int
    """
    level = np.clip(before.position[:, 2] * (levels / height), 0, levels - 1).astype(np.int64)
    return np.where(before.block >= 0, level * blocks + before.block, -1)
