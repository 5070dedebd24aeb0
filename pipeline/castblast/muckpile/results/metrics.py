"""What a cast did to a bench, in numbers, and the band of each number over repeated casts.

Lengths in the direction of throw, x, count from the original face line: the toe of the free face
at x = 0, or the foremost edge of a bench of another shape at the same place along it. Rock that
leaves such a bench over another free face is not counted as cast. Balls have one density, so
shares of mass are shares of ball volume.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from castblast.muckpile.balls.particles import Particles, centre_of_mass
from castblast.muckpile.bench.geometry import Bench, bench_volume
from castblast.muckpile.ground.walls import Walls, ground_height
from castblast.muckpile.results.ballistic import ballistic_cast
from castblast.muckpile.results.movement import group_movement
from castblast.muckpile.results.profile import (
    HeightField,
    face_line,
    mass_quantile,
    mean_profile,
    repose_angle,
    surface_height,
)
from castblast.types import FloatArray, IntArray


class PileMetrics(NamedTuple):
    """What a cast did to a bench.

    Attributes
    ----------
    throw : array (3,) [m]
        Displacement of the centre of mass.
    block_throw : array (b, 3) [m]
        The same for each block; its third column is the heave, negative for what came down. NaN
        for a block without balls.
    block_spread : array (b, 3) [m]
        Standard deviation of the displacements of the balls of each block.
    cast_fraction : float [-]
        Share of the mass past the original face line.
    runout_95, runout_99 : float [m]
        Distance from the face line that this share of the mass does not pass (per cent).
    maximum_height : float [m]
        Of the surface over the ground.
    dig_height : float [m]
        What a loader faces on average: height of the surface over the ground, averaged over the
        volume of the pile (integral of h^2 over integral of h). A level pile has its own height.
    pile_volume : float [m3]
        Between surface and ground.
    swell : float [-]
        Pile volume over the volume of the bench; near 1, since the bench of balls is as porous
        as the pile.
    rock_swell : float [-]
        Pile volume over the solid volume of the balls, i.e. over rock without pores: the swell
        factor of practice.
    repose_angle : float [rad]
        Slope of the mean profile on the side of the throw; NaN where the pile has no such side.
    ballistic_throw : float [m]
        Mean way along x if every ball flew freely to the ground with the velocity of its block.
    ballistic_cast_fraction : float [-]
        Share of the mass that would come down past the face line.
    ballistic_runout_99 : float [m]
        Distance that 99 % of the mass would not pass.
    """

    throw: FloatArray
    block_throw: FloatArray
    block_spread: FloatArray
    cast_fraction: float
    runout_95: float
    runout_99: float
    maximum_height: float
    dig_height: float
    pile_volume: float
    swell: float
    rock_swell: float
    repose_angle: float
    ballistic_throw: float
    ballistic_cast_fraction: float
    ballistic_runout_99: float


#: Unit of each metric.
UNITS = {
    "throw": "m",
    "block_throw": "m",
    "block_spread": "m",
    "cast_fraction": "1",
    "runout_95": "m",
    "runout_99": "m",
    "maximum_height": "m",
    "dig_height": "m",
    "pile_volume": "m3",
    "swell": "1",
    "rock_swell": "1",
    "repose_angle": "rad",
    "ballistic_throw": "m",
    "ballistic_cast_fraction": "1",
    "ballistic_runout_99": "m",
}


def pile_metrics(
    before: Particles,
    after: Particles,
    bench: Bench,
    *,
    block_velocity: FloatArray,
    walls: Walls | None = None,
    gravity: float = 9.81,
) -> PileMetrics:
    """Compare the pile with the bench it came from.

    Parameters
    ----------
    before, after : Particles
        The same balls in the same order.
    bench : Bench
    block_velocity : array (b, 3) [m s-1]
        For the ballistic estimate.
    walls : Walls, optional
        Heights and volumes count from the walls that face up; None: from the level z = 0.
    gravity : float [m s-2]
    """
    mass = after.radius**3
    ahead = _ahead(after.position, bench)
    field = _height_over_ground(after, walls)
    volume = float(np.sum(field.height)) * _cell_area(field)
    squares = float(np.sum(field.height**2)) * _cell_area(field)
    blocks = group_movement(before, after, before.block, len(block_velocity))
    free = ballistic_cast(before, block_velocity, walls=walls, gravity=gravity)
    free_ahead = _ahead(free.landing, bench)
    return PileMetrics(
        throw=centre_of_mass(after) - centre_of_mass(before),
        block_throw=blocks.displacement,
        block_spread=blocks.spread,
        cast_fraction=float(np.average(ahead > 0.0, weights=mass)),
        runout_95=mass_quantile(ahead, after.radius, 0.95),
        runout_99=mass_quantile(ahead, after.radius, 0.99),
        maximum_height=float(np.max(field.height)),
        dig_height=squares / volume if volume > 0.0 else 0.0,
        pile_volume=volume,
        swell=volume / bench_volume(bench),
        rock_swell=volume / (4.0 / 3.0 * np.pi * float(np.sum(mass))),
        repose_angle=repose_angle(mean_profile(field)),
        ballistic_throw=float(free.throw[0]),
        ballistic_cast_fraction=float(np.average(free_ahead > 0.0, weights=mass)),
        ballistic_runout_99=mass_quantile(free_ahead, after.radius, 0.99),
    )


def _ahead(position: FloatArray, bench: Bench) -> FloatArray:
    """Distance (n,) [m] of centres (n, 3) from the face line, positive past it."""
    return np.asarray(position[:, 0] - face_line(bench, position[:, 1]))


def _height_over_ground(after: Particles, walls: Walls | None) -> HeightField:
    """Surface over the ground, sampled at half the mean radius."""
    cell = 0.5 * float(np.mean(after.radius))
    field = surface_height(after.position, after.radius, cell=cell)
    if walls is None:
        return field
    ground = ground_height(walls, *np.meshgrid(field.x, field.y))
    return field._replace(height=np.maximum(field.height - ground, 0.0))


def _cell_area(field: HeightField) -> float:
    sides = [axis[1] - axis[0] if len(axis) > 1 else 0.0 for axis in (field.x, field.y)]
    return float(sides[0] * sides[1])


class Band(NamedTuple):
    """A quantity over n repeated runs; arrays have the shape of the quantity.

    Attributes
    ----------
    mean, sd : array
        Mean, and standard deviation of the sample (divisor n - 1); NaN where too few runs know
        the quantity: none for the mean, one for the deviation.
    n : array, int64
        Runs that know it.
    """

    mean: FloatArray
    sd: FloatArray
    n: IntArray


def band(values: Sequence[ArrayLike]) -> Band:
    """Mean and scatter of equally shaped values, one per run; NaN counts as unknown."""
    table = np.stack([np.asarray(value, dtype=np.float64) for value in values])
    known = np.isfinite(table)
    n = known.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(known, table, 0.0).sum(axis=0) / np.where(n > 0, n, np.nan)
        square = np.where(known, (table - mean) ** 2, 0.0).sum(axis=0)
        sd = np.sqrt(square / np.where(n > 1, n - 1, np.nan))
    return Band(np.asarray(mean), np.asarray(sd), np.asarray(n, dtype=np.int64))
