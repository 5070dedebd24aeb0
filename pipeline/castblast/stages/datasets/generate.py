"""From a recipe to a dataset: design, simulate, check, write, describe."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from castblast.dataset.building.build import build_shards
from castblast.dataset.building.final import Rows, write_final
from castblast.dataset.building.process import peak_memory
from castblast.dataset.building.work import Work
from castblast.dataset.building.workplace import (
    close_work_folder,
    is_finished,
    open_work_folder,
    sole_builder,
)
from castblast.dataset.file.card import write_card
from castblast.dataset.file.failures import require_success, summary
from castblast.dataset.file.provenance import ExplosiveSource, load_explosives, made_from, rows_hash
from castblast.dataset.file.store import reading_dataset
from castblast.dataset.rows.design import make_design
from castblast.dataset.rows.simulation import Simulator, blast_simulator
from castblast.disk.plain import as_plain
from castblast.progress import ProgressCallback, silent
from castblast.specs.recipe import RecipeSource, load_recipe
from castblast.stages.outcome import Outcome

CARD_NAME = "DATASHEET.md"


class GenerateOutcome(Outcome, os.PathLike[str]):
    """What was generated; stands for the path of the dataset where a path is needed."""

    @property
    def path(self) -> Path:
        """The dataset."""
        return Path(self.document["path"])

    def __fspath__(self) -> str:
        """Path of the dataset."""
        return str(self.path)


def generate(
    recipe: Path,
    out: Path | None = None,
    *,
    size: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    restart: bool = False,
    progress: ProgressCallback = silent,
) -> GenerateOutcome:
    """Build the dataset of a recipe file; goes on where an earlier run of it was stopped.

    Parameters
    ----------
    recipe : Path
    out : Path, optional
        The netCDF file, or a folder for it; default: ``data/NAME/VERSION/data.nc``.
    size : int, optional
        Rows instead of those of the recipe.
    workers : int, optional
        Threads; default: one per core that may be used.
    scheduler : str, optional
        Address of a running Dask scheduler whose workers see the folder of `out`.
    restart : bool
        Discard what an earlier run left.

    Raises
    ------
    SpecError
        Faults of recipe or explosives, impossible designs, results of another recipe in the way.
    OutputError
        Nothing can be written there, or the disk is full.
    LockedError
        Another process is building the same dataset.
    SimulationError
        More failed samples than the recipe allows; the shards are kept.
    """
    source = load_recipe(recipe, size)
    explosives = load_explosives(source)
    simulator = blast_simulator(
        source.recipe, tuple(entry.spec.to_explosive() for entry in explosives)
    )
    path = output_path(source, out)
    return produce(
        source,
        explosives,
        simulator,
        path,
        workers=workers,
        scheduler=scheduler,
        restart=restart,
        progress=progress,
    )


def produce(
    source: RecipeSource,
    explosives: tuple[ExplosiveSource, ...],
    simulator: Simulator,
    path: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    restart: bool = False,
    progress: ProgressCallback = silent,
) -> GenerateOutcome:
    """Build a dataset with a given simulator; see `generate`."""
    recipe = source.recipe
    origin = made_from(recipe, explosives)
    with sole_builder(path):
        if not restart and is_finished(path, origin):
            return already_finished(path)
        progress(0.0, "drawing the design")
        design = make_design(recipe, simulator, str(source.path))
        folder = open_work_folder(path, origin, restart=restart).resolve()
        work = Work(design, simulator, rows_hash(origin), folder, recipe.shard_size)
        lines = build_shards(work, workers=workers, scheduler=scheduler, progress=progress)
        names = tuple(entry.name for entry in explosives)
        require_success(recipe, names, design, work.status)
        rows = Rows(design, work.status, work.results())
        content = write_final(path, folder, source, explosives, rows, progress=progress)
        return finish(path, content, [*lines, summary(work.status)])


def already_finished(path: Path) -> GenerateOutcome:
    """Leave a dataset alone that is there, whole, and made from the same."""
    line = f"{path}: finished already, from the same recipe"
    return GenerateOutcome(document=_document(path), lines=[line])


def finish(path: Path, content: str, lines: list[str]) -> GenerateOutcome:
    """Describe a dataset that lies in its place, and remove its shards."""
    with reading_dataset(path) as dataset:
        card = write_card(dataset, path.with_name(CARD_NAME))
    close_work_folder(path)
    wrote = (
        f"wrote {path} ({path.stat().st_size / 1e6:.1f} MB, content {content[:12]}) and "
        f"{card.name}; peak {peak_memory() / 1e6:.0f} MB"
    )
    return GenerateOutcome(document=_document(path), lines=[*lines, wrote])


def output_path(source: RecipeSource, out: Path | None) -> Path:
    """File of the dataset of a recipe; `out` is the file, or a folder for it."""
    if out is None:
        return Path("data") / source.recipe.name / source.recipe.version / "data.nc"
    return out if out.suffix == ".nc" else out / "data.nc"


def _document(path: Path) -> dict[str, Any]:
    with reading_dataset(path) as dataset:
        attributes = dict(dataset.attrs)
    keys = ("id", "n_ok", "n_failed", "designs_drawn", "recipe_sha256", "content_sha256")
    return {"path": str(path), **{key: as_plain(attributes[key]) for key in keys}}
