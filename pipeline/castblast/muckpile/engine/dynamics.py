"""The time loop: kick, drift, contact forces, kick.

Velocity Verlet with one force evaluation per step; the dashpots see the velocity of the half step,
as in the leapfrog of PFC and in LAMMPS. Both half kicks are always made apart, so that stopping
between two steps (for a picture, a firing, a sample) changes no bit of the motion.

A step is one sweep over the slabs in order: when the pairs of a slab are done, its balls have all
their forces, nobody asks for their positions any more, and they are moved on at once while they
are in the cache. Several sweeps run side by side, each over a *chunk* of slabs; the last slab of a
chunk touches the next one, so its pairs are done before. The chunks do not depend on the number of
threads, hence neither does any sum. Left out: multi-rate stepping.
"""

from __future__ import annotations

import numpy as np
from numba import prange
from numpy.typing import NDArray

from castblast.kernel import inline_kernel, lean_kernel, parallel_kernel
from castblast.muckpile.balls.columns import (
    FX,
    FY,
    FZ,
    HELD,
    MASS,
    MX,
    MY,
    MZ,
    RADIUS,
    VX,
    VY,
    VZ,
    WX,
    WY,
    WZ,
)
from castblast.muckpile.balls.contact import Constants
from castblast.muckpile.balls.state import Balls, Contacts
from castblast.muckpile.engine.pair_forces import BLOCK_NAMES, BLOCK_NUMBERS, pair_forces
from castblast.muckpile.engine.wall_forces import wall_forces
from castblast.muckpile.ground.walls import WallTable
from castblast.types import FloatArray, Int32Array, IntArray, RealArray

#: Most sweeps that run side by side; more threads than that have nothing to do.
MOST_CHUNKS = 32
#: Least work of a chunk, in the unit of `cut_chunks`: balls and contacts.
LEAST_WORK = 2000


