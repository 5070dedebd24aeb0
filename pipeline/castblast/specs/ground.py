"""Ground of a bench file: heights on a grid or an STL surface, read and checked before use."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from castblast.errors import SpecError, nearest_name
from castblast.extras import require
from castblast.muckpile.particles import FloatArray
from castblast.muckpile.terrain import height_faults, heightmap, surface_faults
from castblast.muckpile.walls import Walls, join, surface
from castblast.specs.loading import Spec, read_text
from castblast.specs.quantity import QuantityError, QuantityIn

_GRID_KEYS = ("x0", "y0", "dx")
_AXIS_KEYS = ("x", "y")
_HEADER = ("ncols", "nrows", "cellsize")
#: Largest difference of a place from a regular grid, over its spacing.
_OFF_GRID = 1e-3

_Shift = Annotated[float, QuantityIn("m", -1e7, 1e7)]


class GroundSpec(Spec):
    """A surface on which balls land: heights on a grid, or facets of an STL file.

    Attributes
    ----------
    heightmap : str, optional
        ``.npz`` with height (ny, nx) in m and either x (nx,), y (ny,) or x0, y0, dx and maybe dy;
        ``.csv`` with the columns x, y, z in any order of rows; ``.asc``, an ESRI grid.
    stl : str, optional
        STL file in m; its facets are counter-clockwise seen from the side of the balls.
    shift : 3 lengths
        Added to the coordinates of the file, onto the frame of the bench.
    friction : float, optional
        For sliding and rolling; default: that of the contact law.
    floor : length
        Level of the floor around the bench. Heights no higher than it are left to the floor.
    smooth : length
        Heights are averaged with Gaussian weights of this standard deviation. The surface of an
        earlier pile is rough where single balls lie, and is refused (`rough_ground`); it wants
        three mean radii.
    extend : length
        The outermost heights go on outwards so far, such as half a cell of a surface that is given
        by the middles of its cells.
    """

    heightmap: Annotated[str, Field(min_length=1)] | None = None
    stl: Annotated[str, Field(min_length=1)] | None = None
    shift: tuple[_Shift, _Shift, _Shift] = (0.0, 0.0, 0.0)
    friction: Annotated[float, QuantityIn("1", 0.0, 5.0)] | None = None
    floor: Annotated[float, QuantityIn("m", -1e4, 1e4)] = 0.0
    smooth: Annotated[float, QuantityIn("m", 0.0, 1e3)] = 0.0
    extend: Annotated[float, QuantityIn("m", 0.0, 1e4)] = 0.0

    @model_validator(mode="after")
    def _one_of_two(self) -> GroundSpec:
        if (self.heightmap is None) == (self.stl is None):
            message = "exactly one of 'heightmap' and 'stl' is needed"
            raise QuantityError(message)
        if self.stl is not None and (self.smooth or self.extend):
            message = "'smooth' and 'extend' go with a heightmap"
            raise QuantityError(message)
        return self


def one_or_many(value: object) -> object:
    """Let a file name or one group stand for a list of one; an ``.stl`` name is an STL file."""
    if isinstance(value, str):
        return [{"stl" if value.lower().endswith(".stl") else "heightmap": value}]
    return [value] if isinstance(value, Mapping) else value


def read_ground(grounds: tuple[GroundSpec, ...], beside: Path) -> Walls:
    """Read all surfaces; file names are relative to the folder `beside`.

    Raises
    ------
    SpecError
        One line per fault, with file, row and column or facet.
    """
    if not grounds:
        return surface(np.zeros((0, 3, 3)))
    return join(*(_read_one(ground, beside) for ground in grounds))


def rough_ground(grounds: tuple[GroundSpec, ...], beside: Path, radius: float) -> list[str]:
    """Name heightmaps that are rougher than balls of mean `radius` [m] can lie on; []: none.

    Ridges and pits thinner than a ball, higher than its radius, hold it on both sides at once, deep
    inside the rock: it gains energy from nothing.
    """
    faults = []
    for ground in grounds:
        if ground.heightmap is None:
            continue
        _, _, height = _heights(ground, beside)
        step = [np.diff(height, axis=axis) for axis in (0, 1)]
        pairs = [
            (s[:-1], s[1:]) if axis == 0 else (s[:, :-1], s[:, 1:]) for axis, s in enumerate(step)
        ]
        rough = sum(
            int(np.sum((a * b < 0.0) & (np.minimum(np.abs(a), np.abs(b)) > radius)))
            for a, b in pairs
        )
        if rough:
            faults.append(
                f"{beside / ground.heightmap}: {rough} heights stand out from both neighbours by "
                f"more than the mean radius of the balls, {radius:.2g} m; set "
                f"'smooth: {4.0 * radius:.1g} m' or a wider grid"
            )
    return faults


def _heights(ground: GroundSpec, beside: Path) -> tuple[FloatArray, FloatArray, FloatArray]:
    assert ground.heightmap is not None
    x, y, height = read_heights(beside / ground.heightmap)
    if ground.smooth > 0.0:
        height = smooth_heights(x, y, height, ground.smooth)
    return x, y, height


def _read_one(ground: GroundSpec, beside: Path) -> Walls:
    friction = math.nan if ground.friction is None else ground.friction
    if ground.stl is not None:
        corner = read_stl(beside / ground.stl) + np.array(ground.shift)
        return surface(corner, friction, base=ground.floor)
    x, y, height = _heights(ground, beside)
    if ground.extend > 0.0:
        x, y = (np.array([v[0] - ground.extend, *v, v[-1] + ground.extend]) for v in (x, y))
        height = np.pad(height, 1, mode="edge")
    dx, dy, dz = ground.shift
    return heightmap(x + dx, y + dy, height + dz, friction, base=ground.floor)


def smooth_heights(x: FloatArray, y: FloatArray, height: FloatArray, width: float) -> FloatArray:
    """Average heights (ny, nx) with Gaussian weights of standard deviation `width`; all in m.

    Each height counts for the part of its axis that is nearest to it, so that the spacing of the
    places does not matter.
    """

    def weights(place: FloatArray) -> FloatArray:
        apart = (place[:, None] - place[None, :]) / width
        share = np.exp(-0.5 * apart**2) * np.gradient(place)[None, :]
        return np.asarray(share / share.sum(axis=1, keepdims=True))

    return np.asarray(weights(y) @ height @ weights(x).T)


def read_heights(path: Path) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Read a grid of heights: x (nx,), y (ny,), height (ny, nx), all in m.

    Raises
    ------
    SpecError
        One line per fault.
    """
    readers = {".npz": _read_npz, ".csv": _read_csv, ".asc": _read_asc}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise SpecError(f"{path}: heights must be in a .npz, .csv or .asc file")
    x, y, height = reader(path)
    if faults := height_faults(x, y, height):
        raise SpecError("\n".join(f"{path}: {fault}" for fault in faults))
    return x, y, height


