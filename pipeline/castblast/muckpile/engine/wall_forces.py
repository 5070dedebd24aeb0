"""Forces between balls and walls: where they touch, how they move there, what follows.

Arguments are plain arrays: these functions are compiled into the passes of the time loop.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from castblast.kernel import inline_kernel
from castblast.muckpile.balls.columns import (
    DAMPING,
    FX,
    FY,
    FZ,
    MASS,
    MX,
    MY,
    MZ,
    RADIUS,
    ROLL_X,
    ROLL_Y,
    ROLL_Z,
    SHEAR_X,
    SHEAR_Y,
    SHEAR_Z,
    STIFFNESS,
    VX,
    VY,
    VZ,
    WX,
    WY,
    WZ,
    X,
    Y,
    Z,
)
from castblast.muckpile.balls.contact import Constants, close_contact, wall_stiffness
from castblast.muckpile.engine.contact_step import book_opening, book_step, step_contact
from castblast.muckpile.ground.facets import hand_over
from castblast.muckpile.ground.walls import WallTable, wall_distance, wall_friction
from castblast.types import FloatArray, Int32Array, RealArray


@inline_kernel
def wall_forces(
    place: FloatArray,
    motion: RealArray,
    force: RealArray,
    partner: Int32Array,
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
    radius = place[i, RADIUS]
    if len(walls.facet) > 0:
        hand_over(walls, place, partner, memory, touching, dash, first, last, i)
    for p in range(first, last):
        k = partner[p]
        distance, (nx, ny, nz) = wall_distance(
            walls, k, place[i, X], place[i, Y], place[i, Z], radius
        )
        overlap = radius - distance
        if overlap <= 0.0 and not touching[p]:
            continue
        wx, wy, wz = motion[i, WX], motion[i, WY], motion[i, WZ]
        arm = radius - 0.5 * max(overlap, 0.0)
        slide = (
            motion[i, VX] - arm * (wy * nz - wz * ny),
            motion[i, VY] - arm * (wz * nx - wx * nz),
            motion[i, VZ] - arm * (wx * ny - wy * nx),
        )
        if overlap <= 0.0:
            touching[p] = 0
            if len(dash) > 0:
                book_opening(work, w, memory, dash, p, law.shear_ratio, radius, slide, step)
            continue
        if not touching[p]:
            touching[p] = 1
            stiffness = wall_stiffness(radius, law.modulus)
            close_contact(memory, dash, p, stiffness, motion[i, MASS])
        friction, rolling_friction = wall_friction(walls, k)
        kn = memory[p, STIFFNESS]
        (px, py, pz), shear, moment, dashpot, turned, bent, cut, length, roll_cut, roll_length = (
            step_contact(
                law, friction, rolling_friction, nx, ny, nz, overlap, radius,
                slide[0], slide[1], slide[2], wx, wy, wz,
                0.5 * step * (wx * nx + wy * ny + wz * nz), step,
                memory[p, SHEAR_X], memory[p, SHEAR_Y], memory[p, SHEAR_Z],
                memory[p, ROLL_X], memory[p, ROLL_Y], memory[p, ROLL_Z], kn, memory[p, DAMPING],
            )
        )  # fmt: skip
        memory[p, SHEAR_X], memory[p, SHEAR_Y], memory[p, SHEAR_Z] = shear
        memory[p, ROLL_X], memory[p, ROLL_Y], memory[p, ROLL_Z] = moment
        if len(dash) > 0:
            book_step(
                work, w, dash, p, law, radius, kn, step, (nx, ny, nz), slide, shear, moment,
                dashpot, turned, bent, cut, length, roll_cut, roll_length,
            )  # fmt: skip
        mx, my, mz = moment
        force[i, FX] += px
        force[i, FY] += py
        force[i, FZ] += pz
        force[i, MX] += mx - arm * (ny * pz - nz * py)
        force[i, MY] += my - arm * (nz * px - nx * pz)
        force[i, MZ] += mz - arm * (nx * py - ny * px)
