"""Where a dataset comes into being: its file, and the folder of its shards until it is finished.

A stopped run goes on only with shards made from exactly the same; a finished dataset is never
overwritten by another one unless that is asked for.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from castblast.dataset.file.provenance import differences
from castblast.dataset.file.store import reading
from castblast.disk.files import require_writable
from castblast.disk.locks import only_writer
from castblast.disk.note import read_note, write_note
from castblast.disk.reading import parse_json
from castblast.errors import DatasetError, SpecError, StaleResultError


def work_folder(path: Path) -> Path:
    """Folder of the shards of the dataset `path`, beside it."""
    return path.with_suffix(".work")


@contextmanager
def sole_builder(path: Path) -> Iterator[None]:
    """Make the folder of the dataset `path` and keep others from building there meanwhile.

    Raises
    ------
    OutputError
        The folder cannot be made or written to.
    LockedError
        Another process is building the same dataset.
    """
    require_writable(path.parent)
    with only_writer(path.with_name(f".{path.name}.lock"), path):
        yield


def is_finished(path: Path, origin: Mapping[str, Any]) -> bool:
    """Say whether the dataset is there, whole, and made from the same.

    A damaged file is moved aside, to be made again.

    Raises
    ------
    SpecError
        Something else has that name.
    StaleResultError
        A dataset that was made from something else has that name.
    """
    if not path.exists():
        return False
    try:
        with reading(path) as found:
            attributes = dict(found.attrs)
    except DatasetError:
        path.replace(path.with_suffix(".nc.cut"))
        return False
    try:
        old = parse_json(str(attributes["made_from"]))
    except (KeyError, SpecError):
        message = f"{path}: is not a dataset of castblast; choose another name with --out"
        raise SpecError(message) from None
    if old != origin:
        raise StaleResultError(_stale(path, old, origin))
    return True


def open_work_folder(path: Path, origin: Mapping[str, Any], *, restart: bool) -> Path:
    """Make the folder of the shards, or make sure that those in it are ours.

    Raises
    ------
    StaleResultError
        The shards were made from something else; the difference and the ways on are named.
    OutputError
        The folder cannot be written to.
    """
    folder = work_folder(path)
    if restart and folder.exists():
        shutil.rmtree(folder)
    require_writable(folder)
    old = read_note(folder)
    if old and old != origin:
        raise StaleResultError(_stale(folder, old, origin))
    for left_over in folder.glob(".*.tmp.*"):  # of a process that was killed while it wrote
        left_over.unlink(missing_ok=True)
    write_note(folder, origin)
    return folder


def close_work_folder(path: Path) -> None:
    """Remove the shards of a finished dataset."""
    shutil.rmtree(work_folder(path))


def _stale(place: Path, old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    """Name what changed and the two ways on."""
    changes = "\n".join(f"  {line}" for line in differences(old, new))
    return (
        f"{place}: was made from something else than now asked for:\n{changes}\n"
        "  either discard it with --restart, or give the recipe a new name or version"
    )
