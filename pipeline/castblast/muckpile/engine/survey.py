"""Looks at a running simulation: energies of balls and contacts, how fast and how far balls go.

Sums are formed slab by slab, or in a fixed number of pieces, and do not depend on threads.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numba import prange

from castblast.kernel import lean_kernel, parallel_kernel
from castblast.muckpile.balls.columns import MASS, RADIUS, WX, X, Y, Z
from castblast.muckpile.balls.contact import Constants, spring_energy
from castblast.muckpile.balls.state import Balls, Contacts
from castblast.muckpile.engine.threads import require_threads
from castblast.muckpile.ground.walls import WallTable, wall_distance
from castblast.muckpile.search.neighbours import PIECES
from castblast.types import FloatArray, IntArray, RealArray

#: Overlap over the radius of the smaller ball from which a contact counts as deep.
DEEP = 0.5

# Columns of the sums over balls: mass, m v^2, I w^2, and from the last on m times place.
_MASS, _TRANSLATION, _ROTATION, _FIRST_MOMENT = 0, 1, 2, 3
# Columns of the survey of a slab, in the order of `ContactSurvey`.
_ENERGY, _LARGEST, _TOTAL, _CONTACTS, _WORST, _DEEP_ONES = 0, 1, 2, 3, 4, 5


class BallSurvey(NamedTuple):
    """The balls at one moment.

    Attributes
    ----------
    mass : float [kg]
    translational_energy, rotational_energy : float [J]
    centre_of_mass : array (3,) [m]
    """

    mass: float
    translational_energy: float
    rotational_energy: float
    centre_of_mass: FloatArray


def survey_balls(balls: Balls) -> BallSurvey:
    """Energies and means of all balls."""
    require_threads()
    sums = _sum_balls(balls).sum(axis=0)
    mass, translation, rotation = map(float, sums[:_FIRST_MOMENT])
    return BallSurvey(
        mass=mass,
        translational_energy=0.5 * translation,
        rotational_energy=0.5 * rotation,
        centre_of_mass=sums[_FIRST_MOMENT:] / mass,
    )


@parallel_kernel
def _sum_balls(balls: Balls) -> FloatArray:
    count = len(balls.place)
    sums = np.zeros((PIECES, 6))
    for piece in prange(PIECES):
        _sum_piece(
            balls.place, balls.motion,
            piece * count // PIECES, (piece + 1) * count // PIECES, sums, piece,
        )  # fmt: skip
    return sums


@lean_kernel
def _sum_piece(
    place: FloatArray, motion: RealArray, first: int, last: int, sums: FloatArray, piece: int
) -> None:
    for i in range(first, last):
        mass = float(motion[i, MASS])
        speed, spin = 0.0, 0.0
        for axis in range(3):
            speed += float(motion[i, axis]) ** 2
            spin += float(motion[i, axis + WX]) ** 2
            sums[piece, _FIRST_MOMENT + axis] += mass * place[i, axis]
        sums[piece, _MASS] += mass
        sums[piece, _TRANSLATION] += mass * speed
        sums[piece, _ROTATION] += 0.4 * mass * place[i, RADIUS] * place[i, RADIUS] * spin


@parallel_kernel
def first_bad_ball(balls: Balls, farthest: float) -> int:
    """Return the least identity of a ball with a state not finite or beyond `farthest` [m]; -1."""
    place, motion, identity = balls.place, balls.motion, balls.identity
    count = len(place)
    bad = np.full(PIECES, count)
    for piece in prange(PIECES):
        for i in range(piece * count // PIECES, (piece + 1) * count // PIECES):
            far = abs(place[i, X]) + abs(place[i, Y]) + abs(place[i, Z])
            fast = 0.0
            for axis in range(6):
                fast += abs(motion[i, axis])
            # Asked in this way, what is not a number fails.
            if not (far < farthest and fast < np.inf):
                bad[piece] = min(bad[piece], identity[i])
    least = bad.min()
    return least if least < count else -1


@parallel_kernel
def greatest_deviation(motion: RealArray) -> float:
    """Greatest speed [m s-1] of a ball relative to the middle of the box of all velocities."""
    count = len(motion)
    lower, upper = np.full((PIECES, 3), np.inf), np.full((PIECES, 3), -np.inf)
    for piece in prange(PIECES):
        for i in range(piece * count // PIECES, (piece + 1) * count // PIECES):
            for axis in range(3):
                lower[piece, axis] = min(lower[piece, axis], motion[i, axis])
                upper[piece, axis] = max(upper[piece, axis], motion[i, axis])
    middle = np.empty(3)
    for axis in range(3):
        middle[axis] = 0.5 * (lower[:, axis].min() + upper[:, axis].max())
    most = np.zeros(PIECES)
    for piece in prange(PIECES):
        for i in range(piece * count // PIECES, (piece + 1) * count // PIECES):
            square = 0.0
            for axis in range(3):
                square += (motion[i, axis] - middle[axis]) ** 2
            most[piece] = max(most[piece], square)
    return sqrt(most.max())


class ContactSurvey(NamedTuple):
    """All contacts at one moment.

    Attributes
    ----------
    energy : float [J]
        In the springs.
    largest_overlap : float [-]
        Over the radius of the smaller ball.
    total_overlap : float [m]
        Of balls with balls.
    contacts : int
        Of balls with balls.
    worst : int
        Ball, in the order of cells, of the largest overlap.
    deep_share : float [-]
        Contacts deeper than `DEEP`, with balls and walls, over the number of balls.
    """

    energy: float
    largest_overlap: float
    total_overlap: float
    contacts: int
    worst: int
    deep_share: float


def survey_contacts(
    balls: Balls,
    pairs: Contacts,
    touches: Contacts,
    walls: WallTable,
    slab: IntArray,
    law: Constants,
) -> ContactSurvey:
    """Energy, overlaps and number of contacts."""
    require_threads()
    rows = np.zeros((len(slab) - 1, 6))
    _survey_slabs(balls, pairs, touches, walls, slab, law, rows)
    deepest = int(np.argmax(rows[:, _LARGEST]))
    energy, _, total, contacts, _, deep = map(float, rows.sum(axis=0))
    return ContactSurvey(
        energy=energy,
        largest_overlap=float(rows[deepest, _LARGEST]),
        total_overlap=total,
        contacts=int(contacts),
        worst=int(rows[deepest, _WORST]),
        deep_share=deep / len(balls.place),
    )


@parallel_kernel
def _survey_slabs(
    balls: Balls,
    pairs: Contacts,
    touches: Contacts,
    walls: WallTable,
    slab: IntArray,
    law: Constants,
    rows: FloatArray,
) -> None:
    for s in prange(len(rows)):
        _survey_pairs(balls, pairs, slab[s], slab[s + 1], law, rows, s)
        _survey_walls(balls, touches, walls, slab[s], slab[s + 1], law, rows, s)


@lean_kernel
def _survey_pairs(
    balls: Balls, pairs: Contacts, first: int, last: int, law: Constants, rows: FloatArray, s: int
) -> None:
    place, start, partner = balls.place, pairs.start, pairs.partner
    touching, memory = pairs.touching, pairs.memory
    for i in range(first, last):
        radius = place[i, RADIUS]
        for p in range(start[i], start[i + 1]):
            if touching[p]:
                j = partner[p]
                square = 0.0
                for axis in range(3):
                    square += (place[j, axis] - place[i, axis]) ** 2
                radii = radius + place[j, RADIUS]
                overlap = radii - sqrt(square)
                effective = radius * place[j, RADIUS] / radii
                rows[s, _ENERGY] += spring_energy(memory, p, overlap, effective, law.shear_ratio)
                share = overlap / min(radius, place[j, RADIUS])
                if share > rows[s, _LARGEST]:
                    rows[s, _LARGEST], rows[s, _WORST] = share, i
                if share > DEEP:
                    rows[s, _DEEP_ONES] += 1.0
                rows[s, _TOTAL] += overlap
                rows[s, _CONTACTS] += 1.0


@lean_kernel
def _survey_walls(
    balls: Balls,
    touches: Contacts,
    walls: WallTable,
    first: int,
    last: int,
    law: Constants,
    rows: FloatArray,
    s: int,
) -> None:
    place, start, partner = balls.place, touches.start, touches.partner
    touching, memory = touches.touching, touches.memory
    for i in range(first, last):
        radius = place[i, RADIUS]
        for p in range(start[i], start[i + 1]):
            if touching[p]:
                distance, _ = wall_distance(
                    walls, partner[p], place[i, X], place[i, Y], place[i, Z], radius
                )
                overlap = radius - distance
                rows[s, _ENERGY] += spring_energy(memory, p, overlap, radius, law.shear_ratio)
                if overlap > rows[s, _LARGEST] * radius:
                    rows[s, _LARGEST], rows[s, _WORST] = overlap / radius, i
                if overlap > DEEP * radius:
                    rows[s, _DEEP_ONES] += 1.0
