"""A running simulation: the balls in cell order, their lists, the clock, and when to renew what.

This is the engine below `run_cast` and the packing. It steps to a given time, renews the lists
whenever a ball leaves its straight path by half a skin or the lists reach their horizon, and
chooses the stable step anew at each renewal. Nothing it does depends on the number of threads.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import ceil, inf

import numpy as np
from numpy.typing import NDArray

from castblast.muckpile.contact import ContactLaw, damped_step_factor, law_constants
from castblast.muckpile.dynamics import advance, first_forces
from castblast.muckpile.neighbours import (
    Balls,
    Contacts,
    carry_memory,
    count_partners,
    count_walls,
    empty_contacts,
    fill_partners,
    fill_walls,
    make_grid,
    sort_by_cell,
    starts,
)
from castblast.muckpile.particles import FloatArray, IntArray, Particles, ball_mass
from castblast.muckpile.stability import stable_step, survey
from castblast.muckpile.walls import Walls, wall_table

#: Skin over mean diameter; measured as the fastest for balls in free flight and at rest.
SKIN_RATIO = 0.15
#: A ball may stray this far from the centre of a cast before its state counts as unstable [m].
FARTHEST = 1e6
#: Overlap over radius that only an unstable step can make: a small ball caught between large ones
#: in a cast reaches 2 with the usual soft modulus.
DEEPEST = 20.0
#: First and longest life of a list, in steps.
FIRST_LIFE, LONGEST_LIFE = 16, 64


@dataclass
class Simulation:
    """State of a run.

    Attributes
    ----------
    particles : Particles
        Initial state; not changed.
    law : ContactLaw
    walls : Walls
    held : array (n,), bool
        Balls that stand still until `fire`.
    gravity : float [m s-2]
    step_safety : float
        Share of the stable step that is used.
    time_step : float [s]
        A fixed step; 0: by the rule.
    skin : float [m]
        0: by the rule.
    ballistic : bool
        Lists along straight paths; False: lists for balls that stay where they are.
    threads : int
        Number of shares of the work; the numbers do not depend on it.
    keep_ledger : bool
        Record what slip, rolling slip and dashpots dissipate.
    """

    particles: Particles
    law: ContactLaw
    walls: Walls
    held: NDArray[np.bool_]
    gravity: float = 9.81
    step_safety: float = 0.8
    time_step: float = 0.0
    skin: float = 0.0
    ballistic: bool = True
    threads: int = 1
    keep_ledger: bool = True

    clock: float = field(default=0.0, init=False)
    steps: int = field(default=0, init=False)
    rebuilds: int = field(default=0, init=False)
    failed_ball: int = field(default=-1, init=False)
    smallest_step: float = field(default=inf, init=False)
    largest_step: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        given, count = self.particles, len(self.particles.radius)
        self._law = law_constants(self.law)
        self._walls = wall_table(self.walls, self._law.friction, self._law.rolling_friction)
        self._factor = self.step_safety * damped_step_factor(self.law)
        if self.skin <= 0.0:
            self.skin = SKIN_RATIO * 2.0 * float(np.mean(given.radius))
        motion = np.zeros((count, 8))
        motion[:, 0:3] = given.velocity
        motion[:, 3:6] = given.angular_velocity
        motion[:, 6] = ball_mass(given.radius, self.law.density)
        motion[:, 7] = self.held
        motion[self.held, 0:6] = 0.0
        self._balls = Balls(
            np.column_stack([given.position, given.radius]),
            motion,
            np.zeros((count, 8)),
            np.zeros((count, 6)),
            np.arange(count),
        )
        self._pairs = empty_contacts(np.zeros(count + 1, dtype=np.int64), self.keep_ledger)
        self._touches = self._pairs
        self._slab = np.array([0, count])
        self._part = np.array([0, 1])
        self._work = np.zeros((1, 3))
        self._spent = np.zeros(3)
        self._pending, self._step = -1.0, 0.0
        self._built, self._life, self._horizon = 0.0, 0.0, inf
        self._stale = True
        if self._renew_lists():
            first_forces(
                self._balls,
                self._pairs,
                self._touches,
                self._walls,
                self._law,
                self.gravity,
                self._work,
            )
        self._stale = True

    # -- results -----------------------------------------------------------------------------

    @property
    def failed(self) -> bool:
        """Whether the state became non-finite, or balls passed through one another."""
        return self.failed_ball >= 0

    @property
    def dissipated(self) -> FloatArray:
        """Energy (3,) [J] spent by slip, rolling slip and dashpots so far."""
        return np.asarray(self._spent + self._work.sum(axis=0))

    def state(self) -> Particles:
        """Return a copy of the present state in the caller's order."""
        back = np.argsort(self._balls.identity)
        return Particles(
            np.ascontiguousarray(self._balls.place[back, 0:3]),
            np.ascontiguousarray(self._balls.motion[back, 0:3]),
            np.ascontiguousarray(self._balls.motion[back, 3:6]),
            self.particles.radius.copy(),
            self.particles.block.copy(),
        )

    def survey(self) -> tuple[float, float, int]:
        """Elastic energy [J], largest overlap over radius, number of contacts between balls.

        A ball that is wholly inside another or behind a wall is noted as a failure.
        """
        found = survey(self._balls, self._pairs, self._touches, self._walls, self._law)
        if found[1] > DEEPEST and not self.failed:
            self.failed_ball = int(self._balls.identity[found[4]])
        return float(found[0]), float(found[1]), int(found[3])

    def mean_overlap(self) -> float:
        """Mean overlap of touching balls over the mean radius."""
        found = survey(self._balls, self._pairs, self._touches, self._walls, self._law)
        mean_radius = float(np.mean(self.particles.radius))
        return float(found[2]) / max(int(found[3]), 1) / mean_radius

    def translational_energy(self) -> float:
        """Kinetic energy [J] of the motion of the centres."""
        motion = self._balls.motion
        return float(0.5 * np.sum(motion[:, 6] * np.sum(motion[:, 0:3] ** 2, axis=1)))

    # -- actions -----------------------------------------------------------------------------

    def fire(self, chosen: NDArray[np.bool_], velocity: FloatArray) -> None:
        """Release the `chosen` balls (n,) with `velocity` (n, 3) [m s-1]; spins stay."""
        mask = chosen[self._balls.identity]
        self._balls.motion[mask, 0:3] = velocity[self._balls.identity[mask]]
        self._balls.motion[mask, 7] = 0.0
        self._stale = True

    def slow(self, factor: float) -> None:
        """Multiply all velocities and spins by `factor`."""
        self._balls.motion[:, 0:6] *= factor

    def run(self, until: float, event: float) -> bool:
        """Step to the first end of a step at or after `until` [s], or exactly to `event` [s].

        The step is fitted to `event`, never to `until`, so that a look at the state changes
        nothing. Returns False if the state became non-finite.
        """
        while True:
            if self._pending < 0.0 and self.clock >= min(until, event):
                return True
            if self._stale:
                if not self._renew_lists():
                    return False
                self._choose_step(event)
            under_way = int(self._pending >= 0.0)
            # No end in sight (an infinite event) is as good as a far one.
            to_event = ceil(min((event - self.clock) / self._step, 1e9) - 1e-6)
            to_until = ceil(min((until - self.clock) / self._step, 1e9) - 1e-6)
            goal = max(1, min(to_event, to_until) + under_way)
            ended, begun, self._pending, self.clock = advance(
                self._balls,
                self._pairs,
                self._touches,
                self._walls,
                self._slab,
                self._part,
                self._law,
                self.gravity,
                goal,
                self._pending,
                self._step,
                self.clock,
                self._built,
                self._horizon,
                0.5 * self.skin,
                self._work,
            )
            self.steps += ended
            if self.time_step <= 0.0 and begun == to_event:
                self.clock = event
            self._stale = self._pending >= 0.0

    # -- lists -------------------------------------------------------------------------------

    def _choose_step(self, event: float) -> None:
        rule = self._factor * stable_step(
            self._balls, self._pairs, self._touches, self._walls, self._law
        )
        remaining = event - self.clock
        if self.time_step > 0.0:
            self._step = self.time_step
        elif 0.0 < remaining < inf:
            self._step = remaining / ceil(remaining / rule * (1.0 - 1e-12))
        else:
            self._step = rule
        self.smallest_step = min(self.smallest_step, rule)
        self.largest_step = max(self.largest_step, rule)
        if self.ballistic:
            self._horizon = self._life

    def _next_life(self, fastest: float) -> float:
        """Choose how long [s] the next lists shall live: a little longer than the last did."""
        if not self.ballistic or self._step == 0.0:
            return 0.0
        age = self.clock - self._built
        life = min(max(1.5 * age, FIRST_LIFE * self._step), LONGEST_LIFE * self._step)
        # Longer paths need larger cells, which cost more than a renewal.
        reach = float(np.max(self._balls.place[:, 3]))
        return max(min(life, 0.5 * reach / max(fastest, 1e-9)), 2.0 * self._step)

    def _renew_lists(self) -> bool:
        """Sort the balls, search their partners and carry the memory of contacts over."""
        balls = self._balls
        if not self._check_finite():
            return False
        mean = np.mean(balls.motion[:, 0:3], axis=0)
        fastest = float(np.sqrt(np.max(np.sum((balls.motion[:, 0:3] - mean) ** 2, axis=1))))
        life = self._next_life(fastest)
        velocity = balls.motion[:, 0:3] if life > 0.0 else np.zeros((len(balls.place), 3))
        middle = balls.place[:, 0:3] + 0.5 * life * velocity
        cell = 2.0 * float(np.max(balls.place[:, 3])) + self.skin + fastest * life
        grid = make_grid(middle.min(axis=0), middle.max(axis=0), cell, len(middle))
        order, cell_start, slab = sort_by_cell(middle, grid)
        reference = np.column_stack([balls.place[:, 0:3], velocity])
        self._balls = Balls(
            balls.place[order],
            balls.motion[order],
            balls.force[order],
            reference[order],
            balls.identity[order],
        )
        shape = (self._balls, cell_start, grid, self.skin, life)
        pairs = empty_contacts(starts(count_partners(*shape)), self.keep_ledger)
        fill_partners(*shape, pairs.start, pairs.partner)
        near = (self._balls, self._walls, self.skin, life)
        touches = empty_contacts(starts(count_walls(*near)), self.keep_ledger)
        fill_walls(*near, touches.start, touches.partner)
        modulus = self._law.modulus
        carry_memory(self._balls, pairs, self._pairs, order, modulus, False)
        carry_memory(self._balls, touches, self._touches, order, modulus, True)
        self._share_work(pairs, slab)
        self._pairs, self._touches, self._slab = pairs, touches, slab
        self._spent += self._work.sum(axis=0)
        self._work = np.zeros((len(slab) - 1, 3))
        self._built, self._life, self._stale = self.clock, life, False
        self._horizon = life if life > 0.0 else inf
        self.rebuilds += 1
        return True

    def _share_work(self, pairs: Contacts, slab: IntArray) -> None:
        """Cut the slabs into shares of about equal work, one per thread."""
        load = pairs.start[slab] + 3 * slab
        targets = load[-1] * np.arange(self.threads + 1) / self.threads
        self._part = np.searchsorted(load, targets, side="left").astype(np.int64)
        self._part[0], self._part[-1] = 0, len(slab) - 1

    def _check_finite(self) -> bool:
        """Note the first ball, in the caller's order, whose state is no longer finite."""
        balls = self._balls
        good = np.all(np.isfinite(balls.place) & (np.abs(balls.place) < FARTHEST), axis=1)
        good &= np.all(np.isfinite(balls.motion), axis=1)
        if good.all():
            return True
        self.failed_ball = int(balls.identity[~good].min())
        return False
