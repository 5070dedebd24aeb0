"""Push overlapping balls apart, pair by pair, without forces or time.

Each pair is moved apart by its overlap, half each, in the order of the cells, sweep after sweep
(Gauss-Seidel), and every ball is put back inside the planes, or into the section of a body. Below
the density of random close packing this ends without overlaps. It replaces the growth of radii
(Lubachevsky and Stillinger 1990), which needs many more sweeps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import sqrt
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from castblast.kernel import kernel
from castblast.muckpile.bench.outline import Outline
from castblast.muckpile.engine.threads import require_threads
from castblast.muckpile.ground.walls import Walls
from castblast.muckpile.search.neighbours import make_grid, sort_by_cell
from castblast.muckpile.search.pair_search import list_pairs
from castblast.muckpile.search.paths import lay_out
from castblast.progress import ProgressCallback, silent
from castblast.types import FloatArray, Int32Array

#: Over the mean radius: skin of the pair list.
_SKIN = 0.4
_NONE_HELD = np.empty(0, dtype=np.bool_)
_NO_SIDES = np.empty((0, 5))

#: Told the state of the work, as arrays by name.
Look: TypeAlias = Callable[[dict[str, NDArray[Any]]], None]


def _pass_by(state: dict[str, NDArray[Any]]) -> None:
    """Look at nothing."""


def push_apart(
    position: FloatArray,
    radius: FloatArray,
    planes: Walls,
    tolerance: float = 0.01,
    most_sweeps: int = 2000,
    progress: ProgressCallback = silent,
    body: Outline | None = None,
    look: Look = _pass_by,
    resume: Mapping[str, NDArray[Any]] | None = None,
) -> FloatArray:
    """Return centres (n, 3) [m] without overlaps of more than `tolerance` mean radii.

    Parameters
    ----------
    position, radius : array (n, 3), (n,) [m]
    planes : Walls
        Only their endless planes are used; all balls end in front of them.
    tolerance : float [-]
    most_sweeps : int
        What is reached by then is returned.
    progress : callable
    body : Outline, optional
        Sides that hold the balls besides the planes; corners may point inwards.
    look : callable
        Told the state now and then, as arrays by name.
    resume : mapping, optional
        Such a state, to go on from to the same last bit.
    """
    require_threads()
    sides = _NO_SIDES if body is None else np.column_stack([body.corner, body.lean, body.sine])
    mean = float(np.mean(radius))
    place = np.column_stack([position, radius])
    identity = np.arange(len(radius))
    sweeps, overlap = 0, np.inf
    if resume is not None:
        place, identity = resume["place"].copy(), resume["identity"].copy()
        sweeps, overlap = int(resume["sweeps"]), float(resume["overlap"])
    while sweeps < most_sweeps and overlap > tolerance * mean:
        reach = 2.0 * float(radius.max()) + _SKIN * mean
        rows = np.column_stack([place[:, 0:3], np.zeros_like(place[:, 0:3])])
        grid = make_grid(place[:, 0:3].min(axis=0), place[:, 0:3].max(axis=0), reach, len(place))
        order, cell_start, slab = sort_by_cell(rows, grid)
        paths = lay_out(rows, place[:, 3], order, _SKIN * mean)
        place, identity = place[order], identity[order]
        start, partner = list_pairs(paths, _NONE_HELD, cell_start, slab, grid, 0.0)
        done, overlap = _sweep(
            place,
            start,
            partner,
            planes.origin,
            planes.normal,
            sides,
            0.5 * _SKIN * mean,
            tolerance * mean,
            most_sweeps - sweeps,
        )
        sweeps += done
        share = min(0.99, sweeps / most_sweeps)
        state = {"place": place, "identity": identity}
        look(state | {"sweeps": np.array(sweeps), "overlap": np.array(overlap)})
        progress(share, f"packing: overlaps up to {100.0 * overlap / mean:.0f} % of the radius")
    back = np.empty((len(radius), 3))
    back[identity] = place[:, 0:3]
    return back


@kernel
def _put_inside(place: FloatArray, i: int, sides: FloatArray) -> float:
    """Move ball `i` level into the section at its height; return by how much it stood out [m].

    Rows of `sides`: corner (2), its way per height (2), sine of the edge that begins there.
    """
    x, y, z = place[i, 0], place[i, 1], place[i, 2]
    count = len(sides)
    nearest, near_x, near_y, sine, inside = np.inf, x, y, 1.0, False
    for k in range(count):
        n = (k + 1) % count
        ax, ay = sides[k, 0] + z * sides[k, 2], sides[k, 1] + z * sides[k, 3]
        bx, by = sides[n, 0] + z * sides[n, 2], sides[n, 1] + z * sides[n, 3]
        ex, ey = bx - ax, by - ay
        along = min(max(((x - ax) * ex + (y - ay) * ey) / (ex * ex + ey * ey), 0.0), 1.0)
        px, py = ax + along * ex, ay + along * ey
        distance = sqrt((x - px) ** 2 + (y - py) ** 2)
        if distance < nearest:
            nearest, near_x, near_y, sine = distance, px, py, sides[k, 4]
        if (ay > y) != (by > y) and x < ax + (y - ay) * ex / ey:
            inside = not inside
    signed = nearest if inside else -nearest
    depth = place[i, 3] / sine - signed
    if depth <= 0.0 or nearest == 0.0:
        return 0.0
    place[i, 0] += depth * (x - near_x) / signed
    place[i, 1] += depth * (y - near_y) / signed
    return float(depth * sine)


@kernel
def _sweep(
    place: FloatArray,
    start: Int32Array,
    partner: Int32Array,
    origin: FloatArray,
    normal: FloatArray,
    sides: FloatArray,
    allowed: float,
    tolerance: float,
    most: int,
) -> tuple[int, float]:
    """Sweep until a ball has moved by `allowed`; return the sweeps and the largest overlap [m]."""
    first = place.copy()
    largest = np.inf
    for sweep in range(most):
        largest, way = 0.0, 0.0
        for i in range(len(place)):
            for p in range(start[i], start[i + 1]):
                j = partner[p]
                dx = place[j, 0] - place[i, 0]
                dy = place[j, 1] - place[i, 1]
                dz = place[j, 2] - place[i, 2]
                radii = place[i, 3] + place[j, 3]
                square = dx * dx + dy * dy + dz * dz
                if square < radii * radii:
                    distance = sqrt(square)
                    overlap = radii - distance
                    largest = max(largest, overlap)
                    # Two coincident centres part along z.
                    part = 0.5 * overlap / max(distance, 1e-12)
                    dz = max(dz, 1e-12) if distance < 1e-12 else dz
                    place[i, 0] -= part * dx
                    place[i, 1] -= part * dy
                    place[i, 2] -= part * dz
                    place[j, 0] += part * dx
                    place[j, 1] += part * dy
                    place[j, 2] += part * dz
        for i in range(len(place)):
            for k in range(len(origin)):
                depth = place[i, 3]
                for axis in range(3):
                    depth -= (place[i, axis] - origin[k, axis]) * normal[k, axis]
                if depth > 0.0:
                    largest = max(largest, depth)
                    for axis in range(3):
                        place[i, axis] += depth * normal[k, axis]
            if len(sides) > 0:
                largest = max(largest, _put_inside(place, i, sides))
            moved = 0.0
            for axis in range(3):
                moved += (place[i, axis] - first[i, axis]) ** 2
            way = max(way, moved)
        if largest <= tolerance or way > allowed * allowed:
            return sweep + 1, largest
    return most, largest
