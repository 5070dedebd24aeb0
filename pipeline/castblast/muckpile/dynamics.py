"""The time loop: kick, drift, contact forces, kick; and the stable step.

Velocity Verlet with one force evaluation per step; the dashpots see the velocity of the half step,
as in the leapfrog of PFC and in LAMMPS. Both half kicks are always made apart, so that stopping
between two steps (for a picture, a firing, a sample) changes no bit of the motion.

The step is the rule of the PFC manual: a safety factor times the least sqrt(m/k) and sqrt(I/k_r)
over balls and directions, with the stiffnesses of the contacts of a ball summed (diagonal terms)
and raised for damping. Left out: multi-rate stepping and sleeping balls.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import prange
from numpy.typing import NDArray

from castblast.kernel import inline_kernel, kernel, lean_kernel, parallel_kernel
from castblast.muckpile.contact import (
    Constants,
    contact_force,
    forget_contact,
    spring_energy,
    wall_stiffness,
)
from castblast.muckpile.neighbours import Balls, Contacts
from castblast.muckpile.particles import FloatArray, IntArray
from castblast.muckpile.walls import FRICTION, ROLLING_FRICTION, wall_distance


@inline_kernel
def _pair_forces(
    place: FloatArray,
    motion: FloatArray,
    force: FloatArray,
    partner: NDArray[np.int32],
    memory: FloatArray,
    touching: NDArray[np.uint8],
    dash: FloatArray,
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
        nx, ny, nz = dx / distance, dy / distance, dz / distance
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
            touching[p] = 0
            forget_contact(memory, dash, p, law.shear_ratio, effective, slide, step, work, w)
            continue
        touching[p] = 1
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
def _wall_forces(
    place: FloatArray,
    motion: FloatArray,
    force: FloatArray,
    partner: NDArray[np.int32],
    memory: FloatArray,
    touching: NDArray[np.uint8],
    dash: FloatArray,
    first: int,
    last: int,
    walls: FloatArray,
    i: int,
    law: Constants,
    step: float,
    work: FloatArray,
    w: int,
) -> None:
    """Add the forces of the wall contacts first .. last - 1 of ball `i`."""
    radius = place[i, 3]
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
            forget_contact(memory, dash, p, law.shear_ratio, radius, slide, step, work, w)
            continue
        touching[p] = 1
        (px, py, pz), (mx, my, mz) = contact_force(
            memory,
            dash,
            p,
            law,
            walls[k, FRICTION],
            walls[k, ROLLING_FRICTION],
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
            _pair_forces(
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
                    _wall_forces(
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


@kernel
def stable_step(
    balls: Balls, pairs: Contacts, touches: Contacts, walls: FloatArray, law: Constants
) -> float:
    """Return the least sqrt(m/k) or sqrt(I/k_r) [s] over all balls, undamped.

    Every ball is given at least one contact with a wall, since such a contact may form before the
    next check, and a fifth of its radius as the longest way of one step.
    """
    count = len(balls.place)
    stiffness = np.zeros((count, 6))
    for i in range(count):
        radius = balls.place[i, 3]
        for p in range(pairs.start[i], pairs.start[i + 1]):
            if pairs.touching[p]:
                j = pairs.partner[p]
                dx = balls.place[j, 0] - balls.place[i, 0]
                dy = balls.place[j, 1] - balls.place[i, 1]
                dz = balls.place[j, 2] - balls.place[i, 2]
                other = balls.place[j, 3]
                effective = radius * other / (radius + other)
                kn = pairs.memory[p, 6]
                _add_stiffness(stiffness, i, (dx, dy, dz), kn, law.shear_ratio, radius, effective)
                _add_stiffness(stiffness, j, (dx, dy, dz), kn, law.shear_ratio, other, effective)
        for p in range(touches.start[i], touches.start[i + 1]):
            if touches.touching[p]:
                _, normal = wall_distance(
                    walls,
                    touches.partner[p],
                    balls.place[i, 0],
                    balls.place[i, 1],
                    balls.place[i, 2],
                    radius,
                )
                kn = touches.memory[p, 6]
                _add_stiffness(stiffness, i, normal, kn, law.shear_ratio, radius, radius)
    least = np.inf
    for i in range(count):
        mass, radius = balls.motion[i, 6], balls.place[i, 3]
        alone = wall_stiffness(radius, law.modulus)
        for axis in range(3):
            k = max(stiffness[i, axis], alone)
            k_r = max(stiffness[i, axis + 3], 2.0 * alone * law.shear_ratio * radius * radius)
            least = min(least, mass / k, 0.4 * mass * radius * radius / k_r)
        speed = balls.motion[i, 0] ** 2 + balls.motion[i, 1] ** 2 + balls.motion[i, 2] ** 2
        least = min(least, 0.04 * radius * radius / speed)
    return sqrt(least)


@inline_kernel
def _add_stiffness(
    stiffness: FloatArray,
    i: int,
    along: tuple[float, float, float],
    kn: float,
    shear_ratio: float,
    radius: float,
    effective: float,
) -> None:
    """Add one contact to the diagonal of the stiffness of ball `i`."""
    length = sqrt(along[0] * along[0] + along[1] * along[1] + along[2] * along[2])
    ks = kn * shear_ratio
    for axis in range(3):
        share = (along[axis] / length) ** 2
        stiffness[i, axis] += (kn - ks) * share + ks
        stiffness[i, axis + 3] += ks * (radius * radius + effective * effective) * (1.0 - share)


@kernel
def survey(
    balls: Balls, pairs: Contacts, touches: Contacts, walls: FloatArray, law: Constants
) -> tuple[float, float, float, int, int]:
    """Elastic energy [J], largest overlap over radius, sum of overlaps [m], contacts of balls.

    The last number is the ball with the largest overlap.
    """
    energy, largest, total, contacts, worst = 0.0, 0.0, 0.0, 0, 0
    place = balls.place
    for i in range(len(place)):
        radius = place[i, 3]
        for p in range(pairs.start[i], pairs.start[i + 1]):
            if pairs.touching[p]:
                j = pairs.partner[p]
                square = 0.0
                for axis in range(3):
                    square += (place[j, axis] - place[i, axis]) ** 2
                radii = radius + place[j, 3]
                overlap = radii - sqrt(square)
                effective = radius * place[j, 3] / radii
                energy += spring_energy(pairs.memory, p, overlap, effective, law.shear_ratio)
                if overlap > largest * min(radius, place[j, 3]):
                    largest, worst = overlap / min(radius, place[j, 3]), i
                total += overlap
                contacts += 1
        for p in range(touches.start[i], touches.start[i + 1]):
            if touches.touching[p]:
                distance, _ = wall_distance(
                    walls, touches.partner[p], place[i, 0], place[i, 1], place[i, 2], radius
                )
                overlap = radius - distance
                energy += spring_energy(touches.memory, p, overlap, radius, law.shear_ratio)
                if overlap > largest * radius:
                    largest, worst = overlap / radius, i
    return energy, largest, total, contacts, worst
