"""The differences of two datasets in words, as a table, and for programs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from castblast.dataset.file.compare import Comparison, compare
from castblast.dataset.file.store import reading_dataset
from castblast.progress import ProgressCallback, silent
from castblast.stages.outcome import Outcome


def diff_datasets(
    first: str | Path, second: str | Path, progress: ProgressCallback = silent
) -> Outcome:
    """Compare two datasets: what they were made from, their form, their rows and values.

    Raises
    ------
    DatasetError
        One of the files cannot be read as a dataset.
    """
    first = Path(first)
    second = Path(second)
    with reading_dataset(first) as one, reading_dataset(second) as two:
        found = compare(one, two, progress)
        ids = [str(dataset.attrs.get("id", "?")) for dataset in (one, two)]
        content = [str(dataset.attrs.get("content_sha256", "")) for dataset in (one, two)]
    document = {
        "first": {"path": str(first), "id": ids[0], "content_sha256": content[0]},
        "second": {"path": str(second), "id": ids[1], "content_sha256": content[1]},
        "same": found.same,
        "making": found.making,
        "attributes": found.attributes,
        "form": found.form,
        "rows": {
            "common": found.common,
            "first_only": len(found.first_only),
            "second_only": len(found.second_only),
        },
        "variables": {
            column.name: {
                "rows": column.rows,
                "largest_relative_difference": column.largest,
                "sample": column.sample,
            }
            for column in found.columns
        },
    }
    rows = [
        (
            column.name,
            str(column.rows),
            f"{column.largest:.2e}" if np.isfinite(column.largest) else "changed",
            "" if column.sample is None else str(column.sample),
        )
        for column in found.columns
    ]
    header = ("variable", "rows that differ", "largest relative difference", "sample")
    lines = _lines(ids, content, found)
    return Outcome(document=document, header=header, rows=rows, lines=lines, ok=found.same)


def _lines(ids: list[str], content: list[str], found: Comparison) -> list[str]:
    if found.same:
        return [f"{ids[0]}: the same {found.common} samples, content {content[0][:12]}"]
    lines = [f"{ids[0]} ({content[0][:12]}) → {ids[1]} ({content[1][:12]})"]
    for title, entries in (
        ("made from", found.making),
        ("described", found.attributes),
        ("form", found.form),
    ):
        lines += [f"{title}:", *(f"  {entry}" for entry in entries)] if entries else []
    lines.append(
        f"samples: {found.common} common"
        + _ids(found.first_only, "only in the first")
        + _ids(found.second_only, "only in the second")
    )
    if not found.columns and found.common:
        lines.append(f"the {found.common} common samples are equal in every value")
    return lines


def _ids(ids: NDArray[np.integer], where: str) -> str:
    return f", {len(ids)} {where} (ids {ids.min()} to {ids.max()})" if len(ids) else ""
