"""A CSV file of blast holes: where they stand, when they fire, and what is special about each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from castblast.design.variables import INPUT_NAMES
from castblast.errors import SpecError
from castblast.muckpile.bench.geometry import Bench, assign_blocks, bench_outline, block_centres
from castblast.muckpile.bench.outline import depth_inside
from castblast.specs.bench.firing import THROW_AZIMUTH, THROW_ELEVATION
from castblast.specs.bench.frame import GRID_PLACE, FrameSpec, suggest_frame
from castblast.specs.bench.tie_up import firing_times
from castblast.specs.quantity import QuantityIn, VariableIn
from castblast.specs.tables.table import ID_HEADS, Form, Table, read_table
from castblast.types import FloatArray, IntArray

_FROM_BENCH = ("bench_height", "face_angle")
#: Two holes closer than this share of burden and spacing are one, where balls go to the nearest.
_TOO_CLOSE = 0.25
#: So many holes outside the bench are slips; more of them, and most, stand in another frame.
_A_FEW = 3
_FORM = Form(
    columns={
        "x": GRID_PLACE,
        "y": GRID_PLACE,
        "delay": QuantityIn("s", 0.0, 60.0),
        "connector_delay": QuantityIn("s", 0.0, 10.0),
        "velocity": QuantityIn("m s-1", 0.0, 100.0),
        "direction": THROW_AZIMUTH,
        "elevation": THROW_ELEVATION,
        "charge_mass": QuantityIn("kg", above=0.0, upper=1e5),
        **{name: VariableIn(name) for name in INPUT_NAMES if name not in _FROM_BENCH},
    },
    required=("x", "y", "delay"),
    texts=("explosive", "from_hole"),
    aliases={
        "easting": "x",
        "northing": "y",
        "firing_time": "delay",
        "diameter": "hole_diameter",
        "explosive_mass": "charge_mass",
        "charge_weight": "charge_mass",
        "stemming": "stemming_length",
    },
    ids=ID_HEADS,
    unique_ids=True,
    instead={"delay": ("from_hole", "connector_delay")},
    hint="; or say in the bench file which columns they are, by head or number: "
    "'firing: {columns: {x: Collar X [m], y: 5 [m], ...}}'",
)
_STRING_FILE = (
    "is a string file (.str), without heads and delays; a CSV with x [m], y [m], delay [ms] is "
    "needed"
)


class Holes(NamedTuple):
    """Holes of a plan, n of them.

    Attributes
    ----------
    place : array (n, 2) [m]
    delay : array (n,) [s]
    velocity : array (n,) [m s-1]
        NaN: that of the bench file.
    direction, elevation : array (n,) [rad]
        Of the throw; NaN: that of the bench file.
    design : list of dict
        Explosive and variables in SI units in which a hole differs from the design of the bench
        file; ``charge_mass`` [kg] besides.
    where : list of str
        File and line of each hole, and its id if it has one, for messages.
    label : list of str
        Ids of the holes; empty where the file has none.
    """

    place: FloatArray
    delay: FloatArray
    velocity: FloatArray
    direction: FloatArray
    elevation: FloatArray
    design: list[dict[str, Any]]
    where: list[str]
    label: list[str]


def read_holes(
    path: Path,
    bench: Bench,
    *,
    by_block: bool,
    frame: FrameSpec | None = None,
    columns: Mapping[str, str] | None = None,
) -> Holes:
    """Read and check a file of holes.

    Parameters
    ----------
    path : Path
        CSV with ``x [m], y [m], delay [ms]`` (or ``from_hole`` and ``connector_delay [ms]``, which
        are summed along the tie-up), optionally ids,  ``velocity [m/s]``, ``direction [deg]``,
        ``elevation [deg]``, ``explosive``, ``charge_mass [kg]`` and any input variable.
    bench : Bench
        Holes must stand inside it.
    by_block : bool
        Each hole has a block of burden by spacing to itself; otherwise holes may stand anywhere but
        on the same spot.

    Raises
    ------
    SpecError
        One line per fault, with file and line.
    """
    if path.suffix.lower() == ".str":
        raise SpecError(f"{path}: {_STRING_FILE}")
    table = read_table(path, replace(_FORM, chosen=columns or {}))
    delay = table.number.get("delay")
    if delay is None:
        delay = firing_times(table, "from_hole", "connector_delay")
    place = np.column_stack([table.number["x"], table.number["y"]])
    if frame is not None:
        place = frame.to_bench(place)
    faults = _place_faults(table, place, delay, bench, frame)
    faults += _shared_blocks(table, place, bench) if by_block else _close(table, place, bench)
    if faults:
        raise SpecError("\n".join(faults))
    number = table.number
    nothing = np.full(len(place), np.nan)
    return Holes(
        place=place,
        delay=delay,
        velocity=number.get("velocity", nothing),
        direction=number.get("direction", nothing),
        elevation=number.get("elevation", nothing),
        design=_designs(table),
        where=[table.where(k) for k in range(len(table.line))],
        label=table.label,
    )


def blocks_of_holes(holes: Holes, bench: Bench) -> IntArray:
    """Return the hole (blocks,) that fires each block; -1: none.

    A block without a hole of its own goes with the nearest one within the diagonal of a block, so
    that the ends of staggered rows are not left standing.
    """
    own = assign_blocks(_level(holes.place), bench)
    centre = block_centres(bench)
    away = np.linalg.norm(centre[:, None, :] - holes.place[None, :, :], axis=2)
    nearest = np.argmin(away, axis=1)
    reach = float(np.hypot(bench.burden, bench.spacing))
    hole = np.where(away[np.arange(len(centre)), nearest] <= reach, nearest, -1)
    hole[own] = np.arange(len(own))
    return np.asarray(hole, dtype=np.int64)


def _level(place: FloatArray) -> FloatArray:
    return np.column_stack([place, np.zeros(len(place))])


def _place_faults(
    table: Table, place: FloatArray, delay: FloatArray, bench: Bench, frame: FrameSpec | None
) -> list[str]:
    """Say which holes stand outside the bench; where most do, what would bring them onto it."""
    outside = depth_inside(bench_outline(bench), _level(place)) < -1e-9
    room = f"the bench, {-bench.width:g} to 0 m in x and 0 to {bench.length:g} m in y"
    if outside.sum() <= max(_A_FEW, 0.5 * len(place)):
        return [
            f"{table.where(k)}: the hole at x = {place[k, 0]:g} m, y = {place[k, 1]:g} m stands "
            f"outside {room}"
            for k in np.flatnonzero(outside).tolist()
        ]
    size = np.ptp(place, axis=0)
    count = "all" if outside.all() else f"{outside.sum()} of {len(place)}"
    found = (
        f"{table.path}: {count} holes stand outside {room}: x is {place[:, 0].min():.10g} to "
        f"{place[:, 0].max():.10g} m, y {place[:, 1].min():.10g} to {place[:, 1].max():.10g} m"
    )
    grid = np.column_stack([table.number["x"], table.number["y"]])
    suggested = suggest_frame(grid, delay, bench)
    if suggested is None:
        return [
            f"{found}; {size[0]:.4g} x {size[1]:.4g} m are more than the bench holds: check the "
            f"units of x and y, and the size of the bench"
        ]
    lead = "places in a mine grid need" if frame is None else "the frame of the bench file may be"
    return [f"{found}; {lead} '{suggested.words()}'"]


def _shared_blocks(table: Table, place: FloatArray, bench: Bench) -> list[str]:
    first: dict[int, int] = {}
    faults = []
    for k, block in enumerate(assign_blocks(_level(place), bench).tolist()):
        if block in first:
            faults.append(
                f"{_pair(table, first[block], k)}: two holes "
                f"on block {block}, {bench.burden:g} x {bench.spacing:g} m; set 'firing.blocks: "
                f"nearest_hole' for holes off the grid"
            )
        first.setdefault(block, k)
    return faults


def _close(table: Table, place: FloatArray, bench: Bench) -> list[str]:
    from scipy.spatial import cKDTree

    reach = _TOO_CLOSE * min(bench.burden, bench.spacing)
    return [
        f"{_pair(table, i, j)}: two holes on one block, "
        f"{np.linalg.norm(place[i] - place[j]):.2g} m apart; at least {reach:g} m is needed"
        for i, j in sorted(cKDTree(place).query_pairs(reach))
    ]


def _pair(table: Table, one: int, other: int) -> str:
    """File and lines of two holes, and their ids."""
    lines = f"{table.path}: lines {table.line[one]} and {table.line[other]}"
    return f"{lines} ({table.label[one]}, {table.label[other]})" if table.label else lines


def _designs(table: Table) -> list[dict[str, Any]]:
    names = [name for name in table.number if name in INPUT_NAMES or name == "charge_mass"]
    designs: list[dict[str, Any]] = []
    for k in range(len(table.line)):
        design: dict[str, Any] = {
            name: float(table.number[name][k])
            for name in names
            if np.isfinite(table.number[name][k])
        }
        if table.text.get("explosive", [""] * len(table.line))[k]:
            design["explosive"] = table.text["explosive"][k]
        designs.append(design)
    return designs
