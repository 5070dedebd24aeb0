"""A running simulation: the balls in cell order, their lists, the clock, and when to renew what.

This is the engine below `run_cast` and the packing. It steps to a given time, renews the lists
whenever a ball leaves its straight path by half a skin or the lists reach their horizon, and
chooses the stable step anew at each renewal. Nothing it does depends on the number of threads.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import ceil, inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from castblast.muckpile.balls.columns import HELD, MASS, RADIUS
from castblast.muckpile.balls.contact import ContactLaw, damped_step_factor, law_constants
from castblast.muckpile.balls.particles import Particles, ball_mass
from castblast.muckpile.balls.state import PRECISIONS, Balls, Contacts, make_contacts
from castblast.muckpile.engine.carry import inverse, put_aside, restore, take_rows
from castblast.muckpile.engine.dynamics import advance, cut_chunks, present_forces
from castblast.muckpile.engine.stability import stable_step
from castblast.muckpile.engine.survey import (
    BallSurvey,
    ContactSurvey,
    first_bad_ball,
    greatest_deviation,
    survey_balls,
    survey_contacts,
)
from castblast.muckpile.engine.threads import enough_threads
from castblast.muckpile.ground.walls import Walls, wall_table
from castblast.muckpile.search.neighbours import Grid, make_grid, sort_by_cell
from castblast.muckpile.search.pair_search import list_pairs
from castblast.muckpile.search.paths import lay_out, straight_paths
from castblast.muckpile.search.wall_search import list_walls
from castblast.stopping import NEVER, StopRequest
from castblast.types import BoolArray, FloatArray, Int32Array

#: Skin over mean diameter; measured as the fastest for balls in free flight and at rest.
SKIN_RATIO = 0.10
#: A ball may stray this far from the centre of a cast before its state counts as unstable [m].
FARTHEST = 1e5
#: Overlap over radius that only an unstable step can make: a small ball caught between large ones
#: in a cast reaches 2 with the usual soft modulus.
DEEPEST = 20.0
#: First and longest life of a list, in steps.
FIRST_LIFE, LONGEST_LIFE = 16, 64

#: What a run changes: numbers and arrays, and records of arrays.
_CHANGING = (
    "clock", "steps", "rebuilds", "failed_ball", "smallest_step", "largest_step", "_slab", "_chunk",
    "_work", "_spent", "_pending", "_step", "_built", "_life", "_horizon", "_stale", "_step_due",
)  # fmt: skip
_GROUPS: dict[str, type[Balls] | type[Contacts]] = {
    "_balls": Balls, "_pairs": Contacts, "_touches": Contacts,
}  # fmt: skip


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
    keep_ledger : bool
        Record what slip, rolling slip and dashpots dissipate.
    precision : {"float64", "mixed"}
        See `castblast.muckpile.balls.state`.
    """

    particles: Particles
    law: ContactLaw
    walls: Walls
    held: BoolArray
    gravity: float = 9.81
    step_safety: float = 0.8
    time_step: float = 0.0
    skin: float = 0.0
    ballistic: bool = True
    keep_ledger: bool = True
    precision: str = "float64"

    clock: float = field(default=0.0, init=False)
    steps: int = field(default=0, init=False)
    rebuilds: int = field(default=0, init=False)
    failed_ball: int = field(default=-1, init=False)
    smallest_step: float = field(default=inf, init=False)
    largest_step: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        given, count = self.particles, len(self.particles.radius)
        self._law = law_constants(self.law, PRECISIONS[self.precision])
        self._walls = wall_table(self.walls, self._law.friction, self._law.rolling_friction)
        self._factor = self.step_safety * damped_step_factor(self.law)
        if self.skin <= 0.0:
            self.skin = SKIN_RATIO * 2.0 * float(np.mean(given.radius))
        self._largest_radius = float(np.max(given.radius))
        real = PRECISIONS[self.precision]
        motion = np.zeros((count, 8), dtype=real)
        motion[:, 0:3] = given.velocity
        motion[:, 3:6] = given.angular_velocity
        motion[:, MASS] = ball_mass(given.radius, self.law.density)
        motion[:, HELD] = self.held
        motion[self.held, 0:6] = 0.0
        self._balls = Balls(
            place=np.column_stack([given.position, given.radius]),
            motion=motion,
            force=np.zeros((count, 8), dtype=real),
            paths=np.empty((7, 0), dtype=np.float32),
            identity=np.arange(count, dtype=np.int32),
        )
        none = np.zeros(count + 1, dtype=np.int32)
        self._pairs = make_contacts(none, none[:0], real, self.keep_ledger)
        self._touches = self._pairs
        self._slab = np.array([0, count])
        self._chunk = np.array([0, 1])
        self._work = np.zeros((1, 3))
        self._spent = np.zeros(3)
        self._pending, self._step = -1.0, 0.0
        self._built, self._life, self._horizon = 0.0, 0.0, inf
        self._stale, self._step_due = True, True
        with enough_threads(count):
            if self._renew_lists():
                self._evaluate()
        self._stale = True

    # -- results -----------------------------------------------------------------------------

    @property
    def failed(self) -> bool:
        """Whether the state became non-finite, or balls passed through one another."""
        return self.failed_ball >= 0

    @property
    def chunks(self) -> int:
        """Number of shares of the work that can be done side by side."""
        return len(self._chunk) - 1

    @property
    def dissipated(self) -> FloatArray:
        """Energy (3,) [J] spent by slip, rolling slip and dashpots so far."""
        return np.asarray(self._spent + self._work.sum(axis=0))

    def state(self) -> Particles:
        """Return a copy of the present state in the caller's order."""
        balls, count = self._balls, len(self._balls.place)
        position, velocity, spin = (np.empty((count, 3)) for _ in range(3))
        position[balls.identity] = balls.place[:, 0:3]
        velocity[balls.identity] = balls.motion[:, 0:3]
        spin[balls.identity] = balls.motion[:, 3:6]
        return Particles(
            position=position,
            velocity=velocity,
            angular_velocity=spin,
            radius=self.particles.radius.copy(),
            block=self.particles.block.copy(),
        )

    def survey_balls(self) -> BallSurvey:
        """Energies and means of all balls."""
        return survey_balls(self._balls)

    def survey_contacts(self) -> ContactSurvey:
        """Energy, overlaps and number of contacts.

        A ball that is wholly inside another or behind a wall is noted as a failure.
        """
        found = survey_contacts(
            self._balls, self._pairs, self._touches, self._walls, self._slab, self._law
        )
        if found.largest_overlap > DEEPEST and not self.failed:
            self.failed_ball = int(self._balls.identity[found.worst])
        return found

    def mean_overlap(self) -> float:
        """Mean overlap of touching balls over the mean radius."""
        found = self.survey_contacts()
        mean_radius = float(np.mean(self.particles.radius))
        return found.total_overlap / max(found.contacts, 1) / mean_radius

    def translational_energy(self) -> float:
        """Kinetic energy [J] of the motion of the centres."""
        return self.survey_balls().translational_energy

    # -- actions -----------------------------------------------------------------------------

    def fire(self, chosen: BoolArray, velocity: FloatArray) -> None:
        """Release the `chosen` balls (n,) with `velocity` (n, 3) [m s-1]; spins stay.

        Contacts among held balls are not listed; they appear now, with the load of their overlap.
        """
        balls = self._balls
        mask = chosen[balls.identity]
        balls.motion[mask, 0:3] = velocity[balls.identity[mask]]
        balls.motion[mask, HELD] = 0.0
        with enough_threads(len(mask)):
            if self._renew_lists():
                self._evaluate()
            else:
                self._stale = True
        self._step_due = True

    def slow(self, factor: float) -> None:
        """Multiply all velocities and spins by `factor`."""
        self._balls.motion[:, 0:6] *= factor

    def run(self, until: float, event: float, stop: StopRequest = NEVER) -> bool:
        """Step to the first end of a step at or after `until` [s], or exactly to `event` [s].

        The step is fitted to `event`, never to `until`, so that a look at the state changes
        nothing. Returns False if the state became non-finite. Once a `stop` has been requested it
        may return earlier, perhaps within a step; the next call goes on as if it had not.
        """
        with enough_threads(len(self._balls.place)):
            return self._run(until, event, stop)

    def _run(self, until: float, event: float, stop: StopRequest) -> bool:
        while True:
            if self._pending < 0.0 and self.clock >= min(until, event):
                return True
            if stop.made and self.clock < min(until, event):
                return True
            if self._stale:
                if not self._renew_lists():
                    return False
                self._step_due = True
            if self._step_due:
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
                self._chunk,
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

    # -- restart -----------------------------------------------------------------------------

    def save(self) -> dict[str, NDArray[Any]]:
        """Return all that changes in a run, by name."""
        arrays = {name: np.asarray(getattr(self, name)) for name in _CHANGING}
        for group in _GROUPS:
            records = getattr(self, group)._asdict()
            arrays |= {f"{group}.{name}": array for name, array in records.items()}
        return arrays

    def resume(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `save` returned in a run of the same case."""
        for name in _CHANGING:
            value = arrays[name]
            setattr(self, name, value if value.ndim else value.item())
        for group, kind in _GROUPS.items():
            setattr(self, group, kind(**{n: arrays[f"{group}.{n}"] for n in kind._fields}))

    # -- lists -------------------------------------------------------------------------------

    def _evaluate(self) -> None:
        """Forces of the state as it stands."""
        present_forces(
            self._balls, self._pairs, self._touches, self._walls, self._slab, self._chunk,
            self._law, self._work,
        )  # fmt: skip

    def _choose_step(self, event: float) -> None:
        rule = self._factor * stable_step(
            self._balls, self._pairs, self._touches, self._walls, self._slab, self._chunk, self._law
        )
        self._step_due = False
        remaining = event - self.clock
        if self.time_step > 0.0:
            self._step = self.time_step
        elif 0.0 < remaining < inf:
            self._step = remaining / ceil(remaining / rule * (1.0 - 1e-12))
        else:
            self._step = rule
        self.smallest_step = min(self.smallest_step, rule)
        self.largest_step = max(self.largest_step, rule)

    def _next_life(self, fastest: float) -> float:
        """Choose how long [s] the next lists shall live: a little longer than the last did."""
        if not self.ballistic or self._step == 0.0:
            return 0.0
        age = self.clock - self._built
        life = min(max(1.5 * age, FIRST_LIFE * self._step), LONGEST_LIFE * self._step)
        # Longer paths need larger cells, which cost more than a renewal.
        longest = 0.5 * self._largest_radius / max(fastest, 1e-9)
        return max(min(life, longest), 2.0 * self._step)

    def _renew_lists(self) -> bool:
        """Sort the balls, search their partners and carry the memory of contacts over."""
        bad = first_bad_ball(self._balls, FARTHEST)
        if bad >= 0:
            self.failed_ball = bad
            return False
        fastest = greatest_deviation(self._balls.motion)
        life = self._next_life(fastest)
        reach = 2.0 * self._largest_radius + self.skin + fastest * life
        order, cell_start, grid = self._sort_balls(life, reach)
        balls, ledger = self._balls, self.keep_ledger
        real, place_of = balls.motion.dtype, inverse(order)
        held = balls.motion[:, HELD] != 0.0
        held = held if held.any() else held[:0]
        near = (balls.paths, held)
        guess = 1.1 * len(self._pairs.partner) / len(order) + 4.0

        memory = put_aside(self._touches)
        self._touches = make_contacts(*list_walls(*near, self._walls, life), real, ledger)
        restore(self._touches, memory, order, place_of, True)
        memory = put_aside(self._pairs)
        # The old list goes before the new one comes.
        self._pairs = self._touches
        start, partner = list_pairs(*near, cell_start, self._slab, grid, life, guess)
        self._pairs = make_contacts(start, partner, real, ledger)
        restore(self._pairs, memory, order, place_of, False)

        self._chunk = cut_chunks(self._pairs.start[self._slab] + 2 * self._slab)
        self._spent += self._work.sum(axis=0)
        self._work = np.zeros((len(self._slab) - 1, 3))
        self._built, self._life, self._stale = self.clock, life, False
        self._horizon = life if life > 0.0 else inf
        self.rebuilds += 1
        return True

    def _sort_balls(self, life: float, reach: float) -> tuple[Int32Array, Int32Array, Grid]:
        """Bring the balls into the order of cells, for lists of this `life` [s] and `reach` [m]."""
        # One array at a time, each in the place of its old self: here a run needs most memory.
        self._balls = self._balls._replace(paths=np.empty((7, 0), dtype=np.float32))
        rows, lower, upper = straight_paths(self._balls.place, self._balls.motion, life)
        grid = make_grid(lower, upper, reach, len(rows))
        order, cell_start, self._slab = sort_by_cell(rows, grid, 0.5 * life)
        paths = lay_out(rows, self._balls.place[:, RADIUS], order, self.skin)
        del rows
        self._balls = self._balls._replace(paths=paths, identity=self._balls.identity[order])
        for name in ("place", "motion", "force"):
            taken = take_rows(getattr(self._balls, name), order)
            self._balls = self._balls._replace(**{name: taken})
        return order, cell_start, grid
