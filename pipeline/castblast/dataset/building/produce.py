"""From a recipe to a dataset in its place: design, simulate, check, write, describe."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

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
from castblast.dataset.file.provenance import load_explosives, made_from, rows_hash
from castblast.dataset.file.store import reading_dataset
from castblast.dataset.rows.design import make_design
from castblast.dataset.rows.simulation import Simulator, blast_simulator
from castblast.progress import ProgressCallback, silent
from castblast.specs.recipe import RecipeSource

CARD_NAME = "DATASHEET.md"


class Built(NamedTuple):
    """A dataset that lies in its place, and what was done, for people."""

    path: Path
    lines: list[str]


def build_dataset(
    source: RecipeSource,
    path: Path,
    simulator: Simulator | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    restart: bool = False,
    progress: ProgressCallback = silent,
) -> Built:
    """Build the dataset of a recipe; resumes an earlier run that was stopped.

    Parameters
    ----------
    source : RecipeSource
    path : path
        The netCDF file.
    simulator : Simulator, optional
        Default: the physics.
    workers : int, optional
        Threads; default: one per core that may be used.
    scheduler : str, optional
        Address of a running Dask scheduler whose workers see the folder of `path`.
    restart : bool
        Discard what an earlier run left.

    Raises
    ------
    SpecError
        Impossible designs, results of another recipe in the way.
    OutputError
        Nothing can be written there, or the disk is full.
    LockedError
        Another process is building the same dataset.
    SimulationError
        More failed samples than the recipe allows; the shards are kept.
    """
    recipe, explosives = source.recipe, load_explosives(source)
    if simulator is None:
        simulator = blast_simulator(recipe, tuple(one.spec.to_explosive() for one in explosives))
    origin = made_from(recipe, explosives)
    with sole_builder(path):
        if not restart and is_finished(path, origin):
            return already_built(path)
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


def already_built(path: Path) -> Built:
    """Leave a dataset alone that is there, whole, and made from the same."""
    return Built(path, [f"{path}: finished already, from the same recipe"])


def finish(path: Path, content: str, lines: list[str]) -> Built:
    """Describe a dataset that lies in its place, and remove its shards."""
    with reading_dataset(path) as dataset:
        card = write_card(dataset, path.with_name(CARD_NAME))
    close_work_folder(path)
    wrote = (
        f"wrote {path} ({path.stat().st_size / 1e6:.1f} MB, content {content[:12]}) and "
        f"{card.name}; peak {peak_memory() / 1e6:.0f} MB"
    )
    return Built(path, [*lines, wrote])


def output_path(source: RecipeSource, out: str | Path | None) -> Path:
    """File of the dataset of a recipe; `out` is the file, or a folder for it."""
    if out is None:
        return Path("data") / source.recipe.name / source.recipe.version / "data.nc"
    out = Path(out)
    return out if out.suffix == ".nc" else out / "data.nc"
