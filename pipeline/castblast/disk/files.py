"""Files appear whole or not at all: written under a temporary name, then renamed.

Results of several files are written into a folder of their own beside the old ones and moved into
place together (`staged`).
"""

from __future__ import annotations

import csv
import errno
import io
import os
import shutil
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
from numpy.typing import ArrayLike

from castblast.disk.plain import json_text
from castblast.errors import CastblastError, OutputError
from castblast.names import cell_text
from castblast.stopping import deferred_stop

#: A disk, a quota or the allowed size of a file is full.
_NO_ROOM = {getattr(errno, name) for name in ("ENOSPC", "EDQUOT", "EFBIG") if hasattr(errno, name)}
#: Folder, in that of the results, in which they lie until all of them are written.
UNFINISHED = ".unfinished"


def write_with(path: Path, writer: Callable[[Path], object]) -> Path:
    """Let `writer` write to a temporary name beside `path`, then put the file in its place.

    The temporary name keeps the suffix, by which many writers choose the format. It is nobody
    else's: threads and machines that share the folder may write the same file at the same time.

    Raises
    ------
    OutputError
        The folder cannot be made or written to, or the disk is full; names `path`.
    """
    temporary = path.with_name(f".{path.stem}.{uuid4().hex[:12]}.tmp{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            writer(temporary)
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except CastblastError:
        raise
    except Exception as fault:
        cause = _disk_fault(fault)
        if cause is None:
            raise
        message = f"{path}: cannot be written: {cause.strerror or cause}"
        raise OutputError(message) from fault
    return path


def _disk_fault(fault: BaseException) -> OSError | None:
    """What the system said; a library may have raised another error while it tidied up."""
    if isinstance(fault, OSError):
        return fault
    seen = fault.__cause__ or fault.__context__
    while seen is not None:
        if isinstance(seen, OSError) and seen.errno in _NO_ROOM:
            return seen
        seen = seen.__cause__ or seen.__context__
    return None


def require_writable(folder: Path) -> None:
    """Make a folder and try to write into it, before work begins whose result goes there.

    Raises
    ------
    OutputError
        It cannot be made or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".probe.{os.getpid()}"
        probe.write_bytes(b"?")
        probe.unlink()
    except OSError as fault:
        message = f"{folder}: cannot be written to: {fault.strerror or fault}"
        raise OutputError(message) from None


@contextmanager
def tried(folder: Path) -> Iterator[None]:
    """Make sure that `folder` can be written to; a new one that stays empty is removed again.

    Raises
    ------
    OutputError
        As `require_writable`.
    """
    is_new = not folder.exists()
    try:
        require_writable(folder)
        yield
    finally:
        if is_new:
            with suppress(OSError):  # it is not empty
                folder.rmdir()


@contextmanager
def staged(
    folder: Path,
    *,
    resume: bool = False,
    keep: bool = False,
    replaces: Collection[str] = (),
    name: str = UNFINISHED,
) -> Iterator[Path]:
    """Give a folder to write results into; when all are there they move into `folder` together.

    Moving needs no room on the disk. If the work fails or is stopped, nothing in `folder` changes.
    For one writer at a time, see `castblast.disk.locks`.

    Parameters
    ----------
    folder : path
    resume : bool
        Go on with what an earlier run kept; otherwise that is discarded.
    keep : bool
        Keep what is there when the work fails or is stopped.
    replaces : patterns
        Files of earlier results that are removed if no new one takes their place.
    name : str
        Of the folder, in `folder`, in which they lie until then.

    Raises
    ------
    OutputError
        The folder cannot be written to.
    """
    scratch = folder / name
    if not resume:
        shutil.rmtree(scratch, ignore_errors=True)
    require_writable(scratch)
    try:
        yield scratch
    except BaseException:
        if not keep:
            shutil.rmtree(scratch, ignore_errors=True)
        raise
    publish(scratch, folder, replaces)


def written_together(folder: Path, write: Callable[[Path], Sequence[Path]]) -> list[Path]:
    """Let `write` make files in a folder, and put all of them into `folder` together.

    Parameters
    ----------
    folder : path
    write : callable
        Takes a folder, returns its files.

    Returns
    -------
    list of path
        The files where they lie now.
    """
    with staged(folder, name=f"{UNFINISHED}.{uuid4().hex[:12]}") as scratch:
        files = write(scratch)
    return [folder / path.relative_to(scratch) for path in files]


def publish(scratch: Path, folder: Path, replaces: Collection[str] = ()) -> None:
    """Move what `scratch` holds, but for hidden things, into `folder`; then remove `scratch`.

    Ctrl-C waits until that is done.

    Raises
    ------
    OutputError
        A file cannot be moved; names it.
    """
    found = (path.relative_to(scratch) for path in scratch.rglob("*") if path.is_file())
    written = [path for path in found if not any(part.startswith(".") for part in path.parts)]
    with deferred_stop() as stop:
        try:
            for name in written:
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                (scratch / name).replace(folder / name)
            for old in (path for pattern in replaces for path in folder.glob(pattern)):
                if old.relative_to(folder) not in written:
                    old.unlink()
        except OSError as fault:
            message = f"{fault.filename2 or fault.filename}: cannot be replaced: {fault.strerror}"
            raise OutputError(message) from None
        shutil.rmtree(scratch, ignore_errors=True)
    if stop.made:
        stop.obey(f"stopped; the results in {folder} are complete")


def write_bytes(path: Path, content: bytes) -> Path:
    """Write a file as it is."""
    return write_with(path, lambda name: name.write_bytes(content))


def write_text(path: Path, text: str) -> Path:
    """Write UTF-8 text with Unix line ends."""
    return write_bytes(path, text.encode())


def write_json(path: Path, document: Any) -> Path:
    """Write a document as JSON, see `json_text`."""
    return write_text(path, json_text(document))


def write_csv(path: Path, columns: Mapping[str, ArrayLike | Sequence[str]]) -> Path:
    """Write equally long columns under their headings, with full float precision.

    A column of texts is written as it is; none of its cells becomes a formula of a spreadsheet.
    """
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*map(_cells, columns.values()), strict=True))
    return write_text(path, buffer.getvalue())


def _cells(column: ArrayLike | Sequence[str]) -> list[str]:
    """Cells of a column as text."""
    values = np.asarray(column)
    if values.dtype.kind == "U":
        return list(map(cell_text, values.tolist()))
    return [f"{value:.17g}" for value in values.astype(np.float64).tolist()]
