"""Forces of all contacts of one ball: where two partners touch, how they move there, what follows.

The geometry of a contact is made here and handed to the law; forces and moments go to the balls.
Arguments are plain arrays: these functions are compiled into the passes of the time loop.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from castblast.kernel import inline_kernel
from castblast.muckpile.contact import (
    Constants,
    ball_stiffness,
    close_contact,
    contact_force,
    open_contact,
    wall_stiffness,
)
from castblast.muckpile.facets import hand_over
from castblast.muckpile.particles import FloatArray, RealArray
from castblast.muckpile.walls import WallTable, wall_distance, wall_friction


@inline_kernel
def pair_forces(
    place: FloatArray,
    motion: RealArray,
    force: RealArray,
    partner: NDArray[np.int32],
    memory: RealArray,
    touching: NDArray[np.uint8],
    dash: RealArray,
    first: int,
    last: int,
    i: int,
    law: Constants,
    step: float,
    work: FloatArray,
    w: int,
) -> None:
    """Add the forces of the pairs first .. last - 1 of ball `i` to it and to its partners."""
    x, y, z, radius = place[i, 0], place[i, 1], place[i, 2], place[i, 3]
    ux, uy, uz = motion[i, 0], motion[i, 1], motion[i, 2]
    wx, wy, wz = motion[i, 3], motion[i, 4], motion[i, 5]
    fx, fy, fz, tx, ty, tz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for p in range(first, last):
        j = partner[p]
        dx, dy, dz = place[j, 0] - x, place[j, 1] - y, place[j, 2] - z
        square = dx * dx + dy * dy + dz * dz
        radii = radius + place[j, 3]
        if square >= radii * radii and not touching[p]:
            continue
        distance = sqrt(square)
        overlap = radii - distance
        per_distance = 1.0 / distance
        nx, ny, nz = dx * per_distance, dy * per_distance, dz * per_distance
        arm = radius - 0.5 * overlap
        other = place[j, 3] - 0.5 * overlap
        ax, ay, az = motion[j, 3], motion[j, 4], motion[j, 5]
        sx, sy, sz = arm * wx + other * ax, arm * wy + other * ay, arm * wz + other * az
        slide = (
            motion[j, 0] - ux - (sy * nz - sz * ny),
            motion[j, 1] - uy - (sz * nx - sx * nz),
            motion[j, 2] - uz - (sx * ny - sy * nx),
        )
        effective = radius * place[j, 3] / radii
        if overlap <= 0.0:
            # Two balls that just meet may pass the test above and yet have no overlap.
            if touching[p]:
                touching[p] = 0
                open_contact(memory, dash, p, law.shear_ratio, effective, slide, step, work, w)
            continue
        if not touching[p]:
            touching[p] = 1
            stiffness = ball_stiffness(radius, place[j, 3], law.modulus)
            mass = motion[i, 6] * motion[j, 6] / (motion[i, 6] + motion[j, 6])
            close_contact(memory, dash, p, stiffness, mass)
        (px, py, pz), (mx, my, mz) = contact_force(
            memory,
            dash,
            p,
            law,
            law.friction,
            law.rolling_friction,
            (nx, ny, nz),
            overlap,
            effective,
            slide,
            (ax - wx, ay - wy, az - wz),
            0.5 * ((wx + ax) * nx + (wy + ay) * ny + (wz + az) * nz),
            step,
            work,
            w,
        )
        cx, cy, cz = ny * pz - nz * py, nz * px - nx * pz, nx * py - ny * px
        fx -= px
        fy -= py
        fz -= pz
        tx -= arm * cx + mx
        ty -= arm * cy + my
        tz -= arm * cz + mz
        force[j, 0] += px
        force[j, 1] += py
        force[j, 2] += pz
        force[j, 3] += mx - other * cx
        force[j, 4] += my - other * cy
        force[j, 5] += mz - other * cz
    force[i, 0] += fx
    force[i, 1] += fy
    force[i, 2] += fz
    force[i, 3] += tx
    force[i, 4] += ty
    force[i, 5] += tz


@inline_kernel
def wall_forces(
    place: FloatArray,
    motion: RealArray,
    force: RealArray,
    partner: NDArray[np.int32],
    memory: RealArray,
    touching: NDArray[np.uint8],
    dash: RealArray,
    first: int,
    last: int,
    walls: WallTable,
    i: int,
    law: Constants,
    step: float,
    work: FloatArray,
    w: int,
) -> None:
    """Add the forces of the wall contacts first .. last - 1 of ball `i`."""
    radius = place[i, 3]
    if len(walls.facet) > 0:
        hand_over(walls, place, partner, memory, touching, dash, first, last, i)
    for p in range(first, last):
        k = partner[p]
        distance, (nx, ny, nz) = wall_distance(
            walls, k, place[i, 0], place[i, 1], place[i, 2], radius
        )
        overlap = radius - distance
        if overlap <= 0.0 and not touching[p]:
            continue
        wx, wy, wz = motion[i, 3], motion[i, 4], motion[i, 5]
        arm = radius - 0.5 * max(overlap, 0.0)
        slide = (
            motion[i, 0] - arm * (wy * nz - wz * ny),
            motion[i, 1] - arm * (wz * nx - wx * nz),
            motion[i, 2] - arm * (wx * ny - wy * nx),
        )
        if overlap <= 0.0:
            touching[p] = 0
            open_contact(memory, dash, p, law.shear_ratio, radius, slide, step, work, w)
            continue
        if not touching[p]:
            touching[p] = 1
            stiffness = wall_stiffness(radius, law.modulus)
            close_contact(memory, dash, p, stiffness, motion[i, 6])
        friction, rolling_friction = wall_friction(walls, k)
        (px, py, pz), (mx, my, mz) = contact_force(
            memory,
            dash,
            p,
            law,
            friction,
            rolling_friction,
            (nx, ny, nz),
            overlap,
            radius,
            slide,
            (wx, wy, wz),
            0.5 * (wx * nx + wy * ny + wz * nz),
            step,
            work,
            w,
        )
        force[i, 0] += px
        force[i, 1] += py
        force[i, 2] += pz
        force[i, 3] += mx - arm * (ny * pz - nz * py)
        force[i, 4] += my - arm * (nz * px - nx * pz)
        force[i, 5] += mz - arm * (nx * py - ny * px)
