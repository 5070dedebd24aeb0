"""Files appear whole or not at all: written under a temporary name, then renamed."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from pathlib import Path
from uuid import uuid4

import numpy as np
from numpy.typing import ArrayLike


def write_with(path: Path, writer: Callable[[Path], object]) -> Path:
    """Let `writer` write to a temporary name beside `path`, then put the file in its place.

    The temporary name keeps the suffix, by which many writers choose the format. It is nobody
    else's: threads and machines that share the folder may write the same file at the same time.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{uuid4().hex[:12]}.tmp{path.suffix}")
    try:
        writer(temporary)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
    return path


def write_text(path: Path, text: str) -> Path:
    """Write UTF-8 text with Unix line ends."""
    return write_with(path, lambda name: name.write_bytes(text.encode()))


def write_csv(path: Path, columns: Mapping[str, ArrayLike]) -> Path:
    """Write equally long columns under their headings, with full float precision."""
    buffer = io.StringIO()
    table = np.column_stack([np.asarray(column, dtype=np.float64) for column in columns.values()])
    np.savetxt(buffer, table, delimiter=",", header=",".join(columns), comments="", fmt="%.17g")
    return write_text(path, buffer.getvalue())
