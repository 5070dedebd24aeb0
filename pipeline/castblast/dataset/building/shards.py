"""Shards: the part of a dataset that one task simulates and writes.

A shard file holds a span of consecutive rows and is named by it. It is complete once it has its
name and carries a seal over what it was made from and what it holds, so it can be trusted or
refused by itself. That is all a stopped run needs to go on, and spans need not be the same from run
to run. Shards are plain arrays (NPZ), not netCDF: they are for nobody else to read, are written
within milliseconds, and keep the workers out of the HDF5 library with its one lock.
"""

from __future__ import annotations

import hashlib
import re
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from castblast.dataset.building.process import peak_memory, process_name
from castblast.dataset.rows.simulation import HISTORY_NAMES, BatchResult, Simulator
from castblast.disk.files import write_with
from castblast.disk.reading import read_npz
from castblast.errors import DatasetError, SpecError
from castblast.types import FloatArray

_NAME = re.compile(r"shard-(\d{9})-(\d{9})\.npz")
_ORIGIN, _SEAL = "rows_sha256", "seal"


class Span(NamedTuple):
    """Rows `begin` to `end` - 1 of a design, by position."""

    begin: int
    end: int

    @property
    def file_name(self) -> str:
        """Name of the shard of these rows."""
        return f"shard-{self.begin:09d}-{self.end:09d}.npz"


@dataclass(frozen=True)
class ShardTask:
    """One task, complete in itself, for a worker anywhere that sees the work folder.

    Attributes
    ----------
    span : Span
    folder : Path
        Where to write.
    rows_sha256 : str
        Hash of what the dataset is made from.
    simulator : Simulator
    inputs : dict of (n,) [SI]
        Every input of the rows.
    explosive : (n,) int8
    """

    span: Span
    folder: Path
    rows_sha256: str
    simulator: Simulator
    inputs: dict[str, FloatArray]
    explosive: NDArray[np.int8]

    @property
    def path(self) -> Path:
        """File to write."""
        return self.folder / self.span.file_name


class ShardReport(NamedTuple):
    """What a worker sends home: a byte for every row and a few numbers; the rest is on disk.

    Attributes
    ----------
    span : Span
    status : (n,) int8
        `castblast.errors.Status` of each row.
    worker : str
        Thread that did it, unlike any other anywhere.
    process : str
        Process of that thread.
    begin, end : float [s]
        On a clock of the process.
    peak_memory : int [byte]
        Of the process so far.
    """

    span: Span
    status: NDArray[np.int8]
    worker: str
    process: str
    begin: float
    end: float
    peak_memory: int


def run_shard(task: ShardTask) -> ShardReport:
    """Simulate the rows of a task and write its file.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    begin = time.perf_counter()
    result = task.simulator.run(task.inputs, task.explosive)
    write_shard(task.folder, task.span, task.rows_sha256, result)
    process = process_name()
    return ShardReport(
        span=task.span,
        status=result.status,
        worker=f"{process}-{threading.get_ident()}",
        process=process,
        begin=begin,
        end=time.perf_counter(),
        peak_memory=peak_memory(),
    )


def write_shard(folder: Path, span: Span, rows_sha256: str, result: BatchResult) -> Path:
    """Write the results of a span; histories in single precision, as the dataset keeps them.

    Raises
    ------
    OutputError
        The folder cannot be written to, or the disk is full.
    """
    arrays: dict[str, NDArray[Any]] = {"status": np.asarray(result.status, dtype=np.int8)}
    arrays |= result.outputs
    arrays |= {name: result.histories[name].astype(np.float32) for name in HISTORY_NAMES}
    seal = _seal(span, rows_sha256, arrays)
    path = folder / span.file_name

    def write(name: Path) -> None:
        marks = {_ORIGIN: np.array(rows_sha256), _SEAL: np.array(seal)}
        contents: dict[str, Any] = {**arrays, **marks}
        np.savez(name, **contents)

    return write_with(path, write)


def read_shard(
    folder: Path, span: Span, rows_sha256: str, output_names: tuple[str, ...]
) -> BatchResult:
    """Read the file of a span and make sure that it is its file, whole.

    Raises
    ------
    DatasetError
        Missing, cut, damaged, or made from something else.
    """
    path = folder / span.file_name
    try:
        arrays = read_npz(path, "a shard of a dataset")
    except SpecError as fault:
        raise DatasetError(str(fault)) from None
    origin, seal = str(arrays.pop(_ORIGIN, "")), str(arrays.pop(_SEAL, ""))
    if origin != rows_sha256:
        message = f"{path}: was made from something else"
        raise DatasetError(message)
    if seal != _seal(span, origin, arrays):
        message = f"{path}: is damaged (its seal is broken)"
        raise DatasetError(message)
    if set(arrays) != {"status", *output_names, *HISTORY_NAMES}:
        message = f"{path}: holds other variables"
        raise DatasetError(message)
    return BatchResult(
        status=arrays["status"],
        outputs={name: arrays[name] for name in output_names},
        histories={name: arrays[name] for name in HISTORY_NAMES},
    )


def find_spans(folder: Path) -> list[Span]:
    """Spans that the shard files of a folder are named by, in order, without overlaps.

    Of two that overlap, as runs with different sizes of shards may leave, the earlier one counts.
    """
    named = (_NAME.fullmatch(path.name) for path in folder.glob("shard-*.npz"))
    found = sorted(Span(int(match[1]), int(match[2])) for match in named if match)
    spans: list[Span] = []
    for span in found:
        if span.begin < span.end and (not spans or spans[-1].end <= span.begin):
            spans.append(span)
    return spans


def _seal(span: Span, rows_sha256: str, arrays: dict[str, NDArray[Any]]) -> str:
    digest = hashlib.sha256(f"{rows_sha256} {span.begin} {span.end}".encode())
    for name in sorted(arrays):
        values = np.ascontiguousarray(arrays[name])
        digest.update(f" {name} {values.dtype.str} {values.shape} ".encode())
        digest.update(values.data)
    return digest.hexdigest()
