"""Fill a bench with balls and let them come to rest, before anything is fired.

Radii are drawn evenly from mean (1 - d) to mean (1 + d) until they fill the stated share of the
bench, centres at random in a taller one. Overlaps are pushed apart without forces; then gravity
and the contact law act, and the packing settles between frictionless walls (so that the silo
effect of Janssen (1895) leaves no trace), braked by a drag that damps its slowest vibration. The
outcome depends on the seed only. Left out: joints and blocks of rock; the bench is rubble of the
stated solid fraction, which is what the published discrete-element models fire as well.
"""

from __future__ import annotations

from math import cos, exp, inf, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from castblast.errors import Status
from castblast.muckpile.bench import Bench, assign_blocks, bench_volume, check_bench, crest_position
from castblast.muckpile.contact import ContactLaw
from castblast.muckpile.particles import (
    FloatArray,
    Particles,
    particles_at_rest,
)
from castblast.muckpile.porosity import solid_fraction
from castblast.muckpile.separation import push_apart
from castblast.muckpile.simulation import Simulation
from castblast.muckpile.threads import thread_count
from castblast.muckpile.walls import Walls, join, plane
from castblast.progress import ProgressCallback, silent

#: Solid fractions that random packings of rough balls can have at rest under gravity.
LOOSEST, DENSEST = 0.55, 0.63
#: Overlap over mean radius that pushing apart must reach, and what it may take.
_APART, _MOST_SWEEPS = 0.01, 2000
#: Solid fraction after settling = _SETTLED + _COMPACTION (that before - _LOOSE): fitted by this
#: project to packings with friction and rolling friction of 0.5.
_LOOSE, _SETTLED, _COMPACTION = 0.50, 0.570, 0.586
#: Rest: kinetic energy over mass x gravity x mean radius.
_REST = 2e-4
#: Simulated time [s]: between two looks at a settling packing, and at most.
_LOOK, _LONGEST_SETTLING = 0.01, 6.0
#: Over the mean radius: the layer at floor, ends, rear and face that balls do not fill.
_WALL_LAYER = 0.5


class Packing(NamedTuple):
    """A bench full of balls at rest.

    Attributes
    ----------
    particles : Particles
        With their blocks.
    solid_fraction : float [-]
        Reached inside, away from walls and top.
    height : float [m]
        Of the settled bench: the highest ball.
    mean_overlap : float [-]
        Of touching balls, over their mean radius.
    time : float [s]
        Simulated time of settling.
    status : Status
        OK, or NOT_CONVERGED if the balls still moved when the time was over.
    """

    particles: Particles
    solid_fraction: float
    height: float
    mean_overlap: float
    time: float
    status: Status


def estimate_count(
    bench: Bench,
    mean_radius: float,
    relative_deviation: float = 0.5,
    solid_fraction: float = 0.60,
) -> int:
    """Number of balls that fill `bench`; radii even in mean_radius (1 -+ relative_deviation)."""
    mean_volume = _ball_volume(mean_radius, relative_deviation)
    return round(solid_fraction * _filled_volume(bench, mean_radius) / mean_volume)


def _filled_volume(bench: Bench, mean_radius: float) -> float:
    """Volume [m3] that a packing fills: balls pack loosely along walls."""
    layer = _WALL_LAYER * mean_radius
    shares = (
        1.0 - 2.0 * layer / bench.length,
        1.0 - 2.0 * layer / (bench.width + 0.5 * crest_position(bench)),
        1.0 - layer / bench.height,
    )
    return bench_volume(bench) * float(np.prod(shares))


def mean_radius_for_count(
    bench: Bench, count: int, relative_deviation: float = 0.5, solid_fraction: float = 0.60
) -> float:
    """Mean radius [m] with which about `count` balls fill `bench`."""
    unit = count * _ball_volume(1.0, relative_deviation)
    radius = float((solid_fraction * bench_volume(bench) / unit) ** (1.0 / 3.0))
    for _ in range(20):
        radius = float((solid_fraction * _filled_volume(bench, radius) / unit) ** (1.0 / 3.0))
    return radius


def _ball_volume(mean_radius: float, deviation: float) -> float:
    """Mean volume [m3] of a ball; the mean of R^3 of an even distribution is R^3 (1 + d^2)."""
    return 4.0 / 3.0 * np.pi * mean_radius**3 * (1.0 + deviation**2)


def check_packing(
    bench: Bench, mean_radius: float, relative_deviation: float, solid_fraction: float
) -> list[str]:
    """Return every fault in what `fill_bench` is asked for, in words; empty: none."""
    faults = check_bench(bench)
    if not 0.0 <= relative_deviation < 1.0:
        faults.append(f"relative_deviation = {relative_deviation:g}: must be in 0 to 1, below 1")
    if not LOOSEST <= solid_fraction <= DENSEST:
        faults.append(
            f"solid_fraction = {solid_fraction:g}: a random packing of balls at rest has "
            f"{LOOSEST} to {DENSEST}"
        )
    smallest = min(bench.length, bench.width, bench.height)
    if not 0.0 < mean_radius * (1.0 + relative_deviation) <= 0.25 * smallest:
        faults.append(
            f"mean_radius = {mean_radius:g} m: the largest ball must fit at least twice into the "
            f"shortest side of the bench, {smallest:g} m"
        )
    return faults