def cut_chunks(load: IntArray) -> IntArray:
    """Cut slabs into chunks of at least two slabs and about equal work.

    Parameters
    ----------
    load : array (s + 1,)
        Running total of the work of the slabs.

    Returns
    -------
    array (c + 1,)
        First slab of each chunk, and the number of slabs.
    """
    slabs = len(load) - 1
    chunks = max(1, min(MOST_CHUNKS, slabs // 3, int(load[-1]) // LEAST_WORK))
    cuts = np.searchsorted(load, load[-1] * np.arange(chunks + 1) / chunks).astype(np.int64)
    cuts[0], cuts[-1] = 0, slabs
    kept = [0]
    for cut in cuts[1:-1]:
        if cut >= kept[-1] + 2 and cut <= slabs - 2:
            kept.append(int(cut))
    return np.array([*kept, slabs], dtype=np.int64)


@inline_kernel
def _kick(
    motion: RealArray, force: RealArray, i: int, light: float, spin: float, fall: float
) -> None:
    """Half a step of acceleration: half step over mass, over moment of inertia, and g times it."""
    motion[i, VX] += force[i, FX] * light
    motion[i, VY] += force[i, FY] * light
    motion[i, VZ] += force[i, FZ] * light - fall
    motion[i, WX] += force[i, MX] * spin
    motion[i, WY] += force[i, MY] * spin
    motion[i, WZ] += force[i, MZ] * spin


@inline_kernel
def _drift(
    place: FloatArray,
    motion: RealArray,
    force: RealArray,
    paths: NDArray[np.float32],
    i: int,
    step: float,
    elapsed: float,
) -> float:
    """Move ball `i`, clear its force; return the square [m2] of its way off its straight path."""
    off = 0.0
    for axis in range(3):
        place[i, axis] += motion[i, axis] * step
        straight = paths[axis, i] + paths[axis + 3, i] * elapsed
        off += (place[i, axis] - straight) ** 2
        force[i, axis] = 0.0
        force[i, axis + MX] = 0.0
    return off


@lean_kernel
def _do_balls(
    balls: Balls,
    touches: Contacts,
    walls: WallTable,
    first: int,
    last: int,
    law: Constants,
    gravity: float,
    pending: float,
    step: float,
    elapsed: float,
    work: FloatArray,
    w: int,
) -> float:
    """Walls, second kick of the pending step, then first kick and drift of the next one.

    A negative `pending` or a zero `step` leaves out its part. Returns the largest square [m2] of
    the way off the straight path, `elapsed` after the lists were made.
    """
    place, motion, force, paths = balls.place, balls.motion, balls.force, balls.paths
    start, partner, memory = touches.start, touches.partner, touches.memory
    touching, dash = touches.touching, touches.dash
    largest = 0.0
    for i in range(first, last):
        if motion[i, HELD] != 0.0:
            continue
        per_mass = 0.5 / motion[i, MASS]
        per_inertia = per_mass / (0.4 * place[i, RADIUS] * place[i, RADIUS])
        if pending >= 0.0:
            if start[i] < start[i + 1]:
                wall_forces(
                    place, motion, force, partner, memory, touching, dash,
                    start[i], start[i + 1], walls, i, law, pending, work, w,
                )  # fmt: skip
            _kick(
                motion, force, i,
                per_mass * pending, per_inertia * pending, 0.5 * gravity * pending,
            )  # fmt: skip
        if step > 0.0:
            _kick(motion, force, i, per_mass * step, per_inertia * step, 0.5 * gravity * step)
            off = _drift(place, motion, force, paths, i, step, elapsed)
            # A state that is not finite counts as far off.
            if not off <= largest:
                largest = off if off == off else np.inf
    return largest


@lean_kernel
def _sweep(
    balls: Balls,
    pairs: Contacts,
    touches: Contacts,
    walls: WallTable,
    slab: IntArray,
    first: int,
    last: int,
    ends: bool,
    law: Constants,
    gravity: float,
    pending: float,
    step: float,
    elapsed: float,
    work: FloatArray,
    blocks: RealArray,
    names: Int32Array,
    b: int,
) -> float:
    """Pass over the slabs first .. last - 1; `ends`: no chunk follows, the last pairs are left."""
    largest = 0.0
    for s in range(first, last):
        here, there = slab[s], slab[s + 1]
        if pending >= 0.0 and (ends or s < last - 1):
            pair_forces(balls, pairs, here, there, law, pending, work, s, blocks, names, b)
        off = _do_balls(
            balls, touches, walls, here, there, law, gravity, pending, step, elapsed, work, s
        )
        largest = max(largest, off)
    return largest


@parallel_kernel
def advance(
    balls: Balls,
    pairs: Contacts,
    touches: Contacts,
    walls: WallTable,
    slab: IntArray,
    chunk: IntArray,
    law: Constants,
    gravity: float,
    steps: int,
    pending: float,
    step: float,
    clock: float,
    built: float,
    horizon: float,
    allowed: float,
    work: FloatArray,
) -> tuple[int, int, float, float]:
    """Make up to `steps` steps; stop early, inside a step, when the lists must be made anew.

    Parameters
    ----------
    balls : Balls
        In the order of their cells; changed in place, as the contacts.
    pairs, touches : Contacts
        Ball with ball, ball with wall.
    walls : WallTable
    slab : array (s + 1,)
        First ball of each slab.
    chunk : array (c + 1,)
        First slab of each chunk.
    law : Constants
    gravity : float [m s-2]
    steps : int
        Steps to end, with the pending one.
    pending : float [s]
        Length of the step that is under way (balls drifted, forces missing); negative: none.
    step : float [s]
        Length of the next steps.
    clock : float [s]
        Time of the present positions.
    built : float [s]
        Time at which the lists were made.
    horizon : float [s]
        Age up to which the lists are complete.
    allowed : float [m]
        Way off the straight path up to which they are.
    work : array (s, 3) [J]
        Dissipated work per slab, see `contact_force`.

    Returns
    -------
    ended, begun : int
        Number of steps.
    pending, clock : float
        As on entry. The clock is summed step by step, so that it is the same wherever one stops.
    """
    chunks = len(chunk) - 1
    off = np.zeros(chunks)
    blocks = np.empty(chunks * BLOCK_NUMBERS, balls.motion.dtype)
    names = np.empty(chunks * BLOCK_NAMES, np.int32)
    ended, begun = 0, 0
    while pending < 0.0 or not (clock - built > horizon or not off.max() <= allowed * allowed):
        following = step if pending < 0.0 or ended + 1 < steps else 0.0
        if pending >= 0.0:
            if chunks > 1:
                for c in prange(chunks - 1):
                    s = chunk[c + 1] - 1
                    pair_forces(
                        balls, pairs, slab[s], slab[s + 1], law, pending, work, s, blocks, names, c
                    )
            ended += 1
        elapsed = clock + following - built
        for c in prange(chunks):
            off[c] = _sweep(
                balls, pairs, touches, walls, slab, chunk[c], chunk[c + 1], c == chunks - 1,
                law, gravity, pending, following, elapsed, work, blocks, names, c,
            )  # fmt: skip
        if following == 0.0:
            return ended, begun, -1.0, clock
        begun += 1
        clock += following
        pending = step
    return ended, begun, pending, clock


@parallel_kernel
def present_forces(
    balls: Balls,
    pairs: Contacts,
    touches: Contacts,
    walls: WallTable,
    slab: IntArray,
    chunk: IntArray,
    law: Constants,
    work: FloatArray,
) -> None:
    """Forces of a state as it stands: no contact is loaded any further."""
    chunks = len(chunk) - 1
    blocks = np.empty(chunks * BLOCK_NUMBERS, balls.motion.dtype)
    names = np.empty(chunks * BLOCK_NAMES, np.int32)
    balls.force[:, 0:6] = 0.0
    for c in prange(chunks - 1):
        s = chunk[c + 1] - 1
        pair_forces(balls, pairs, slab[s], slab[s + 1], law, 0.0, work, s, blocks, names, c)
    for c in prange(chunks):
        _sweep(
            balls, pairs, touches, walls, slab, chunk[c], chunk[c + 1], c == chunks - 1,
            law, 0.0, 0.0, 0.0, 0.0, work, blocks, names, c,
        )  # fmt: skip
