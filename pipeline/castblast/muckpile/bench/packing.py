"""Fill a bench with balls and let them come to rest, before anything is fired.

Radii are drawn from the distribution asked for until they fill the stated share of the bench,
centres at random in a taller one. Overlaps are pushed apart without forces; then gravity
and the contact law act, and the packing settles between frictionless walls (so that the silo
effect of Janssen (1895) leaves no trace), braked by a drag that damps its slowest vibration. The
outcome depends on the seed only. Left out: joints and blocks of rock; the bench is rubble of the
stated solid fraction, which is what the published discrete-element models fire as well.
"""

from __future__ import annotations

from math import exp, inf, pi, sqrt
from typing import NamedTuple

import numpy as np

from castblast.errors import SpecError, Status
from castblast.muckpile.balls.contact import ContactLaw
from castblast.muckpile.balls.particles import Particles, particles_at_rest
from castblast.muckpile.bench.enclosure import holding_walls, parting_planes
from castblast.muckpile.bench.geometry import (
    Bench,
    assign_blocks,
    bench_outline,
    bench_volume,
    check_bench,
)
from castblast.muckpile.bench.outline import (
    depth_inside,
    is_convex,
    outline_volume,
    polygon_area,
    section_at,
    shrink,
)
from castblast.muckpile.bench.porosity import solid_fraction
from castblast.muckpile.bench.separation import Look, push_apart
from castblast.muckpile.bench.sizes import (
    Sizes,
    draw_radii,
    mean_ball_volume,
    random_close_fraction,
    sauter_radius,
    scaled,
    uniform_sizes,
)
from castblast.muckpile.cast.restart import Arrays, Keeper
from castblast.muckpile.engine.simulation import Simulation
from castblast.muckpile.engine.threads import thread_count
from castblast.progress import ProgressCallback, silent
from castblast.stopping import NEVER, StopRequest
from castblast.types import FloatArray

#: Solid fractions that random packings of rough balls can have at rest under gravity.
LOOSEST, DENSEST = 0.55, 0.63
#: Overlap over mean radius that pushing apart must reach, and what it may take.
_APART, _MOST_SWEEPS = 0.01, 2000
#: Solid fraction after settling = _SETTLED + _COMPACTION (that before - _LOOSE): fitted by this
#: project to packings with friction and rolling friction of 0.5.
_LOOSE, _SETTLED, _COMPACTION = 0.50, 0.570, 0.586
#: Sizes whose random close packing is denser settle denser, by this share of the difference from
#: even radii with a deviation of 0.5: fitted by this project to even, normal, Swebrec and
#: Rosin-Rammler sizes, to 0.004.
_DENSER, _EVEN = 0.38, random_close_fraction(uniform_sizes(1.0, 0.5))
#: Rest: kinetic energy over mass x gravity x Sauter radius (mean cube over mean square).
_REST = 1.7e-4
#: Simulated time [s]: between two looks at a settling packing, and at most.
_LOOK, _LONGEST_SETTLING = 0.01, 6.0
#: Over the Sauter radius: the layer at floor and sides that balls do not fill.
_WALL_LAYER = 0.433
_NOT_KEPT = Keeper(None, "")


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


def count_of(bench: Bench, sizes: Sizes, solid_fraction: float = 0.60) -> int:
    """Number of balls of these `sizes` that fill `bench`."""
    return round(solid_volume(bench, sizes, solid_fraction) / mean_ball_volume(sizes))


def solid_volume(bench: Bench, sizes: Sizes, solid_fraction: float = 0.60) -> float:
    """Volume [m3] of the balls that fill `bench`: along walls they pack loosely."""
    layer = _WALL_LAYER * sauter_radius(sizes)
    inner = shrink(bench_outline(bench), layer)
    return solid_fraction * outline_volume(inner, bench.height) * (1.0 - layer / bench.height)


def mean_radius_for_count(
    bench: Bench, count: int, relative_deviation: float = 0.5, solid_fraction: float = 0.60
) -> float:
    """Mean radius [m] with which about `count` balls fill `bench`; radii even around it."""
    unit = uniform_sizes(1.0, relative_deviation)
    return float(sizes_for_count(bench, unit, count, solid_fraction).radius.mean())


