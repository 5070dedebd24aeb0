"""Where the content of a file lies against the bench: slips of grid, shift and unit show there.

A surface in the grid of a mine lies thousands of kilometres from a bench whose toe is at x = 0, and
one in millimetres is a thousand times as long as it: both would be simulated without a word, as if
there were no ground at all.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from castblast.muckpile.bench.geometry import Bench
from castblast.types import FloatArray

#: No rock of a bench flies this far [m], nor this many times the largest side of the bench.
_OUT_OF_REACH, _OUT_OF_REACH_SIDES = 500.0, 10.0
#: Distance [m] from which the place is worth a remark.
_APART = 50.0
#: No surface around a bench is longer than so many of its sides, within these bounds [m], and none
#: is shorter than this share of its height.
_LONGEST_SIDES, _LONGEST, _SHORTEST_SHARE = 500.0, (5e3, 2e4), 0.02
#: The same for what lies in the bench.
_LONGEST_INSIDE = 100.0
#: Units that files without units are most often in, besides metres.
_UNITS = {"mm": 1e-3, "cm": 1e-2, "km": 1e3}


class Extent(NamedTuple):
    """Least and largest coordinates (2,) or (3,) [m] of what a file holds."""

    low: FloatArray
    high: FloatArray


def extent(points: FloatArray) -> Extent:
    """Extent of points (..., 2 or 3) [m]; places with a NaN do not count."""
    flat = points.reshape(-1, points.shape[-1])
    flat = flat[np.isfinite(flat).all(axis=1)]
    return Extent(flat.min(axis=0), flat.max(axis=0))


def place_faults(
    where: Extent, bench: Bench, onto: str, written: Extent | None = None, *, inside: bool = False
) -> list[str]:
    """Say what rules out that something lies at the bench: its size, its distance, its level.

    Parameters
    ----------
    where : Extent
        In the frame of the bench.
    bench : Bench
    onto : str
        How to move it, for the message: ``"'shift' would have to be {offset}"``.
    written : Extent, optional
        As the file has it, where an offset counts from there.
    inside : bool
        It belongs into the bench; otherwise before its face.
    """
    side = max(bench.length, bench.width, bench.height)
    size = float((where.high - where.low)[:2].max())
    longest = float(np.clip(_LONGEST_SIDES * side, *_LONGEST))
    longest = _LONGEST_INSIDE * side if inside else longest
    if size > longest or size < _SHORTEST_SHARE * bench.height:
        return [_size_fault(size, side, inside)]
    reach = max(_OUT_OF_REACH, _OUT_OF_REACH_SIDES * side)
    away = plan_distance(where, bench)
    offset = offset_onto(written or where, bench if inside else None)
    if away > reach:
        return [
            f"lies {shown_length(away)} from the bench at its nearest ({_range(where)}); "
            + onto.format(offset=_shown_offset(offset))
        ]
    if len(where.low) == 3:
        above, below = where.low[2] - bench.height, -where.high[2]
        if max(above, below) > reach:
            word = "above the top" if above > below else "below the floor"
            return [
                f"lies {shown_length(max(above, below))} {word} of the bench; "
                + onto.format(offset=_shown_offset(offset))
            ]
    return []


def place_remarks(where: Extent, bench: Bench) -> list[str]:
    """Say what is odd about the place of something that may be right."""
    away = plan_distance(where, bench)
    if away > _APART:
        return [f"lies {shown_length(away)} from the bench at its nearest ({_range(where)})"]
    return []


def plan_distance(where: Extent, bench: Bench) -> float:
    """Distance [m] in plan from the bench, 0 where they touch or overlap."""
    low, high = np.array([-bench.width, 0.0]), np.array([0.0, bench.length])
    gap = np.maximum(np.maximum(low - where.high[:2], where.low[:2] - high), 0.0)
    return float(np.hypot(*gap))


def offset_onto(where: Extent, bench: Bench | None = None) -> FloatArray:
    """Whole metres that bring the least corner to the toe and the floor, or all into a bench."""
    if bench is None:
        return -np.round(where.low)
    middle = np.array([-bench.width, bench.length]) / 2.0
    aside = np.round(middle - (where.low + where.high)[:2] / 2.0)
    return np.concatenate([aside, -np.round(where.low[2:])])


def _size_fault(size: float, side: float, inside: bool) -> str:
    """Too long or too short, with the unit that would make it as large as a bench."""
    line = f"is {shown_length(size)} long, beside a bench of {side:g} m"
    for unit, factor in _UNITS.items():
        if 0.3 * side <= size * factor <= 300.0 * side:
            remedy = f"give heads with it, 'x [{unit}]'" if inside else f"then say 'unit: {unit}'"
            return f"{line}: are its lengths in {unit}? {remedy}"
    return line


def shown_length(length: float) -> str:
    """Write a length as people do: ``7,403 km``, ``120 m``, ``4.2 cm``."""
    if length >= 1e9:
        return f"{length * 1e-3:.3g} km"
    if length >= 1e4:
        return f"{length * 1e-3:,.0f} km"
    return f"{length:.3g} m" if length >= 1.0 else f"{length * 1e2:.3g} cm"


def _range(where: Extent) -> str:
    return " and ".join(
        f"{axis} from {low:.10g} to {high:.10g} m"
        for axis, low, high in zip("xy", where.low.round(1), where.high.round(1), strict=False)
    )


def _shown_offset(offset: FloatArray) -> str:
    # The sum takes the sign off a zero.
    return "[" + ", ".join(f"{value + 0.0:.0f} m" for value in offset) + "]"
