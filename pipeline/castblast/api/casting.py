"""From a bench to its muckpile: packed, fired, settled and measured, in memory."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from castblast.api.bench import Bench, load_bench
from castblast.api.muckpile.document import bench_content, run_document
from castblast.api.muckpile.ore import follow_ore
from castblast.api.muckpile.pile import Muckpile, Run
from castblast.api.shared.reporting import Progress, reporter
from castblast.errors import SimulationError, SpecError, Status
from castblast.extras import require
from castblast.muckpile.cast.solver import run_cast
from castblast.muckpile.results.metrics import pile_metrics
from castblast.muckpile.results.ore import DigPlan
from castblast.progress import part
from castblast.scene.bounds import BallSizes, require_bounds
from castblast.scene.build import build, read_site
from castblast.scene.case import describe_sizes
from castblast.scene.options import with_options, with_precision
from castblast.specs.bench.ground.spec import Ground
from castblast.specs.bench.ore import read_ore
from castblast.specs.quantity import parse_quantity
from castblast.stopping import deferred_stop
from castblast.types import FloatArray

if TYPE_CHECKING:
    from castblast.api.model import Model

_PACKING_SHARE = 0.25


def cast(
    bench: Bench | str | Path | Mapping[str, Any],
    *,
    velocity: str | float | None = None,
    model: Model | None = None,
    balls: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    precision: str | None = None,
    snapshots: str | float | None = None,
    progress: Progress = None,
) -> Muckpile:
    """Pack a bench with balls, fire it and let the muckpile come to rest.

    Parameters
    ----------
    bench : Bench, str, path or mapping
        See `castblast.load_bench`.
    velocity : str or float [m s-1], optional
        Instead of that of the bench.
    model : Model, optional
        What predicts velocities where the bench asks for that; default: ``full``.
    balls : int, optional
        About so many instead of those of the bench; changes their size.
    seed : int, optional
        Instead of that of the bench.
    threads : int, optional
        Default: all cores. The numbers do not depend on it.
    precision : {"mixed", "float64"}, optional
    snapshots : str or float [s], optional
        Simulated time between two states that are kept; default: none are.
    progress : bool or callable, optional
        True: a line on the screen. The work can be interrupted.

    Returns
    -------
    Muckpile

    Raises
    ------
    MissingLibraryError
        Numba or SciPy is not installed.
    SpecError
        Faults of the bench or of a file it names; what cannot be cast.
    SimulationError
        The simulation became unstable.

    Examples
    --------
    >>> import castblast as cb
    >>> pile = cb.cast("demo", balls=300, velocity="10 m/s")
    >>> bool(pile.metrics["throw_x"] > 1.0), pile.faults
    (True, [])
    """
    require("simulate", purpose="castblast.cast")
    opened = bench if isinstance(bench, Bench) else load_bench(bench)
    spec = with_precision(with_options(opened.spec, balls, velocity), precision)
    spec = spec if seed is None else spec.model_copy(update={"seed": int(seed)})
    network = None if model is None else model.network
    site = read_site(spec, opened.folder, one_speed=velocity is not None, network=network)
    geometry, plan = site.bench, site.plan
    polygons = read_ore(opened.folder / spec.ore, geometry, spec.frame) if spec.ore else ()
    interval = _interval(snapshots)
    report, count = reporter(progress), threads or 0
    kept: list[tuple[float, FloatArray]] = []
    with TemporaryDirectory(prefix="castblast-") as scratch, deferred_stop() as stop:

        def limit(sizes: BallSizes) -> None:
            require_bounds(spec, sizes, Path(scratch), count)

        scene = build(
            spec,
            site,
            opened.folder,
            Path(scratch),
            threads=count,
            limit=limit,
            progress=part(report, 0.0, _PACKING_SHARE),
            stop=stop,
        )
        start, case = scene.start, scene.case._replace(snapshot_interval=interval)
        result = run_cast(
            case,
            part(report, _PACKING_SHARE, 1.0),
            (lambda time, state: kept.append((time, state.position.copy()))) if interval else None,
            stop=stop,
        )
    if Status(result.status) is Status.UNSTABLE_STEP:
        message = (
            f"{spec.name}: the simulation became unstable at {result.failed_time:.3g} s "
            f"(ball {result.failed_ball})"
        )
        raise SimulationError(message)
    metrics = pile_metrics(
        start.balls,
        result.particles,
        geometry,
        block_velocity=case.block_velocity,
        walls=case.walls,
    )
    ore = follow_ore(polygons, DigPlan(block=geometry.spacing), case, result)
    document = run_document(spec, plan.speed, plan.prediction, start, result, metrics, ore)
    document |= {"fragments": describe_sizes(scene.sizes), **bench_content(spec, opened.folder)}
    document |= _ground_remarks(site.ground)
    report(1.0, f"{result.time:.1f} s simulated")
    return Muckpile(
        Run(
            spec=spec,
            folder=opened.folder,
            plan=plan,
            start=start,
            case=case,
            result=result,
            metrics=metrics,
            ore=ore,
            document=document,
            snapshots=kept,
        )
    )


def _ground_remarks(ground: Ground) -> dict[str, Any]:
    return {"ground_remarks": list(ground.remarks)} if ground.remarks else {}


def _interval(snapshots: str | float | None) -> float:
    """Time [s] between two states that are kept; 0: none are."""
    if snapshots is None:
        return 0.0
    text = isinstance(snapshots, str)
    number = parse_quantity(snapshots, "s", "snapshots") if text else float(snapshots)
    if not 0.0 < number < float("inf"):
        message = f"snapshots: {snapshots}: must be larger than 0 s"
        raise SpecError(message, field="snapshots", value=snapshots, allowed="above 0 s")
    return number