def sizes_for_count(bench: Bench, sizes: Sizes, count: int, solid_fraction: float = 0.60) -> Sizes:
    """Scale `sizes` so that about `count` balls fill `bench`."""
    unit = count * mean_ball_volume(sizes)
    factor = float((solid_fraction * bench_volume(bench) / unit) ** (1.0 / 3.0))
    for _ in range(20):
        fill = solid_volume(bench, scaled(sizes, factor), solid_fraction)
        factor = float((fill / unit) ** (1.0 / 3.0))
    return scaled(sizes, factor)


def check_packing(
    bench: Bench, mean_radius: float, relative_deviation: float, solid_fraction: float
) -> list[str]:
    """Return every fault in what `fill_bench` is asked for, in words; empty: none."""
    faults = check_bench(bench)
    if not 0.0 <= relative_deviation < 1.0:
        faults.append(f"relative_deviation = {relative_deviation:g}: must be in 0 to 1, below 1")
    faults += _fraction_faults(solid_fraction)
    return faults + _size_faults(
        bench, mean_radius * (1.0 + relative_deviation), f"mean_radius = {mean_radius:g} m"
    )


def check_sizes(bench: Bench, sizes: Sizes, solid_fraction: float) -> list[str]:
    """As `check_packing`, for any distribution of sizes."""
    largest = float(sizes.radius[-1])
    shown = f"largest diameter {2.0 * largest:.3g} m"
    return (
        check_bench(bench) + _fraction_faults(solid_fraction) + _size_faults(bench, largest, shown)
    )


def _fraction_faults(solid_fraction: float) -> list[str]:
    if LOOSEST <= solid_fraction <= DENSEST:
        return []
    return [
        f"solid_fraction = {solid_fraction:g}: a random packing of balls at rest has "
        f"{LOOSEST} to {DENSEST}"
    ]


def _size_faults(bench: Bench, largest: float, shown: str) -> list[str]:
    smallest = min(bench.length, bench.width, bench.height)
    if 0.0 < largest <= 0.25 * smallest:
        return []
    return [
        f"{shown}: the largest ball must fit at least twice into the shortest side of the bench, "
        f"{smallest:g} m"
    ]


def fill_bench(
    bench: Bench,
    *,
    mean_radius: float = 0.0,
    relative_deviation: float = 0.5,
    sizes: Sizes | None = None,
    solid_fraction: float = 0.60,
    seed: int = 0,
    law: ContactLaw | None = None,
    threads: int = 0,
    progress: ProgressCallback = silent,
    restart: Keeper = _NOT_KEPT,
    stop: StopRequest = NEVER,
) -> Packing:
    """Fill `bench` with settled balls.

    Parameters
    ----------
    bench : Bench
        A rectangle or any polygon in plan, with leaning faces.
    mean_radius : float [m]
    relative_deviation : float [-]
        Radii are even in mean_radius (1 -+ relative_deviation).
    sizes : Sizes, optional
        Any other distribution; instead of the two before.
    solid_fraction : float [-]
        Volume of the balls over that of the bench inside of it, 0.55 to 0.63; near floor and
        walls a packing is looser.
    seed : int
    law : ContactLaw, optional
    threads : int
        0: all; the packing does not depend on it.
    progress : callable
    restart : Keeper
        Keeps the state of the work; its key stands for all other arguments. What it holds is gone
        on with, to the same last bit, and a file that cannot be used is passed over.
    stop : StopRequest
        Looked at whenever the state is whole.

    Raises
    ------
    ValueError
        See `check_packing` and `check_sizes`; the message names every fault.
    Stopped
        Somebody asked for it; the state is kept.
    """
    if sizes is None:
        faults = check_packing(bench, mean_radius, relative_deviation, solid_fraction)
        sizes = uniform_sizes(mean_radius, relative_deviation)
    else:
        faults = check_sizes(bench, sizes, solid_fraction)
    if faults:
        raise ValueError("; ".join(faults))
    law = law or ContactLaw()
    rng = np.random.default_rng(seed)
    radius = draw_radii(sizes, count_of(bench, sizes, solid_fraction), rng)
    # The sample is brought to the exact solid volume; the factor differs from 1 by chance only.
    solid = 4.0 / 3.0 * np.pi * float(np.sum(radius**3))
    radius *= (solid_volume(bench, sizes, solid_fraction) / solid) ** (1.0 / 3.0)
    denser = _DENSER * (random_close_fraction(sizes) - _EVEN)
    before = _LOOSE + (solid_fraction - _SETTLED - denser) / _COMPACTION
    taller = _heightened(bench, solid_fraction / before)
    body = None if is_convex(bench_outline(bench)) else bench_outline(bench)
    kept = _kept(restart)

    def look(state: Arrays) -> None:
        if restart.due:
            restart.keep(state)
        if stop.made:
            restart.write(state)
            stop.obey(f"stopped while the bench was packed; {restart.how_to_go_on}")

    with thread_count(threads):
        if "clock" in kept:  # it was settling already
            position = np.empty((len(radius), 3))
            position[kept["_balls.identity"]] = kept["_balls.place"][:, 0:3]
        else:
            position = push_apart(
                _scatter(taller, radius, rng),
                radius,
                parting_planes(taller),
                _APART,
                _MOST_SWEEPS,
                lambda share, line: progress(0.2 * share, line),
                body,
                look,
                kept or None,
            )
            kept = {}
        return _settle(particles_at_rest(position, radius), bench, law, progress, look, kept)


