"""Ground of a bench file: heights on a grid or an STL surface, read, mended and checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from castblast.errors import SpecError
from castblast.muckpile.bench.geometry import Bench
from castblast.muckpile.ground.mend import Mended, Repair, cracks, median_side, mend, weld_distance
from castblast.muckpile.ground.terrain import heightmap, named_facets, surface_faults
from castblast.muckpile.ground.walls import Walls, join, surface
from castblast.specs.bench.ground.heights import Heights, read_heights
from castblast.specs.bench.ground.stl import load_stl, single_precision_remark
from castblast.specs.bench.place import Extent, extent, place_faults, place_remarks, shown_length
from castblast.specs.loading import Spec
from castblast.specs.quantity import QuantityError, QuantityIn
from castblast.specs.units import unit_factor
from castblast.types import FloatArray

_ONTO = "'shift' would have to be {offset} for its least corner to lie at the toe of the bench"
#: Depth [m] below the floor from which it is said that the floor lies over the ground there.
_HOLLOW = 0.3
#: Corners further apart than this share of a side are not the same corner.
_LARGEST_WELD = 0.25

_Shift = Annotated[float, QuantityIn("m", -2e7, 2e7)]


def _length_unit(unit: str) -> str:
    unit_factor(unit, "m")
    return unit


class GroundSpec(Spec):
    """A surface on which balls land: heights on a grid, or facets of an STL file.

    Attributes
    ----------
    heightmap : str, optional
        ``.npz`` with height (ny, nx) and either x (nx,), y (ny,) or x0, y0, dx and maybe dy;
        ``.csv``, ``.txt``, ``.xyz`` with the columns x, y, z in any order of rows, on a grid or
        scattered; ``.asc``, an ESRI grid.
    stl : str, optional
        STL file; its facets are counter-clockwise seen from the side of the balls.
    unit : str
        Of a file that gives none: ``mm``, ``ft``; default: m.
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
    spacing : length, optional
        Of the grid onto which heights or scattered points are brought; default: that of the file.
    mend : bool
        Corners of an STL surface that lie close together are joined, facets without height or given
        twice dropped, and those that face the wrong way turned; what was done is said. Otherwise
        each of these is refused.
    weld : length, optional
        How close; default: 1 mm, and no more than a hundredth of the facets.
    """

    heightmap: Annotated[str, Field(min_length=1)] | None = None
    stl: Annotated[str, Field(min_length=1)] | None = None
    unit: Annotated[str, AfterValidator(_length_unit)] = ""
    shift: tuple[_Shift, _Shift, _Shift] = (0.0, 0.0, 0.0)
    friction: Annotated[float, QuantityIn("1", 0.0, 5.0)] | None = None
    floor: Annotated[float, QuantityIn("m", -1e4, 1e4)] = 0.0
    smooth: Annotated[float, QuantityIn("m", 0.0, 1e3)] = 0.0
    extend: Annotated[float, QuantityIn("m", 0.0, 1e4)] = 0.0
    spacing: Annotated[float, QuantityIn("m", 0.01, 1e3)] | None = None
    mend: bool = True
    weld: Annotated[float, QuantityIn("m", 0.0, 1.0)] | None = None

    @model_validator(mode="after")
    def _one_of_two(self) -> GroundSpec:
        if (self.heightmap is None) == (self.stl is None):
            message = "exactly one of 'heightmap' and 'stl' is needed"
            raise QuantityError(message)
        if self.stl is not None and (self.smooth or self.extend or self.spacing):
            message = "'smooth', 'extend' and 'spacing' go with a heightmap"
            raise QuantityError(message)
        if self.stl is None and {"mend", "weld"} & self.model_fields_set:
            message = "'mend' and 'weld' go with an STL file"
            raise QuantityError(message)
        return self


def one_or_many(value: object) -> object:
    """Let a file name or one group stand for a list of one; an ``.stl`` name is an STL file."""
    if isinstance(value, str):
        return [{"stl" if value.lower().endswith(".stl") else "heightmap": value}]
    return [value] if isinstance(value, Mapping) else value


class Ground(NamedTuple):
    """All surfaces of a bench.

    Attributes
    ----------
    walls : Walls
    remarks : tuple of str
        What was mended, left out or found odd, with the file; one line each.
    maps : tuple of (Path, Heights)
        Heights as the walls have them, in the frame of their files.
    """

    walls: Walls
    remarks: tuple[str, ...] = ()
    maps: tuple[tuple[Path, Heights], ...] = ()


def read_ground(
    grounds: tuple[GroundSpec, ...], beside: Path, bench: Bench | None = None
) -> Ground:
    """Read all surfaces; file names are relative to the folder `beside`.

    Parameters
    ----------
    grounds : tuple of GroundSpec
    beside : Path
    bench : Bench, optional
        Surfaces are held against its place and size.

    Raises
    ------
    SpecError
        One line per fault, with file, row and column or facet.
    """
    parts = [surface(np.zeros((0, 3, 3)))]
    remarks: list[str] = []
    maps: list[tuple[Path, Heights]] = []
    for ground in grounds:
        path = beside / (ground.stl or ground.heightmap or "")
        if ground.stl is not None:
            walls, said = _read_surface(ground, path, bench)
        else:
            heights = _read_map(ground, path)
            maps.append((path, heights))
            walls, said = _map_walls(ground, heights, path, bench)
        parts.append(walls)
        remarks += [f"{path}: {line}" for line in said]
    return Ground(join(*parts), tuple(remarks), tuple(maps))


def rough_ground(ground: Ground, radius: float) -> list[str]:
    """Name heightmaps that are rougher than balls of mean `radius` [m] can lie on; []: none.

    Ridges and pits thinner than a ball, higher than its radius, hold it on both sides at once, deep
    inside the rock: it gains energy from nothing.
    """
    faults = []
    for path, heights in ground.maps:
        step = [np.diff(heights.height, axis=axis) for axis in (0, 1)]
        pairs = [
            (s[:-1], s[1:]) if axis == 0 else (s[:, :-1], s[:, 1:]) for axis, s in enumerate(step)
        ]
        rough = sum(
            int(np.sum((a * b < 0.0) & (np.minimum(np.abs(a), np.abs(b)) > radius)))
            for a, b in pairs
        )
        if rough:
            faults.append(
                f"{path}: {rough} heights stand out from both neighbours by "
                f"more than the mean radius of the balls, {radius:.2g} m; set "
                f"'smooth: {4.0 * radius:.1g} m' or a wider grid"
            )
    return faults


def _read_map(ground: GroundSpec, path: Path) -> Heights:
    heights = read_heights(path, ground.unit, ground.spacing)
    if ground.smooth > 0.0:
        smooth = smooth_heights(heights.x, heights.y, heights.height, ground.smooth)
        heights = heights._replace(height=smooth)
    return heights


def _map_walls(
    ground: GroundSpec, heights: Heights, path: Path, bench: Bench | None
) -> tuple[Walls, list[str]]:
    friction = math.nan if ground.friction is None else ground.friction
    x, y, height = heights.x, heights.y, heights.height
    if ground.extend > 0.0:
        x, y = (np.array([v[0] - ground.extend, *v, v[-1] + ground.extend]) for v in (x, y))
        height = np.pad(height, 1, mode="edge")
    dx, dy, dz = ground.shift
    x, y, height = x + dx, y + dy, height + dz
    known = height[np.isfinite(height)]
    where = Extent(np.array([x[0], y[0], known.min()]), np.array([x[-1], y[-1], known.max()]))
    remarks = [*heights.remarks, *_place(ground, where, path, bench)]
    remarks += _below_floor(known, ground.floor, "heights")
    return heightmap(x, y, height, friction, base=ground.floor), remarks


def _below_floor(height: FloatArray, floor: float, what: str) -> list[str]:
    """Say that the endless floor lies over hollows of the ground."""
    low = height < floor - _HOLLOW
    if not low.any():
        return []
    return [
        f"{low.sum()} of {height.size} {what} lie below the floor at {floor:g} m, the lowest at "
        f"{height.min():.3g} m: rock comes to rest on the floor there"
    ]


def _place(ground: GroundSpec, where: Extent, path: Path, bench: Bench | None) -> list[str]:
    """Hold a surface against the bench; returns what is odd, raises what cannot be."""
    if bench is None:
        return []
    # The offset that is offered is the whole of it, not what to add.
    written = Extent(where.low - np.array(ground.shift), where.high - np.array(ground.shift))
    if faults := place_faults(where, bench, _ONTO, written):
        raise SpecError("\n".join(f"{path}: {fault}" for fault in faults))
    return place_remarks(where, bench)


def _read_surface(ground: GroundSpec, path: Path, bench: Bench | None) -> tuple[Walls, list[str]]:
    friction = math.nan if ground.friction is None else ground.friction
    found = load_stl(path)
    factor = unit_factor(ground.unit or "m", "m")
    remarks = []
    if found.single and (line := single_precision_remark(found.corner, factor)):
        remarks.append(line)
    corner = found.corner * factor + np.array(ground.shift)
    remarks += _place(ground, extent(corner), path, bench)
    towards = None if bench is None else _middle(bench)
    mended, distance = mended_surface(path, corner, ground, towards)
    remarks += [f"{_met(repair)}: {repair.done}" for repair in mended.repairs]
    remarks += _below_floor(mended.corner[:, :, 2], ground.floor, "corners of facets")
    count, gap = cracks(mended.corner, distance)
    if count:
        remarks.append(
            f"{count} corners at its rims lie up to {shown_length(gap)} from another rim without "
            f"being joined: a ball meets both; 'weld: {1e3 * gap * 1.01:.0f} mm' joins them"
        )
    walls = surface(mended.corner, friction, base=ground.floor, welded=True)
    return walls, remarks


def _middle(bench: Bench) -> FloatArray:
    return np.array([-bench.width, bench.length, bench.height]) / 2.0


def mended_surface(
    path: Path, corner: FloatArray, ground: GroundSpec, towards: FloatArray | None = None
) -> tuple[Mended, float]:
    """Mend facets (t, 3, 3) [m] and hold what is left against the rules of a surface.

    Returns
    -------
    mended : Mended
    distance : float [m]
        Within which corners were joined.

    Raises
    ------
    SpecError
        What is to be mended though the bench file says no, or what cannot be; facets by number.
    """
    distance = weld_distance(corner) if ground.weld is None else ground.weld
    side = median_side(corner)
    if distance > _LARGEST_WELD * side:
        raise SpecError(
            f"{path}: weld: {distance:g} m: too far for facets with sides of {side:.3g} m; "
            f"allowed: 0 to {_LARGEST_WELD * side:.2g} m"
        )
    mended = mend(corner, distance, towards)
    faults = surface_faults(mended.corner, mended.source)
    if not ground.mend:
        faults = [
            f"{_met(r)}; not {r.done}, since 'mend' is false" for r in mended.repairs
        ] + faults
    if faults:
        raise SpecError("\n".join(f"{path}: {fault}" for fault in faults))
    return mended, distance


def _met(repair: Repair) -> str:
    count = len(repair.facet)
    some = "1 facet" if count == 1 else f"{count:,} facets"
    return f"{some} {repair.what} ({named_facets(repair.facet)})"


def smooth_heights(x: FloatArray, y: FloatArray, height: FloatArray, width: float) -> FloatArray:
    """Average heights (ny, nx) with Gaussian weights of standard deviation `width`; all in m.

    Each height counts for the part of its axis that is nearest to it, so that the spacing of the
    places does not matter. Missing heights (NaN) count for nothing and stay missing.
    """

    def weights(place: FloatArray) -> FloatArray:
        apart = (place[:, None] - place[None, :]) / width
        share = np.exp(-0.5 * apart**2) * np.gradient(place)[None, :]
        return np.asarray(share / share.sum(axis=1, keepdims=True))

    along, across = weights(x).T, weights(y)
    known = np.isfinite(height)
    if known.all():
        return np.asarray(across @ height @ along)
    total = across @ np.where(known, height, 0.0) @ along
    return np.where(known, total / np.maximum(across @ known @ along, 1e-300), np.nan)
