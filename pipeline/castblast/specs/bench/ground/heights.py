"""Heights on a grid from files: NumPy archives, ESRI grids, points that form a grid or none."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from castblast.disk.reading import read_npz
from castblast.errors import SpecError, nearest_name
from castblast.muckpile.ground.terrain import height_faults, missing_heights
from castblast.specs.bench.ground.asc import is_esri_grid, read_esri_grid
from castblast.specs.bench.ground.points import read_points
from castblast.specs.bench.ground.stl import single_precision_remark
from castblast.specs.units import unit_factor
from castblast.types import FloatArray

_GRID_KEYS = ("x0", "y0", "dx")
_AXIS_KEYS = ("x", "y")
_TEXTS = (".csv", ".txt", ".xyz", ".dat", ".asc")
#: No place on Earth is so low, and none so high, in m: a value beyond is a mark for none.
_DEEPEST, _HIGHEST = -9000.0, 9e4
#: Most heights of a file, and of the ground: a facet takes some 5 kB as a wall, a height two.
MOST_READ, MOST_HEIGHTS = 8_000_000, 500_000


class Heights(NamedTuple):
    """A grid of heights.

    Attributes
    ----------
    x, y : array (nx,), (ny,) [m]
    height : array (ny, nx) [m]
        NaN where it is missing.
    remarks : tuple of str
        What was done or found on the way.
    """

    x: FloatArray
    y: FloatArray
    height: FloatArray
    remarks: tuple[str, ...] = ()


def read_heights(path: Path, unit: str = "", spacing: float | None = None) -> Heights:
    """Read heights.

    Parameters
    ----------
    path : Path
        ``.npz``; ``.asc``, an ESRI grid; ``.csv``, ``.txt``, ``.xyz`` or ``.dat`` with x, y, z.
    unit : str
        Unit of a file that gives none; empty: m.
    spacing : float, optional [m]
        Of the grid onto which heights are brought; default: that of the file.

    Raises
    ------
    SpecError
        One line per fault.
    """
    factor = unit_factor(unit or "m", "m")
    suffix = path.suffix.lower()
    if suffix == ".npz":
        found = _read_npz(path, factor)
    elif suffix not in _TEXTS:
        raise SpecError(f"{path}: heights must be in a .npz, {', '.join(_TEXTS)} file")
    elif suffix == ".asc" or is_esri_grid(path):
        found = Heights(*read_esri_grid(path, MOST_READ, factor))
    else:
        x, y, height, remarks, scattered = read_points(path, unit, spacing, MOST_HEIGHTS)
        found = Heights(x, y, height, remarks)
        spacing = None if scattered else spacing
    found = _checked(path, found)
    if spacing is not None:
        found = _thinned(path, found, spacing)
    if found.height.size > MOST_HEIGHTS:
        fine = np.sqrt(np.ptp(found.x) * np.ptp(found.y) / MOST_HEIGHTS)
        raise SpecError(
            f"{path}: {found.height.size:,} heights; at most {MOST_HEIGHTS:,} make ground: set "
            f"'spacing: {1.1 * fine:.2g} m', or cut the surface"
        )
    if missing := missing_heights(found.height):
        found = found._replace(remarks=(*found.remarks, missing))
    return found


def _thinned(path: Path, found: Heights, spacing: float) -> Heights:
    """Interpolate a grid linearly at places `spacing` [m] apart."""
    from scipy.interpolate import RegularGridInterpolator

    # A share of the spacing keeps the last place of a grid that it divides.
    axes = [np.arange(a[0], a[-1] + 1e-6 * spacing, spacing) for a in (found.x, found.y)]
    count = len(axes[0]) * len(axes[1])
    if min(map(len, axes)) < 2 or count > MOST_READ:
        raise SpecError(
            f"{path}: spacing: {spacing:g} m: gives {len(axes[1])} x {len(axes[0])} heights over "
            f"{np.ptp(found.x):.5g} x {np.ptp(found.y):.5g} m; at least 2 x 2 are needed"
        )
    x, y = (np.minimum(new, old[-1]) for new, old in zip(axes, found[:2], strict=True))
    place = np.stack(np.meshgrid(y, x, indexing="ij"), axis=-1)
    height = RegularGridInterpolator((found.y, found.x), found.height)(place)
    remark = f"heights interpolated on a grid of {spacing:g} m ({len(y)} x {len(x)} heights)"
    thin = Heights(x, y, np.asarray(height, dtype=np.float64), (*found.remarks, remark))
    return _checked(path, thin)


def _checked(path: Path, found: Heights) -> Heights:
    """Take marks of missing heights out, and hold the grid against its own rules."""
    height, remarks = found.height, found.remarks
    with np.errstate(invalid="ignore"):
        odd = np.isfinite(height) & ((height < _DEEPEST) | (height > _HIGHEST))
    if odd.any() and not odd.all():
        height = np.where(odd, np.nan, height)
        remarks += (
            f"{odd.sum()} heights beyond {_DEEPEST:g} to {_HIGHEST:g} m are taken as missing",
        )
    if faults := height_faults(found.x, found.y, height):
        raise SpecError("\n".join(f"{path}: {fault}" for fault in faults))
    return Heights(found.x, found.y, height, remarks)


def _read_npz(path: Path, factor: float) -> Heights:
    stored = read_npz(path, "an .npz file of heights")
    needed = _AXIS_KEYS if all(key in stored for key in _AXIS_KEYS) else _GRID_KEYS
    missing = [key for key in ("height", *needed) if key not in stored]
    if missing:
        found = ", ".join(stored) or "nothing"
        lines = [f"{path}: {key}: is missing{nearest_name(key, list(stored))}" for key in missing]
        raise SpecError("\n".join([*lines, f"{path}: the file holds {found}"]))
    scalars = ("dy",) if needed == _GRID_KEYS and "dy" in stored else ()
    keys = ("height", *needed, *scalars)
    bad = [key for key in keys if stored[key].dtype.kind not in "fiu"]
    if bad:
        raise SpecError("\n".join(f"{path}: {key}: numbers are needed" for key in bad))
    odd = [k for k in keys[1:] if needed == _GRID_KEYS and stored[k].size != 1]
    if odd:
        raise SpecError(f"{path}: {odd[0]}: shape {stored[odd[0]].shape}; one number is needed")
    height = np.asarray(stored["height"], dtype=np.float64) * factor
    if height.ndim != 2:
        raise SpecError(f"{path}: height: shape {height.shape}; (ny, nx) is needed")
    if height.size > MOST_READ:
        raise SpecError(f"{path}: {height.size:,} heights; at most {MOST_READ:,}: coarsen it")
    if needed == _AXIS_KEYS:
        odd = [key for key in _AXIS_KEYS if stored[key].ndim != 1]
        if odd:
            raise SpecError(f"{path}: {odd[0]}: shape {stored[odd[0]].shape}; (n,) is needed")
        x, y = (np.asarray(stored[key], dtype=np.float64) * factor for key in _AXIS_KEYS)
        return Heights(x, y, height, _rounding(stored, factor))
    dx = stored["dx"].item()
    dy = stored["dy"].item() if scalars else dx
    rows, columns = height.shape
    x = _line(stored["x0"], dx, columns) * factor
    return Heights(x, _line(stored["y0"], dy, rows) * factor, height)


def _rounding(stored: dict[str, Any], factor: float) -> tuple[str, ...]:
    """Remark on places in single precision."""
    single = [stored[key] for key in _AXIS_KEYS if stored[key].dtype == np.float32]
    worst = max(single, key=lambda axis: float(np.abs(axis).max(initial=0.0)), default=None)
    line = "" if worst is None else single_precision_remark(worst.astype(np.float64), factor)
    return (line,) if line else ()


def _line(start: Any, spacing: float, count: int) -> FloatArray:
    return np.asarray(start.item() + spacing * np.arange(count), dtype=np.float64)
