"""The stable step, and a survey of all contacts of a state.

The step is the rule of the PFC manual: the least sqrt(m/k) and sqrt(I/k_r) over balls and
directions, with the stiffnesses of the contacts of a ball summed (diagonal terms). The caller
multiplies it by a safety factor and by that of the damping.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from castblast.kernel import inline_kernel, kernel
from castblast.muckpile.contact import Constants, spring_energy, wall_stiffness
from castblast.muckpile.neighbours import Balls, Contacts
from castblast.muckpile.particles import FloatArray
from castblast.muckpile.walls import wall_distance


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
