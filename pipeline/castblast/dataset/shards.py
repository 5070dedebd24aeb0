"""Shards: the part of a dataset that one task simulates and writes.

A shard file is complete once it has its name, carries the hash of what it was made from and of its
own content, and can therefore be trusted or refused by itself. That is all a stopped run needs to
go on.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from castblast.dataset.assemble import history_columns
from castblast.dataset.design import Design
from castblast.dataset.schema import (
    content_hash,
    label_attributes,
    output_role,
    variable_attributes,
)
from castblast.dataset.simulation import HISTORY_NAMES, BatchResult, FloatArray, Simulator
from castblast.dataset.store import read_file, write_dataset
from castblast.errors import DatasetError, Status

SHARD_SCHEMA = "castblast shard"


@dataclass(frozen=True)
class ShardTask:
    """One task, complete in itself, for a worker anywhere that sees the work folder.

    Attributes
    ----------
    index : int
    path : Path
        File to write.
    rows_sha256 : str
        Hash of what the dataset is made from.
    simulator : Simulator
    sample : (n,) int32
    inputs : dict of (n,) [SI]
        Every input of the rows.
    explosive : (n,) int8
    """

    index: int
    path: Path
    rows_sha256: str
    simulator: Simulator
    sample: NDArray[np.int32]
    inputs: dict[str, FloatArray]
    explosive: NDArray[np.int8]


class ShardReport(NamedTuple):
    """What a worker sends home: a few numbers, the rows are on disk."""

    shard: int
    rows: int
    failed: int
    seconds: float


def make_tasks(
    design: Design, simulator: Simulator, rows_sha256: str, folder: Path, shard_size: int
) -> list[ShardTask]:
    """Cut a design into tasks of `shard_size` consecutive rows."""
    tasks = []
    for index, start in enumerate(range(0, len(design.sample), shard_size)):
        rows = slice(start, start + shard_size)
        tasks.append(
            ShardTask(
                index=index,
                path=folder / f"shard-{index:06d}.nc",
                rows_sha256=rows_sha256,
                simulator=simulator,
                sample=design.sample[rows],
                inputs={name: values[rows] for name, values in design.inputs.items()},
                explosive=design.explosive[rows],
            )
        )
    return tasks


def run_shard(task: ShardTask) -> ShardReport:
    """Simulate the rows of a task and write its file."""
    begin = time.perf_counter()
    result = task.simulator.run(task.inputs, task.explosive)
    write_dataset(_to_dataset(task, result), task.path)
    failed = int(np.count_nonzero(result.status != Status.OK))
    return ShardReport(task.index, len(task.sample), failed, time.perf_counter() - begin)


def read_shard(task: ShardTask) -> BatchResult:
    """Read the file of a task and make sure that it is its file, whole.

    Raises
    ------
    DatasetError
        Missing, cut, damaged, or made from something else.
    """
    shard = read_file(task.path)
    attributes = shard.attrs
    if attributes.get("schema") != SHARD_SCHEMA:
        message = f"{task.path}: is no shard"
        raise DatasetError(message)
    if attributes.get("rows_sha256") != task.rows_sha256:
        message = f"{task.path}: was made from another recipe"
        raise DatasetError(message)
    if not np.array_equal(shard["sample"].to_numpy(), task.sample):
        message = f"{task.path}: holds other samples"
        raise DatasetError(message)
    if attributes.get("content_sha256") != content_hash(shard):
        message = f"{task.path}: is damaged (hash differs)"
        raise DatasetError(message)
    return BatchResult(
        status=shard["status"].to_numpy(),
        outputs={name: shard[name].to_numpy() for name in task.simulator.output_names},
        histories={name: shard[name].to_numpy() for name in HISTORY_NAMES},
    )


def split_valid(tasks: list[ShardTask]) -> tuple[list[ShardTask], list[ShardTask], int]:
    """Tell finished tasks from those to do; files that cannot be trusted are moved aside.

    Returns
    -------
    done, todo : list of ShardTask
    aside : int
        Files renamed to ``*.cut``.
    """
    done, todo, aside = [], [], 0
    for task in tasks:
        if not task.path.exists():
            todo.append(task)
            continue
        try:
            read_shard(task)
        except DatasetError:
            task.path.replace(task.path.with_suffix(".nc.cut"))
            aside += 1
            todo.append(task)
        else:
            done.append(task)
    return done, todo, aside


def join_shards(tasks: list[ShardTask]) -> BatchResult:
    """Read all files of finished tasks into columns in the order of the design.

    Raises
    ------
    DatasetError
        A shard is missing or damaged.
    """
    parts = [read_shard(task) for task in tasks]
    first = parts[0]
    return BatchResult(
        status=np.concatenate([part.status for part in parts]),
        outputs={
            name: np.concatenate([part.outputs[name] for part in parts]) for name in first.outputs
        },
        histories={
            name: np.concatenate([part.histories[name] for part in parts])
            for name in first.histories
        },
    )


def _to_dataset(task: ShardTask, result: BatchResult) -> xr.Dataset:
    columns = {
        name: ("sample", values, variable_attributes(name, output_role(name)))
        for name, values in result.outputs.items()
    }
    columns["status"] = ("sample", result.status.astype(np.int8), label_attributes("status"))
    dataset = xr.Dataset(
        data_vars=columns | history_columns(result.histories),
        coords={"sample": ("sample", task.sample, label_attributes("sample"))},
        attrs={"schema": SHARD_SCHEMA, "rows_sha256": task.rows_sha256},
    )
    dataset.attrs["content_sha256"] = content_hash(dataset)
    return dataset
