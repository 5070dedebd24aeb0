"""Throw a bench: pack or read the balls, fire, settle, and write state, profile and pictures."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from castblast.errors import SimulationError, SpecError, Status
from castblast.files import write_with
from castblast.kernel import source_hash
from castblast.muckpile.bench import Bench, assign_blocks, block_shape, block_velocities
from castblast.muckpile.packing import fill_bench, mean_radius_for_count
from castblast.muckpile.particles import Particles, particles_at_rest
from castblast.muckpile.metrics import pile_metrics
from castblast.muckpile.solver import CastCase, run_cast
from castblast.muckpile.walls import bench_walls
from castblast.progress import ProgressCallback, silent
from castblast.specs.balls import read_balls
from castblast.specs.bench import BallsSpec, BenchSpec, find_bench, load_bench
from castblast.specs.loading import make_spec
from castblast.specs.quantity import parse_quantity
from castblast.stages.muckpile_results import MuckpileOutcome, Start, describe_run, write_results

_PACKING_SHARE, _CAST_SHARE = 0.25, 0.95
_MAX_VELOCITY = 100.0


def run_muckpile(
    bench: str | Path,
    out: Path | None = None,
    *,
    balls: int | None = None,
    threads: int | None = None,
    velocity: str | float | None = None,
    progress: ProgressCallback = silent,
) -> MuckpileOutcome:
    """Run a bench file.

    Parameters
    ----------
    bench : str or path
        Bench file, or the name of one that comes with castblast.
    out : path, optional
        Folder of the results; default ``runs/NAME``. A packing found there is used again if it was
        made from the same numbers.
    balls : int, optional
        About this many balls instead of those of the file; changes their size.
    threads : int, optional
        Default: all cores. The numbers do not depend on it.
    velocity : str or float [m s-1], optional
        Instead of that of the file; a text carries its unit.
    progress : callback

    Raises
    ------
    SpecError
        Faults of the bench file or of the file of balls.
    SimulationError
        The simulation became unstable.
    """
    path = find_bench(bench)
    spec = _with_options(load_bench(path), balls, velocity)
    geometry = spec.bench.to_bench()
    speed, prediction = _speed(spec)
    folder = Path("runs") / spec.name if out is None else out
    folder.mkdir(parents=True, exist_ok=True)
    threads = threads or 0
    start = _start(
        spec, geometry, path.parent, folder, threads, _part(progress, 0.0, _PACKING_SHARE)
    )
    case = _case(spec, geometry, start.balls, speed, threads)
    result = run_cast(case, _part(progress, _PACKING_SHARE, _CAST_SHARE))
    if Status(result.status) is Status.UNSTABLE_STEP:
        message = (
            f"{spec.name}: the simulation became unstable at {result.failed_time:.3g} s "
            f"(ball {result.failed_ball})"
        )
        raise SimulationError(message)
    progress(_CAST_SHARE, "writing files and pictures")
    metrics = pile_metrics(
        start.balls,
        result.particles,
        geometry,
        block_velocity=case.block_velocity,
        walls=case.walls,
    )
    outcome = describe_run(spec, speed, prediction, start, result, metrics)
    files = write_results(folder, spec, case, result, outcome.document)
    progress(1.0, f"{result.time:.1f} s simulated")
    return MuckpileOutcome(outcome.document, outcome.title, outcome.rows, files)


def _with_options(spec: BenchSpec, balls: int | None, velocity: str | float | None) -> BenchSpec:
    """Bench spec with what the command line sets instead of the file."""
    update: dict[str, Any] = {}
    if balls is not None:
        if spec.balls.file is not None:
            message = f"--balls: {spec.name} takes its balls from {spec.balls.file}"
            raise SpecError(message)
        made = spec.balls.model_dump() | {"count": balls, "mean_radius": None}
        update["balls"] = make_spec(made, BallsSpec, "--balls")
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


def _speed(spec: BenchSpec) -> tuple[float, dict[str, Any] | None]:
    """Initial velocity [m s-1] of the blocks, and the prediction it comes from."""
    design = spec.design()
    if design is None:
        return spec.velocity or 0.0, None
    from castblast.stages.predict import predict

    values = {name: value for name, value in design.items() if name != "explosive"}
    answer = predict(values, design["explosive"])
    kept = ("explosive", "burden_velocity", "inputs", "in_domain", "domain_faults", "model")
    return answer["burden_velocity"], {key: answer[key] for key in kept}


def _part(progress: ProgressCallback, low: float, high: float) -> ProgressCallback:
    """Progress of one part of the run; the share, an estimate there, never falls."""
    reached = 0.0

    def report(share: float, line: str) -> None:
        nonlocal reached
        reached = max(reached, share)
        progress(low + reached * (high - low), line)

    return report


def _start(
    spec: BenchSpec,
    bench: Bench,
    beside: Path,
    folder: Path,
    threads: int,
    progress: ProgressCallback,
) -> Start:
    """Read the balls, or pack them, or take the packing of an earlier run from `folder`."""
    if spec.balls.file is not None:
        balls = read_balls(beside / spec.balls.file)
        if spec.firing.pattern != "none" and (balls.block < 0).all():
            balls = balls._replace(block=assign_blocks(balls.position, bench))
        return Start(balls)
    key, cache = _packing_key(spec), folder / "packing.npz"
    stored = _read_packing(cache, key)
    if stored is not None:
        progress(1.0, "packing of an earlier run")
        return stored
    radius = spec.balls.mean_radius
    if radius is None:
        assert spec.balls.count is not None
        radius = mean_radius_for_count(
            bench, spec.balls.count, spec.balls.relative_deviation, spec.balls.solid_fraction
        )
    faults = spec.room_faults(radius)
    if faults:
        raise SpecError("\n".join(f"{spec.name}: {fault}" for fault in faults))
    packing = fill_bench(
        bench,
        mean_radius=radius,
        relative_deviation=spec.balls.relative_deviation,
        solid_fraction=spec.balls.solid_fraction,
        seed=spec.seed,
        law=spec.contact.to_law(),
        threads=threads,
        progress=progress,
    )
    if Status(packing.status) is Status.UNSTABLE_STEP:
        message = f"{spec.name}: the bench could not be packed: {Status(packing.status).meaning}"
        raise SimulationError(message)
    settled = Status(packing.status) is Status.OK
    start = Start(packing.particles, float(packing.solid_fraction), settled=settled)
    _write_packing(cache, key, start)
    return start


def _packing_key(spec: BenchSpec) -> str:
    """Hash of all that a packing depends on, the code included."""
    parts = [spec.bench.sha256(), spec.balls.sha256(), spec.contact.sha256(), str(spec.seed)]
    parts.append(source_hash(("kernel.py", "muckpile")))
    return hashlib.sha256(" ".join(parts).encode()).hexdigest()


def _read_packing(path: Path, key: str) -> Start | None:
    try:
        with np.load(path, allow_pickle=False) as stored:
            if str(stored["key"]) != key:
                return None
            balls = particles_at_rest(stored["x"], stored["r"], stored["block"])
            fraction, settled = float(stored["solid_fraction"]), bool(stored["settled"])
            return Start(balls, fraction, settled=settled, reused=True)
    except (OSError, ValueError, KeyError, EOFError):
        return None


def _write_packing(path: Path, key: str, start: Start) -> None:
    balls = start.balls
    arrays: dict[str, Any] = {
        "key": np.array(key),
        "x": balls.position,
        "r": balls.radius,
        "block": balls.block,
        "solid_fraction": np.array(start.solid_fraction),
        "settled": np.array(start.settled),
    }
    write_with(path, lambda name: np.savez(name, **arrays))


def _case(spec: BenchSpec, bench: Bench, balls: Particles, speed: float, threads: int) -> CastCase:
    rows, columns = block_shape(bench)
    slope = spec.slope
    walls = bench_walls(
        bench,
        rear=spec.bench.rear,
        ends=spec.bench.ends,
        slope_distance=slope.distance if slope else None,
        **({"slope_angle": slope.angle} if slope else {}),
    )
    if spec.firing.pattern == "none":
        balls = balls._replace(block=np.full_like(balls.block, -1))
    return CastCase(
        particles=balls,
        law=spec.contact.to_law(),
        walls=walls,
        block_delay=spec.firing.block_delay(bench),
        block_velocity=block_velocities(
            speed,
            rows * columns,
            azimuth=spec.direction.azimuth,
            elevation=spec.direction.elevation,
        ),
        hold_unfired=spec.firing.hold_unfired,
        max_time=spec.stop.longest_time,
        stop_energy_ratio=spec.stop.energy_ratio,
        stop_duration=spec.stop.duration,
        threads=threads,
    )
