"""What a march of the annulus means: end state, zones of damage, histories."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from castblast.kernel import kernel
from castblast.nearfield.lagrangian import (
    CRUSHED_UNDER_HOOP_COMPRESSION,
    SHEAR_YIELD,
    TENSILE_YIELD,
    Body,
    FloatArray,
    IntArray,
)

#: Plastic shear multiplier that bounds the crushed zone.
CRUSHED_STRAIN = 0.01
#: Accumulated plastic strain that bounds the zone of intense shear.
INTENSE_STRAIN = 0.2


class Window(NamedTuple):
    """Hole radius over a span of time.

    Attributes
    ----------
    mean, lowest, highest : float [m]
    """

    mean: float
    lowest: float
    highest: float


@kernel
def mean_over(record: FloatArray, start: float, end: float) -> Window:
    """Time mean and extremes of the recorded radius between two times [s]."""
    area = 0.0
    lowest, highest = np.inf, -np.inf
    for k in range(record.shape[0] - 1):
        t0, t1 = max(record[k, 0], start), min(record[k + 1, 0], end)
        if t1 <= t0:
            continue
        slope = (record[k + 1, 1] - record[k, 1]) / (record[k + 1, 0] - record[k, 0])
        r0 = record[k, 1] + slope * (t0 - record[k, 0])
        r1 = record[k, 1] + slope * (t1 - record[k, 0])
        area += 0.5 * (r0 + r1) * (t1 - t0)
        lowest = min(lowest, r0, r1)
        highest = max(highest, r0, r1)
    return Window(area / (end - start), lowest, highest)


@kernel
def last_time_outside(record: FloatArray, value: float, band: float) -> float:
    """Last time [s] at which the recorded radius differs from `value` by more than `band`."""
    for k in range(record.shape[0] - 1, -1, -1):
        gap = abs(record[k, 1] - value)
        if gap > band:
            if k == record.shape[0] - 1:
                return float(record[k, 0])
            next_gap = abs(record[k + 1, 1] - value)
            share = (gap - band) / max(gap - next_gap, 1e-300)
            return float(record[k, 0] + min(share, 1.0) * (record[k + 1, 0] - record[k, 0]))
    return 0.0


@kernel
def threshold_radius(nodes: FloatArray, strain: FloatArray, threshold: float) -> float:
    """Outermost initial radius [m] at which a zone strain reaches a threshold.

    Linear between zone centres, so that it moves smoothly and not by whole zones; the radius of
    the wall if the threshold is reached nowhere.

    Parameters
    ----------
    nodes : array (n + 1,) [m]
        Initial node radii.
    strain : array (n,) [-]
        Values at zone centres.
    """
    for j in range(strain.size - 1, -1, -1):
        if strain[j] < threshold:
            continue
        centre = 0.5 * (nodes[j] + nodes[j + 1])
        if j == strain.size - 1:
            return float(nodes[j + 1])
        following = 0.5 * (nodes[j + 1] + nodes[j + 2])
        share = (strain[j] - threshold) / (strain[j] - strain[j + 1])
        return float(centre + share * (following - centre))
    return float(nodes[0])


@kernel
def outermost(nodes: FloatArray, history: IntArray, bit: int) -> float:
    """Outer initial radius [m] of the last zone with a bit set; the wall if none has it."""
    for j in range(history.size - 1, -1, -1):
        if history[j] & bit:
            return float(nodes[j + 1])
    return float(nodes[0])


@kernel
def damage_radii(body: Body) -> tuple[float, float, float, float, float]:
    """Initial radii [m]: crushed, plastic, crushed under hoop compression, tensile, intense."""
    nodes = body.initial_radius
    return (
        threshold_radius(nodes, body.shear_multiplier, CRUSHED_STRAIN),
        outermost(nodes, body.history, SHEAR_YIELD),
        outermost(nodes, body.history, CRUSHED_UNDER_HOOP_COMPRESSION),
        outermost(nodes, body.history, TENSILE_YIELD),
        threshold_radius(nodes, body.shear_strain, INTENSE_STRAIN),
    )


@kernel
def histories(record: FloatArray, points: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time [s], pressure [Pa] and radius [m] on a fixed number of points, dense at the start.

    The times are end * (k / (points - 1))^2, k = 0 ... points - 1; values are interpolated
    between steps.
    """
    end = record[-1, 0]
    time = np.empty(points)
    for k in range(points):
        share = k / (points - 1)
        time[k] = end * share * share
    return (
        time,
        np.interp(time, record[:, 0], record[:, 2]),
        np.interp(time, record[:, 0], record[:, 1]),
    )
