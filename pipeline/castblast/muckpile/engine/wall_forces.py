"""Forces between balls and walls: where they touch, how they move there, what follows.

Arguments are plain arrays: these functions are compiled into the passes of the time loop.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from castblast.kernel import inline_kernel
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
            if len(dash) > 0:
                book_opening(work, w, memory, dash, p, law.shear_ratio, radius, slide, step)
            continue
        if not touching[p]:
            touching[p] = 1
            stiffness = wall_stiffness(radius, law.modulus)
            close_contact(memory, dash, p, stiffness, motion[i, 6])
        friction, rolling_friction = wall_friction(walls, k)
        kn = memory[p, 6]
        (px, py, pz), shear, moment, dashpot, turned, bent, cut, length, roll_cut, roll_length = (
            step_contact(
                law, friction, rolling_friction, nx, ny, nz, overlap, radius,
                slide[0], slide[1], slide[2], wx, wy, wz,
                0.5 * step * (wx * nx + wy * ny + wz * nz), step,
                memory[p, 0], memory[p, 1], memory[p, 2],
                memory[p, 3], memory[p, 4], memory[p, 5], kn, memory[p, 7],
            )
        )  # fmt: skip
        memory[p, 0], memory[p, 1], memory[p, 2] = shear
        memory[p, 3], memory[p, 4], memory[p, 5] = moment
        if len(dash) > 0:
            book_step(
                work, w, dash, p, law, radius, kn, step, (nx, ny, nz), slide, shear, moment,
                dashpot, turned, bent, cut, length, roll_cut, roll_length,
            )  # fmt: skip
        mx, my, mz = moment
        force[i, 0] += px
        force[i, 1] += py
        force[i, 2] += pz
        force[i, 3] += mx - arm * (ny * pz - nz * py)
        force[i, 4] += my - arm * (nz * px - nx * pz)
        force[i, 5] += mz - arm * (nx * py - ny * px)