def _read_npz(path: Path) -> tuple[FloatArray, FloatArray, FloatArray]:
    try:
        with np.load(path, allow_pickle=False) as archive:
            stored: dict[str, NDArray[Any]] = {key: archive[key] for key in archive.files}
    except FileNotFoundError:
        raise SpecError(f"{path}: no such file") from None
    except (AttributeError, OSError, ValueError, EOFError, zipfile.BadZipFile) as fault:
        line = str(fault).splitlines()[0] if str(fault) else type(fault).__name__
        raise SpecError(f"{path}: is no readable .npz file ({line})") from None
    needed = _AXIS_KEYS if all(key in stored for key in _AXIS_KEYS) else _GRID_KEYS
    missing = [key for key in ("height", *needed) if key not in stored]
    if missing:
        found = ", ".join(stored) or "nothing"
        lines = [f"{path}: {key}: is missing{nearest_name(key, list(stored))}" for key in missing]
        raise SpecError("\n".join([*lines, f"{path}: the file holds {found}"]))
    bad = [key for key in ("height", *needed) if stored[key].dtype.kind not in "fiu"]
    if bad:
        raise SpecError("\n".join(f"{path}: {key}: numbers are needed" for key in bad))
    height = np.asarray(stored["height"], dtype=np.float64)
    if needed == _AXIS_KEYS:
        x, y = (np.asarray(stored[key], dtype=np.float64) for key in _AXIS_KEYS)
        return x, y, height
    if height.ndim != 2:
        raise SpecError(f"{path}: height: shape {height.shape}; (ny, nx) is needed")
    dx = float(stored["dx"])
    dy = float(stored.get("dy", stored["dx"]))
    rows, columns = height.shape
    return _line(stored["x0"], dx, columns), _line(stored["y0"], dy, rows), height


def _line(start: Any, spacing: float, count: int) -> FloatArray:
    return np.asarray(float(start) + spacing * np.arange(count), dtype=np.float64)


