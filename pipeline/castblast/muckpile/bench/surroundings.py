"""Floor and intact rock around a bench, as walls."""

from __future__ import annotations

from math import inf

from castblast.muckpile.bench.geometry import Bench
from castblast.muckpile.ground.walls import Walls, floor, join, plane, rectangle


def bench_walls(bench: Bench, *, rear: bool = True, ends: str = "open") -> Walls:
    """Floor and what stands around a bench.

    Parameters
    ----------
    bench : Bench
    rear : bool
        Intact rock behind the bench, with the ground on top of it.
    ends : {"open", "wall", "mirror"}
        At both ends of the bench: nothing; intact rock beside the bench, as high as it;
        frictionless planes of any extent, i.e. the bench is a slice of a long one.

    Raises
    ------
    ValueError
        `ends` is not one of the three words.
    """
    width, length, height = bench.width, bench.length, bench.height
    parts = [floor()]
    if rear:
        parts.append(
            rectangle((-width, 0, 0), (0, 1, 0), (0, 0, 1), (-inf, inf, -inf, height), rim=False)
        )
        parts.append(rectangle((-width, 0, height), (1, 0, 0), (0, 1, 0), (-inf, 0, -inf, inf)))
    if ends == "wall":
        parts += [_end_rock(0.0, -1.0, height), _end_rock(length, 1.0, height)]
    elif ends == "mirror":
        parts.append(plane((0, 0, 0), (0, 1, 0), friction=0.0))
        parts.append(plane((0, length, 0), (0, -1, 0), friction=0.0))
    elif ends != "open":
        message = f"ends = {ends!r}: must be 'open', 'wall' or 'mirror'"
        raise ValueError(message)
    return join(*parts)


def _end_rock(y: float, side: float, height: float) -> Walls:
    """Intact rock beyond the end `y` of a bench, outwards along `side` (-1 or 1): three walls."""
    beyond = (-inf, 0.0) if side < 0.0 else (0.0, inf)
    flank = (
        rectangle((0, y, 0), (0, 0, 1), (1, 0, 0), (-inf, height, -inf, 0), rim=False)
        if side < 0.0
        else rectangle((0, y, 0), (1, 0, 0), (0, 0, 1), (-inf, 0, -inf, height), rim=False)
    )
    front = rectangle((0, y, 0), (0, 1, 0), (0, 0, 1), (*beyond, -inf, height))
    top = rectangle((0, y, height), (1, 0, 0), (0, 1, 0), (-inf, 0, *beyond))
    return join(flank, front, top)
