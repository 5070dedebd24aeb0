"""What a muckpile looks like: its surface, how far the rock went, how much it swelled.

The surface is what a vertical line meets first: the highest point of any ball above a place in
plan. Volumes and profiles follow from it. Balls have one density, so shares of mass are shares of
ball volume. Beside the simulated throw stands the ballistic one, in which every ball flies freely
to the floor and stays where it comes down: contacts in flight shorten the throw, sliding and
rolling after it lengthen it.
"""

from __future__ import annotations

from math import nan
from typing import NamedTuple

import numpy as np

from castblast.kernel import kernel
from castblast.muckpile.bench import Bench, bench_volume
from castblast.muckpile.contact import ContactLaw
from castblast.muckpile.particles import FloatArray, Particles, centre_of_mass
from castblast.muckpile.walls import Walls, ground_height


class HeightField(NamedTuple):
    """Surface of a pile over a regular grid in plan.

    Attributes
    ----------
    x : array (nx,) [m]
    y : array (ny,) [m]
        Places at which the surface is sampled.
    height : array (ny, nx) [m]
        Over the floor; 0 where there is no ball.
    """

    x: FloatArray
    y: FloatArray
    height: FloatArray


class Profile(NamedTuple):
    """Height [m] over the direction of throw [m], arrays (nx,)."""

    x: FloatArray
    height: FloatArray


class PileMetrics(NamedTuple):
    """What a cast did to a bench.

    Attributes
    ----------
    throw : array (3,) [m]
        Displacement of the centre of mass.
    block_throw : array (b, 3) [m]
        The same for each block; NaN for a block without balls.
    cast_fraction : float [-]
        Share of the mass past the original face line, x > 0.
    runout_95, runout_99 : float [m]
        Distance from the face line that this share of the mass does not pass (per cent).
    maximum_height : float [m]
        Of the surface over the ground.
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
        Mean way along x if every ball flew freely to the floor with the velocity of its block.
    ballistic_cast_fraction : float [-]
        Share of the mass that would come down past the face line.
    """

    throw: FloatArray
    block_throw: FloatArray
    cast_fraction: float
    runout_95: float
    runout_99: float
    maximum_height: float
    pile_volume: float
    swell: float
    rock_swell: float
    repose_angle: float
    ballistic_throw: float
    ballistic_cast_fraction: float


def surface_height(
    position: FloatArray,
    radius: FloatArray,
    *,
    cell: float,
    x_range: tuple[float, float] | None = None,
    y_range: tuple[float, float] | None = None,
) -> HeightField:
    """Sample the surface at the centres of square cells.

    Parameters
    ----------
    position, radius : array (n, 3), (n,) [m]
    cell : float [m]
        Size of a cell; about the mean radius resolves the surface.
    x_range, y_range : 2 floats, optional [m]
        Default: as far as there are balls. Balls outside are cut off.
    """
    ranges = []
    for axis, given in ((0, x_range), (1, y_range)):
        low = float(np.min(position[:, axis] - radius))
        high = float(np.max(position[:, axis] + radius))
        ranges.append(given or (low, high))
    count = [max(1, round((high - low) / cell)) for low, high in ranges]
    size = [(high - low) / n for (low, high), n in zip(ranges, count, strict=True)]
    x, y = (
        np.asarray(low + step * (np.arange(n) + 0.5), dtype=np.float64)
        for (low, _), step, n in zip(ranges, size, count, strict=True)
    )
    height = np.zeros((len(y), len(x)))
    _raise_surface(
        np.ascontiguousarray(position, dtype=np.float64),
        np.ascontiguousarray(radius, dtype=np.float64),
        float(x[0]),
        float(y[0]),
        float(size[0]),
        float(size[1]),
        height,
    )
    return HeightField(x, y, height)


@kernel
def _raise_surface(
    position: FloatArray,
    radius: FloatArray,
    x0: float,
    y0: float,
    dx: float,
    dy: float,
    height: FloatArray,
) -> None:
    """Lift `height` to the top of every ball above each place."""
    ny, nx = height.shape
    for n in range(len(radius)):
        x, y, r = position[n, 0], position[n, 1], radius[n]
        first_i, last_i = int(np.ceil((x - r - x0) / dx)), int(np.floor((x + r - x0) / dx))
        first_j, last_j = int(np.ceil((y - r - y0) / dy)), int(np.floor((y + r - y0) / dy))
        for j in range(max(first_j, 0), min(last_j, ny - 1) + 1):
            for i in range(max(first_i, 0), min(last_i, nx - 1) + 1):
                off = (x0 + i * dx - x) ** 2 + (y0 + j * dy - y) ** 2
                if off < r * r:
                    height[j, i] = max(height[j, i], position[n, 2] + np.sqrt(r * r - off))


