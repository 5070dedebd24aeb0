"""The case of a cast: balls, surroundings and plan of a bench, and what makes it impossible."""

from __future__ import annotations

from typing import Any

import numpy as np

from castblast.errors import SpecError
from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.bench.enclosure import rock_walls
from castblast.muckpile.bench.geometry import Bench
from castblast.muckpile.bench.given import pressed_share
from castblast.muckpile.bench.surroundings import bench_walls
from castblast.muckpile.cast.case import CastCase
from castblast.muckpile.engine.simulation import Simulation
from castblast.muckpile.engine.threads import thread_count
from castblast.muckpile.ground.terrain import wall_faults
from castblast.muckpile.ground.walls import Walls, join, slope
from castblast.scene.plan import Plan
from castblast.specs.bench.balls.spec import ChosenSizes
from castblast.specs.bench.bench import BenchSpec
from castblast.specs.bench.ground.spec import Ground, rough_ground

#: Simulated time [s] that is enough for one step.
_ONE_STEP = 1e-12


def bench_surroundings(spec: BenchSpec, bench: Bench, ground: Ground) -> Walls:
    """All that balls meet: floor, rock around the bench, slope, ground."""
    if bench.corners:
        parts = [rock_walls(bench)]
    else:
        parts = [bench_walls(bench, rear=spec.bench.rear, ends=spec.bench.ends)]
    if spec.slope is not None:
        parts.append(slope(spec.slope.distance, spec.slope.angle))
    if spec.ground:
        parts.append(ground.walls)
    return join(*parts)


def cast_case(
    spec: BenchSpec, walls: Walls, balls: Particles, plan: Plan, threads: int
) -> CastCase:
    """Everything that a cast takes: balls in their place, contact law, walls, plan."""
    if spec.firing.pattern == "none":
        balls = balls._replace(block=np.full_like(balls.block, -1))
    return CastCase(
        particles=balls,
        law=spec.contact.to_law(),
        walls=walls,
        block_delay=plan.delay,
        block_velocity=plan.velocity,
        hold_unfired=spec.firing.hold_unfired,
        max_time=spec.stop.longest_time,
        stop_energy_ratio=spec.stop.energy_ratio,
        stop_duration=spec.stop.duration,
        step_safety=spec.numerics.step_safety,
        time_step=spec.numerics.time_step or 0.0,
        threads=threads,
        precision=spec.numerics.precision,
    )


def require_possible(spec: BenchSpec, case: CastCase, ground: Ground) -> None:
    """Refuse walls that cut the balls, rough ground, and a fixed step above the stable one."""
    allowed = pressed_share(case.particles, case.law, case.gravity)
    cuts = wall_faults(case.walls, case.particles, allowed)
    faults = [f"{spec.name}: {cut}" for cut in cuts]
    faults += rough_ground(ground, float(case.particles.radius.mean()))
    if not faults and case.time_step > 0.0:
        stable = _stable_step(case)
        if case.time_step > stable:
            faults.append(
                f"{spec.name}: numerics.time_step: {case.time_step:.3g} s: above the stable step "
                f"of these balls, {stable:.3g} s; leave it out to follow the stability rule"
            )
    if faults:
        raise SpecError("\n".join(faults))


def _stable_step(case: CastCase) -> float:
    """Stable step [s] of the balls where they are."""
    held = np.zeros(len(case.particles.radius), dtype=np.bool_)
    with thread_count(case.threads):
        run = Simulation(
            case.particles,
            case.law,
            case.walls,
            held,
            step_safety=1.0,
            ballistic=False,
        )
        run.run(_ONE_STEP, np.inf)
    return float(run.smallest_step)


def describe_sizes(chosen: ChosenSizes | None) -> dict[str, Any] | None:
    """What fragments the balls stand for, and what share of their mass is left out."""
    if chosen is None or chosen.cut is None or chosen.curve is None:
        return None
    cut = chosen.cut
    return {
        "curve": type(chosen.curve).__name__.lower(),
        **chosen.curve._asdict(),
        "smallest_ball": cut.smallest,
        "largest_ball": cut.largest,
        "mass_share_finer": cut.finer,
        "mass_share_coarser": cut.coarser,
    }
