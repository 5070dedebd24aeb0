"""How large the balls of a packing are: distributions of radii, by number or by volume.

Every distribution becomes a table of the share of balls, by number, below given radii, linear in
between. What is known by volume (a sieve curve) is turned into numbers segment by segment, volume
for volume: a share of volume divided by the mean volume of a ball of that segment. Drawing sizes
from a sieve curve as if it counted balls would put nearly all volume into the largest ones.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from castblast.types import FloatArray

_NODES = 257
#: A normal distribution of radii is cut at so many standard deviations.
NORMAL_CUT = 2.0


class Sizes(NamedTuple):
    """A distribution of radii.

    Attributes
    ----------
    radius : array (k,) [m]
        Not decreasing.
    below : array (k,) [-]
        Share of the balls, by number, up to each radius; from 0 to 1, linear in between.
    """

    radius: FloatArray
    below: FloatArray


def uniform_sizes(mean_radius: float, relative_deviation: float) -> Sizes:
    """Radii even, by number, between mean_radius (1 -+ relative_deviation) [m]."""
    ends = mean_radius * np.array([1.0 - relative_deviation, 1.0 + relative_deviation])
    return Sizes(ends, np.array([0.0, 1.0]))


def normal_sizes(mean_radius: float, relative_deviation: float) -> Sizes:
    """Radii normal, by number, with the standard deviation relative_deviation mean_radius [m].

    Cut at two standard deviations on both sides, which leaves 88 % of that deviation.
    """
    deviate = np.linspace(-NORMAL_CUT, NORMAL_CUT, _NODES)
    share = ndtr(deviate)
    below = (share - share[0]) / (share[-1] - share[0])
    return Sizes(mean_radius * (1.0 + relative_deviation * deviate), below)


def sizes_by_volume(diameter: FloatArray, passing: FloatArray) -> Sizes:
    """Radii whose shares by volume follow a sieve curve.

    Parameters
    ----------
    diameter : array (k,) [m]
        Increasing mesh sizes, of the finest and the coarsest ball at the ends.
    passing : array (k,) [-]
        Share of the volume below each; what lies outside of the ends is left out, the rest scaled
        to 1.
    """
    radius = 0.5 * np.asarray(diameter, dtype=np.float64)
    number = np.diff(passing) / _mean_power(radius, 3)
    below = np.concatenate([[0.0], np.cumsum(number)])
    return Sizes(radius, below / below[-1])


def _mean_power(radius: FloatArray, power: int) -> FloatArray:
    """Mean of radius**power in each segment between the nodes, where radii are even."""
    low, high = radius[:-1], radius[1:]
    terms = [low**k * high ** (power - k) for k in range(power + 1)]
    return np.asarray(sum(terms) / (power + 1))


def mean_of_power(sizes: Sizes, power: int) -> float:
    """Mean of radius**power [m**power] by number."""
    return float(np.sum(np.diff(sizes.below) * _mean_power(sizes.radius, power)))


def mean_ball_volume(sizes: Sizes) -> float:
    """Mean volume [m3] of a ball."""
    return 4.0 / 3.0 * np.pi * mean_of_power(sizes, 3)


def sauter_radius(sizes: Sizes) -> float:
    """Radius [m] of equal balls with the same surface for their volume."""
    return mean_of_power(sizes, 3) / mean_of_power(sizes, 2)


def random_close_fraction(sizes: Sizes) -> float:
    """Solid fraction of the random close packing of smooth balls (Desmond & Weeks 2014).

    0.634 + 0.0658 d + 0.0857 S d^2 with standard deviation over mean d and skewness S.
    """
    mean, square, cube = (mean_of_power(sizes, power) for power in (1, 2, 3))
    variance = max(square - mean * mean, 0.0)
    third = cube - 3.0 * mean * square + 2.0 * mean**3
    deviation = variance**0.5 / mean
    # S d^2 is the third central moment over the standard deviation and the squared mean.
    skewed = third / (variance**0.5 * mean * mean) if deviation > 1e-6 else 0.0
    return float(0.634 + 0.0658 * deviation + 0.0857 * skewed)


def draw_radii(sizes: Sizes, count: int, rng: np.random.Generator) -> FloatArray:
    """Draw `count` radii [m], one from each of `count` equal shares, in random order.

    So the sieve curve of the sample is that of the distribution to the volume of one ball.
    """
    share = (rng.permutation(count) + rng.random(count)) / count
    return np.interp(share, sizes.below, sizes.radius)


def scaled(sizes: Sizes, factor: float) -> Sizes:
    """All radii times `factor`."""
    return Sizes(sizes.radius * factor, sizes.below)
