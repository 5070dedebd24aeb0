"""From a dataset to a larger one: new rows beside the old, which stay as they are."""

from __future__ import annotations

from itertools import chain
from pathlib import Path

import numpy as np

from castblast.dataset.build import build_shards
from castblast.dataset.design import extend_design, join_designs
from castblast.dataset.extend import Existing, read_existing
from castblast.dataset.failures import require_success, summary
from castblast.dataset.final import Rows, write_final
from castblast.dataset.provenance import made_from, rows_hash
from castblast.dataset.simulation import Simulator, blast_simulator
from castblast.dataset.store import require_writable
from castblast.dataset.work import Work
from castblast.dataset.workplace import is_finished, open_work_folder
from castblast.errors import SpecError
from castblast.progress import ProgressCallback, silent
from castblast.stages.generate import (
    GenerateOutcome,
    already_finished,
    finish,
    output_path,
)


def extend(
    dataset: Path,
    add: int,
    out: Path | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    restart: bool = False,
    progress: ProgressCallback = silent,
) -> GenerateOutcome:
    """Write a new dataset of the rows of `dataset` and `add` new ones, as its next minor version.

    Parameters
    ----------
    dataset : Path
        Stays untouched; its rows are taken over, not simulated again.
    add : int
        New rows; their ids follow the largest so far.
    out : Path, optional
        The netCDF file, or a folder for it; default: ``data/NAME/NEW_VERSION/data.nc``.
    workers, scheduler, restart
        As in `stages.generate.generate`.

    Raises
    ------
    SpecError
        Impossible designs, results of something else in the way, code or libraries that are not
        those of the dataset.
    DatasetError
        The dataset cannot be read, or nothing can be written there.
    CheckError
        The dataset does not pass its own check.
    SimulationError
        More failed samples than the recipe allows; the shards are kept.
    """
    existing = read_existing(dataset, lambda _, line: progress(0.0, line))
    simulator = blast_simulator(
        existing.source.recipe, tuple(entry.spec.to_explosive() for entry in existing.explosives)
    )
    return produce_extension(
        existing,
        simulator,
        add,
        out,
        workers=workers,
        scheduler=scheduler,
        restart=restart,
        progress=progress,
    )


def produce_extension(
    existing: Existing,
    simulator: Simulator,
    add: int,
    out: Path | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    restart: bool = False,
    progress: ProgressCallback = silent,
) -> GenerateOutcome:
    """Extend a dataset with a given simulator; see `extend`."""
    source = existing.extended_source(add)
    recipe, parents = source.recipe, existing.as_parents
    path = output_path(source, out)
    if path.resolve() == existing.path.resolve():
        message = f"{path}: is the dataset to be extended; choose another place with --out"
        raise SpecError(message)
    require_writable(path.parent)
    origin = made_from(recipe, existing.explosives, parents)
    if not restart and is_finished(path, origin):
        return already_finished(path)
    new = extend_design(
        recipe,
        simulator,
        str(source.path),
        add=add,
        first_sample=int(existing.design.sample.max()) + 1,
        first_batch=int(existing.design.batch.max()) + 1,
    )
    folder = open_work_folder(path, origin, restart=restart).resolve()
    work = Work(new, simulator, rows_hash(origin), folder, recipe.shard_size)
    lines = build_shards(work, workers=workers, scheduler=scheduler, progress=progress)
    rows = Rows(
        design=join_designs([existing.design, new]),
        status=np.concatenate([existing.status, work.status]),
        results=chain(existing.results(), work.results()),
    )
    names = tuple(entry.name for entry in existing.explosives)
    require_success(recipe, names, rows.design, rows.status)
    content = write_final(
        path, folder, source, existing.explosives, rows, parents=parents, progress=progress
    )
    lines += [f"{parents[-1].size} rows of {parents[-1].id} taken over", summary(rows.status)]
    return finish(path, content, lines)
