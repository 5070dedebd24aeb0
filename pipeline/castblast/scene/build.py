"""From a bench spec to the scene of a cast, step by step once: what comes after needs no spec."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from castblast.muckpile.bench.geometry import Bench
from castblast.muckpile.cast.case import CastCase
from castblast.muckpile.ground.walls import Walls
from castblast.network import Network
from castblast.progress import ProgressCallback, silent
from castblast.scene.begun import Start
from castblast.scene.bounds import BallSizes
from castblast.scene.case import bench_surroundings, cast_case, require_possible
from castblast.scene.plan import Plan, make_plan
from castblast.scene.start import make_start
from castblast.specs.bench.balls.spec import ChosenSizes
from castblast.specs.bench.bench import BenchSpec
from castblast.specs.bench.ground.spec import Ground, read_ground
from castblast.stopping import NEVER, StopRequest


class Site(NamedTuple):
    """A bench before it holds balls.

    Attributes
    ----------
    bench : Bench
    ground : Ground
        Surfaces that were read, with remarks on their files.
    walls : Walls
        All that balls meet: floor, rock around the bench, slope, ground.
    plan : Plan
        When and how fast each block moves.
    """

    bench: Bench
    ground: Ground
    walls: Walls
    plan: Plan


class Scene(NamedTuple):
    """All that a cast begins with; ``run_cast(scene.case)`` throws it.

    Attributes
    ----------
    site : Site
    start : Start
        Balls before firing and how they came about.
    sizes : ChosenSizes or None
        What the balls stand for; None for a file of balls.
    case : CastCase
    """

    site: Site
    start: Start
    sizes: ChosenSizes | None
    case: CastCase


def read_site(
    spec: BenchSpec,
    folder: Path,
    *,
    one_speed: bool = False,
    network: Network | None = None,
) -> Site:
    """Bench, ground and firing plan of a spec; files of ground and holes are read once.

    Parameters
    ----------
    spec : BenchSpec
    folder : Path
        Where the files that `spec` names lie.
    one_speed : bool
        The velocity of `spec` holds for all, whatever a file of holes says.
    network : Network, optional
        What predicts velocities; default: the one that comes with castblast.

    Raises
    ------
    SpecError
        Faults of a file of ground or holes, or a design that the surrogate cannot take.
    """
    bench = spec.bench.to_bench()
    ground = read_ground(spec.ground, folder, bench)
    return Site(
        bench=bench,
        ground=ground,
        walls=bench_surroundings(spec, bench, ground),
        plan=make_plan(spec, bench, folder, one_speed=one_speed, network=network),
    )


def build(
    spec: BenchSpec,
    site: Site,
    folder: Path,
    packings: Path,
    *,
    threads: int = 0,
    limit: Callable[[BallSizes], None] = lambda sizes: None,
    progress: ProgressCallback = silent,
    stop: StopRequest = NEVER,
) -> Scene:
    """Fill a site with balls and check that it can be thrown.

    In memory: ``site = read_site(spec, folder)``, ``scene = build(spec, site, folder, packings)``,
    ``result = run_cast(scene.case)``.

    Parameters
    ----------
    spec : BenchSpec
    site : Site
        Of the same spec.
    folder : Path
        Where the files that `spec` names lie.
    packings : Path
        Folder of packings, named by the hash of all they depend on.
    threads : int
        0: all cores. The numbers do not depend on it.
    limit : callable
        Refuses too many balls, or unfit ones, before they are packed.
    progress : callable
        Of the packing.
    stop : StopRequest

    Raises
    ------
    SpecError
        Faults of a file of balls, balls that do not fit the bench or that `limit` refuses, walls
        that cut the balls, ground too rough for them, a fixed step above the stable one.
    SimulationError
        The packing became unstable.
    Stopped
        Somebody asked for it; a packing under way is kept beside the finished ones.
    """
    start, sizes = make_start(
        spec, site.bench, site.plan, folder, packings, threads, progress, limit, stop
    )
    case = cast_case(spec, site.walls, start.balls, site.plan, threads)
    require_possible(spec, case, site.ground)
    return Scene(site=site, start=start, sizes=sizes, case=case)
