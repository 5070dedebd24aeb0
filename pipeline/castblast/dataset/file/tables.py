"""The rows of a dataset as tables for other tools: CSV and Parquet, written block by block.

One row a sample: names of explosive, split and status, then every variable in SI, by its name, with
those that are the same in all rows, then columns that a user has added. Histories stay in the
netCDF file. Both files hold the same numbers to the last bit; `castblast.dataset.file.croissant`
describes them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from castblast.dataset.file.croissant import CROISSANT, TableFile, croissant_record
from castblast.dataset.file.schema import LABELS, flag_names
from castblast.dataset.file.store import row_blocks
from castblast.design.variables import INPUT_NAMES, OUTPUT_NAMES
from castblast.disk.files import write_json, write_with, written_together
from castblast.errors import SpecError, nearest_name
from castblast.extras import require
from castblast.identity import file_hash
from castblast.names import cell_text

#: Formats of a table, and the name of its file.
FORMATS = {"csv": "samples.csv", "parquet": "samples.parquet"}
_FLAGS = ("explosive", "split", "status")


def table_formats(formats: Sequence[str]) -> list[str]:
    """Check what was asked for, before anything is read.

    Raises
    ------
    SpecError
        No format, or an unknown one, with the nearest.
    MissingLibraryError
        Parquet needs a library that is not installed.
    """
    wanted = list(dict.fromkeys(name.strip().lower() for name in formats if name.strip()))
    for name in wanted or [""]:
        if name not in FORMATS:
            known = ", ".join(FORMATS)
            what = f"'{name}': not known{nearest_name(name, FORMATS)}" if name else "none given"
            message = f"table format {what} (there are {known})"
            raise SpecError(message, field="formats", value=name, allowed=tuple(FORMATS))
    if "parquet" in wanted:
        require("parquet", purpose="table format 'parquet'")
    return wanted


def column_names(dataset: xr.Dataset) -> list[str]:
    """Columns of a table, in order; those that a user has added come last."""
    known = [*LABELS, *INPUT_NAMES, *OUTPUT_NAMES]
    own = [
        str(name)
        for name, variable in dataset.variables.items()
        if variable.dims == ("sample",) and name not in known
    ]
    return [*(name for name in known if name in dataset.variables), *own]


def write_tables(dataset: xr.Dataset, folder: Path, formats: Sequence[str]) -> list[Path]:
    """Write a dataset as tables, with a Croissant record beside them; all files or none.

    Parameters
    ----------
    dataset : Dataset
        With codes and flags, as in the file.
    folder : path
    formats : sequence of str
        Keys of `FORMATS`.

    Returns
    -------
    list of path
        Tables, then ``croissant.json``.

    Raises
    ------
    SpecError
        As `table_formats`.
    OutputError
        The folder cannot be written to, or the disk is full.
    """
    return written_together(folder, partial(_write, dataset=dataset, wanted=table_formats(formats)))


def _write(folder: Path, dataset: xr.Dataset, wanted: Sequence[str]) -> list[Path]:
    writers = {"csv": _write_csv, "parquet": _write_parquet}
    files = [
        write_with(folder / FORMATS[name], partial(_fill, writers[name], dataset))
        for name in wanted
    ]
    tables = [TableFile(path.name, path.stat().st_size, file_hash(path)) for path in files]
    record = croissant_record(dataset, column_names(dataset), tables)
    return [*files, write_json(folder / CROISSANT, record)]


def _fill(
    write: Callable[[Iterator[pd.DataFrame], Path], None], dataset: xr.Dataset, path: Path
) -> None:
    write(_frames(dataset), path)


def _frames(dataset: xr.Dataset) -> Iterator[pd.DataFrame]:
    """Blocks of rows as frames, one in memory at a time."""
    for block in row_blocks(dataset[column_names(dataset)]):
        rows = block.sizes["sample"]
        yield pd.DataFrame({name: _column(block, name, rows) for name in column_names(dataset)})


def _column(block: xr.Dataset, name: str, rows: int) -> Any:
    if name in _FLAGS:
        return np.array(
            [cell_text(text) for text in flag_names(block[name]).tolist()], dtype=object
        )
    values = np.broadcast_to(block[name].to_numpy(), rows)
    if values.dtype.kind not in "OU":
        return values
    cells = [cell_text(cell) if isinstance(cell, str) else cell for cell in values.tolist()]
    return np.array(cells, dtype=object)


def _write_csv(frames: Iterator[pd.DataFrame], path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as stream:
        for number, frame in enumerate(frames):
            frame.to_csv(stream, index=False, header=number == 0, lineterminator="\n")


def _write_parquet(frames: Iterator[pd.DataFrame], path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    writer = None
    for frame in frames:
        block = pa.Table.from_pandas(frame, preserve_index=False).replace_schema_metadata(None)
        writer = writer or pq.ParquetWriter(path, block.schema)
        writer.write_table(block)
    if writer is not None:
        writer.close()
