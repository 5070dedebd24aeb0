"""The last step of a build: from shards to one file that has passed its own check."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from castblast.dataset.building.assemble import assemble
from castblast.dataset.file.check import check
from castblast.dataset.file.content import ContentHash
from castblast.dataset.file.provenance import ExplosiveSource, Parent, global_attributes
from castblast.dataset.file.store import disk_faults, flush, reading, write_blocks
from castblast.dataset.rows.design import Design
from castblast.dataset.rows.simulation import BatchResult
from castblast.disk.files import write_with
from castblast.errors import CheckError, Status
from castblast.progress import ProgressCallback, silent
from castblast.specs.recipe import RecipeSource


@dataclass(frozen=True)
class Rows:
    """All rows of a dataset to be written.

    Attributes
    ----------
    design : Design
    status : (n,) int8
    results : iterable of BatchResult
        In the order of the design, in parts of any length; gone through once.
    """

    design: Design
    status: NDArray[np.int8]
    results: Iterable[BatchResult]


def write_final(
    path: Path,
    folder: Path,
    source: RecipeSource,
    explosives: tuple[ExplosiveSource, ...],
    rows: Rows,
    *,
    parents: tuple[Parent, ...] = (),
    progress: ProgressCallback = silent,
) -> str:
    """Write a dataset, read it back, check it, and only then put it in its place.

    Parameters
    ----------
    path : Path
        The dataset.
    folder : Path
        On the same disk, for the file until it is complete.

    Returns
    -------
    str
        Its content hash.

    Raises
    ------
    DatasetError
        A shard is damaged, or the disk is full. The shards stay where they are.
    CheckError
        The rows break a rule of the format.
    """
    size = len(rows.design.sample)
    failed = int(np.count_nonzero(rows.status != Status.OK))
    attributes = global_attributes(
        source,
        explosives,
        drawn=rows.design.drawn,
        n_ok=size - failed,
        n_failed=failed,
        parents=parents,
    )

    def blocks() -> Iterator[xr.Dataset]:
        content, done = ContentHash(), 0
        for block in assemble(source.recipe, explosives, rows.design, rows.results):
            content.add(block)
            yield block
            done += block.sizes["sample"]
            progress(1.0, f"wrote {done} of {size} samples")
        attributes["content_sha256"] = content.hexdigest()

    def write(name: Path) -> None:
        with disk_faults(path):
            write_blocks(name, size, blocks(), attributes)
            flush(name)
        _require_sound(name, path, progress)

    write_with(folder / path.name, write).replace(path)
    return str(attributes["content_sha256"])


def _require_sound(name: Path, path: Path, progress: ProgressCallback) -> None:
    """Read a file back and check it: what was written is what was meant, and keeps the rules."""

    def report(_: float, line: str) -> None:
        progress(1.0, line)

    with reading(name) as dataset:
        faults: list[Any] = list(check(dataset, report))
    if faults:  # a fault of the physics or ours: better no dataset than a wrong one
        message = f"{path}: not written, as it does not pass its own check:\n"
        raise CheckError(message + "\n".join(f"  {fault}" for fault in faults))
