"""Balls before firing: read from a file, taken from an earlier packing, or packed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from castblast.disk.files import write_with
from castblast.disk.reading import read_npz
from castblast.errors import SimulationError, SpecError, Status
from castblast.identity import digest, source_hash
from castblast.muckpile.balls.particles import Particles, particles_at_rest
from castblast.muckpile.bench.geometry import Bench, bench_outline
from castblast.muckpile.bench.packing import count_of, fill_bench
from castblast.muckpile.bench.sizes import Sizes
from castblast.muckpile.cast.restart import CAST_SOURCES, Keeper
from castblast.progress import ProgressCallback
from castblast.scene.begun import Start
from castblast.scene.bounds import BallSizes, sizes_of_balls, sizes_of_table
from castblast.scene.plan import Plan
from castblast.specs.bench.balls.files import read_balls
from castblast.specs.bench.balls.spec import ChosenSizes, choose_sizes
from castblast.specs.bench.bench import BenchSpec
from castblast.specs.bench.place import extent, place_faults
from castblast.stopping import NEVER, StopRequest


def make_start(
    spec: BenchSpec,
    bench: Bench,
    plan: Plan,
    beside: Path,
    packings: Path,
    threads: int,
    progress: ProgressCallback,
    require: Callable[[BallSizes], None],
    stop: StopRequest = NEVER,
) -> tuple[Start, ChosenSizes | None]:
    """Read the balls, or pack them, or take a packing of the same content from `packings`.

    Parameters
    ----------
    spec : BenchSpec
    bench : Bench
    plan : Plan
        Says which block a ball belongs to.
    beside : Path
        Folder of the bench file.
    packings : Path
        Folder of packings, named by the hash of all they depend on.
    threads : int
    progress : callable
    require : callable
        Refuses too many balls, or unfit ones, before they are packed.
    stop : StopRequest

    Raises
    ------
    SpecError
        Faults of a file of balls, balls that do not fit the bench, or that `require` refuses.
    SimulationError
        The packing became unstable.
    Stopped
        Somebody asked for it; a packing under way is kept beside the finished ones.
    """
    if spec.balls.file is not None:
        path = beside / spec.balls.file
        balls = read_balls(path, spec.contact.to_law())
        require(sizes_of_balls(balls.radius))
        if (balls.block < 0).all():
            balls = balls._replace(block=plan.blocks_of(balls.position, bench))
        elif balls.block.max() >= len(plan.delay):
            raise SpecError(
                f"{path}: block: {balls.block.max()} of ball {int(balls.block.argmax())}: the "
                f"plan has the blocks 0 to {len(plan.delay) - 1}"
            )
        _require_near(path, balls, bench)
        return Start(balls), None
    try:
        chosen = choose_sizes(spec.balls, bench, spec.design() or {})
    except ValueError as fault:
        raise SpecError(f"{spec.name}: balls: {fault}") from None
    count = count_of(bench, chosen.sizes, spec.balls.solid_fraction)
    require(sizes_of_table(chosen.sizes, count))
    key = _packing_key(spec, bench, chosen.sizes)
    path = packings / f"{key[:16]}.npz"
    start = _read_packing(path, key)
    if start is None:
        keeper = Keeper(packings / f"{key[:16]}.part.npz", key)
        start = _pack(spec, bench, chosen.sizes, threads, progress, keeper, stop)
        _write_packing(path, key, start)
        keeper.remove()
    else:
        progress(1.0, "packing of an earlier run")
    block = plan.blocks_of(start.balls.position, bench)
    return start._replace(balls=start.balls._replace(block=block)), chosen


def _require_near(path: Path, balls: Particles, bench: Bench) -> None:
    """Refuse balls in another grid, where they would fall beside all walls."""
    onto = "move all balls by {offset}"
    if faults := place_faults(extent(balls.position), bench, onto, inside=True):
        raise SpecError("\n".join(f"{path}: {fault}" for fault in faults))


def _pack(
    spec: BenchSpec,
    bench: Bench,
    sizes: Sizes,
    threads: int,
    progress: ProgressCallback,
    keeper: Keeper,
    stop: StopRequest,
) -> Start:
    try:
        packing = fill_bench(
            bench,
            sizes=sizes,
            solid_fraction=spec.balls.solid_fraction,
            seed=spec.seed,
            law=spec.contact.to_law(),
            threads=threads,
            progress=progress,
            restart=keeper,
            stop=stop,
        )
    except ValueError as fault:
        raise SpecError(f"{spec.name}: {fault}") from None
    if Status(packing.status) is Status.UNSTABLE_STEP:
        message = f"{spec.name}: the bench could not be packed: {Status(packing.status).meaning}"
        raise SimulationError(message)
    settled = Status(packing.status) is Status.OK
    return Start(packing.particles, float(packing.solid_fraction), settled=settled)


def _packing_key(spec: BenchSpec, bench: Bench, sizes: Sizes) -> str:
    """Hash of all that a packing depends on, the code included; not of blocks and firing."""
    outline = bench_outline(bench)
    numbers = (outline.corner, outline.lean, sizes.radius, sizes.below)
    parts = [repr(bench.height), repr(spec.balls.solid_fraction), spec.contact.sha256()]
    parts += [str(spec.seed), source_hash(CAST_SOURCES)]
    contents = (np.asarray(array, dtype="<f8").tobytes() + b"/" for array in numbers)
    return digest(*contents, " ".join(parts))


def _read_packing(path: Path, key: str) -> Start | None:
    """Read a packing of this `key`; None if there is none, or none that can be used."""
    try:
        stored = read_npz(path)
        if str(stored["key"]) != key:
            return None
        balls = particles_at_rest(stored["x"], stored["r"])
        fraction, settled = float(stored["solid_fraction"]), bool(stored["settled"])
        return Start(balls, fraction, settled=settled, reused=True)
    except (SpecError, ValueError, TypeError, KeyError):
        return None


def _write_packing(path: Path, key: str, start: Start) -> None:
    arrays: dict[str, Any] = {
        "key": np.array(key),
        "x": start.balls.position,
        "r": start.balls.radius,
        "solid_fraction": np.array(start.solid_fraction),
        "settled": np.array(start.settled),
    }
    write_with(path, lambda name: np.savez(name, **arrays))
