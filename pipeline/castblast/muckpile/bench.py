"""The bench: its geometry, the blocks it is cut into, and when and how fast each block is fired.

Frame: x points in the direction of throw with the toe of the free face at x = 0, y runs along the
bench, z up from the floor. An inclined face leans back from its toe to the crest. Blocks are cut
in plan, burden by spacing, one per hole; block = row * columns + column with row 0 at the face
and column 0 at y = 0.
"""

from __future__ import annotations

from math import ceil, cos, pi, sin, tan
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from castblast.muckpile.particles import FloatArray, IntArray


class Bench(NamedTuple):
    """A bench in front of which nothing stands; lengths in m, the angle in radians.

    Attributes
    ----------
    length : float
        Along the face, 0 <= y <= length.
    width : float
        From the rear to the toe, -width <= x <= 0.
    height : float
    face_angle : float
        Of the free face over the horizontal; pi/2 is vertical.
    burden, spacing : float
        Size of a block along x and y.
    """

    length: float = 84.0
    width: float = 24.0
    height: float = 12.5
    face_angle: float = pi / 2.0
    burden: float = 3.0
    spacing: float = 3.0


def crest_position(bench: Bench) -> float:
    """Return x [m] of the crest of the free face, 0 for a vertical one, negative otherwise."""
    if bench.face_angle >= pi / 2.0:
        return 0.0
    return -bench.height / tan(bench.face_angle)


def bench_volume(bench: Bench) -> float:
    """Bulk volume [m3] between floor, top, ends, rear and face."""
    section = bench.height * (bench.width + 0.5 * crest_position(bench))
    return bench.length * section


def check_bench(bench: Bench) -> list[str]:
    """Return every fault of `bench` in words; an empty list means that it can be used."""
    faults = [
        f"{name} = {value:g} m: must be positive"
        for name, value in bench._asdict().items()
        if name != "face_angle" and not value > 0.0
    ]
    if not 0.0 < bench.face_angle <= pi / 2.0:
        faults.append(f"face_angle = {bench.face_angle:g} rad: must be above 0 and at most pi/2")
    elif not faults and -crest_position(bench) >= bench.width:
        faults.append(
            f"face_angle = {bench.face_angle:g} rad: the face would reach the rear of a bench "
            f"{bench.width:g} m wide and {bench.height:g} m high"
        )
    return faults


def block_shape(bench: Bench) -> tuple[int, int]:
    """Return the number of rows (from the face to the rear) and of columns (along the face)."""
    rows = max(1, ceil(bench.width / bench.burden - 1e-9))
    columns = max(1, ceil(bench.length / bench.spacing - 1e-9))
    return rows, columns


def assign_blocks(position: FloatArray, bench: Bench) -> IntArray:
    """Return the block (n,) of each centre (n, 3) by its place in plan; outer balls to the rim."""
    rows, columns = block_shape(bench)
    row = np.clip(np.floor(-position[:, 0] / bench.burden), 0, rows - 1)
    column = np.clip(np.floor(position[:, 1] / bench.spacing), 0, columns - 1)
    return np.asarray(row * columns + column, dtype=np.int64)


def echelon_delays(
    rows: int, columns: int, interval: float = 0.030, start: float = 0.0
) -> FloatArray:
    """Firing times (rows * columns,) [s] of an echelon: start + (row + column) interval."""
    row, column = np.divmod(np.arange(rows * columns), columns)
    return np.asarray(start + (row + column) * interval, dtype=np.float64)


def row_delays(rows: int, columns: int, interval: float, start: float = 0.0) -> FloatArray:
    """Firing times (rows * columns,) [s] row by row: start + row interval."""
    row = np.arange(rows * columns) // columns
    return np.asarray(start + row * interval, dtype=np.float64)


def v_delays(rows: int, columns: int, interval: float, start: float = 0.0) -> FloatArray:
    """Firing times (rows * columns,) [s] of a V that opens in the middle of the front row."""
    row, column = np.divmod(np.arange(rows * columns), columns)
    away = np.floor(np.abs(column - 0.5 * (columns - 1)))
    return np.asarray(start + (row + away) * interval, dtype=np.float64)


def block_velocities(
    speed: ArrayLike, count: int, *, azimuth: float = 0.0, elevation: float = 0.0
) -> FloatArray:
    """Velocity (count, 3) [m s-1] of each block.

    Parameters
    ----------
    speed : float or array_like (count,) [m s-1]
    count : int
        Number of blocks.
    azimuth : float [rad]
        Of the throw in plan: 0 along x, positive towards y.
    elevation : float [rad]
        Of the throw over the horizontal.
    """
    direction = np.array(
        [cos(elevation) * cos(azimuth), cos(elevation) * sin(azimuth), sin(elevation)]
    )
    each = np.broadcast_to(np.asarray(speed, dtype=np.float64), (count,))
    return np.ascontiguousarray(each[:, None] * direction)
