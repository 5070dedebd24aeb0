"""The time loop: kick, drift, contact forces, kick.

Velocity Verlet with one force evaluation per step; the dashpots see the velocity of the half step,
as in the leapfrog of PFC and in LAMMPS. Both half kicks are always made apart, so that stopping
between two steps (for a picture, a firing, a sample) changes no bit of the motion. Left out:
multi-rate stepping and sleeping balls.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from castblast.kernel import inline_kernel, kernel, lean_kernel, parallel_kernel
from castblast.muckpile.contact import Constants
from castblast.muckpile.forces import pair_forces, wall_forces
from castblast.muckpile.neighbours import Balls, Contacts
from castblast.muckpile.particles import FloatArray, IntArray


@inline_kernel
def _kick(
    radius: float, motion: FloatArray, force: FloatArray, i: int, gravity: float, half: float
) -> None:
    """Half a step of acceleration for ball `i`, unless it is held."""
    if motion[i, 7] != 0.0:
        return
    per_mass = half / motion[i, 6]
    per_inertia = per_mass / (0.4 * radius * radius)
    motion[i, 0] += force[i, 0] * per_mass
    motion[i, 1] += force[i, 1] * per_mass
    motion[i, 2] += force[i, 2] * per_mass - gravity * half
    motion[i, 3] += force[i, 3] * per_inertia
    motion[i, 4] += force[i, 4] * per_inertia
    motion[i, 5] += force[i, 5] * per_inertia


@inline_kernel
def _drift(
    place: FloatArray,
    motion: FloatArray,
    force: FloatArray,
    reference: FloatArray,
    i: int,
    step: float,
    elapsed: float,
) -> float:
    """Move ball `i`, clear its force; return the square [m2] of its way off its straight path."""
    off = 0.0
    for axis in range(3):
        place[i, axis] += motion[i, axis] * step
        straight = reference[i, axis] + reference[i, axis + 3] * elapsed
        off += (place[i, axis] - straight) ** 2
        force[i, axis] = 0.0
        force[i, axis + 3] = 0.0
    return off


@lean_kernel
def _pass_pairs(
    balls: Balls,
    pairs: Contacts,
    slab: IntArray,
    first: int,
    last: int,
    parity: int,
    law: Constants,
    step: float,
    work: FloatArray,
) -> None:
    """Pair forces of the slabs of one parity in first .. last - 1."""
    place, motion, force = balls.place, balls.motion, balls.force
    start, partner, memory = pairs.start, pairs.partner, pairs.memory
    touching, dash = pairs.touching, pairs.dash
    for s in range(first + (first + parity) % 2, last, 2):
        for i in range(slab[s], slab[s + 1]):
            pair_forces(
                place, motion, force, partner, memory, touching, dash,
                start[i], start[i + 1], i, law, step, work, s,
            )  # fmt: skip


@lean_kernel
def _pass_balls(
    balls: Balls,
    touches: Contacts,
    walls: FloatArray,
    slab: IntArray,
    first: int,
    last: int,
    law: Constants,
    gravity: float,
    pending: float,
    step: float,
    elapsed: float,
    work: FloatArray,
) -> float:
    """End the pending step of the balls in slabs first .. last - 1, begin the next.

    A `pending` below zero: no step is under way. A `step` of zero: no other is begun. Returns the
    largest square [m2] of the way off the straight path.
    """
    place, motion, force = balls.place, balls.motion, balls.force
    reference = balls.reference
    start, partner, memory = touches.start, touches.partner, touches.memory
    touching, dash = touches.touching, touches.dash
    largest = 0.0
    for s in range(first, last):
        for i in range(slab[s], slab[s + 1]):
            if pending >= 0.0:
                if start[i] < start[i + 1]:
                    wall_forces(
                        place, motion, force, partner, memory, touching, dash,
                        start[i], start[i + 1], walls, i, law, pending, work, s,
                    )  # fmt: skip
                _kick(place[i, 3], motion, force, i, gravity, 0.5 * pending)
            if step > 0.0:
                _kick(place[i, 3], motion, force, i, gravity, 0.5 * step)
                off = _drift(place, motion, force, reference, i, step, elapsed)
                # A state that is not finite counts as far off.
                if not off <= largest:
                    largest = off if off == off else np.inf
    return largest


@parallel_kernel
def advance(
    balls: Balls,
    pairs: Contacts,
    touches: Contacts,
    walls: FloatArray,
    slab: IntArray,
    part: IntArray,
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
    walls : array (w, 20)
        See `castblast.muckpile.walls.wall_table`.
    slab : array (s + 1,)
        First ball of each slab.
    part : array (threads + 1,)
        First slab of each thread's share.
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
    workers = len(part) - 1
    off = np.zeros(workers)
    ended, begun = 0, 0
    if pending < 0.0:
        clock += step
        elapsed = clock - built
        for w in prange(workers):
            off[w] = _pass_balls(
                balls, touches, walls, slab, part[w], part[w + 1],
                law, gravity, -1.0, step, elapsed, work,
            )  # fmt: skip
        begun += 1
        pending = step
    while not (clock - built > horizon or not off.max() <= allowed * allowed):
        for parity in range(2):
            for w in prange(workers):
                _pass_pairs(balls, pairs, slab, part[w], part[w + 1], parity, law, pending, work)
        ended += 1
        following = step if ended < steps else 0.0
        elapsed = clock + following - built
        for w in prange(workers):
            off[w] = _pass_balls(
                balls, touches, walls, slab, part[w], part[w + 1],
                law, gravity, pending, following, elapsed, work,
            )  # fmt: skip
        if following == 0.0:
            return ended, begun, -1.0, clock
        begun += 1
        clock += following
        pending = step
    return ended, begun, pending, clock


@kernel
def first_forces(
    balls: Balls,
    pairs: Contacts,
    touches: Contacts,
    walls: FloatArray,
    law: Constants,
    gravity: float,
    work: FloatArray,
) -> None:
    """Forces of the initial state: springs by overlap, no shear and no moment yet."""
    balls.force[:] = 0.0
    everything = np.array([0, len(balls.place)])
    _pass_pairs(balls, pairs, everything, 0, 1, 0, law, 0.0, work)
    _pass_balls(balls, touches, walls, everything, 0, 1, law, gravity, 0.0, 0.0, 0.0, work)
