"""Restart files: all of a running cast or packing, so that it goes on to the same last bit.

A file belongs to one case: it carries the hash of everything that the motion depends on, and
another case is refused. Threads and the interval of pictures are no part of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from castblast.disk.files import write_with
from castblast.disk.reading import read_npz
from castblast.errors import OutputError, SpecError
from castblast.identity import digest, source_hash
from castblast.muckpile.cast.case import CastCase

#: What may differ between the interrupted and the continued run.
_FREE = ("threads", "snapshot_interval")

#: Arrays by name, as `Simulation.save` makes them.
Arrays = dict[str, NDArray[Any]]
#: Least wall time [s] between two writings of a file.
INTERVAL = 300.0


@runtime_checkable
class Kept(Protocol):
    """What else belongs to the state of a run, such as the pictures taken so far."""

    def save(self) -> Arrays:
        """Return all of it by name."""
        ...

    def resume(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `save` returned."""
        ...


class Keeper:
    """The restart file of one run; without a path it does nothing.

    Parameters
    ----------
    path : path or None
    key : str
        Hash of what is run.
    interval : float [s]
        Least wall time between two writings.
    """

    def __init__(self, path: Path | None, key: str, interval: float = INTERVAL) -> None:
        self.path, self.key, self.interval = path, key, interval
        self._last = perf_counter()

    @property
    def due(self) -> bool:
        """Whether it is time to write the file again."""
        return self.path is not None and perf_counter() - self._last >= self.interval

    @property
    def how_to_go_on(self) -> str:
        """What a user who stopped the run may do, in words."""
        if self.path is None:
            return "nothing is kept"
        return f"its state is kept in {self.path}; run the same command again to resume"

    def read(self) -> Arrays | None:
        """State to go on from; None: begin anew.

        Raises
        ------
        SpecError
            As `read_restart`.
        """
        if self.path is None or not self.path.exists():
            return None
        return read_restart(self.path, self.key)

    def write(self, arrays: Arrays) -> None:
        """Write the file."""
        if self.path is not None:
            write_restart(self.path, self.key, arrays)
            self._last = perf_counter()

    def keep(self, arrays: Arrays) -> str:
        """Write the file if the disk allows; what stood in the way, in words, else "".

        A long run shall not end because its state cannot be kept just now.
        """
        try:
            self.write(arrays)
        except OutputError as fault:
            self._last = perf_counter()
            return str(fault)
        return ""

    def remove(self) -> None:
        """Remove the file: nothing is left to go on with."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)


#: Sources that decide a packing and a cast, but not what is measured on the pile.
CAST_SOURCES = (
    "kernel.py", "muckpile/balls", "muckpile/bench", "muckpile/cast", "muckpile/engine",
    "muckpile/ground", "muckpile/search",
)  # fmt: skip


def case_hash(case: CastCase) -> str:
    """SHA-256 (hex) of a case and of the code that runs it."""
    parts: list[Any] = [source_hash(CAST_SOURCES)]
    for name, value in case._asdict().items():
        if name not in _FREE:
            parts.append(name)
            parts += map(np.asarray, value if isinstance(value, tuple) else (value,))
    return digest(*parts)


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
    arrays = read_npz(path, "a restart file of a cast")
    if str(arrays.pop("case", "")) != key:
        message = (
            f"{path}: the restart file of another case or of another version; remove it to start "
            "from the beginning"
        )
        raise SpecError(message)
    return arrays