def _kept(restart: Keeper) -> Arrays:
    """State of an interrupted packing; empty if there is none that can be used."""
    try:
        return restart.read() or {}
    except SpecError:
        return {}


def _heightened(bench: Bench, factor: float) -> Bench:
    """The same sides, so high that the bench holds `factor` times its volume."""
    outline = bench_outline(bench)
    wanted = factor * bench_volume(bench)
    height = bench.height * factor
    for _ in range(30):
        top = polygon_area(section_at(outline, height))
        if top <= 0.0:
            message = "the faces lean back so far that balls cannot be poured between them"
            raise ValueError(message)
        height += (wanted - outline_volume(outline, height)) / top
    return bench._replace(height=height)


def _scatter(bench: Bench, radius: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Centres (n, 3) at random in the bench, each at least its radius away from all sides."""
    outline = bench_outline(bench)
    box_low = np.array([-bench.width, 0.0, 0.0]) + radius[:, None]
    box_high = np.array([0.0, bench.length, bench.height]) - radius[:, None]
    position = np.empty((len(radius), 3))
    todo = np.arange(len(radius))
    while len(todo):
        position[todo] = rng.uniform(box_low[todo], box_high[todo])
        todo = todo[depth_inside(outline, position[todo]) < radius[todo]]
    return position


def _settle(
    apart: Particles,
    bench: Bench,
    law: ContactLaw,
    progress: ProgressCallback,
    look: Look,
    kept: Arrays,
) -> Packing:
    """Let gravity act until the balls are at rest; go on from what was `kept`, if anything."""
    run = Simulation(
        apart,
        law,
        holding_walls(bench, float(np.mean(apart.radius))),
        np.zeros(len(apart.radius), dtype=np.bool_),
        ballistic=False,
        keep_ledger=False,
    )
    weight = 4.0 / 3.0 * np.pi * law.density * float(np.sum(apart.radius**3)) * 9.81
    sauter = float(np.sum(apart.radius**3) / np.sum(apart.radius**2))
    limit = _REST * weight * sauter
    brake = exp(-2.0 * _slowest_vibration(bench, law) * _LOOK)
    status = Status.NOT_CONVERGED
    if kept:
        run.resume(kept)
    while run.clock < _LONGEST_SETTLING:
        if not run.run(run.clock + _LOOK, inf):
            status = Status.UNSTABLE_STEP
            break
        energy = run.translational_energy()
        if run.clock > 10.0 * _LOOK and energy < limit:
            status = Status.OK
            break
        run.slow(brake)
        look(run.save())
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
        particles=particles,
        solid_fraction=solid_fraction(particles, bench),
        height=float(np.max(state.position[:, 2] + state.radius)),
        mean_overlap=run.mean_overlap(),
        time=run.clock,
        status=status,
    )


def _slowest_vibration(bench: Bench, law: ContactLaw) -> float:
    """Angular frequency [rad s-1] of a layer of balls on a floor: a quarter wave in its height.

    The bulk stiffness is about half of the effective modulus, the bulk density 0.6 of that of the
    balls; measured on settling packings by this project.
    """
    return float(pi / (2.0 * bench.height) * sqrt(0.8 * law.effective_modulus / law.density))
