"""STL files, text or binary: read through trimesh, and held against what they say of themselves.

The format has no check sum: a file that was cut off, or was written with decimal commas, would be
read in part. So the bytes are held against the number of facets before anything is allocated, and
what was read against the facets that a text begins.
"""

from __future__ import annotations

import io
import logging
import re
import struct
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from castblast.disk.reading import read_bytes
from castblast.errors import SpecError
from castblast.extras import require
from castblast.types import FloatArray

#: More facets take more memory than most machines have: some 5 kB each as a wall.
MOST_FACETS = 1_000_000
_LARGEST = 1 << 29
_HEADER, _RECORD = 84, 50
_BEGIN = re.compile(rb"\bfacet\s+normal\b", re.IGNORECASE)
_VERTEX = re.compile(rb"\bvertex[ \t]+\S+[ \t]+\S+[ \t]+\S+[ \t]*(?=[\r\n])", re.IGNORECASE)
#: A rounding of corners [m] below this is none.
_FINE = 1e-3


class StlFile(NamedTuple):
    """Facets of a file.

    Attributes
    ----------
    corner : array (t, 3, 3)
        In the unit of the file.
    single : bool
        Corners are stored in single precision.
    """

    corner: FloatArray
    single: bool


def load_stl(path: Path) -> StlFile:
    """Read the facets of an STL file.

    Raises
    ------
    SpecError
        One line: no file, no STL, cut off, more facets than fit, or a corner that is no number.
    MissingLibraryError
        trimesh is not installed.
    """
    data = read_bytes(path, "STL file", _LARGEST)
    require("stl", purpose=f"{path}: an STL file")
    stated = struct.unpack_from("<I", data, _HEADER - 4)[0] if len(data) >= _HEADER else -1
    binary = len(data) == _HEADER + _RECORD * stated
    text = not binary and data[:512].lstrip().lower().startswith(b"solid")
    if text:
        if not _last_line(data).startswith(b"endsolid"):
            raise SpecError(f"{path}: is cut off: its last line is no 'endsolid'")
        count, corners = len(_BEGIN.findall(data)), len(_VERTEX.findall(data))
        if corners != 3 * count:
            raise SpecError(
                f"{path}: is damaged: {count:,} facets are begun, with {corners:,} corners"
            )
        data = _decimal_points(data)
    elif binary:
        count = stated
    else:
        raise SpecError(f"{path}: {_damage(data, stated)}")
    if count > MOST_FACETS:
        raise SpecError(f"{path}: {count:,} facets; at most {MOST_FACETS:,} are taken: coarsen it")
    corner = _parsed(path, data) if count else np.zeros((0, 3, 3))
    if len(corner) != count:
        begun = "are begun" if text else "are stated"
        raise SpecError(
            f"{path}: is damaged: {count:,} facets {begun}, {len(corner):,} can be read"
        )
    if not len(corner):
        raise SpecError(f"{path}: holds no facet")
    bad = np.flatnonzero(~np.isfinite(corner).all(axis=(1, 2)))
    if len(bad):
        raise SpecError(f"{path}: facet {bad[0]}: a corner is not a number ({len(bad)} such)")
    return StlFile(corner, single=not text)


def _last_line(data: bytes) -> bytes:
    return data[-1000:].rstrip().splitlines()[-1].strip().lower()


def _damage(data: bytes, stated: int) -> str:
    if stated < 0:
        return f"is not an STL file: {len(data)} bytes; a binary one has at least {_HEADER}"
    needed = _HEADER + _RECORD * stated
    return (
        f"is not an STL file, or is damaged: {stated:,} facets stated take {needed:,} bytes, "
        f"it has {len(data):,}"
    )


def _decimal_points(data: bytes) -> bytes:
    """Replace decimal commas of corners, which trimesh would stop at."""
    first = _VERTEX.search(data)
    if first is None or b"," not in first[0]:
        return data
    return data.replace(b",", b".")


def _parsed(path: Path, data: bytes) -> FloatArray:
    import trimesh

    # It writes tracebacks of normals that it cannot read, which nobody needs here.
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    try:
        mesh: Any = trimesh.load_mesh(io.BytesIO(data), file_type="stl", process=False)
        return np.asarray(mesh.triangles, dtype=np.float64).reshape(-1, 3, 3)
    except Exception as fault:  # trimesh raises whatever its parsers raise
        line = (str(fault).splitlines() or [type(fault).__name__])[0]
        raise SpecError(f"{path}: is not a readable STL file ({line})") from None


def single_precision_remark(values: FloatArray, factor: float = 1.0) -> str:
    """Say how far single precision rounds such coordinates; empty: not so that it matters.

    Parameters
    ----------
    values : array
        Coordinates as stored.
    factor : float [m]
        Unit of the file.
    """
    largest = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    step = float(np.spacing(np.float32(largest))) * factor
    if step < _FINE:
        return ""
    size = f"{step * 1e3:.2g} mm" if step < 0.1 else f"{step:.2g} m"
    return (
        f"coordinates up to {largest:.10g} in single precision are rounded to {size}: take off the "
        f"offset of the grid before the file is written"
    )
