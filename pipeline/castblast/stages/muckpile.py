"""Throw a bench: pack or read the balls, fire, settle, and write state, profile and pictures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from castblast.errors import SimulationError, SpecError, Status, nearest_name
from castblast.muckpile.bench import Bench
from castblast.muckpile.enclosure import rock_walls
from castblast.muckpile.initial_state import pressed_share
from castblast.muckpile.metrics import pile_metrics
from castblast.muckpile.particles import Particles
from castblast.muckpile.simulation import Simulation
from castblast.muckpile.solver import CastCase, CastResult, run_cast
from castblast.muckpile.state import PRECISIONS
from castblast.muckpile.terrain import wall_faults
from castblast.muckpile.threads import thread_count
from castblast.muckpile.walls import Walls, bench_walls, join, slope
from castblast.progress import ProgressCallback, silent
from castblast.resources import find_spec
from castblast.specs.balls import ChosenSizes
from castblast.specs.bench import BenchSpec, load_bench
from castblast.specs.ground import Ground, read_ground, rough_ground
from castblast.specs.quantity import parse_quantity
from castblast.stages.muckpile_deck import Decks, write_decks
from castblast.stages.muckpile_extras import Extras, read_extras
from castblast.stages.muckpile_frames import Frames
from castblast.stages.muckpile_ore import follow_ore
from castblast.stages.muckpile_plan import Plan, make_plan
from castblast.stages.muckpile_results import (
    MuckpileOutcome,
    bench_content,
    describe_run,
    write_results,
)
from castblast.stages.muckpile_start import make_start
from castblast.stages.muckpile_velocity import velocity_remarks

_PACKING_SHARE, _CAST_SHARE = 0.25, 0.95
_MAX_VELOCITY = 100.0
_FEWEST_BALLS = 10
_RESTART = "restart.npz"
#: Simulated time [s] that is enough for one step.
_ONE_STEP = 1e-12


def run_muckpile(
    bench: str | Path,
    out: Path | None = None,
    *,
    balls: int | None = None,
    threads: int | None = None,
    velocity: str | float | None = None,
    seed: int | None = None,
    precision: str | None = None,
    sleeping: bool | None = None,
    packings: Path | None = None,
    extras: Extras = Extras(),  # noqa: B008 - a record of constants
    decks: Decks = Decks(),  # noqa: B008 - a record of constants
    progress: ProgressCallback = silent,
) -> MuckpileOutcome:
    """Run a bench file; an interrupted run goes on where it was, to the same numbers.

    Parameters
    ----------
    bench : str or path
        Bench file, or the name of one that comes with castblast.
    out : path, optional
        Folder of the results; default ``runs/NAME``.
    balls : int, optional
        About this many balls instead of those of the file; changes their size.
    threads : int, optional
        Default: all cores. The numbers do not depend on it.
    velocity : str or float [m s-1], optional
        Instead of that of the file; a text carries its unit.
    seed : int, optional
        Instead of that of the file.
    precision : {"mixed", "float64"}, optional
    sleeping : bool, optional
        Instead of `numerics` of the file.
    packings : path, optional
        Folder of packings, named by the hash of their content: one that is there is used again,
        whatever run made it. Default: ``packings`` in `out`.
    extras : Extras
        Ore, animation, files for ParaView.
    decks : Decks
        Folders for the input of LAMMPS or LIGGGHTS. With one the bench is packed and checked but
        not thrown.
    progress : callback

    Raises
    ------
    SpecError
        Faults of the bench file, of a file of balls, holes, ground or ore, or of an extra; a wall
        that cuts the balls, a step above the stable one, too little memory, or what another engine
        cannot take. Nothing has been simulated then, and a packing that was made is kept.
    SimulationError
        The simulation became unstable; its last restart file is kept.
    """
    path = find_spec(bench, "bench")
    spec = _with_options(load_bench(path), balls, velocity)
    spec = _with_numerics(spec, precision, sleeping)
    if seed is not None:
        spec = spec.model_copy(update={"seed": seed})
    geometry = spec.bench.to_bench()
    ore_of_bench = path.parent / spec.ore if spec.ore else None
    wanted = read_extras(extras, geometry, ore_of_bench, spec.frame)
    ground = read_ground(spec.ground, path.parent, geometry)
    walls = bench_surroundings(spec, geometry, ground)
    plan = make_plan(spec, geometry, path.parent, one_speed=velocity is not None)
    folder = Path("runs") / spec.name if out is None else out
    threads = threads or 0
    start, sizes = make_start(
        spec,
        geometry,
        plan,
        path.parent,
        folder / "packings" if packings is None else packings,
        threads,
        _part(progress, 0.0, _PACKING_SHARE),
    )
    case = _case(spec, walls, start.balls, plan, threads)
    _require_possible(spec, case, ground)
    if decks.wanted:
        written = write_decks(spec, case, decks)
        return _with_remarks(replace(written, remarks=velocity_remarks(plan.prediction)), ground)
    folder.mkdir(parents=True, exist_ok=True)
    result, frames = _simulate(
        spec, case, folder, extras, wanted.interval, _part(progress, _PACKING_SHARE, _CAST_SHARE)
    )
    progress(_CAST_SHARE, "writing files and pictures")
    metrics = pile_metrics(
        start.balls,
        result.particles,
        geometry,
        block_velocity=case.block_velocity,
        walls=case.walls,
    )
    ore = follow_ore(wanted.ore, wanted.plan, case, result)
    outcome = describe_run(spec, plan.speed, plan.prediction, start, result, metrics, ore)
    more = {"fragments": _describe_sizes(sizes), **bench_content(spec, path.parent)}
    outcome = _with_remarks(replace(outcome, document=outcome.document | more), ground)
    files = write_results(folder, spec, case, result, outcome.document, ore, plan.label) + frames
    progress(1.0, f"{result.time:.1f} s simulated")
    return replace(outcome, files=files)


def _with_remarks(outcome: MuckpileOutcome, ground: Ground) -> MuckpileOutcome:
    """Outcome that says what was mended, left out or found odd in files of ground."""
    if not ground.remarks:
        return outcome
    document = outcome.document | {"ground_remarks": list(ground.remarks)}
    return replace(outcome, document=document, remarks=[*ground.remarks, *outcome.remarks])


def _simulate(
    spec: BenchSpec,
    case: CastCase,
    folder: Path,
    extras: Extras,
    interval: float,
    progress: ProgressCallback,
) -> tuple[CastResult, list[Path]]:
    """Throw the bench; frames along the way are written even if it fails."""
    frames, files = None, []
    if extras.frames:
        case = case._replace(snapshot_interval=interval)
        frames = Frames(
            folder,
            case,
            spec.bench.to_bench(),
            animation=extras.animation,
            vtk=extras.vtk,
            vtkhdf=extras.vtkhdf,
        )
    # Frames along the way are not kept in a restart file: such a run begins anew.
    restart = None if frames else folder / _RESTART
    result = run_cast(case, progress, frames, restart)
    if frames is not None:
        progress(1.0, "writing frames")
        files = frames.close()
    if Status(result.status) is Status.UNSTABLE_STEP:
        message = (
            f"{spec.name}: the simulation became unstable at {result.failed_time:.3g} s "
            f"(ball {result.failed_ball})"
        )
        if restart is not None and restart.exists():
            message += f"; its last good state is kept in {restart}"
        raise SimulationError(message)
    return result, files


def _with_options(spec: BenchSpec, balls: int | None, velocity: str | float | None) -> BenchSpec:
    """Bench spec with what the command line sets instead of the file."""
    update: dict[str, Any] = {}
    if balls is not None:
        if spec.balls.file is not None:
            message = f"--balls: {spec.name} takes its balls from {spec.balls.file}"
            raise SpecError(message)
        made: dict[str, Any] = {"count": balls, "mean_radius": None}
        if spec.balls.fragments is not None:
            made["fragments"] = spec.balls.fragments.model_copy(update={"smallest": None})
        update["balls"] = spec.balls.model_copy(update=made)
        if balls < _FEWEST_BALLS:
            raise SpecError(f"--balls: {balls}: at least {_FEWEST_BALLS} are needed")
    if velocity is not None:
        if isinstance(velocity, str):
            velocity = parse_quantity(velocity, "m s-1", "--velocity")
        if not 0.0 <= velocity <= _MAX_VELOCITY:
            message = (
                f"--velocity: {velocity:g} m/s: implausible; allowed: 0 to {_MAX_VELOCITY:g} m/s"
            )
            raise SpecError(message)
        if spec.firing.pattern == "none":
            message = f"--velocity: {spec.name} is not fired (firing.pattern: none)"
            raise SpecError(message)
        update |= {"velocity": velocity, "surrogate": None}
    return spec.model_copy(update=update)


def _with_numerics(spec: BenchSpec, precision: str | None, sleeping: bool | None) -> BenchSpec:
    """Bench spec with what the command line says about the solution."""
    if precision is not None and precision not in PRECISIONS:
        hint = nearest_name(precision, PRECISIONS)
        raise SpecError(f"--precision: {precision}: must be one of {', '.join(PRECISIONS)}{hint}")
    given = {"precision": precision, "sleeping": sleeping}
    update = {name: value for name, value in given.items() if value is not None}
    return spec.model_copy(update={"numerics": spec.numerics.model_copy(update=update)})


def _part(progress: ProgressCallback, low: float, high: float) -> ProgressCallback:
    """Progress of one part of the run; the share, an estimate there, never falls."""
    reached = 0.0

    def report(share: float, line: str) -> None:
        nonlocal reached
        reached = max(reached, share)
        progress(low + reached * (high - low), line)

    return report


def _describe_sizes(chosen: ChosenSizes | None) -> dict[str, Any] | None:
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


def _case(spec: BenchSpec, walls: Walls, balls: Particles, plan: Plan, threads: int) -> CastCase:
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
        sleeping=spec.numerics.sleeping,
    )


def _require_possible(spec: BenchSpec, case: CastCase, ground: Ground) -> None:
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