def mean_profile(field: HeightField) -> Profile:
    """Return the height averaged along the bench."""
    return Profile(field.x, field.height.mean(axis=0))


def section(field: HeightField, y: float) -> Profile:
    """Return the cross-section at the sampled place nearest to `y` [m]."""
    return Profile(field.x, field.height[int(np.argmin(np.abs(field.y - y)))].copy())


def repose_angle(profile: Profile) -> float:
    """Slope [rad] of a pile on the side of the throw.

    A line is fitted to the part of `profile` between 80 and 20 per cent of its greatest height
    that lies beyond that height; NaN if fewer than three points are there.
    """
    top = int(np.argmax(profile.height))
    x, height = profile.x[top:], profile.height[top:]
    share = height / max(float(height[0]), 1e-300)
    ends = np.flatnonzero(share < 0.2)
    last = int(ends[0]) if len(ends) else len(share)
    inside = (share[:last] <= 0.8) & (share[:last] >= 0.2)
    if np.count_nonzero(inside) < 3:
        return nan
    slope = np.polyfit(x[:last][inside], height[:last][inside], 1)[0]
    return float(np.arctan(-slope))


def mass_quantile(value: FloatArray, radius: FloatArray, share: float) -> float:
    """Value that a `share` of the mass of balls does not exceed, between balls by steps."""
    order = np.argsort(value, kind="stable")
    mass = np.cumsum(radius[order] ** 3)
    at = int(np.searchsorted(mass, share * mass[-1]))
    return float(value[order[min(at, len(order) - 1)]])


def _ballistic(before: Particles, velocity: FloatArray, gravity: float) -> tuple[float, float]:
    """Mean way along x [m] and share past the face of balls that fly freely to the floor."""
    launch = np.where(before.block[:, None] >= 0, velocity[before.block], 0.0)
    up = launch[:, 2]
    fall = np.maximum(before.position[:, 2] - before.radius, 0.0)
    time = (up + np.sqrt(up**2 + 2.0 * gravity * fall)) / gravity
    way = launch[:, 0] * time
    mass = before.radius**3
    past = before.position[:, 0] + way > 0.0
    return float(np.average(way, weights=mass)), float(np.average(past, weights=mass))


def pile_metrics(
    before: Particles,
    after: Particles,
    bench: Bench,
    *,
    block_velocity: FloatArray,
    walls: Walls | None = None,
    law: ContactLaw | None = None,
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
    law : ContactLaw, optional
        Reserved; the balls have one density, which cancels.
    gravity : float [m s-2]
    """
    del law
    mass = after.radius**3
    blocks = len(block_velocity)
    x = after.position[:, 0]
    field = surface_height(after.position, after.radius, cell=0.5 * float(np.mean(after.radius)))
    if walls is not None:
        ground = ground_height(walls, *np.meshgrid(field.x, field.y))
        field = field._replace(height=np.maximum(field.height - ground, 0.0))
    area = (field.x[1] - field.x[0]) if len(field.x) > 1 else 0.0
    area *= (field.y[1] - field.y[0]) if len(field.y) > 1 else 0.0
    volume = float(np.sum(field.height) * area)
    solid = 4.0 / 3.0 * np.pi * float(np.sum(mass))
    way, past = _ballistic(before, block_velocity, gravity)
    return PileMetrics(
        throw=centre_of_mass(after) - centre_of_mass(before),
        block_throw=_block_throw(before, after, blocks),
        cast_fraction=float(np.average(x > 0.0, weights=mass)),
        runout_95=mass_quantile(x, after.radius, 0.95),
        runout_99=mass_quantile(x, after.radius, 0.99),
        maximum_height=float(np.max(field.height)),
        pile_volume=volume,
        swell=volume / bench_volume(bench),
        rock_swell=volume / solid,
        repose_angle=repose_angle(mean_profile(field)),
        ballistic_throw=way,
        ballistic_cast_fraction=past,
    )


def _block_throw(before: Particles, after: Particles, blocks: int) -> FloatArray:
    """Displacement (b, 3) [m] of the centre of mass of each block."""
    chosen = before.block >= 0
    group = before.block[chosen]
    mass = before.radius[chosen] ** 3
    way = (after.position - before.position)[chosen]
    total = np.bincount(group, mass, minlength=blocks)
    moved = np.column_stack(
        [np.bincount(group, mass * way[:, axis], minlength=blocks) for axis in range(3)]
    )
    filled = np.where(total > 0.0, total, nan)
    return np.asarray(moved / filled[:, None])
