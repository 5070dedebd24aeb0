"""A written dataset as the first part of a larger one: what its file tells, and its rows again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
import yaml
from numpy.typing import NDArray

from castblast.dataset.file.check import check
from castblast.dataset.file.provenance import (
    ExplosiveSource,
    Parent,
    differences,
    made_from,
    stored_explosives,
)
from castblast.dataset.file.store import reading_dataset, row_blocks
from castblast.dataset.rows.design import Design
from castblast.dataset.rows.simulation import HISTORY_NAMES, BatchResult
from castblast.design.variables import INPUT_NAMES, OUTPUT_NAMES
from castblast.disk.reading import parse_json
from castblast.errors import CheckError, DatasetError, StaleResultError
from castblast.progress import ProgressCallback, silent
from castblast.specs.loading import make_spec, parse_yaml
from castblast.specs.recipe import Recipe, RecipeSource


@dataclass(frozen=True)
class Existing:
    """A written dataset whose rows another one takes over.

    Attributes
    ----------
    path : Path
    source : RecipeSource
        The recipe it carries.
    explosives : tuple of ExplosiveSource
        Those it carries, in the order of the recipe.
    parents : tuple of Parent
        What it was extended from itself, the oldest first.
    content_sha256 : str
    design : Design
    status : (n,) int8
    """

    path: Path
    source: RecipeSource
    explosives: tuple[ExplosiveSource, ...]
    parents: tuple[Parent, ...]
    content_sha256: str
    design: Design
    status: NDArray[np.int8]

    @property
    def as_parents(self) -> tuple[Parent, ...]:
        """The datasets that an extension of this one extends."""
        recipe = self.source.recipe
        size = len(self.status)
        own = Parent(f"{recipe.name}/{recipe.version}", size, self.content_sha256)
        return (*self.parents, own)

    def extended_source(self, add: int) -> RecipeSource:
        """Recipe of the extension: `add` rows more and the next minor version.

        Raises
        ------
        SpecError
            More rows than a recipe may have.
        """
        content = parse_yaml(self.source.text, f"{self.path}: recipe")
        major, minor, _ = self.source.recipe.version.split(".")
        content |= {"version": f"{major}.{int(minor) + 1}.0", "size": len(self.status) + add}
        text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True)
        return RecipeSource(make_spec(content, Recipe, f"{self.path}: recipe"), text, self.path)

    def results(self) -> Iterator[BatchResult]:
        """Read the stored results again, a block at a time."""
        names = ["status", *OUTPUT_NAMES, *HISTORY_NAMES]
        with reading_dataset(self.path) as dataset:
            for block in row_blocks(dataset[names]):
                yield BatchResult(
                    status=block["status"].to_numpy(),
                    outputs={name: block[name].to_numpy() for name in OUTPUT_NAMES},
                    histories={name: block[name].to_numpy() for name in HISTORY_NAMES},
                )


def read_existing(path: Path, progress: ProgressCallback = silent) -> Existing:
    """Read all but the results of a dataset that is to be extended.

    Raises
    ------
    DatasetError
        The file cannot be read as a dataset.
    CheckError
        It does not pass its own check.
    StaleResultError
        Code or libraries of today are not those that made it.
    SpecError
        Its recipe is none of this version.
    """
    with reading_dataset(path) as dataset:
        faults = check(dataset, progress)
        if faults:
            message = f"{path}: not extended, as it does not pass its own check:\n"
            raise CheckError(message + "\n".join(f"  {fault}" for fault in faults))
        attributes = dict(dataset.attrs)
        text = str(attributes["recipe"])
        where = f"{path}: recipe"
        recipe = make_spec(parse_yaml(text, where), Recipe, where)
        explosives = tuple(stored_explosives(attributes, str(path)).values())
        parents = _parents(path, str(attributes.get("extends", "[]")))
        _require_same_making(path, attributes, made_from(recipe, explosives, parents))
        return Existing(
            path=path,
            source=RecipeSource(recipe, text, path),
            explosives=explosives,
            parents=parents,
            content_sha256=str(attributes["content_sha256"]),
            design=_design(dataset, recipe),
            status=dataset["status"].to_numpy(),
        )


def _parents(path: Path, text: str) -> tuple[Parent, ...]:
    try:
        return tuple(Parent(**entry) for entry in parse_json(text))
    except TypeError:
        raise DatasetError(f"{path}: attribute extends does not name datasets") from None


def _require_same_making(path: Path, attributes: dict[str, object], now: dict[str, object]) -> None:
    """Rows of one dataset come from one physics."""
    before = parse_json(str(attributes["made_from"]), f"{path}: attribute made_from: ")
    changes = differences(before, now)
    if changes:
        lines = "\n".join(f"  {line}" for line in changes)
        message = (
            f"{path}: cannot be extended, as its rows were made by something else than new ones "
            f"would be:\n{lines}\n  either extend it with what made it, or generate all rows anew "
            "from a recipe with a new version"
        )
        raise StaleResultError(message)


def _design(dataset: xr.Dataset, recipe: Recipe) -> Design:
    """Rebuild the design from the columns of a file."""
    size = dataset.sizes["sample"]
    inputs = {
        str(name): np.broadcast_to(variable.to_numpy(), size)
        for name, variable in dataset.variables.items()
        if name in INPUT_NAMES
    }
    return Design(
        sample=dataset["sample"].to_numpy(),
        columns={spec.name: inputs[spec.name] for spec in (*recipe.sampled, *recipe.fixed)},
        inputs=inputs,
        explosive=dataset["explosive"].to_numpy(),
        split=dataset["split"].to_numpy(),
        batch=dataset["design_batch"].to_numpy(),
        drawn=int(dataset.attrs["designs_drawn"]),
    )
