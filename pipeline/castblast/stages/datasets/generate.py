"""From a recipe to a dataset: a shell around `castblast.dataset.building.produce`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from castblast.dataset.building.produce import Built, build_dataset, output_path
from castblast.dataset.file.store import reading_dataset
from castblast.disk.plain import as_plain
from castblast.progress import ProgressCallback, silent
from castblast.specs.recipe import load_recipe
from castblast.stages.outcome import Outcome


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
    recipe: str | Path,
    out: str | Path | None = None,
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
    recipe : str or path
    out : str or path, optional
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
    built = build_dataset(
        source,
        output_path(source, out),
        workers=workers,
        scheduler=scheduler,
        restart=restart,
        progress=progress,
    )
    return generated(built)


def generated(built: Built) -> GenerateOutcome:
    """Say what was built."""
    return GenerateOutcome(document=_document(built.path), lines=built.lines)


def _document(path: Path) -> dict[str, Any]:
    with reading_dataset(path) as dataset:
        attributes = dict(dataset.attrs)
    keys = ("id", "n_ok", "n_failed", "designs_drawn", "recipe_sha256", "content_sha256")
    return {"path": str(path), **{key: as_plain(attributes[key]) for key in keys}}
