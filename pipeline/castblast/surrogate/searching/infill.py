"""Which designs to simulate next: where members of an ensemble disagree, and not all in one place.

A batch of the rows with the largest spread would sit in one corner, where the first of them
already tells most of what the others would. So the rows are taken one after the other, each time
the one with the largest worth, and the worth of what lies close to a row just taken falls.
"""

from __future__ import annotations

import numpy as np

from castblast.types import FloatArray, IntArray

#: Rows drawn for every row to be chosen.
POOL_FACTOR = 20
_NEIGHBOUR_SAMPLE = 500


def infill_worth(spread: FloatArray) -> FloatArray:
    """One figure for every row: root mean square over the targets of their relative spreads.

    Parameters
    ----------
    spread : (n, m)
        Relative standard deviation over the members, see `network.member_spread`. Each target is
        measured in its own median, so that the least certain target does not decide alone.

    Returns
    -------
    (n,)
    """
    return np.asarray(np.sqrt(np.mean((spread / np.median(spread, axis=0)) ** 2, axis=1)))


def choose_batch(points: FloatArray, kinds: IntArray, worth: FloatArray, count: int) -> IntArray:
    """Choose rows of a pool, worth most and apart from each other.

    Parameters
    ----------
    points : (n, k)
        Scaled inputs of the pool.
    kinds : (n,)
        Explosive of each row; rows of two explosives do not stand for each other.
    worth : (n,)
        Positive.
    count : int
        At most n.

    Returns
    -------
    (count,)
        Positions in the order in which they were taken: any first part of it is a batch too.
    """
    length = _typical_gap(points, count)
    left = worth.astype(np.float64)
    chosen = np.empty(count, dtype=np.int64)
    for place in range(count):
        best = int(np.argmax(left))
        chosen[place] = best
        near = np.flatnonzero(kinds == kinds[best])
        squared = np.sum((points[near] - points[best]) ** 2, axis=1)
        # As the variance of a Gaussian process with one observation: 0 there, whole far away.
        left[near] *= -np.expm1(-squared / length**2)
        left[chosen[: place + 1]] = -1.0
    return chosen


def _typical_gap(points: FloatArray, count: int) -> float:
    """Distance from a row to its nearest neighbour among `count` rows of the pool, median."""
    from scipy.spatial import cKDTree

    rng = np.random.default_rng(0)
    some = points[rng.permutation(len(points))[: min(count + 1, len(points))]]
    asked = some[:_NEIGHBOUR_SAMPLE]
    gaps = cKDTree(some).query(asked, k=min(2, len(some)))[0]
    gap = float(np.median(np.atleast_2d(gaps)[:, -1]))
    return gap if gap > 0.0 else 1.0
