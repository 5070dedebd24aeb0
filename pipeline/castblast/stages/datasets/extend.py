"""From a dataset to a larger one: new rows beside the old, which stay as they are."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from castblast.dataset.building.build import build_shards
from castblast.dataset.building.extend import Existing, read_existing
from castblast.dataset.building.final import Rows, write_final
from castblast.dataset.building.produce import already_built, finish, output_path
from castblast.dataset.building.work import Work
from castblast.dataset.building.workplace import is_finished, open_work_folder, sole_builder
from castblast.dataset.file.failures import require_success, summary
from castblast.dataset.file.provenance import Parent, made_from, rows_hash
from castblast.dataset.rows.design import Design, extend_design, join_designs
from castblast.dataset.rows.design_file import design_of_rows, read_design_file, rows_sha256
from castblast.dataset.rows.simulation import Simulator, blast_simulator
from castblast.errors import SpecError
from castblast.progress import ProgressCallback, silent
from castblast.specs.recipe import Recipe
from castblast.stages.datasets.generate import GenerateOutcome, generated
from castblast.types import FloatArray


@dataclass(frozen=True)
class _NewRows:
    """Rows to add: so many to be drawn, or those of a design file."""

    count: int
    parents: tuple[Parent, ...]
    path: Path | None = None
    chosen: tuple[dict[str, FloatArray], NDArray[np.int8]] | None = None

    def design(self, existing: Existing, recipe: Recipe, simulator: Simulator) -> Design:
        """Draw or complete the rows, with ids and a batch number after those there are."""
        sample = int(existing.design.sample.max()) + 1
        batch = int(existing.design.batch.max()) + 1
        if self.chosen is not None:
            where = str(self.path)
            return design_of_rows(
                recipe, simulator, *self.chosen, where, first_sample=sample, batch=batch
            )
        where = str(existing.path)
        return extend_design(
            recipe, simulator, where, add=self.count, first_sample=sample, first_batch=batch
        )


def _new_rows(existing: Existing, add: int | str | Path) -> _NewRows:
    parents = existing.as_parents
    if isinstance(add, int):
        return _NewRows(add, parents)
    names = tuple(entry.name for entry in existing.explosives)
    add = Path(add)
    chosen = read_design_file(add, existing.source.recipe, names)
    own = parents[-1]._replace(design_sha256=rows_sha256(*chosen))
    return _NewRows(len(chosen[1]), (*parents[:-1], own), add, chosen)


def extend(
    dataset: str | Path,
    add: int | str | Path,
    out: str | Path | None = None,
    *,
    simulator: Simulator | None = None,
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
    add : int or Path
        Number of new rows, or a design file of them (see `dataset.rows.design_file`): those are all
        training rows. Their ids follow the largest so far.
    out : Path, optional
        The netCDF file, or a folder for it; default: ``data/NAME/NEW_VERSION/data.nc``.
    simulator : Simulator, optional
        Default: the physics.
    workers, scheduler, restart
        As in `stages.datasets.generate.generate`.

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
    existing = read_existing(Path(dataset), lambda _, line: progress(0.0, line))
    new_rows = _new_rows(existing, add)
    source, parents = existing.extended_source(new_rows.count), new_rows.parents
    recipe = source.recipe
    if simulator is None:
        products = tuple(entry.spec.to_explosive() for entry in existing.explosives)
        simulator = blast_simulator(recipe, products)
    path = output_path(source, out)
    if path.resolve() == existing.path.resolve():
        message = f"{path}: is the dataset to be extended; choose another place with --out"
        raise SpecError(message)
    origin = made_from(recipe, existing.explosives, parents)
    with sole_builder(path):
        if not restart and is_finished(path, origin):
            return generated(already_built(path))
        new = new_rows.design(existing, recipe, simulator)
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
        return generated(finish(path, content, lines))
