"""Walls around a bench: those that hold a packing while it settles, and rock beside a polygon.

A convex bench is held by endless planes. Where a corner points into the bench no endless plane can
stand; there every side is a stack of strips that end where the side ends at their height, so that
leaning sides meet within a strip. The strips of one side do not overlap and have no friction: a
ball that crosses a seam feels one plane.
"""

from __future__ import annotations

from itertools import pairwise
from math import ceil, inf, sqrt

import numpy as np

from castblast.muckpile.bench.geometry import Bench, bench_outline
from castblast.muckpile.bench.outline import FREE, ROCK, Outline, is_convex, section_at
from castblast.muckpile.ground.walls import Walls, floor, join, plane, rectangle
from castblast.types import FloatArray


def holding_walls(bench: Bench, mean_radius: float) -> Walls:
    """Frictionless walls on all sides of the bench, and a floor with friction."""
    outline = bench_outline(bench)
    if is_convex(outline):
        return join(floor(), *_planes(outline))
    return join(floor(), *_strips(outline, bench.height, mean_radius))


def parting_planes(bench: Bench) -> Walls:
    """Endless planes between which balls are pushed apart: with a lid, and sides if convex."""
    outline = bench_outline(bench)
    sides = _planes(outline) if is_convex(outline) else []
    return join(floor(), *sides, plane((0, 0, bench.height), (0, 0, -1), 0.0))


def _inwards(outline: Outline, k: int) -> FloatArray:
    """Unit normal (3,) of side `k`, into the bench: down where the side leans back."""
    sine = float(outline.sine[k])
    return np.array([*(-sine * outline.normal[k]), -sqrt(max(1.0 - sine * sine, 0.0))])


def _planes(outline: Outline) -> list[Walls]:
    return [
        plane((*outline.corner[k], 0.0), _inwards(outline, k), 0.0)
        for k in range(len(outline.corner))
    ]


def _strips(outline: Outline, height: float, mean_radius: float) -> list[Walls]:
    """Sides of a body with inward corners; they reach above it, for balls that stand out."""
    walls = []
    top = height + 4.0 * mean_radius
    count = len(outline.corner)
    for k in range(count):
        following = (k + 1) % count
        tapered = np.any(outline.lean[[k, following]] != 0.0)
        number = max(1, ceil(top / mean_radius)) if tapered else 1
        levels = np.linspace(0.0, top, number + 1)
        # The lowest strip reaches below the floor, so that a ball pressed into it is held.
        for low, high in pairwise(levels):
            section = section_at(outline, 0.5 * (low + high))
            start, end = section[k], section[following]
            reach = 0.5 * (high - low) / outline.sine[k]
            below = inf if low == 0.0 else reach
            above = inf if high == top else reach
            along = np.array([*(end - start), 0.0])
            length = float(np.linalg.norm(along))
            down = np.cross(_inwards(outline, k), along / length)
            bounds = (0.0, length, -above, below)
            place = (*start, 0.5 * (low + high))
            walls.append(rectangle(place, along, down, bounds, 0.0, rim=False))
    return walls + [_corner(outline, k) for k in range(count) if _turns_in(outline, k)]


def _corner(outline: Outline, k: int) -> Walls:
    """The edge of an inward corner: a wall without width, touched at its rim only."""
    up = np.array([*outline.lean[k], 1.0])
    across = np.cross(up, (1.0, 0.0, 0.0))
    return rectangle((*outline.corner[k], 0.0), across, up, (0.0, 0.0, -inf, inf), 0.0)


def _turns_in(outline: Outline, k: int) -> bool:
    """Whether corner `k` points into the bench: there a ball may touch the edge itself."""
    a, b = outline.normal[k - 1], outline.normal[k]
    return bool(a[0] * b[1] - a[1] * b[0] < -1e-9)


def rock_walls(bench: Bench) -> Walls:
    """Floor, and the rock that stands beside the rock edges of a polygon bench.

    Each such side is a vertical wall as long as its edge and without end upwards. Where it meets a
    free or an open edge, rock also stands beyond the corner, in line with that edge.
    """
    outline = bench_outline(bench)
    corner, normal, kinds = outline.corner, outline.normal, bench.edges
    count = len(corner)
    parts = [floor()]
    for k in range(count):
        following = (k + 1) % count
        along = corner[following] - corner[k]
        if kinds[k] != ROCK:
            continue
        length = float(np.linalg.norm(along))
        parts.append(_upright(corner[k], along, -normal[k], length))
        if kinds[k - 1] == FREE and not _turns_in(outline, k):
            beyond = corner[k] - corner[k - 1]
            parts.append(_upright(corner[k], beyond, normal[k - 1], inf))
        if kinds[following] == FREE and not _turns_in(outline, following):
            beyond = corner[following] - corner[(following + 1) % count]
            parts.append(_upright(corner[following], beyond, normal[following], inf))
    return join(*parts)


def _upright(start: FloatArray, along: FloatArray, facing: FloatArray, length: float) -> Walls:
    """Vertical wall from `start` (2,) over `length` [m]; those without end have a rim to touch."""
    first, out = np.array([*along, 0.0]), np.array([*facing, 0.0])
    return rectangle(
        (*start, 0.0), first, np.cross(out, first), (0.0, length, -inf, inf), rim=length == inf
    )
