"""A cast in parts, as the decks for other engines need it: types of radius, firings, time step."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from math import ceil, inf, pi
from pathlib import Path
from typing import NamedTuple

import numpy as np

from castblast.errors import SpecError
from castblast.muckpile.balls.contact import ContactLaw, damped_step_factor
from castblast.muckpile.balls.particles import Particles, ball_mass
from castblast.muckpile.cast.case import CastCase
from castblast.types import FloatArray, IntArray

#: LAMMPS has 32 groups; one per type, and a few others.
MOST_TYPES = 24
SKIN_RATIO = 0.15
#: Goes on with the forces as they are.
ON = "pre no post no"
_LOOP = re.compile(r"^Loop time of (\S+) on (\d+) procs for (\d+) steps with (\d+) atoms", re.M)


class RadiusTypes(NamedTuple):
    """Balls sorted into types by radius.

    Attributes
    ----------
    type : array (n,), int64
        From 0.
    radius : array (t,) [m]
        Whose stiffness the type has: the mean of its balls.
    """

    type: IntArray
    radius: FloatArray


class Firings(NamedTuple):
    """What happens when.

    Attributes
    ----------
    time : array (f,) [s]
    velocity : array (f, 3) [m s-1]
    number : array (n,), int64
        Firing of each ball, from 1; 0: free from the start; f + 1: held for good.
    """

    time: FloatArray
    velocity: FloatArray
    number: IntArray


def radius_types(radius: FloatArray, bins: int) -> RadiusTypes:
    """Sort radii (n,) [m] into types: one per distinct radius, or bins of equal width."""
    distinct, number = np.unique(radius, return_inverse=True)
    if len(distinct) > bins:
        edges = np.linspace(distinct[0], distinct[-1], bins + 1)
        raw = np.clip(np.searchsorted(edges, radius, side="right") - 1, 0, bins - 1)
        number = np.unique(raw, return_inverse=True)[1]
    mean = np.bincount(number, weights=radius) / np.bincount(number)
    return RadiusTypes(number.astype(np.int64), np.asarray(mean))


def plan_firings(case: CastCase) -> Firings:
    """Put blocks that go at the same time with the same velocity into one firing, in time order."""
    due = np.isfinite(case.block_delay) & (case.block_delay < case.max_time)
    due &= np.isin(np.arange(len(due)), case.particles.block)
    plan = np.column_stack([case.block_delay, case.block_velocity])
    events, number = np.unique(plan[due], axis=0, return_inverse=True)
    of_block = np.full(len(due) + 1, len(events) + 1 if case.hold_unfired else 0)
    of_block[:-1][due] = number.ravel() + 1
    of_block[-1] = 0
    return Firings(events[:, 0], events[:, 1:4], of_block[case.particles.block].astype(np.int64))


def time_step(case: CastCase, firings: Firings) -> float:
    """Step [s] by the rule of `castblast.muckpile.engine.stability`, for the contacts at the start.

    Stiffnesses of a ball are summed without regard to direction, so this is a little shorter. If
    the times of firing are multiples of one interval, a whole number of steps fills it.
    """
    if case.time_step > 0.0:
        return case.time_step
    law = case.law
    least = _least_period(case.particles, law)
    rule = case.step_safety * damped_step_factor(law) * least
    times = np.unique(np.concatenate([[0.0], firings.time]))
    interval = float(np.diff(times).min()) if len(times) > 1 else inf
    return rule if interval == inf else interval / ceil(interval / rule)


def _least_period(particles: Particles, law: ContactLaw) -> float:
    """Least sqrt(m/k) and sqrt(I/k_r) [s] over all balls, each with at least one wall contact."""
    from scipy.spatial import cKDTree

    radius = particles.radius
    shear = 1.0 / law.stiffness_ratio
    mass = ball_mass(radius, law.density)
    alone = pi * radius * law.effective_modulus
    push, turn = np.zeros(len(radius)), np.zeros(len(radius))
    pairs = cKDTree(particles.position).query_pairs(2.0 * radius.max(), output_type="ndarray")
    i, j = pairs[:, 0], pairs[:, 1]
    gap = np.linalg.norm(particles.position[i] - particles.position[j], axis=1)
    touch = gap < radius[i] + radius[j]
    i, j = i[touch], j[touch]
    kn = pair_stiffness(radius[i], radius[j], law.effective_modulus)
    mean = radius[i] * radius[j] / (radius[i] + radius[j])
    for ball in (i, j):
        np.add.at(push, ball, kn)
        np.add.at(turn, ball, kn * shear * (radius[ball] ** 2 + mean**2))
    # A third of the contacts of a ball acts along any one axis, two thirds turn it about one.
    push = np.maximum((1.0 + 2.0 * shear) / 3.0 * push, alone)
    turn = np.maximum(2.0 / 3.0 * turn, 2.0 * alone * shear * radius**2)
    return float(np.sqrt(np.minimum(mass / push, 0.4 * mass * radius**2 / turn)).min())


def pair_stiffness(one: FloatArray, two: FloatArray, modulus: float) -> FloatArray:
    """Normal stiffness [N m-1] between balls of radii `one` and `two` [m]: A E*/L."""
    return np.asarray(pi * np.minimum(one, two) ** 2 * modulus / (one + two))


def deck_types(engine: str, case: CastCase, radius_bins: int, faults: list[str]) -> RadiusTypes:
    """Types of a deck.

    Raises
    ------
    SpecError
        One line per fault, those of the caller first.
    """
    if not 1 <= radius_bins <= MOST_TYPES:
        faults = [*faults, f"radius_bins = {radius_bins}: must be 1 to {MOST_TYPES}"]
    if faults:
        raise SpecError("\n".join(f"{engine} deck: {fault}" for fault in faults))
    return radius_types(case.particles.radius, radius_bins)


def atom_lines(
    case: CastCase, types: RadiusTypes, type_count: int, order: IntArray | None = None
) -> Iterator[str]:
    """Lines of a data file up to the velocities.

    Parameters
    ----------
    case : CastCase
    types : RadiusTypes
    type_count : int
        Types of the deck, those of walls included.
    order : array (n,), optional
        Ball that atom k + 1 is; default: ball k.
    """
    balls = case.particles
    order = np.arange(len(balls.radius)) if order is None else order
    low = (balls.position - balls.radius[:, None]).min(axis=0) - balls.radius.max()
    high = (balls.position + balls.radius[:, None]).max(axis=0) + balls.radius.max()
    yield f"castblast: {len(order)} balls in {len(types.radius)} types of radius"
    yield f"\n{len(order)} atoms\n{type_count} atom types\n"
    for name, a, b in zip("xyz", low, high, strict=True):
        yield f"{a:.9g} {b:.9g} {name}lo {name}hi"
    yield "\nAtoms\n"
    for k, ball in enumerate(order):
        x, y, z = balls.position[ball]
        yield (
            f"{k + 1} {types.type[ball] + 1} {2.0 * balls.radius[ball]:.17g} "
            f"{case.law.density:.17g} {x:.17g} {y:.17g} {z:.17g}"
        )
    yield "\nVelocities\n"
    state = np.hstack([balls.velocity, balls.angular_velocity])
    state[(balls.block >= 0) & case.hold_unfired] = 0.0
    for k, ball in enumerate(order):
        yield f"{k + 1} " + " ".join(f"{value:.17g}" for value in state[ball])


def opening_lines(case: CastCase, step: float) -> Iterator[str]:
    """Neighbour lists and time step."""
    yield f"neighbor {SKIN_RATIO * 2.0 * np.mean(case.particles.radius):.6g} bin"
    yield "neigh_modify delay 0 every 1 check yes"
    yield f"timestep {step:.12g}"


def run_lines(
    case: CastCase,
    firings: Firings,
    step: float,
    steps: int,
    members: Callable[[int], str],
    columns: str,
) -> Iterator[str]:
    """Motion, samples, frames of these `columns`, firings and end; arguments as of its parts."""
    yield "fix motion free nve/sphere"
    yield "compute ke all ke\nthermo_style custom step time atoms c_ke"
    yield f"thermo {_sample_steps(case, step)}\nthermo_modify norm no lost warn"
    if case.snapshot_interval > 0.0:
        every = max(1, round(case.snapshot_interval / step))
        yield f"dump frames all custom {every} frames.dump {columns}"
    yield from _firing_lines(case, firings, step, members)
    yield from _ending_lines(case, firings, step, steps)


def _firing_lines(
    case: CastCase, firings: Firings, step: float, members: Callable[[int], str]
) -> Iterator[str]:
    """Lines that run up to each firing and fire it; `members` gives its balls as ``group`` does.

    Forces are set up once: at each further beginning of a run LIGGGHTS would hold the dashpots of
    slipping contacts against no limit, and brake a packed block that is fired by several per cent.
    """
    yield "\n# Firing: balls of a block stand until it is fired, then move freely\n"
    yield "run 0"
    before = 0
    for k, (time, velocity) in enumerate(zip(firings.time, firings.velocity, strict=True)):
        now = round(float(time) / step)
        if now > before:
            yield f"run {now - before} {ON}"
            before = now
        vx, vy, vz = velocity
        yield f"group due {members(k + 1)}"
        yield f"velocity due set {vx:.17g} {vy:.17g} {vz:.17g} units box"
        yield "group due delete"
        if case.hold_unfired:
            yield f"group free {members(k + 1)}"


def _sample_steps(case: CastCase, step: float) -> int:
    """Steps of a sample."""
    return max(1, round(case.sample_interval / step))


def _ending_lines(case: CastCase, firings: Firings, step: float, steps: int) -> Iterator[str]:
    """Run `steps` steps if they are not 0; otherwise until the translational energy stays low."""
    if steps > 0:
        yield f"run {steps} {ON}"
        return
    piece = _sample_steps(case, step)
    start = round(float(firings.time[-1]) / step) if len(firings.time) else 0
    longest = max(start + 1, int(case.max_time / step))
    earliest = ceil(case.min_time / step)
    yield "\n# Until the pile is at rest\n"
    yield "variable most equal 0.0\nvariable quiet equal 0"
    yield f"label piece\nrun {piece} {ON}\nvariable now equal $(c_ke)"
    yield 'if "${now} > ${most}" then "variable most equal ${now}"'
    yield (
        f'if "$(v_now/(v_most+1e-300)) <= {case.stop_energy_ratio:.10g}" '
        'then "variable quiet equal $(v_quiet+1)" else "variable quiet equal 0"'
    )
    quiet = ceil(case.stop_duration / (piece * step)) + 1
    yield f'if "${{quiet}} >= {quiet} && $(step) >= {earliest}" then "jump SELF rest"'
    yield f'if "$(step) >= {longest}" then "jump SELF rest"'
    yield "jump SELF piece\nlabel rest"


class LoopTime(NamedTuple):
    """What one ``run`` of a deck took, by the log of the engine.

    Attributes
    ----------
    seconds : float [s]
        Wall time.
    processes, steps, balls : int
    """

    seconds: float
    processes: int
    steps: int
    balls: int


def read_loop_times(log: Path) -> list[LoopTime]:
    """Read the times of all runs of at least a step from the log of LAMMPS or LIGGGHTS."""
    found = _LOOP.findall(log.read_text(encoding="utf-8", errors="replace"))
    return [LoopTime(float(s), int(p), int(n), int(b)) for s, p, n, b in found if int(n)]
