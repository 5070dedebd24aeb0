"""What a muckpile looks like: its surface, cross-sections and slope.

The surface is what a vertical line meets first: the highest point of any ball above a place in
plan. Volumes and profiles follow from it. Balls have one density, so shares of mass are shares of
ball volume.
"""

from __future__ import annotations

from math import nan
from typing import NamedTuple

import numpy as np

from castblast.kernel import kernel
from castblast.muckpile.bench.geometry import Bench
from castblast.types import FloatArray


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


def section_band(field: HeightField, low: float, high: float) -> Profile:
    """Return the mean cross-section over low <= y < high [m]; that nearest to the middle if none.

    Averaging over a few balls takes the roughness of single ones out of a section.
    """
    chosen = (field.y >= low) & (field.y < high)
    if not chosen.any():
        return section(field, 0.5 * (low + high))
    return Profile(field.x, field.height[chosen].mean(axis=0))


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


def face_line(bench: Bench, y: FloatArray) -> FloatArray:
    """Return x (n,) [m] of the foremost edge of the bench on the floor at the places y (n,) [m].

    0 for a rectangular bench. Beyond the ends of a bench of another shape: that at its end.
    """
    if not bench.corners:
        return np.zeros(np.shape(y))
    corner = np.array(bench.corners)
    place = np.clip(y, corner[:, 1].min(), corner[:, 1].max())
    foremost = np.full(np.shape(y), -np.inf)
    for (ax, ay), (bx, by) in zip(corner, np.roll(corner, -1, axis=0), strict=True):
        over = (place >= min(ay, by)) & (place <= max(ay, by))
        x = ax + (place - ay) * ((bx - ax) / (by - ay)) if ay != by else max(ax, bx)
        foremost = np.where(over, np.maximum(foremost, x), foremost)
    return foremost
