"""The work of a build: the rows of a design, those that are done, and the tasks for the rest.

What is kept per row is one byte, so that a million rows and any number of shards cost nothing.
Tasks are made when they are asked for, results are read back when they are asked for.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from castblast.dataset.building.shards import ShardTask, Span, find_spans, read_shard
from castblast.dataset.rows.design import Design
from castblast.dataset.rows.simulation import BatchResult, Simulator
from castblast.errors import DatasetError, Status
from castblast.progress import ProgressCallback, silent

_TO_DO = -1


@dataclass
class Work:
    """Rows to simulate and their state.

    Attributes
    ----------
    design : Design
    simulator : Simulator
    rows_sha256 : str
        Hash of what the rows are made from; shards of anything else are refused.
    folder : Path
        Of the shards.
    shard_size : int
        Rows of a task; what is on disk may have been cut differently.
    status : (n,) int8
        `castblast.errors.Status` of finished rows, -1 of those to do.
    done, failed : int
        Finished rows, and those of them without a result.
    """

    design: Design
    simulator: Simulator
    rows_sha256: str
    folder: Path
    shard_size: int
    status: NDArray[np.int8] = field(init=False)
    done: int = field(default=0, init=False)
    failed: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        """Begin with nothing done."""
        self.status = np.full(len(self.design.sample), _TO_DO, dtype=np.int8)

    def mark(self, span: Span, status: NDArray[np.int8]) -> None:
        """Note that the shard of a span, not marked before, is on disk."""
        self.status[span.begin : span.end] = status
        self.done += span.end - span.begin
        self.failed += int(np.count_nonzero(status != Status.OK))

    def resume(self, progress: ProgressCallback = silent) -> tuple[int, int]:
        """Look for shards of an earlier run; files that cannot be trusted are moved aside.

        Returns
        -------
        valid, aside : int
            Shards that count, and files renamed to ``*.cut``.
        """
        valid = aside = 0
        spans = find_spans(self.folder)
        for number, span in enumerate(spans):
            progress(0.0, f"reading the shards of an earlier run, {number}/{len(spans)}")
            try:
                result = self._read(span)
            except DatasetError:
                path = self.folder / span.file_name
                path.replace(path.with_suffix(".npz.cut"))
                aside += 1
            else:
                self.mark(span, result.status)
                valid += 1
        return valid, aside

    def missing(self) -> Iterator[Span]:
        """Spans of rows to do, each at most a shard long, in the order of the rows."""
        edges = np.flatnonzero(np.diff(self.status == _TO_DO, prepend=False, append=False))
        for begin, end in edges.reshape(-1, 2).tolist():
            for start in range(begin, end, self.shard_size):
                yield Span(start, min(start + self.shard_size, end))

    def tasks(self) -> Iterator[ShardTask]:
        """One task for every missing span, made when it is asked for."""
        for span in self.missing():
            rows = slice(span.begin, span.end)
            yield ShardTask(
                span=span,
                folder=self.folder,
                rows_sha256=self.rows_sha256,
                simulator=self.simulator,
                inputs={name: values[rows] for name, values in self.design.inputs.items()},
                explosive=self.design.explosive[rows],
            )

    def results(self) -> Iterator[BatchResult]:
        """Read the results of all rows in their order, a shard at a time.

        Raises
        ------
        DatasetError
            A shard is missing or damaged.
        """
        end = 0
        for span in find_spans(self.folder):
            if span.begin != end:
                break
            yield self._read(span)
            end = span.end
        if end != len(self.status):
            message = (
                f"{self.folder}: the shard from row {end} on is missing; run the same command again"
            )
            raise DatasetError(message)

    def _read(self, span: Span) -> BatchResult:
        if span.end > len(self.status):
            message = f"{self.folder / span.file_name}: holds rows that are not in the design"
            raise DatasetError(message)
        return read_shard(self.folder, span, self.rows_sha256, self.simulator.output_names)
