"""Points of a survey as heights on a grid: those that form one, and scattered ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from castblast.errors import SpecError
from castblast.specs.quantity import QuantityIn
from castblast.specs.tables.table import Form, Table, read_table
from castblast.specs.tables.text import NUMBER, open_sheet
from castblast.specs.units import unit_factor
from castblast.types import FloatArray, IntArray

#: Largest difference of a place from a regular grid, over its spacing.
_OFF_GRID = 1e-3
#: A grid holds at least this share of heights; points that would leave more empty are scattered.
_FILLED = 0.25
_FEWEST = 3
#: Spacings from the nearest point from which an interpolated height is worth a remark.
_LONGEST_GAP = 4.0
_PLACE = QuantityIn("m", -2e7, 2e7)
_HEADS = {
    "x": ("easting", "east", "e", "x_coord", "xcoord", "x_coordinate"),
    "y": ("northing", "north", "n", "y_coord", "ycoord", "y_coordinate"),
    "z": ("elevation", "elev", "height", "level", "rl", "h", "z_coord", "zcoord", "altitude"),
}

_Grid = tuple[FloatArray, FloatArray, FloatArray, tuple[str, ...], bool]


def read_points(path: Path, unit: str, spacing: float | None, most: int) -> _Grid:
    """Read points onto a grid: x (nx,), y (ny,), height (ny, nx) [m], remarks, whether scattered.

    Points in any order that fill a grid are taken as they are. Others are a cloud: heights between
    them follow linearly from the triangles of a Delaunay net.

    Parameters
    ----------
    path : Path
        Columns x, y, z, or easting, northing, elevation; three columns without heads are these.
    unit : str
        Of a file whose heads give none; empty: m.
    spacing : float, optional [m]
        Of the grid of a cloud.
    most : int
        Largest number of heights that a cloud is brought onto.

    Raises
    ------
    SpecError
        One line per fault, with the line of the file.
    """
    table, remarks = _read_table(path)
    points = np.column_stack([_in_metres(path, table, name, unit) for name in "xyz"])
    if len(points) < _FEWEST:
        raise SpecError(f"{path}: {len(points)} points; at least {_FEWEST} are needed")
    x, column = _places(points[:, 0])
    y, row = _places(points[:, 1])
    if len(x) * len(y) * _FILLED <= len(points):
        return x, y, _on_grid(table, points, (len(y), len(x)), row, column), remarks, False
    x, y, height, said = _gridded(path, points, spacing, most)
    return x, y, height, (*remarks, *said), True


def _read_table(path: Path) -> tuple[Table, tuple[str, ...]]:
    heads = open_sheet(path).heads
    bare = len(heads) >= 3 and all(NUMBER.fullmatch(h.strip().replace(",", ".")) for h in heads)
    form = Form(
        columns={"x": _PLACE, "y": _PLACE, "z": "m"},  # a height may be a mark for none
        required=("x", "y", "z"),
        aliases={head: name for name, heads in _HEADS.items() for head in heads},
        ids=("id", "point", "point_id", "no", "nr", "number"),
        bare=True,
        loose=True,  # colours, classes and intensities of a scan
        chosen={"x": "1", "y": "2", "z": "3"} if bare else {},
    )
    remark = "no heads: the first three columns are taken as x, y, z" if bare else ""
    return read_table(path, form), (remark,) if remark else ()


def _in_metres(path: Path, table: Table, name: str, unit: str) -> FloatArray:
    """A column in m: by its head, else by `unit`."""
    values = table.number[name]
    if not unit:
        return values
    if table.unit.get(name):
        raise SpecError(
            f"{path}: column '{name} [{table.unit[name]}]': its head gives the unit; leave 'unit: "
            f"{unit}' out of the bench file"
        )
    return values * unit_factor(unit, "m")


def _places(values: FloatArray) -> tuple[FloatArray, IntArray]:
    """Distinct places among `values` and the number of the place of each; close ones are one."""
    order = np.argsort(values, kind="stable")
    gap = np.diff(values[order])
    # Places written with few digits differ a little from row to row.
    new = np.concatenate([[True], gap > _OFF_GRID * max(float(gap.max(initial=0.0)), 1e-300)])
    number = np.empty(len(values), dtype=np.int64)
    number[order] = np.cumsum(new) - 1
    return values[order][new], number


def _on_grid(
    table: Table,
    points: FloatArray,
    shape: tuple[int, int],
    row: IntArray,
    column: IntArray,
) -> FloatArray:
    count = np.zeros(shape, dtype=np.int64)
    np.add.at(count, (row, column), 1)
    if (count > 1).any():
        second = np.flatnonzero((count > 1)[row, column])[1]
        raise SpecError(f"{table.where(int(second))}: two heights at one place")
    height = np.full(shape, np.nan)
    height[row, column] = points[:, 2]
    return height


def _gridded(
    path: Path, points: FloatArray, spacing: float | None, most: int
) -> tuple[FloatArray, FloatArray, FloatArray, tuple[str, ...]]:
    """Bring scattered points onto a grid of their own spacing, or of a given one."""
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import ConvexHull, Delaunay, QhullError, cKDTree

    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    # Coordinates of a mine grid leave few digits for the net.
    plan = points[:, :2] - low
    try:
        area = float(ConvexHull(plan).volume)
        net = Delaunay(plan)
    except QhullError:
        raise SpecError(f"{path}: the points lie on one line; a surface is needed") from None
    own = float(np.sqrt(area / len(points)))
    step = own if spacing is None else spacing
    shape = np.floor((high - low) / step).astype(np.int64) + 1
    if shape.min() < 2 or int(shape[0]) * int(shape[1]) > most:
        raise SpecError(
            f"{path}: a grid of {step:.3g} m over {high[0] - low[0]:.5g} x {high[1] - low[1]:.5g} "
            f"m has {shape[1]} x {shape[0]} heights; 2 x 2 to {most:,} are allowed: set 'spacing'"
        )
    x, y = (step * np.arange(n) for n in shape)
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    height = np.asarray(LinearNDInterpolator(net, points[:, 2])(grid), dtype=np.float64)
    far = np.asarray(cKDTree(plan).query(grid.reshape(-1, 2))[0])
    gap = far.reshape(height.shape) > _LONGEST_GAP * max(step, own)
    remarks = [
        f"{len(points):,} scattered points: brought onto a grid of {step:.3g} m by linear "
        f"interpolation ({shape[1]} x {shape[0]} heights)"
    ]
    if (gap & np.isfinite(height)).any():
        remarks.append(
            f"heights up to {far.max():.3g} m from the nearest point are interpolated across gaps"
        )
    return x + low[0], y + low[1], height, tuple(remarks)
