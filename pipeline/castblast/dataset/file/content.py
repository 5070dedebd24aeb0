"""The hash of the content of a dataset, whole or block by block along its samples.

It is taken over names, units, types, shapes and values, not over the container. Every variable has
a running hash of its own, so the blocks in which a file is written or read do not matter.
"""

from __future__ import annotations

import hashlib
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray


class _Running(NamedTuple):
    """One variable: its line but for the number of rows, and the hash so far."""

    dims: tuple[str, ...]
    rest: tuple[int, ...]
    kind: str
    units: str
    digest: Any


class ContentHash:
    """SHA-256 over a dataset that comes in blocks of consecutive rows."""

    def __init__(self) -> None:
        self._rows = 0
        self._running: dict[str, _Running] = {}

    def add(self, block: xr.Dataset) -> None:
        """Take the next rows; what has no samples counts once, as it is in the first block."""
        for name, variable in block.variables.items():
            by_row = "sample" in variable.dims
            first = str(name) not in self._running
            if first:
                self._running[str(name)] = _Running(
                    dims=tuple(map(str, variable.dims)),
                    rest=variable.shape[1:] if by_row else variable.shape,
                    kind=_kind(variable),
                    units=str(variable.attrs.get("units", "")),
                    digest=hashlib.sha256(),
                )
            if first or by_row:
                self._running[str(name)].digest.update(_plain_bytes(variable.to_numpy()))
        self._rows += block.sizes.get("sample", 0)

    def hexdigest(self) -> str:
        """Hash of all rows so far."""
        lines = []
        for name, (dims, rest, kind, units, digest) in sorted(self._running.items()):
            shape = (self._rows, *rest) if dims[:1] == ("sample",) else rest
            lines.append(f"{name} {dims} {shape} {kind} {units} {digest.hexdigest()}")
        return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def content_hash(dataset: xr.Dataset) -> str:
    """SHA-256 (hex) over a dataset in memory; the same as block by block."""
    running = ContentHash()
    running.add(dataset)
    return running.hexdigest()


def _kind(variable: xr.Variable) -> str:
    return "str" if variable.dtype.kind in "OUT" else variable.dtype.newbyteorder("<").str


def _plain_bytes(values: NDArray[Any]) -> bytes:
    if values.dtype.kind in "OUT":
        return "\0".join(map(str, values.ravel())).encode()
    plain = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
    if plain.dtype.kind == "f":
        plain = np.where(np.isnan(plain), np.array(np.nan, plain.dtype), plain)  # one NaN only
    return plain.tobytes()
