"""A dataset as tables for other tools."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from castblast.dataset.file.form import require_form
from castblast.dataset.file.store import reading_dataset
from castblast.dataset.file.tables import column_names, table_formats, write_tables
from castblast.stages.outcome import Outcome


def export_dataset(
    dataset: str | Path, formats: Sequence[str] = ("csv",), out: str | Path | None = None
) -> Outcome:
    """Write the rows of a dataset as tables, with a Croissant record beside them.

    Parameters
    ----------
    dataset : str or path
    formats : sequence of str
        ``csv``, ``parquet``.
    out : str or path, optional
        Folder; default: ``tables`` beside the dataset.

    Raises
    ------
    MissingLibraryError
        Parquet needs a library that is not installed.
    SpecError
        No format, or an unknown one.
    DatasetError
        The file cannot be read as a dataset.
    OutputError
        The folder cannot be written to, or the disk is full.
    """
    path = Path(dataset)
    wanted = table_formats(formats)
    folder = path.parent / "tables" if out is None else Path(out)
    with reading_dataset(path) as opened:
        require_form(opened, path)
        files = write_tables(opened, folder, wanted)
        rows, columns = opened.sizes["sample"], len(column_names(opened))
    document = {
        "dataset": str(path),
        "rows": rows,
        "columns": columns,
        "files": [str(file) for file in files],
    }
    lines = [f"{rows:,} rows of {columns} columns, SI units; histories stay in {path.name}"]
    return Outcome(document=document, lines=lines, files=files)
