"""Forces between balls, a block of contacts at a time.

Pairs that touch are collected; when a block is full, what their law needs is laid out number by
number, so that one vector instruction serves many contacts, and the results go back to the balls
one by one. The order is that of the list, hence no sum depends on how the work is shared out.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from castblast.kernel import fused_kernel, inline_kernel, lean_kernel
from castblast.muckpile.balls.columns import MASS, MX, RADIUS, WX, X, Y, Z
from castblast.muckpile.balls.contact import Constants, ball_stiffness, close_contact
from castblast.muckpile.balls.state import Balls, Contacts
from castblast.muckpile.engine.contact_step import book_opening, book_step, step_contact
from castblast.types import FloatArray, Int32Array, RealArray

#: Contacts of a block, and how many of them are computed together.
BLOCK, LANES = 32, 16

# Where each number of a block begins; x, y, z or parts of a kind follow one another.
_AWAY, _GAP, _RADIUS, _OTHER = 0, 3 * BLOCK, 4 * BLOCK, 5 * BLOCK
_SLIDE, _SPIN, _OTHER_SPIN = 6 * BLOCK, 9 * BLOCK, 12 * BLOCK
_SHEAR, _MOMENT, _KN, _DAMPING = 15 * BLOCK, 18 * BLOCK, 21 * BLOCK, 22 * BLOCK
_FORCE, _ARM, _OTHER_ARM = 23 * BLOCK, 26 * BLOCK, 29 * BLOCK
_NORMAL, _DASH, _TURNED, _BENT, _SLIP = (
    32 * BLOCK, 35 * BLOCK, 38 * BLOCK, 41 * BLOCK, 44 * BLOCK,
)  # fmt: skip
_EFFECTIVE, _STEP = 48 * BLOCK, 49 * BLOCK
#: Numbers of a block, and integers beside them.
BLOCK_NUMBERS, BLOCK_NAMES = 50 * BLOCK, 2 * BLOCK


@fused_kernel
def _get(block: RealArray, at: int) -> float:
    # Indices without a sign: one with a sign may count from the end, and then nothing is known
    # to be side by side.
    value: float = block[np.uint64(at)]
    return value


@fused_kernel
def _get3(block: RealArray, at: int) -> tuple[float, float, float]:
    return (
        block[np.uint64(at)],
        block[np.uint64(at + BLOCK)],
        block[np.uint64(at + 2 * BLOCK)],
    )


@fused_kernel
def _put3(block: RealArray, at: int, x: float, y: float, z: float) -> None:
    block[np.uint64(at)] = x
    block[np.uint64(at + BLOCK)] = y
    block[np.uint64(at + 2 * BLOCK)] = z


@fused_kernel
def _compute(block: RealArray, base: int, first: int, law: Constants) -> None:
    """Advance the LANES contacts of the block at `base`, from place `first` of it on."""
    step = block[np.uint64(base + _STEP)]
    for k in range(LANES):
        q = base + first + k
        dx, dy, dz = _get3(block, q + _AWAY)
        distance = sqrt(dx * dx + dy * dy + dz * dz)
        per_distance = law.one / distance
        nx, ny, nz = dx * per_distance, dy * per_distance, dz * per_distance
        radius, other = _get(block, q + _RADIUS), _get(block, q + _OTHER)
        radii = radius + other
        # From the difference of squares, which loses no digits in single precision.
        overlap = _get(block, q + _GAP) / (radii + distance)
        arm, other_arm = radius - law.half * overlap, other - law.half * overlap
        effective = radius * other / radii
        ux, uy, uz = _get3(block, q + _SLIDE)
        wx, wy, wz = _get3(block, q + _SPIN)
        ax, ay, az = _get3(block, q + _OTHER_SPIN)
        tx, ty, tz = arm * wx + other_arm * ax, arm * wy + other_arm * ay, arm * wz + other_arm * az
        sx, sy, sz = ux - (ty * nz - tz * ny), uy - (tz * nx - tx * nz), uz - (tx * ny - ty * nx)
        fx, fy, fz = _get3(block, q + _SHEAR)
        mx, my, mz = _get3(block, q + _MOMENT)
        force, shear, moment, dash, turned, bent, cut, length, roll_cut, roll_length = step_contact(
            law, law.friction, law.rolling_friction, nx, ny, nz, overlap, effective,
            sx, sy, sz, ax - wx, ay - wy, az - wz,
            law.half * step * ((wx + ax) * nx + (wy + ay) * ny + (wz + az) * nz), step,
            fx, fy, fz, mx, my, mz, _get(block, q + _KN), _get(block, q + _DAMPING),
        )  # fmt: skip
        px, py, pz = force
        cx, cy, cz = ny * pz - nz * py, nz * px - nx * pz, nx * py - ny * px
        bx, by, bz = moment
        _put3(block, q + _FORCE, px, py, pz)
        _put3(block, q + _ARM, arm * cx + bx, arm * cy + by, arm * cz + bz)
        _put3(block, q + _OTHER_ARM, bx - other_arm * cx, by - other_arm * cy, bz - other_arm * cz)
        _put3(block, q + _SHEAR, shear[0], shear[1], shear[2])
        _put3(block, q + _MOMENT, bx, by, bz)
        # For the ledger.
        _put3(block, q + _SLIDE, sx, sy, sz)
        _put3(block, q + _NORMAL, nx, ny, nz)
        _put3(block, q + _DASH, dash[0], dash[1], dash[2])
        _put3(block, q + _TURNED, turned[0], turned[1], turned[2])
        _put3(block, q + _BENT, bent[0], bent[1], bent[2])
        _put3(block, q + _SLIP, cut, length, roll_cut)
        block[np.uint64(q + _SLIP + 3 * BLOCK)] = roll_length
        block[np.uint64(q + _EFFECTIVE)] = effective


@inline_kernel
def _lay_out(
    place: FloatArray,
    motion: RealArray,
    memory: RealArray,
    touching: NDArray[np.uint8],
    dash: RealArray,
    law: Constants,
    step: float,
    work: FloatArray,
    w: int,
    block: RealArray,
    q: int,
    i: int,
    j: int,
    p: int,
) -> None:
    """Write what the law needs of contact `p` of the balls `i` and `j` at place `q` of the block.

    A contact that has opened gets no stiffness, so that nothing comes of it.
    """
    block[q + _RADIUS], block[q + _OTHER] = place[i, RADIUS], place[j, RADIUS]
    for axis in range(3):
        block[q + _SLIDE + axis * BLOCK] = motion[j, axis] - motion[i, axis]
        block[q + _SPIN + axis * BLOCK] = motion[i, axis + WX]
        block[q + _OTHER_SPIN + axis * BLOCK] = motion[j, axis + WX]
    if block[q + _GAP] <= 0.0:
        if touching[p] and len(dash) > 0:
            _book_opening(block, q, memory, dash, p, law, step, work, w)
        touching[p] = 0
        for word in range(8):
            block[q + _SHEAR + word * BLOCK] = 0.0
        return
    if not touching[p]:
        touching[p] = 1
        mass = motion[i, MASS] * motion[j, MASS] / (motion[i, MASS] + motion[j, MASS])
        stiffness = ball_stiffness(place[i, RADIUS], place[j, RADIUS], law.modulus)
        close_contact(memory, dash, p, stiffness, mass)
    for word in range(8):
        block[q + _SHEAR + word * BLOCK] = memory[p, word]


@lean_kernel
def _book_opening(
    block: RealArray,
    q: int,
    memory: RealArray,
    dash: RealArray,
    p: int,
    law: Constants,
    step: float,
    work: FloatArray,
    w: int,
) -> None:
    """Close the books of contact `p`, laid out at `q`."""
    radius, other = block[q + _RADIUS], block[q + _OTHER]
    dx, dy, dz = _get3(block, q + _AWAY)
    per_distance = 1.0 / sqrt(dx * dx + dy * dy + dz * dz)
    nx, ny, nz = dx * per_distance, dy * per_distance, dz * per_distance
    ux, uy, uz = _get3(block, q + _SLIDE)
    wx, wy, wz = _get3(block, q + _SPIN)
    ax, ay, az = _get3(block, q + _OTHER_SPIN)
    tx, ty, tz = radius * wx + other * ax, radius * wy + other * ay, radius * wz + other * az
    slide = (ux - (ty * nz - tz * ny), uy - (tz * nx - tx * nz), uz - (tx * ny - ty * nx))
    effective = radius * other / (radius + other)
    book_opening(work, w, memory, dash, p, law.shear_ratio, effective, slide, step)


@lean_kernel
def _give_back(
    force: RealArray,
    memory: RealArray,
    dash: RealArray,
    law: Constants,
    step: float,
    work: FloatArray,
    w: int,
    block: RealArray,
    base: int,
    count: int,
    partner: Int32Array,
    names: Int32Array,
    name: int,
) -> None:
    """Add the forces of a computed block to its balls, and keep the memory of its contacts."""
    for k in range(count):
        q, i, p = base + k, names[name + k], names[name + BLOCK + k]
        if block[q + _KN] == 0.0:
            continue
        j = partner[p]
        for axis in range(3):
            push = block[q + _FORCE + axis * BLOCK]
            force[i, axis] -= push
            force[j, axis] += push
            force[i, axis + MX] -= block[q + _ARM + axis * BLOCK]
            force[j, axis + MX] += block[q + _OTHER_ARM + axis * BLOCK]
        for word in range(6):
            memory[p, word] = block[q + _SHEAR + word * BLOCK]
        if len(dash) > 0:
            book_step(
                work, w, dash, p, law, block[q + _EFFECTIVE], block[q + _KN], step,
                _get3(block, q + _NORMAL), _get3(block, q + _SLIDE), _get3(block, q + _SHEAR),
                _get3(block, q + _MOMENT), _get3(block, q + _DASH), _get3(block, q + _TURNED),
                _get3(block, q + _BENT), block[q + _SLIP], block[q + _SLIP + BLOCK],
                block[q + _SLIP + 2 * BLOCK], block[q + _SLIP + 3 * BLOCK],
            )  # fmt: skip


@lean_kernel
def _finish_block(
    place: FloatArray,
    motion: RealArray,
    force: RealArray,
    partner: Int32Array,
    memory: RealArray,
    touching: NDArray[np.uint8],
    dash: RealArray,
    law: Constants,
    step: float,
    work: FloatArray,
    w: int,
    block: RealArray,
    base: int,
    names: Int32Array,
    name: int,
    count: int,
) -> None:
    """Do the `count` contacts that a block has collected."""
    for k in range(count):
        i, p = names[name + k], names[name + BLOCK + k]
        _lay_out(
            place, motion, memory, touching, dash, law, step, work, w, block, base + k,
            i, partner[p], p,
        )  # fmt: skip
    for first in range(0, count, LANES):
        _compute(block, base, first, law)
    _give_back(force, memory, dash, law, step, work, w, block, base, count, partner, names, name)


@lean_kernel
def pair_forces(
    balls: Balls,
    pairs: Contacts,
    first: int,
    last: int,
    law: Constants,
    step: float,
    work: FloatArray,
    w: int,
    blocks: RealArray,
    names: Int32Array,
    b: int,
) -> None:
    """Add the forces of the pairs of the balls first .. last - 1 to them and their partners.

    Parameters
    ----------
    balls : Balls
    pairs : Contacts
    first, last : int
    law : Constants
    step : float [s]
    work : array (k, 3) [J]
        Row `w` collects the work of slip, rolling slip and dashpots.
    blocks, names : array (m * BLOCK_NUMBERS,), (m * BLOCK_NAMES,)
        Room to work in; only block `b` is used.
    """
    place, motion, force = balls.place, balls.motion, balls.force
    start, partner, memory = pairs.start, pairs.partner, pairs.memory
    touching, dash = pairs.touching, pairs.dash
    base, name, count = b * BLOCK_NUMBERS, b * BLOCK_NAMES, 0
    blocks[base + _STEP] = step
    for i in range(first, last):
        x, y, z, radius = place[i, X], place[i, Y], place[i, Z], place[i, RADIUS]
        for p in range(start[i], start[i + 1]):
            j = partner[p]
            dx, dy, dz = place[j, X] - x, place[j, Y] - y, place[j, Z] - z
            radii = radius + place[j, RADIUS]
            gap = radii * radii - (dx * dx + dy * dy + dz * dz)
            at = base + count
            # Written in any case: whether a pair touches cannot be predicted.
            blocks[at + _AWAY], blocks[at + _AWAY + BLOCK] = dx, dy
            blocks[at + _AWAY + 2 * BLOCK], blocks[at + _GAP] = dz, gap
            names[name + count], names[name + BLOCK + count] = i, p
            count += (gap > 0.0) | (touching[p] != 0)
            if count == BLOCK:
                _finish_block(
                    place, motion, force, partner, memory, touching, dash, law, step, work, w,
                    blocks, base, names, name, count,
                )  # fmt: skip
                count = 0
    _finish_block(
        place, motion, force, partner, memory, touching, dash, law, step, work, w,
        blocks, base, names, name, count,
    )  # fmt: skip
