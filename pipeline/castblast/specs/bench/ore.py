"""Files of ore polygons: YAML with names, grades and corners, or CSV with one corner a line.

Coordinates are metres in the frame of the bench: x in the direction of throw with the toe of the
free face at 0 (so the bench has negative x), y along the bench.
"""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from castblast.errors import SpecError
from castblast.muckpile.bench.geometry import Bench
from castblast.muckpile.results.ore import OrePolygon
from castblast.specs.bench.frame import GRID_PLACE, FrameSpec
from castblast.specs.bench.place import extent, place_faults
from castblast.specs.loading import Label, Spec, load_spec, make_spec
from castblast.specs.quantity import QuantityIn
from castblast.specs.tables.table import Form, read_table
from castblast.types import FloatArray

#: Grades are numbers in whatever unit the user thinks in, and as large as they like.
_FORM = Form(
    columns={"x": GRID_PLACE, "y": GRID_PLACE, "grade": QuantityIn("1", lower=0.0)},
    required=("name", "x", "y"),
    texts=("name",),
    aliases={"easting": "x", "northing": "y"},
    bare=True,
)
# Polygons drawn side by side share corners that were rounded to a centimetre.
_OVERLAP = 0.01

_Corner = Annotated[list[float], Field(min_length=2, max_length=2)]


class OrePolygonSpec(Spec):
    """One polygon: name, corners (x, y) in m, and a grade in the unit of the user."""

    name: Label
    corners: Annotated[list[_Corner], Field(min_length=3)]
    grade: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] | None = None


class OreSpec(Spec):
    """Contents of a file of ore polygons."""

    polygons: Annotated[list[OrePolygonSpec], Field(min_length=1)]
    notes: str = ""


def read_ore(
    path: Path, bench: Bench | None = None, frame: FrameSpec | None = None
) -> tuple[OrePolygon, ...]:
    """Read ore polygons from YAML, or from CSV by its suffix.

    YAML holds ``polygons``, a list of ``name``, ``corners`` ([x, y] pairs) and optionally
    ``grade``; CSV has the columns name, x, y (in m, or with a unit: ``x [ft]``) and optionally
    grade, a line per corner.

    Parameters
    ----------
    path : path
    bench : Bench, optional
        Polygons that lie wholly beside it are faults.
    frame : FrameSpec, optional
        Of the bench in the grid in which the corners are eastings and northings.

    Raises
    ------
    SpecError
        One line per fault: no file, unknown columns or keys, no numbers, fewer than three
        corners, a name used twice, sides that cross, polygons that overlap or miss the bench.
    """
    if path.suffix.lower() == ".csv":
        spec = make_spec(_from_csv(path), OreSpec, str(path))
    else:
        spec = load_spec(path, OreSpec)
    polygons = tuple(
        OrePolygon(
            polygon.name,
            _without_closing_corner(_corners(polygon, frame)),
            math.nan if polygon.grade is None else polygon.grade,
        )
        for polygon in spec.polygons
    )
    if faults := _shape_faults(polygons, bench):
        raise SpecError("\n".join(f"{path}: {fault}" for fault in faults))
    return polygons


def _corners(polygon: OrePolygonSpec, frame: FrameSpec | None) -> FloatArray:
    """Corners (k, 2) [m] in the frame of the bench."""
    corners = np.array(polygon.corners, dtype=np.float64)
    return corners if frame is None else frame.to_bench(corners)


def _without_closing_corner(corners: Any) -> Any:
    return corners[:-1] if len(corners) > 3 and (corners[0] == corners[-1]).all() else corners


def _from_csv(path: Path) -> dict[str, Any]:
    """Gather the lines of each name, in order of appearance."""
    table = read_table(path, _FORM)
    grades = table.number.get("grade", np.full(len(table.line), math.nan))
    found: dict[str, dict[str, Any]] = {}
    faults = []
    for k, name in enumerate(table.text["name"]):
        entry = found.setdefault(name, {"name": name, "corners": [], "grade": None})
        entry["corners"].append([float(table.number[key][k]) for key in "xy"])
        grade = float(grades[k])
        if math.isnan(grade):
            continue
        if entry["grade"] not in (None, grade):
            faults.append(f"{table.where(k)}: grade: '{name}' has another grade above")
        entry["grade"] = grade
    if faults:
        raise SpecError("\n".join(faults))
    return {"polygons": list(found.values())}


def _shape_faults(polygons: tuple[OrePolygon, ...], bench: Bench | None) -> list[str]:
    """Say what is wrong with names, corners and places; []: nothing."""
    import shapely

    if bench is not None and (wrong := _place_faults(polygons, bench)):
        return wrong
    times = Counter(polygon.name for polygon in polygons)
    faults = [f"'{name}': the name is used {n} times" for name, n in times.items() if n > 1]
    shapes = []
    for polygon in polygons:
        if not np.isfinite(polygon.corners).all():
            faults.append(f"'{polygon.name}': a corner is not a finite number")
            continue
        shape = shapely.Polygon(polygon.corners)
        if not shape.is_valid or shape.area == 0.0:
            reason = shapely.is_valid_reason(shape) if shape.convex_hull.area else "no area"
            faults.append(f"'{polygon.name}': is not a simple polygon ({reason})")
            continue
        shapes.append((polygon.name, shape))
        if bench is not None and not shape.intersects(_plan(bench)):
            faults.append(
                f"'{polygon.name}': lies beside the bench, which has x from {-bench.width:g} to "
                f"0 m and y from 0 to {bench.length:g} m"
            )
    for k, (name, shape) in enumerate(shapes):
        for other, beside in shapes[:k]:
            with np.errstate(invalid="ignore"):  # shapely 2.0.0 leaves a flag of GEOS behind
                common = shape.intersection(beside).area
            if common > _OVERLAP * min(shape.area, beside.area):
                faults.append(f"'{other}' and '{name}' overlap by {common:.3g} m2")
    return faults


def _place_faults(polygons: tuple[OrePolygon, ...], bench: Bench) -> list[str]:
    """Say that all polygons lie in another grid or in another unit; []: neither."""
    corners = np.concatenate([polygon.corners for polygon in polygons])
    if not np.isfinite(corners).all():
        return []
    onto = "move the corners by {offset}, or say in 'frame' of the bench file where it lies there"
    return place_faults(extent(corners), bench, onto, inside=True)


def _plan(bench: Bench) -> Any:
    import shapely

    return shapely.box(-bench.width, 0.0, 0.0, bench.length)
