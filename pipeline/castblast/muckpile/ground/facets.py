"""Triangles as walls: what a ball meets of a triangulated surface, and a grid to find it.

A ball touches a surface where its centre is nearest to it: over a facet, or over a convex edge or
corner. Each facet answers for itself; an edge or corner is shared by several, and only the nearest
of them (the first among equals) may speak for it, so that a contact is never counted twice and
never lost: the nearest facet of all is never hidden. In a concave edge a ball touches both sides,
unless they are so nearly level that two contacts would be one and the same: then the nearer counts.
Sources: the nearest point of a triangle after Ericson (2005), the side of an edge or corner by the
angle-weighted normals of Baerentzen and Aanaes (2005); that edges and corners yield to facets is
the rule of Hu et al. (2013). Left out: facets much smaller than the balls, in whose hollows a ball
would have several contacts that a smooth surface has not.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from castblast.kernel import inline_kernel, kernel, lean_kernel
from castblast.muckpile.balls.columns import RADIUS, X, Y, Z
from castblast.muckpile.balls.contact import Vector
from castblast.types import FloatArray, Int32Array, IntArray, RealArray

#: Words of a row: corners (9), normal (3), normals of the edges ab, bc, ca (9) and of the corners
#: (9), friction, rolling friction, depth. NaN in the normal of an edge or corner: it cannot be
#: touched; zeros: it can from all sides.
FACET_WORDS = 33
# Corners a, b, c and normal; of the normals of edges and corners the first word.
_AX, _AY, _AZ, _BX, _BY, _BZ, _CX, _CY, _CZ, _NX, _NY, _NZ = range(12)
_ALONG_AB, _ALONG_BC, _ALONG_CA, _AT_A, _AT_B, _AT_C = 12, 15, 18, 21, 24, 27
FACET_FRICTION, FACET_ROLLING, FACET_DEPTH = 30, 31, 32
#: Of `WallTable.grid`.
_LOW_X, _LOW_Y, _PER_X, _PER_Y, _CELLS_X, _CELLS_Y, GRID_REACH = range(7)
#: Bit of `shared` for neighbours that make one contact with this facet where both are touched.
LEVEL = 8
#: Cosine of the angle between two contacts below which they are one: 20 degrees.
LEVEL_COSINE = 0.9396926207859084
#: Nearest points closer together than this share of their distance are one.
SAME_FOOT = 1e-6


class WallTable(NamedTuple):
    """All walls as kernels read them: plane k < w, or facet k - w.

    Flat, and arrays only, because loops over threads take no tuple inside a tuple.

    Attributes
    ----------
    plane : array (w, 20)
        Origin, both axes and normal (3 each), bounds (4), friction, rolling friction, rim and
        whether it is endless.
    facet : array (t, 33)
        See `FACET_WORDS`.
    start : array (t + 1,), int64
    around : array (q,), int32
        Facets that share a corner with facet k: ``around[start[k]:start[k + 1]]``.
    shared : array (q,), uint8
        Which corners of facet k they share, a bit each, and `LEVEL`.
    cell_start : array (nx ny + 1,), int64
    cell : array (c,), int32
        Facets over each cell of a grid in plan.
    span : array (t, 2), int32
        First cell of each facet along x and y.
    grid : array (7,)
        Lower corner [m] of the grid, cells per metre, number of cells along x and y, and over how
        many times its reach a ball must look around itself in plan.
    """

    plane: FloatArray
    facet: FloatArray
    start: IntArray
    around: Int32Array
    shared: NDArray[np.uint8]
    cell_start: IntArray
    cell: Int32Array
    span: Int32Array
    grid: FloatArray


@inline_kernel
def _edge_share(dot_start: float, dot_end: float) -> float:
    """Place along an edge, 0 to 1, of the foot of a point with these products with the edge."""
    length = dot_start - dot_end
    return dot_start / length if length > 0.0 else 0.0


@lean_kernel
def nearest_point(
    row: FloatArray, k: int, x: float, y: float, z: float
) -> tuple[float, float, float, float, int]:
    """Nearest point of facet `k` to (x, y, z): square distance, vector from it, and its feature.

    The feature is 0 for the face, otherwise the bits of the corners of the edge or corner.
    """
    ux, uy, uz = row[k, _BX] - row[k, _AX], row[k, _BY] - row[k, _AY], row[k, _BZ] - row[k, _AZ]
    vx, vy, vz = row[k, _CX] - row[k, _AX], row[k, _CY] - row[k, _AY], row[k, _CZ] - row[k, _AZ]
    ax, ay, az = x - row[k, _AX], y - row[k, _AY], z - row[k, _AZ]
    d1, d2 = ux * ax + uy * ay + uz * az, vx * ax + vy * ay + vz * az
    bx, by, bz = x - row[k, _BX], y - row[k, _BY], z - row[k, _BZ]
    d3, d4 = ux * bx + uy * by + uz * bz, vx * bx + vy * by + vz * bz
    cx, cy, cz = x - row[k, _CX], y - row[k, _CY], z - row[k, _CZ]
    d5, d6 = ux * cx + uy * cy + uz * cz, vx * cx + vy * cy + vz * cz
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        feature, px, py, pz = 1, ax, ay, az
    elif d3 >= 0.0 and d4 <= d3:
        feature, px, py, pz = 2, bx, by, bz
    elif d6 >= 0.0 and d5 <= d6:
        feature, px, py, pz = 4, cx, cy, cz
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        s = _edge_share(d1, d3)
        feature, px, py, pz = 3, ax - s * ux, ay - s * uy, az - s * uz
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        s = _edge_share(d2, d6)
        feature, px, py, pz = 5, ax - s * vx, ay - s * vy, az - s * vz
    elif va <= 0.0 and d4 >= d3 and d5 >= d6:
        s = _edge_share(d4 - d3, d6 - d5)
        feature = 6
        px, py, pz = bx - s * (vx - ux), by - s * (vy - uy), bz - s * (vz - uz)
    else:
        h = ax * row[k, _NX] + ay * row[k, _NY] + az * row[k, _NZ]
        feature, px, py, pz = 0, h * row[k, _NX], h * row[k, _NY], h * row[k, _NZ]
    return px * px + py * py + pz * pz, px, py, pz, feature


@inline_kernel
def _normal_word(feature: int) -> int:
    """First word of the normal that belongs to a feature."""
    if feature == 0:
        return _NX
    if feature == 3:
        return _ALONG_AB
    if feature == 6:
        return _ALONG_BC
    if feature == 5:
        return _ALONG_CA
    return _AT_A if feature == 1 else _AT_B if feature == 2 else _AT_C


@lean_kernel
def _hidden(
    table: WallTable,
    k: int,
    x: float,
    y: float,
    z: float,
    square: float,
    p: Vector,
    feature: int,
) -> bool:
    """Whether another facet speaks for the nearest point of facet `k`."""
    row = table.facet
    for q in range(table.start[k], table.start[k + 1]):
        shared = table.shared[q]
        j = table.around[q]
        other, ox, oy, oz, its_feature = nearest_point(row, j, x, y, z)
        if other > square:
            continue
        if other == square:
            # Of equals a face comes before an edge, then the lower number.
            ours, theirs = feature != 0, its_feature != 0
            if theirs > ours or (theirs == ours and j > k):
                continue
        if feature != 0 and (shared & feature) == feature:
            return True
        # Over a common edge or corner rounding may put the point on either side, or on both.
        apart = (ox - p[0]) ** 2 + (oy - p[1]) ** 2 + (oz - p[2]) ** 2
        if apart < SAME_FOOT * SAME_FOOT * square:
            return True
        dot = ox * p[0] + oy * p[1] + oz * p[2]
        if (
            shared & LEVEL
            and dot > 0.0
            and dot * dot > LEVEL_COSINE * LEVEL_COSINE * other * square
        ):
            return True
    return False


@lean_kernel
def facet_distance(
    table: WallTable, k: int, x: float, y: float, z: float, radius: float
) -> tuple[float, Vector]:
    """Distance [m] of a ball's centre from facet `k` and the unit vector from the facet to it.

    Negative behind the surface. Infinite where the ball cannot touch it: out of reach, hidden by
    another facet, deeper behind the surface than it holds, or at a rim that must not be touched.
    """
    row = table.facet
    square, px, py, pz, feature = nearest_point(row, k, x, y, z)
    word = _normal_word(feature)
    nx, ny, nz = row[k, word], row[k, word + 1], row[k, word + 2]
    side = px * nx + py * ny + pz * nz
    # A rim has no side: its normal is zero.
    within = radius if side >= 0.0 else radius * row[k, FACET_DEPTH]
    up = (row[k, _NX], row[k, _NY], row[k, _NZ])
    if not square < within * within or nx != nx:
        return inf, up
    if _hidden(table, k, x, y, z, square, (px, py, pz), feature):
        return inf, up
    if feature == 0:
        return side, up
    distance = sqrt(square)
    if distance < 1e-12 * radius:
        return distance, up
    sign = 1.0 if side >= 0.0 else -1.0
    return sign * distance, (sign * px / distance, sign * py / distance, sign * pz / distance)


@lean_kernel
def near_facets(
    table: WallTable,
    x: float,
    y: float,
    z: float,
    reach: float,
    found: Int32Array,
    at: int,
) -> int:
    """Count facets within `reach` of a point; write their wall numbers to ``found[at:]``.

    Nothing is written if `at` is negative. Behind a surface that holds deeper the reach is longer.
    """
    count = 0
    if len(table.facet) == 0:
        return count
    row, grid, planes = table.facet, table.grid, len(table.plane)
    wide, ny = reach * grid[GRID_REACH], int(grid[_CELLS_Y])
    low_x = max(int(np.floor((x - wide - grid[_LOW_X]) * grid[_PER_X])), 0)
    high_x = min(int(np.floor((x + wide - grid[_LOW_X]) * grid[_PER_X])), int(grid[_CELLS_X]) - 1)
    low_y = max(int(np.floor((y - wide - grid[_LOW_Y]) * grid[_PER_Y])), 0)
    high_y = min(int(np.floor((y + wide - grid[_LOW_Y]) * grid[_PER_Y])), ny - 1)
    for cx in range(low_x, high_x + 1):
        for cy in range(low_y, high_y + 1):
            c = cx * ny + cy
            for q in range(table.cell_start[c], table.cell_start[c + 1]):
                k = table.cell[q]
                # A facet over several cells counts in the first of them only.
                if cx != max(table.span[k, 0], low_x) or cy != max(table.span[k, 1], low_y):
                    continue
                square, px, py, pz, _ = nearest_point(row, k, x, y, z)
                behind = px * row[k, _NX] + py * row[k, _NY] + pz * row[k, _NZ] < 0.0
                within = reach * max(row[k, FACET_DEPTH], 1.0) if behind else reach
                if square < within * within:
                    if at >= 0:
                        found[at + count] = planes + k
                    count += 1
    return count


@kernel
def facet_height(table: WallTable, x: FloatArray, y: FloatArray, height: FloatArray) -> None:
    """Raise `height` (n,) [m] to that of the highest facet that faces up at x (n,), y (n,)."""
    row, grid = table.facet, table.grid
    nx, ny = int(grid[_CELLS_X]), int(grid[_CELLS_Y])
    for n in range(len(x)):
        i = int(np.floor((x[n] - grid[_LOW_X]) * grid[_PER_X]))
        j = int(np.floor((y[n] - grid[_LOW_Y]) * grid[_PER_Y]))
        # The upper rim belongs to the last cell.
        i = i - 1 if i == nx else i
        j = j - 1 if j == ny else j
        if i < 0 or i >= nx or j < 0 or j >= ny:
            continue
        c = i * ny + j
        for q in range(table.cell_start[c], table.cell_start[c + 1]):
            k = table.cell[q]
            if row[k, _NZ] <= 1e-9:
                continue
            ux, uy = row[k, _BX] - row[k, _AX], row[k, _BY] - row[k, _AY]
            vx, vy = row[k, _CX] - row[k, _AX], row[k, _CY] - row[k, _AY]
            px, py = x[n] - row[k, _AX], y[n] - row[k, _AY]
            area = ux * vy - uy * vx
            s, t = (px * vy - py * vx) / area, (ux * py - uy * px) / area
            if s >= -1e-12 and t >= -1e-12 and s + t <= 1.0 + 1e-12:
                rise = (row[k, _NX] * px + row[k, _NY] * py) / row[k, _NZ]
                height[n] = max(height[n], row[k, _AZ] - rise)


@lean_kernel
def hand_over(
    table: WallTable,
    place: FloatArray,
    partner: Int32Array,
    memory: RealArray,
    touching: NDArray[np.uint8],
    dash: RealArray,
    first: int,
    last: int,
    i: int,
) -> None:
    """Move the memory of a contact of ball `i` from the facet it leaves to the one it comes to.

    Of facets that open in the same step the deepest takes it. Contacts first .. last - 1 are the
    walls of the ball.
    """
    planes = len(table.plane)
    x, y, z, radius = place[i, X], place[i, Y], place[i, Z], place[i, RADIUS]
    for p in range(first, last):
        if not touching[p] or partner[p] < planes:
            continue
        left, _ = facet_distance(table, partner[p] - planes, x, y, z, radius)
        if left < radius:
            continue
        heir, least = -1, radius
        for q in range(first, last):
            if not touching[q] and partner[q] >= planes:
                distance, _ = facet_distance(table, partner[q] - planes, x, y, z, radius)
                if distance < least:
                    heir, least = q, distance
        if heir < 0:
            continue
        for word in range(memory.shape[1]):
            memory[heir, word] = memory[p, word]
        for word in range(6):
            memory[p, word] = 0.0
        if len(dash) > 0:
            for word in range(3):
                dash[heir, word] = dash[p, word]
                dash[p, word] = 0.0
        touching[heir], touching[p] = 1, 0