def fill_bench(
    bench: Bench,
    *,
    mean_radius: float,
    relative_deviation: float = 0.5,
    solid_fraction: float = 0.60,
    seed: int = 0,
    law: ContactLaw | None = None,
    threads: int = 0,
    progress: ProgressCallback = silent,
) -> Packing:
    """Fill `bench` with settled balls.

    Parameters
    ----------
    bench : Bench
    mean_radius : float [m]
    relative_deviation : float [-]
        Radii are even in mean_radius (1 -+ relative_deviation).
    solid_fraction : float [-]
        Volume of the balls over that of the bench inside of it, 0.55 to 0.63; near floor and
        walls a packing is looser.
    seed : int
    law : ContactLaw, optional
    threads : int
        0: all; the packing does not depend on it.
    progress : callable

    Raises
    ------
    ValueError
        See `check_packing`; the message names every fault.
    """
    faults = check_packing(bench, mean_radius, relative_deviation, solid_fraction)
    if faults:
        raise ValueError("; ".join(faults))
    law = law or ContactLaw()
    rng = np.random.default_rng(seed)
    count = estimate_count(bench, mean_radius, relative_deviation, solid_fraction)
    radius = mean_radius * rng.uniform(1 - relative_deviation, 1 + relative_deviation, count)
    # The sample is brought to the exact solid volume; the factor differs from 1 by chance only.
    solid = 4.0 / 3.0 * np.pi * float(np.sum(radius**3))
    filled = _filled_volume(bench, mean_radius)
    radius *= (solid_fraction * filled / solid) ** (1.0 / 3.0)
    before = _LOOSE + (solid_fraction - _SETTLED) / _COMPACTION
    taller = bench._replace(height=bench.height * solid_fraction / before)
    with thread_count(threads) as number:
        position = push_apart(
            _scatter(taller, radius, rng),
            radius,
            _box(taller, lid=True),
            _APART,
            _MOST_SWEEPS,
            lambda share, line: progress(0.2 * share, line),
        )
        return _settle(particles_at_rest(position, radius), bench, law, number, progress)


def _scatter(bench: Bench, radius: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Centres (n, 3) at random in the bench, each at least its radius away from all sides."""
    box_low = np.array([-bench.width, 0.0, 0.0]) + radius[:, None]
    box_high = np.array([0.0, bench.length, bench.height]) - radius[:, None]
    position = np.empty((len(radius), 3))
    todo = np.arange(len(radius))
    while len(todo):
        position[todo] = rng.uniform(box_low[todo], box_high[todo])
        todo = todo[_face_distance(bench, position[todo]) < radius[todo]]
    return position


def _face_distance(bench: Bench, position: FloatArray) -> FloatArray:
    """Distance (n,) [m] of points (n, 3) behind the free face."""
    return -(position[:, 0] * sin(bench.face_angle) + position[:, 2] * cos(bench.face_angle))


def _box(bench: Bench, *, lid: bool) -> Walls:
    """Frictionless walls on all sides of the bench; only the floor has friction."""
    face = (-sin(bench.face_angle), 0.0, -cos(bench.face_angle))
    sides = join(
        plane((0, 0, 0), (0, 0, 1)),
        plane((0, 0, 0), face, 0.0),
        plane((-bench.width, 0, 0), (1, 0, 0), 0.0),
        plane((0, 0, 0), (0, 1, 0), 0.0),
        plane((0, bench.length, 0), (0, -1, 0), 0.0),
    )
    return join(sides, plane((0, 0, bench.height), (0, 0, -1), 0.0)) if lid else sides


def _settle(
    apart: Particles, bench: Bench, law: ContactLaw, threads: int, progress: ProgressCallback
) -> Packing:
    """Let gravity act until the balls are at rest."""
    run = Simulation(
        apart,
        law,
        _box(bench, lid=False),
        np.zeros(len(apart.radius), dtype=np.bool_),
        ballistic=False,
        threads=threads,
        keep_ledger=False,
    )
    weight = 4.0 / 3.0 * np.pi * law.density * float(np.sum(apart.radius**3)) * 9.81
    limit = _REST * weight * float(np.mean(apart.radius))
    brake = exp(-2.0 * _slowest_vibration(bench, law) * _LOOK)
    status = Status.NOT_CONVERGED
    while run.clock < _LONGEST_SETTLING:
        if not run.run(run.clock + _LOOK, inf):
            status = Status.UNSTABLE_STEP
            break
        energy = run.translational_energy()
        if run.clock > 10.0 * _LOOK and energy < limit:
            status = Status.OK
            break
        run.slow(brake)
        progress(
            min(0.99, 0.2 + 0.4 * run.clock),
            f"packing: settling, t = {run.clock:.2f} s",
        )
    state = run.state()
    particles = particles_at_rest(
        state.position, state.radius, assign_blocks(state.position, bench)
    )
    progress(1.0, f"packing: {len(state.radius)} balls at rest")
    return Packing(
        particles,
        solid_fraction(particles, bench),
        float(np.max(state.position[:, 2] + state.radius)),
        run.mean_overlap(),
        run.clock,
        status,
    )


def _slowest_vibration(bench: Bench, law: ContactLaw) -> float:
    """Angular frequency [rad s-1] of a layer of balls on a floor: a quarter wave in its height.

    The bulk stiffness is about half of the effective modulus, the bulk density 0.6 of that of the
    balls; measured on settling packings by this project.
    """
    return float(pi / (2.0 * bench.height) * sqrt(0.8 * law.effective_modulus / law.density))
