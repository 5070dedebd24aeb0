"""The bench: its geometry, the blocks it is cut into, and how fast each block is fired.

Frame: x points in the direction of throw with the toe of the free face at x = 0, y runs along the
bench, z up from the floor. An inclined face leans back from its toe to the crest. A bench is a
rectangle in plan, or any polygon in the same frame: its foremost point lies at x = 0, its least y
is 0. Blocks are cut in plan, burden by spacing, one per hole; block = row * columns + column with
row 0 at the face and column 0 at y = 0.
"""

from __future__ import annotations

from math import ceil, pi, tan
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from castblast.muckpile.bench.outline import (
    FREE,
    OPEN,
    ROCK,
    Outline,
    check_polygon,
    default_edges,
    make_outline,
    outline_volume,
)
from castblast.muckpile.bench.timing import echelon_delays, row_delays, v_delays
from castblast.types import FloatArray, IntArray

__all__ = [
    "Bench",
    "assign_blocks",
    "bench_outline",
    "bench_volume",
    "block_centres",
    "block_shape",
    "block_velocities",
    "check_bench",
    "crest_position",
    "echelon_delays",
    "polygon_bench",
    "row_delays",
    "v_delays",
]


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
    corners : tuple of (x, y) [m]
        Of a bench that is no rectangle, on the floor, counter-clockwise; length and width are then
        those of the rectangle around it. Empty: the rectangle itself.
    edges : tuple of {"free", "rock", "open"}
        What lies beyond each edge of that polygon, from corner k to the next: a free face; rock;
        ground that was blasted before.
    """

    length: float = 84.0
    width: float = 24.0
    height: float = 12.5
    face_angle: float = pi / 2.0
    burden: float = 3.0
    spacing: float = 3.0
    corners: tuple[tuple[float, float], ...] = ()
    edges: tuple[str, ...] = ()


def polygon_bench(
    corners: ArrayLike,
    height: float,
    face_angle: float = pi / 2.0,
    *,
    edges: tuple[str, ...] = (),
    burden: float = 3.0,
    spacing: float = 3.0,
) -> Bench:
    """Make a bench of any shape in plan; see `Bench` and `check_bench`.

    Without `edges` those towards the throw are free, those behind the bench rock, the others open.
    """
    points = np.asarray(corners, dtype=np.float64)
    width, length = -points[:, 0].min(), points[:, 1].max()
    kinds = edges or default_edges(points)
    places = tuple((float(x), float(y)) for x, y in points)
    return Bench(
        length=float(length),
        width=float(width),
        height=height,
        face_angle=face_angle,
        burden=burden,
        spacing=spacing,
        corners=places,
        edges=tuple(kinds),
    )


def bench_outline(bench: Bench) -> Outline:
    """Return the body of the bench: that of its polygon, or of the rectangle."""
    if bench.corners:
        return make_outline(np.array(bench.corners), bench.edges, bench.face_angle)
    length, width = bench.length, bench.width
    corner = np.array([(0.0, 0.0), (0.0, length), (-width, length), (-width, 0.0)])
    return make_outline(corner, (FREE, OPEN, ROCK, OPEN), bench.face_angle)


def crest_position(bench: Bench) -> float:
    """Return x [m] of the crest of the free face, 0 for a vertical one, negative otherwise."""
    if bench.face_angle >= pi / 2.0:
        return 0.0
    return -bench.height / tan(bench.face_angle)


def bench_volume(bench: Bench) -> float:
    """Bulk volume [m3] between floor, top, ends, rear and face."""
    return outline_volume(bench_outline(bench), bench.height)


#: Blocks of a bench; each is a hole.
MOST_BLOCKS = 100_000
_LENGTHS = ("length", "width", "height", "burden", "spacing")


def check_bench(bench: Bench) -> list[str]:
    """Return every fault of `bench` in words; an empty list means that it can be used."""
    # Length and width of a polygon follow from its corners.
    lengths = ("height", "burden", "spacing") if bench.corners else _LENGTHS
    faults = [
        f"{name} = {getattr(bench, name):g} m: must be positive"
        for name in lengths
        if not getattr(bench, name) > 0.0
    ]
    if not 0.0 < bench.face_angle <= pi / 2.0:
        faults.append(f"face_angle = {bench.face_angle:g} rad: must be above 0 and at most pi/2")
    elif bench.corners and not faults:
        faults += _polygon_faults(bench)
    elif not faults and -crest_position(bench) >= bench.width:
        faults.append(
            f"face_angle = {bench.face_angle:g} rad: the face would reach the rear of a bench "
            f"{bench.width:g} m wide and {bench.height:g} m high"
        )
    if not faults:
        blocks = bench.width / bench.burden * bench.length / bench.spacing
        if blocks > MOST_BLOCKS:
            faults.append(
                f"burden {bench.burden:g} m, spacing {bench.spacing:g} m: cut the bench into "
                f"{blocks:.2g} blocks; allowed: {MOST_BLOCKS:,}"
            )
    return faults


def _polygon_faults(bench: Bench) -> list[str]:
    corner = np.array(bench.corners)
    faults = check_polygon(corner, bench.edges, bench.face_angle, bench.height)
    ahead, beside = float(corner[:, 0].max()), float(corner[:, 1].min())
    if not faults and max(abs(ahead), abs(beside)) > 1e-9:
        faults.append(
            f"outline: the foremost corner must lie at x = 0 and the least y be 0: move all "
            f"corners by ({0.0 - ahead:g}, {0.0 - beside:g}) m"
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


def block_centres(bench: Bench) -> FloatArray:
    """Return the middle (blocks, 2) [m] of each block in plan; the last of a row may be cut."""
    rows, columns = block_shape(bench)
    row, column = np.divmod(np.arange(rows * columns), columns)
    far_x = np.minimum((row + 1) * bench.burden, bench.width)
    far_y = np.minimum((column + 1) * bench.spacing, bench.length)
    return np.column_stack(
        [-0.5 * (row * bench.burden + far_x), 0.5 * (column * bench.spacing + far_y)]
    )


def block_velocities(
    speed: ArrayLike, count: int, *, azimuth: ArrayLike = 0.0, elevation: ArrayLike = 0.0
) -> FloatArray:
    """Velocity (count, 3) [m s-1] of each block.

    Parameters
    ----------
    speed : float or array_like (count,) [m s-1]
    count : int
        Number of blocks.
    azimuth : float or array_like (count,) [rad]
        Of the throw in plan: 0 along x, positive towards y.
    elevation : float or array_like (count,) [rad]
        Of the throw over the horizontal.
    """
    each, around, up = (
        np.broadcast_to(np.asarray(value, dtype=np.float64), (count,))
        for value in (speed, azimuth, elevation)
    )
    direction = [np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)]
    return np.ascontiguousarray(each[:, None] * np.column_stack(direction))
