"""Restart files: all of a running cast, so that it goes on to the same last bit.

A file belongs to one case: it carries the hash of everything that the motion depends on, and
another case is refused. Threads, pictures and the longest time are no part of it.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from castblast.errors import SpecError
from castblast.files import write_with
from castblast.kernel import source_hash
from castblast.muckpile.case import CastCase

#: What may differ between the interrupted and the continued run.
_FREE = ("threads", "snapshot_interval")

#: Arrays by name, as `Simulation.save` makes them.
Arrays = dict[str, NDArray[Any]]


def case_hash(case: CastCase) -> str:
    """SHA-256 (hex) of a case and of the code that runs it."""
    digest = hashlib.sha256(source_hash(("kernel.py", "muckpile")).encode())
    for name, value in case._asdict().items():
        if name in _FREE:
            continue
        digest.update(name.encode())
        for part in value if isinstance(value, tuple) else (value,):
            array = np.ascontiguousarray(part)
            digest.update(f"{array.dtype.str} {array.shape}".encode())
            digest.update(array.tobytes())
    return digest.hexdigest()


def write_restart(path: Path, key: str, arrays: Arrays) -> None:
    """Write the state of a run of the case `key`; until it is whole an older file stays."""
    contents: dict[str, Any] = {**arrays, "case": np.array(key)}
    write_with(path, lambda name: np.savez(name, **contents))


def read_restart(path: Path, key: str) -> Arrays:
    """Read the state of a run of the case `key`.

    Raises
    ------
    SpecError
        The file cannot be read, or belongs to another case.
    """
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = dict(stored)
    except (OSError, ValueError, EOFError, BadZipFile) as error:
        message = f"{path}: not a restart file of a cast: {error}"
        raise SpecError(message) from error
    if str(arrays.pop("case", "")) != key:
        message = (
            f"{path}: the restart file of another case or of another version; remove it to start "
            "from the beginning"
        )
        raise SpecError(message)
    return arrays