def _read_csv(path: Path) -> tuple[FloatArray, FloatArray, FloatArray]:
    lines = read_text(path).splitlines()
    names = [name.strip().split(" ")[0].lower() for name in lines[0].split(",")] if lines else []
    missing = [name for name in ("x", "y", "z") if name not in names]
    if missing:
        raise SpecError(f"{path}: line 1: the columns x, y, z are needed; missing: {missing}")
    columns = [names.index(name) for name in ("x", "y", "z")]
    rows = np.empty((len(lines) - 1, 3))
    for number, line in enumerate(lines[1:]):
        parts = line.split(",")
        try:
            rows[number] = [float(parts[c]) for c in columns]
        except (ValueError, IndexError):
            raise SpecError(f"{path}: line {number + 2}: {line[:60]!r}: is no x, y, z") from None
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if len(bad):
        raise SpecError(f"{path}: line {bad[0] + 2}: not a number ({len(bad)} such lines)")
    return _grid_of_points(path, rows)


def _grid_of_points(path: Path, rows: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Put points (k, 3) in any order onto the grid that they form."""
    x, column = _places(rows[:, 0])
    y, row = _places(rows[:, 1])
    height = np.full((len(y), len(x)), np.nan)
    count = np.zeros(height.shape, dtype=np.int64)
    np.add.at(count, (row, column), 1)
    if (count > 1).any():
        first = np.flatnonzero((count > 1)[row, column])[1]
        raise SpecError(f"{path}: line {first + 2}: two heights at one place")
    height[row, column] = rows[:, 2]
    return x, y, height


def _places(values: FloatArray) -> tuple[FloatArray, NDArray[np.int64]]:
    """Distinct places among `values` and the number of the place of each; close ones are one."""
    order = np.argsort(values, kind="stable")
    gap = np.diff(values[order])
    # Places written with few digits differ a little from row to row.
    new = np.concatenate([[True], gap > _OFF_GRID * max(float(gap.max(initial=0.0)), 1e-300)])
    number = np.empty(len(values), dtype=np.int64)
    number[order] = np.cumsum(new) - 1
    return values[order][new], number


def _read_asc(path: Path) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Read an ESRI grid: header of keys and values, rows from north to south."""
    header: dict[str, float] = {}
    lines = read_text(path).splitlines()
    while lines and len(header) < 6 and lines[0].split() and lines[0].split()[0][0].isalpha():
        key, *rest = lines.pop(0).lower().split()
        try:
            header[key] = float(rest[0])
        except (ValueError, IndexError):
            raise SpecError(f"{path}: header: {key}: a number is needed") from None
    missing = [key for key in _HEADER if key not in header]
    missing += [
        f"{axis}llcorner"
        for axis in "xy"
        if not {f"{axis}llcorner", f"{axis}llcenter"} & set(header)
    ]
    if missing:
        raise SpecError(f"{path}: header: missing: {', '.join(missing)}")
    nx, ny = int(header["ncols"]), int(header["nrows"])
    try:
        values = np.array(" ".join(lines).split(), dtype=np.float64)
    except ValueError as fault:
        raise SpecError(f"{path}: {fault}") from None
    if len(values) != nx * ny:
        raise SpecError(f"{path}: {len(values)} heights; nrows x ncols = {ny} x {nx} is needed")
    height = values.reshape(ny, nx)[::-1].copy()
    height[height == header.get("nodata_value", -9999.0)] = np.nan
    size = header["cellsize"]
    x0, y0 = (
        header.get(f"{axis}llcenter", header.get(f"{axis}llcorner", 0.0) + 0.5 * size)
        for axis in "xy"
    )
    return _line(x0, size, nx), _line(y0, size, ny), height


def read_stl(path: Path) -> FloatArray:
    """Read the facets (t, 3, 3) [m] of an STL file, text or binary.

    Raises
    ------
    SpecError
        No file, trimesh is not installed, not an STL, or a fault of the surface, with its facets.
    """
    if not path.is_file():
        raise SpecError(f"{path}: no such file")
    require("stl", purpose=f"{path}: an STL file")
    import trimesh

    try:
        mesh = trimesh.load_mesh(str(path), file_type="stl", process=False)
        corner = np.asarray(mesh.triangles, dtype=np.float64)
    except Exception as fault:  # trimesh raises whatever its parsers raise
        raise SpecError(f"{path}: is no readable STL file ({fault})") from None
    if faults := surface_faults(corner):
        raise SpecError("\n".join(f"{path}: {fault}" for fault in faults))
    return corner
