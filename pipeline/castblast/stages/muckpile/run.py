"""Throw a bench: pack or read the balls, fire, settle, and write state, profile and pictures."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from castblast.api.muckpile.document import bench_content
from castblast.api.muckpile.files import OPTIONAL_FILES, write_results
from castblast.api.muckpile.ore import follow_ore
from castblast.api.muckpile.velocity import velocity_remarks
from castblast.disk.files import publish, staged, tried
from castblast.disk.locks import LOCK_NAME, only_writer
from castblast.disk.resources import find_spec
from castblast.errors import SimulationError, Status
from castblast.muckpile.cast.solver import CastCase, CastResult, run_cast
from castblast.muckpile.results.metrics import pile_metrics
from castblast.progress import ProgressCallback, silent, with_time_left
from castblast.scene.bounds import BallSizes, require_bounds
from castblast.scene.build import Scene, Site, build, read_site
from castblast.scene.case import describe_sizes
from castblast.scene.options import with_options, with_precision
from castblast.specs.bench.bench import BenchSpec, load_bench
from castblast.specs.bench.ground.spec import Ground
from castblast.stages.muckpile.deck import Decks, write_decks
from castblast.stages.muckpile.extras import Extras, ReadExtras, read_extras
from castblast.stages.muckpile.frames import Frames
from castblast.stages.muckpile.results import describe_run
from castblast.stages.outcome import Outcome
from castblast.stopping import StopRequest, deferred_stop

_PACKING_SHARE, _CAST_SHARE = 0.25, 0.95
_RESTART, _FAILED = "restart.npz", "unstable"


def run_muckpile(
    bench: str | Path,
    out: str | Path | None = None,
    *,
    balls: int | None = None,
    threads: int | None = None,
    velocity: str | float | None = None,
    seed: int | None = None,
    precision: str | None = None,
    packings: str | Path | None = None,
    extras: Extras = Extras(),  # noqa: B008 - a record of constants
    decks: Decks = Decks(),  # noqa: B008 - a record of constants
    progress: ProgressCallback = silent,
) -> Outcome:
    """Run a bench file; a run that was stopped goes on where it was, to the same numbers.

    Results appear together when all of them are written; until then those of an earlier run stay.

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
        Instead of `numerics.precision` of the file.
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
    OutputError
        The folder cannot be written to, or the disk is full.
    LockedError
        Another run writes into the folder.
    SimulationError
        The simulation became unstable; its last restart file is kept.
    Stopped
        Ctrl-C or SIGTERM: what has been done is kept in ``restart.npz``, or beside the packings.
    """
    out = None if out is None else Path(out)
    packings = None if packings is None else Path(packings)
    path = find_spec(bench, "bench")
    spec = with_precision(with_options(load_bench(path), balls, velocity), precision)
    if seed is not None:
        spec = spec.model_copy(update={"seed": seed})
    geometry = spec.bench.to_bench()
    ore_of_bench = path.parent / spec.ore if spec.ore else None
    wanted = read_extras(extras, geometry, ore_of_bench, spec.frame)
    site = read_site(spec, path.parent, one_speed=velocity is not None)
    folder = Path("runs") / spec.name if out is None else out
    job = _Job(
        spec=spec,
        site=site,
        beside=path.parent,
        folder=folder,
        extras=extras,
        wanted=wanted,
        threads=threads or 0,
    )
    packings = folder / "packings" if packings is None else packings
    with tried(folder), only_writer(folder / LOCK_NAME, folder):
        with deferred_stop() as stop:
            report = _long_part(progress, 0.0, _PACKING_SHARE)
            scene = _prepare(job, packings, report, stop)
        if decks.wanted:
            written = write_decks(spec, scene.case, decks)
            remarks = velocity_remarks(site.plan.prediction)
            return _with_remarks(replace(written, remarks=remarks), site.ground)
        return _throw(job, scene, progress)


class _Job(NamedTuple):
    """What is asked for, read and checked."""

    spec: BenchSpec
    site: Site
    beside: Path
    folder: Path
    extras: Extras
    wanted: ReadExtras
    threads: int

    @property
    def restart(self) -> Path:
        """File that keeps the state of the cast until all results are written."""
        return self.folder / _RESTART


def _prepare(job: _Job, packings: Path, progress: ProgressCallback, stop: StopRequest) -> Scene:
    """Balls before firing and the case, within the bounds of disk and memory."""
    frames = job.extras.order(job.wanted.interval)

    def require(sizes: BallSizes) -> None:
        require_bounds(job.spec, sizes, job.folder, job.threads, frames)

    return build(
        job.spec,
        job.site,
        job.beside,
        packings,
        threads=job.threads,
        limit=require,
        progress=progress,
        stop=stop,
    )


def _throw(job: _Job, scene: Scene, progress: ProgressCallback) -> Outcome:
    """Simulate the cast and write all results at once; only then is its restart file removed."""
    spec, wanted = job.spec, job.wanted
    start, case, plan = scene.start, scene.case, job.site.plan
    more = {"fragments": describe_sizes(scene.sizes), **bench_content(spec, job.beside)}
    # Frames of a run that was stopped wait for it beside its restart file.
    resume = job.extras.frames and job.restart.exists()
    with staged(
        job.folder, resume=resume, keep=job.extras.frames, replaces=OPTIONAL_FILES
    ) as scratch:
        cast = _long_part(progress, _PACKING_SHARE, _CAST_SHARE)
        result, frames = _simulate(job, case, scratch, cast)
        progress(_CAST_SHARE, "writing files and pictures")
        metrics = pile_metrics(
            start.balls,
            result.particles,
            job.site.bench,
            block_velocity=case.block_velocity,
            walls=case.walls,
        )
        ore = follow_ore(wanted.ore, wanted.plan, case, result)
        outcome = describe_run(spec, plan.speed, plan.prediction, start, result, metrics, ore)
        outcome = replace(outcome, document={**outcome.document, **more})
        outcome = _with_remarks(outcome, job.site.ground)
        files = write_results(scratch, spec, case, result, outcome.document, ore, plan.label)
        files += frames
    job.restart.unlink(missing_ok=True)
    progress(1.0, f"{result.time:.1f} s simulated")
    return replace(outcome, files=[job.folder / path.relative_to(scratch) for path in files])


def _with_remarks(outcome: Outcome, ground: Ground) -> Outcome:
    """Outcome that says what was mended, left out or found odd in files of ground."""
    if not ground.remarks:
        return outcome
    document = {**outcome.document, "ground_remarks": list(ground.remarks)}
    return replace(outcome, document=document, remarks=[*ground.remarks, *outcome.remarks])


def _simulate(
    job: _Job, case: CastCase, scratch: Path, progress: ProgressCallback
) -> tuple[CastResult, list[Path]]:
    """Throw the bench; frames along the way are kept even if it fails."""
    frames, files, extras = None, [], job.extras
    if extras.frames:
        case = case._replace(snapshot_interval=job.wanted.interval)
        frames = Frames(
            scratch,
            case,
            job.site.bench,
            animation=extras.animation,
            vtk=extras.vtk,
            vtkhdf=extras.vtkhdf,
        )
    with deferred_stop() as stop:
        result = run_cast(case, progress, frames, job.restart, stop=stop)
    if frames is not None:
        progress(1.0, "writing frames")
        files = frames.close()
    if Status(result.status) is Status.UNSTABLE_STEP:
        message = (
            f"{job.spec.name}: the simulation became unstable at {result.failed_time:.3g} s "
            f"(ball {result.failed_ball})"
        )
        if job.restart.exists():
            message += f"; its last good state is kept in {job.restart}"
        if files:
            aside = job.folder / _FAILED
            shutil.rmtree(aside, ignore_errors=True)
            publish(scratch, aside)
            message += f"; its frames are in {aside}"
        raise SimulationError(message)
    return result, files


def _part(progress: ProgressCallback, low: float, high: float) -> ProgressCallback:
    """Progress of one part of the run; the share, an estimate there, never falls."""
    reached = 0.0

    def report(share: float, line: str) -> None:
        nonlocal reached
        reached = max(reached, share)
        progress(low + reached * (high - low), line)

    return report


def _long_part(progress: ProgressCallback, low: float, high: float) -> ProgressCallback:
    """The same for a part that takes long: with the time that is left of it."""
    return with_time_left(_part(progress, low, high))
