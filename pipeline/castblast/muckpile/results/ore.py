"""Where the ore of a bench lies after the blast, and what digging loses and dilutes.

Ore is marked by polygons in plan, valid over the whole height of the bench; rock outside all of
them is waste. A ball belongs to the polygon that holds its centre before the blast. Ore is lost
when it is not dug as the ore it is; what is dug as ore is diluted by the waste and the ore of
other polygons in it (Thornton, Sprott & Brunton 2005; Rogers et al. 2012):

    loss     = rock of the polygon that is not dug as it / rock of the polygon
    dilution = other rock that is dug as it / all rock that is dug as it

both by mass. They depend on what is dug, for which there are four answers (`METHODS`):

``as_planned``  the polygon where it was drawn, as if nothing had moved;
``translated``  the polygon moved as a whole by the mean displacement of its rock, as is done with
                movement vectors measured in the blast;
``outlined``    the smallest area in plan that holds a given share of its rock;
``dig_blocks``  square blocks (of limited height, if flitches are given), each assigned to the
                polygon, or to waste, that has the most rock in it.

The last is the best that blocks of that size can do when it is known where the rock went. The
first three dig everything above their area; where two of these areas overlap, the rock there
counts for both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import inf, nan
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from castblast.muckpile.balls.particles import Particles, ball_mass
from castblast.muckpile.results.movement import GroupMovement, group_movement
from castblast.muckpile.results.profile import mass_quantile
from castblast.types import BoolArray, FloatArray, IntArray

METHODS = ("as_planned", "translated", "outlined", "dig_blocks")
WASTE = -1
# A part of an outline smaller than this share of the whole is a few balls that rolled away.
_SPECK = 0.01

#: Parts of an area in plan: each an outer ring, then holes; rings (k, 2) [m], closed.
Area: TypeAlias = list[list[FloatArray]]


class OrePolygon(NamedTuple):
    """Ore on a bench, in plan.

    Attributes
    ----------
    name : str
    corners : array (k, 2) [m]
        x, y in the frame of the bench, in order around the polygon, without the first again.
    grade : float
        In the unit of the user; NaN: not known.
    """

    name: str
    corners: FloatArray
    grade: float = nan


class DigPlan(NamedTuple):
    """How ore is dug.

    Attributes
    ----------
    block : float [m]
        Side of a dig block; blocks are aligned with x = 0 and y = 0.
    flitch : float [m]
        Height of a dig block; infinite: the whole height of the pile.
    share : float [-]
        Of the rock of a polygon that its outline holds.
    cell : float [m]
        Of the grid on which outlines are drawn; 0: twice the mean radius of the balls.
    """

    block: float = 3.0
    flitch: float = inf
    share: float = 0.9
    cell: float = 0.0


class OreResult(NamedTuple):
    """What one way of digging makes of one polygon.

    Attributes
    ----------
    polygon, method : str
    mass : float [kg]
        Of the balls of the polygon.
    dug : float [kg]
        Of the balls that are dug as this polygon.
    loss, dilution : float [-]
        See the module; dilution is NaN when nothing is dug.
    other_ore : float [-]
        Part of the dilution that is ore of other polygons.
    grade : float
        Of what is dug, waste without grade; NaN where a grade is not known.
    """

    polygon: str
    method: str
    mass: float
    dug: float
    loss: float
    dilution: float
    other_ore: float
    grade: float


class OreMovement(NamedTuple):
    """Ore of a bench after the blast; p polygons.

    Attributes
    ----------
    polygon : array (n,), int64
        Of each ball; -1: waste.
    movement : GroupMovement
        Of the rock of each polygon.
    translated, outlined : list of p areas [m]
        See `METHODS`.
    blocks : dict of (column, row, flitch) to polygon
        Dig blocks assigned to ore, by number; column along x, row along y.
    results : list of OreResult
        Every polygon with every method.
    """

    polygon: IntArray
    movement: GroupMovement
    translated: list[Area]
    outlined: list[Area]
    blocks: dict[tuple[int, int, int], int]
    results: list[OreResult]


def ore_of_balls(position: FloatArray, polygons: Sequence[OrePolygon]) -> IntArray:
    """Return the polygon (n,) that holds each centre (n, 3) in plan, the first of several."""
    found = np.full(len(position), WASTE, dtype=np.int64)
    for number in reversed(range(len(polygons))):
        found[_inside([[polygons[number].corners]], position)] = number
    return found


def move_ore(
    before: Particles,
    after: Particles,
    polygons: Sequence[OrePolygon],
    *,
    density: float = 1.0,
    plan: DigPlan = DigPlan(),  # noqa: B008 - a record of constants
) -> OreMovement:
    """Follow the ore through the blast and dig it.

    Parameters
    ----------
    before, after : Particles
        The same balls in the same order.
    polygons : sequence of OrePolygon
    density : float [kg m-3]
        Of the balls.
    plan : DigPlan
    """
    count = len(polygons)
    owner = ore_of_balls(before.position, polygons)
    movement = group_movement(before, after, owner, count)
    way = np.nan_to_num(movement.displacement[:, :2])
    planned: list[Area] = [[[polygon.corners]] for polygon in polygons]
    translated: list[Area] = [
        [[polygon.corners + way[number]]] for number, polygon in enumerate(polygons)
    ]
    cell = plan.cell or 2.0 * float(after.radius.mean())
    outlined = [
        densest_area(after.position[owner == k], after.radius[owner == k], plan.share, cell)
        for k in range(count)
    ]
    mass = ball_mass(after.radius, density)
    blocks, dug_as = _dig_blocks(after.position, mass, owner, count, plan)
    dug: dict[str, list[BoolArray]] = {
        "as_planned": [_inside(area, after.position) for area in planned],
        "translated": [_inside(area, after.position) for area in translated],
        "outlined": [_inside(area, after.position) for area in outlined],
        "dig_blocks": [dug_as == k for k in range(count)],
    }
    results = [
        _result(polygons, k, method, owner, mass, dug[method][k])
        for k in range(count)
        for method in METHODS
    ]
    return OreMovement(
        polygon=owner,
        movement=movement,
        translated=translated,
        outlined=outlined,
        blocks=blocks,
        results=results,
    )


def _inside(area: Area, position: FloatArray) -> BoolArray:
    """Whether each centre (n, 3) lies in `area` in plan."""
    import shapely

    found = np.zeros(len(position), dtype=np.bool_)
    for outer, *holes in area:
        shape = shapely.Polygon(outer, holes)
        found |= shapely.contains_xy(shape, position[:, 0], position[:, 1])
    return found


def densest_area(position: FloatArray, radius: FloatArray, share: float, cell: float) -> Area:
    """Smallest area in plan that holds a share of the mass of balls.

    Mass per area is counted on a square grid and smoothed by a Gaussian of one cell (SciPy). The
    contour (contourpy) is at the density that the stated share of the mass exceeds where it lies:
    the highest density region of Hyndman (1996). Where the density is even, as in an undisturbed
    bench, any part of it would do, and the smoothing chooses the inner one.

    Parameters
    ----------
    position, radius : array (n, 3), (n,) [m]
    share, cell : float [-], [m]

    Returns
    -------
    Area
        Without parts below a hundredth of it; empty without balls.
    """
    if not len(radius):
        return []
    from contourpy import FillType, contour_generator
    from scipy.ndimage import gaussian_filter, map_coordinates

    low = np.floor(position[:, :2].min(axis=0) / cell) - 5.0
    size = (np.floor(position[:, :2].max(axis=0) / cell) + 6.0 - low).astype(int)
    at = np.floor(position[:, :2] / cell - low).astype(np.int64)
    weight = np.bincount(at[:, 1] * size[0] + at[:, 0], radius**3, minlength=int(size.prod()))
    density = gaussian_filter(weight.reshape(size[1], size[0]), 1.0, mode="constant")
    place = position[:, 1::-1] / cell - low[::-1] - 0.5
    level = mass_quantile(
        map_coordinates(density, place.T, order=1, mode="nearest"), radius, 1.0 - share
    )
    x, y = ((low[axis] + 0.5 + np.arange(size[axis])) * cell for axis in (0, 1))
    contours = contour_generator(x, y, density, fill_type=FillType.OuterOffset)
    filled: Any = contours.filled(level, 2.0 * density.max())
    rings = [
        [np.asarray(part[a:b]) for a, b in pairwise(ends)]
        for part, ends in zip(*filled, strict=True)
    ]
    return _without_specks(rings)


def area_size(area: Area) -> float:
    """Size [m2] of an area in plan."""
    import shapely

    return float(sum(shapely.Polygon(outer, holes).area for outer, *holes in area))


def _without_specks(area: Area) -> Area:
    least = _SPECK * area_size(area)
    return [part for part in area if area_size([part]) >= least]


def _dig_blocks(
    position: FloatArray, mass: FloatArray, owner: IntArray, count: int, plan: DigPlan
) -> tuple[dict[tuple[int, int, int], int], IntArray]:
    """Dig blocks assigned to ore, and the polygon (n,) as which each ball is dug."""
    sides = np.array([plan.block, plan.block, plan.flitch])
    number = np.floor(position / sides).astype(np.int64)
    cells, of_ball = np.unique(number, axis=0, return_inverse=True)
    of_ball = of_ball.reshape(-1)
    kinds = count + 1  # the last is waste
    kind = np.where(owner == WASTE, count, owner)
    held = np.bincount(of_ball * kinds + kind, mass, minlength=len(cells) * kinds)
    best = np.argmax(held.reshape(len(cells), kinds), axis=1)
    best[best == count] = WASTE
    blocks = {
        (int(cell[0]), int(cell[1]), int(cell[2])): int(polygon)
        for cell, polygon in zip(cells, best, strict=True)
        if polygon != WASTE
    }
    return blocks, best[of_ball].astype(np.int64)


def _result(
    polygons: Sequence[OrePolygon],
    number: int,
    method: str,
    owner: IntArray,
    mass: FloatArray,
    dug: BoolArray,
) -> OreResult:
    own = owner == number
    total, taken = float(mass[own].sum()), float(mass[dug].sum())
    kept = float(mass[own & dug].sum())
    others = dug & ~own & (owner != WASTE)
    grades = np.array([polygon.grade for polygon in polygons] + [0.0])
    in_dug = np.bincount(owner[dug] % len(grades), mass[dug], minlength=len(grades))
    metal = float(np.sum(in_dug[in_dug > 0.0] * grades[in_dug > 0.0]))
    return OreResult(
        polygon=polygons[number].name,
        method=method,
        mass=total,
        dug=taken,
        loss=1.0 - kept / total if total else nan,
        dilution=1.0 - kept / taken if taken else nan,
        other_ore=float(mass[others].sum()) / taken if taken else nan,
        grade=metal / taken if taken else nan,
    )


def ore_document(polygons: Sequence[OrePolygon], moved: OreMovement) -> Mapping[str, Any]:
    """Movement and digging of the ore as plain data, in SI units (grades as given)."""
    return {
        "polygons": [
            {
                "name": polygon.name,
                "grade": polygon.grade,
                "corners": polygon.corners,
                "displacement": moved.movement.displacement[k],
                "spread": moved.movement.spread[k],
                "balls": moved.movement.balls[k],
                "outline": [[ring.tolist() for ring in part] for part in moved.outlined[k]],
                "outline_area": area_size(moved.outlined[k]),
                "area": area_size([[polygon.corners]]),
            }
            for k, polygon in enumerate(polygons)
        ],
        "digging": [result._asdict() for result in moved.results],
    }
