"""When each block is fired, and which way the rock may go by that order.

Blocks are numbered row by row from the face, block = row * columns + column. Delays are nominal
firing times; `scatter_delays` adds what detonators add to them.
"""

from __future__ import annotations

import numpy as np

from castblast.types import FloatArray, IntArray


def echelon_delays(
    rows: int,
    columns: int,
    interval: float = 0.030,
    start: float = 0.0,
    *,
    row_interval: float | None = None,
    from_far_end: bool = False,
) -> FloatArray:
    """Firing times (rows * columns,) [s] of an echelon.

    start + column interval + row row_interval, from the corner at y = 0 or from the far one.
    Without `row_interval` rows and columns have the same interval.
    """
    row, column = np.divmod(np.arange(rows * columns), columns)
    away = columns - 1 - column if from_far_end else column
    between = interval if row_interval is None else row_interval
    return np.asarray(start + away * interval + row * between, dtype=np.float64)


def row_delays(
    rows: int, columns: int, interval: float, start: float = 0.0, *, hole_interval: float = 0.0
) -> FloatArray:
    """Firing times (rows * columns,) [s] row by row: start + row interval.

    Within a row all blocks at once, or one after the other by `hole_interval` [s] from y = 0.
    """
    row, column = np.divmod(np.arange(rows * columns), columns)
    return np.asarray(start + row * interval + column * hole_interval, dtype=np.float64)


def v_delays(
    rows: int,
    columns: int,
    interval: float,
    start: float = 0.0,
    *,
    row_interval: float | None = None,
    apex: float | None = None,
) -> FloatArray:
    """Firing times (rows * columns,) [s] of a V that opens in the front row at `apex`.

    Parameters
    ----------
    rows, columns : int
    interval : float [s]
        Between neighbours along a row, away from the apex.
    start : float [s]
    row_interval : float, optional [s]
        From row to row; default: as `interval`.
    apex : float, optional
        Column that is first, a half for two at once; default: the middle of the row.
    """
    row, column = np.divmod(np.arange(rows * columns), columns)
    middle = 0.5 * (columns - 1) if apex is None else apex
    away = np.floor(np.abs(column - middle))
    between = interval if row_interval is None else row_interval
    return np.asarray(start + row * between + away * interval, dtype=np.float64)


def scatter_delays(
    delay: FloatArray,
    seed: int,
    *,
    relative: float = 0.0,
    absolute: float = 0.0,
    start: float = 0.0,
) -> FloatArray:
    """Firing times (b,) [s] with the scatter of detonators: normal, independent, never before 0.

    Parameters
    ----------
    delay : array (b,) [s]
        Nominal; infinite ones stay.
    seed : int
        Apart from that of the packing: the same seed may be used for both.
    relative : float [-]
        Standard deviation over the delay, as of pyrotechnic detonators.
    absolute : float [s]
        Standard deviation that every detonator has; both add as variances.
    start : float [s]
        Counted out of the delay: the time before the first detonator is begun.
    """
    rng = np.random.default_rng([seed, 0x5CA77E2])
    deviate = rng.standard_normal(len(delay))
    finite = np.isfinite(delay)
    spread = np.hypot(relative * (np.where(finite, delay, start) - start), absolute)
    return np.where(finite, np.maximum(delay + spread * deviate, 0.0), delay)


def firing_front_azimuth(place: FloatArray, delay: FloatArray, reach: float) -> FloatArray:
    """Azimuth (b,) [rad] normal to the lines of equal delay, towards what was fired before.

    What has just gone leaves a free face, and rock moves at right angles to it: against the
    gradient of the delay, found by least squares over the neighbours within `reach` [m].
    Blocks without neighbours, never fired, or amid a simultaneous firing keep the azimuth 0.

    Parameters
    ----------
    place : array (b, 2) [m]
    delay : array (b,) [s]
    reach : float [m]
    """
    from scipy.spatial import cKDTree

    azimuth = np.zeros(len(delay))
    fired = np.flatnonzero(np.isfinite(delay))
    if len(fired) < 2:
        return azimuth
    tree = cKDTree(place[fired])
    for k in fired:
        near = fired[tree.query_ball_point(place[k], reach)]
        offset, later = place[near] - place[k], delay[near] - delay[k]
        gradient = np.linalg.lstsq(offset, later, rcond=1e-6)[0]
        if np.linalg.norm(gradient) > 1e-9:
            azimuth[k] = np.arctan2(-gradient[1], -gradient[0])
    return azimuth


def nearest_holes(position: FloatArray, holes: FloatArray) -> IntArray:
    """Hole (n,) that is nearest in plan to each ball: centres (n, 3), holes (b, 2) [m]."""
    from scipy.spatial import cKDTree

    _, nearest = cKDTree(holes).query(position[:, 0:2])
    return np.asarray(nearest, dtype=np.int64)
