"""What a muckpile will cost, estimated before anything is computed; the absurd is refused.

Estimates are upper bounds for the longest time that the bench file allows: most casts come to rest
long before. They are good to a factor of two or so, the limits far above what is of use.
"""

from __future__ import annotations

import shutil
from math import sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np

from castblast.cores import available_cores
from castblast.errors import SpecError
from castblast.muckpile.balls.contact import ContactLaw, damped_step_factor
from castblast.muckpile.bench.sizes import Sizes, mean_of_power
from castblast.scene.memory import require_memory
from castblast.specs.bench.balls.spec import MOST_BALLS
from castblast.specs.bench.bench import BenchSpec
from castblast.types import FloatArray

MOST_STEPS = 200_000_000
MOST_FRAMES = 10_000
MOST_DAYS = 30.0
#: Core time [s]: of a ball and step, and of a candidate partner in a renewal of the lists, shared
#: by the steps of its life. Measured by this project, see docs/muckpile_speed.md.
_BALL_STEP, _CANDIDATE_STEP = 1.6e-7, 1.6e-9 / 16.0
#: Candidates per ball over the volume of the search over that of a ball, times solid fraction.
_CANDIDATES = 17.0
#: Stable step in a cast over that of a ball alone on a wall.
_CROWDED = 0.7
#: Bytes on disk of a ball: results with the restart file, and each frame by kind.
_RESULT_BYTES = 600.0
FRAME_BYTES = {"animation": 12.0, "vtk": 40.0, "vtkhdf": 84.0}
_GIB, _DAY = 1024.0**3, 86400.0


class BallSizes(NamedTuple):
    """Number of balls, and what their radii [m] mean for time and step."""

    number: int
    smallest: float
    largest: float
    mean_cube: float


class FrameOrder(NamedTuple):
    """Frames that are wanted: interval [s], and bytes of a ball and frame."""

    interval: float
    bytes: float


def sizes_of_table(sizes: Sizes, count: int) -> BallSizes:
    """Describe `count` balls of a distribution."""
    smallest, largest = float(sizes.radius[0]), float(sizes.radius[-1])
    return BallSizes(
        number=count, smallest=smallest, largest=largest, mean_cube=mean_of_power(sizes, 3)
    )


def sizes_of_balls(radius: FloatArray) -> BallSizes:
    """Describe given balls by their radii (n,) [m]."""
    return BallSizes(
        number=len(radius),
        smallest=float(radius.min()),
        largest=float(radius.max()),
        mean_cube=float(np.mean(radius**3)),
    )


def estimated_step(law: ContactLaw, smallest: float, safety: float) -> float:
    """Estimate the step [s] of a cast by that of its smallest ball, of radius `smallest` [m]."""
    # On a wall: m/k = 4/3 r^2 rho / E*, and rolling is the stiffer motion: I/k_r = 0.4 m/(2 k_s).
    alone = smallest * sqrt(4.0 * law.density / (3.0 * law.effective_modulus))
    rolling = sqrt(min(1.0, 0.2 * law.stiffness_ratio))
    return _CROWDED * alone * rolling * safety * damped_step_factor(law)


def require_bounds(
    spec: BenchSpec, sizes: BallSizes, folder: Path, threads: int, frames: FrameOrder | None = None
) -> None:
    """Refuse what takes more memory, time, steps, frames or disk than anybody can want or has.

    Parameters
    ----------
    spec : BenchSpec
    sizes : BallSizes
    folder : path
        Of the results, which exists.
    threads : int
        0: all cores.
    frames : FrameOrder, optional

    Raises
    ------
    SpecError
        One line per fault: field, value, estimate, what is allowed.
    """
    if sizes.number > MOST_BALLS:
        raise SpecError(_too_many(spec, sizes))
    require_memory(sizes.number, spec.name)
    faults = _time_faults(spec, sizes, threads or available_cores())
    if frames is not None:
        faults += _frame_faults(spec, frames)
    if not faults:
        faults += _disk_faults(spec, sizes, folder, frames)
    if faults:
        raise SpecError("\n".join(f"{spec.name}: {fault}" for fault in faults))


def _too_many(spec: BenchSpec, sizes: BallSizes) -> str:
    balls = spec.balls
    if balls.mean_radius is not None:
        least = balls.mean_radius * (sizes.number / MOST_BALLS) ** (1.0 / 3.0)
        asked = f"balls.mean_radius: {balls.mean_radius:g} m"
        allowed = f"at most {MOST_BALLS:,} balls, a mean radius of about {least:.2g} m"
    elif balls.fragments is not None and balls.fragments.smallest is not None:
        asked = f"balls.fragments.smallest: {balls.fragments.smallest:g} m"
        allowed = f"at most {MOST_BALLS:,} balls; give balls.count instead"
    else:
        asked = f"balls.file: {balls.file}" if balls.file else "balls.count"
        allowed = f"at most {MOST_BALLS:,} balls"
    return f"{spec.name}: {asked}: {sizes.number:,} balls; allowed: {allowed}"


def _time_faults(spec: BenchSpec, sizes: BallSizes, cores: int) -> list[str]:
    law, longest = spec.contact.to_law(), spec.stop.longest_time
    fixed = spec.numerics.time_step
    step = fixed or estimated_step(law, sizes.smallest, spec.numerics.step_safety)
    steps = longest / step
    if steps > MOST_STEPS and fixed:
        return [
            f"numerics.time_step: {fixed:g} s: {steps:.2g} steps for a stop.longest_time of "
            f"{longest:g} s; allowed: {MOST_STEPS:,} steps, at least {longest / MOST_STEPS:.2g} s"
        ]
    candidates = min(_CANDIDATES * sizes.largest**3 / sizes.mean_cube, sizes.number)
    seconds = steps * sizes.number * (_BALL_STEP + _CANDIDATE_STEP * candidates) / cores
    if steps > MOST_STEPS or seconds > MOST_DAYS * _DAY:
        return [
            f"{sizes.number:,} balls with radii of {sizes.smallest:.2g} to {sizes.largest:.2g} m "
            f"take steps of about {step:.1g} s: up to {steps:.2g} steps and {seconds / _DAY:.2g} "
            f"days on {cores} cores for a stop.longest_time of {longest:g} s; allowed: "
            f"{MOST_STEPS:,} steps and {MOST_DAYS:g} days; take fewer balls, less different "
            f"sizes, a smaller contact.effective_modulus or a shorter stop.longest_time"
        ]
    return []


def _frame_faults(spec: BenchSpec, frames: FrameOrder) -> list[str]:
    longest = spec.stop.longest_time
    if longest / frames.interval <= MOST_FRAMES:
        return []
    return [
        f"--frame-interval: {frames.interval:g} s: up to {longest / frames.interval:.2g} frames "
        f"for a stop.longest_time of {longest:g} s; allowed: {MOST_FRAMES:,} frames, at least "
        f"{longest / MOST_FRAMES:.2g} s"
    ]


def _disk_faults(
    spec: BenchSpec, sizes: BallSizes, folder: Path, frames: FrameOrder | None
) -> list[str]:
    free = shutil.disk_usage(folder).free
    needed, what = sizes.number * _RESULT_BYTES, "results"
    if frames is not None:
        number = spec.stop.longest_time / frames.interval + 2.0
        needed, what = needed + number * sizes.number * frames.bytes, "results and frames"
    if needed <= free:
        return []
    return [
        f"{what} of {sizes.number:,} balls take up to {needed / _GIB:.2g} GiB, {free / _GIB:.2g} "
        f"GiB are free in {folder}; take fewer balls, a longer --frame-interval or a shorter "
        f"stop.longest_time"
    ]
