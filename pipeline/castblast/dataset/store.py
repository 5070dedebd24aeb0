"""Writing and reading dataset files: whole or not at all, and the same bytes every time.

NetCDF-4 through the netCDF4 library, deflate level 4 with shuffle, which every reader knows. A file
is written under another name, read back, flushed to the disk and renamed. One lock guards the HDF5
library, which keeps global state and must not be entered by two threads.
"""

from __future__ import annotations

import os
from pathlib import Path
from threading import RLock
from typing import Any

import xarray as xr

from castblast.dataset.schema import SCHEMA, SCHEMA_VERSION
from castblast.errors import DatasetError
from castblast.files import write_with

_LOCK = RLock()
_HDF5 = b"\x89HDF\r\n\x1a\n"
_CLASSIC = b"CDF"


def write_dataset(dataset: xr.Dataset, path: Path) -> Path:
    """Write a dataset so that `path` is complete once it exists.

    Raises
    ------
    DatasetError
        The folder cannot be written to, or the disk is full.
    """

    def write(name: Path) -> None:
        with _LOCK:
            dataset.to_netcdf(name, engine="netcdf4", format="NETCDF4", encoding=_encoding(dataset))
            with xr.open_dataset(name, engine="netcdf4", decode_times=False) as written:
                if written.sizes != dataset.sizes:
                    message = f"{path}: what was written cannot be read back"
                    raise DatasetError(message)
        with name.open("rb+") as stream:
            os.fsync(stream.fileno())

    try:
        return write_with(path, write)
    except (OSError, RuntimeError) as fault:  # a full disk is a RuntimeError of HDF5
        message = f"{path}: cannot be written (is the disk full?): {_short(fault)}"
        raise DatasetError(message) from None


def read_file(path: Path) -> xr.Dataset:
    """Read a netCDF file of any kind into memory and close it.

    Raises
    ------
    DatasetError
        One line: missing, a folder, empty, not netCDF, truncated.
    """
    _require_netcdf(path)
    try:
        with _LOCK, xr.open_dataset(path, engine="netcdf4", decode_times=False) as dataset:
            loaded: xr.Dataset = dataset.load()
    except (OSError, RuntimeError, ValueError, KeyError) as fault:
        message = f"{path}: is truncated or damaged: {_short(fault)}"
        raise DatasetError(message) from None
    return loaded


def open_dataset(path: Path) -> xr.Dataset:
    """Read a near-field dataset into memory.

    Raises
    ------
    DatasetError
        As `read_file`, or the file is of another kind or a newer format.
    """
    dataset = read_file(path)
    kind = dataset.attrs.get("schema")
    if kind != SCHEMA:
        what = f"is a '{kind}'" if kind else "is netCDF, but not written by castblast"
        message = f"{path}: {what}; a {SCHEMA} is needed"
        raise DatasetError(message)
    version = str(dataset.attrs.get("schema_version", ""))
    if version.split(".")[0] != SCHEMA_VERSION.split(".")[0]:
        message = f"{path}: has format {version}; this castblast reads {SCHEMA_VERSION}"
        raise DatasetError(message)
    return dataset


def require_writable(folder: Path) -> None:
    """Make a folder and try to write into it, before work begins whose result goes there.

    Raises
    ------
    DatasetError
        It cannot be made or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".probe.{os.getpid()}"
        probe.touch()
        probe.unlink()
    except OSError as fault:
        message = f"{folder}: cannot be written to: {fault.strerror or fault}"
        raise DatasetError(message) from None


def _require_netcdf(path: Path) -> None:
    """Tell the common mistakes apart before the library sees the file."""
    try:
        with path.open("rb") as stream:
            start = stream.read(len(_HDF5))
    except FileNotFoundError:
        raise DatasetError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise DatasetError(f"{path}: is a folder; a netCDF file is needed") from None
    except OSError as fault:
        raise DatasetError(f"{path}: cannot be read: {fault.strerror}") from None
    if not start:
        raise DatasetError(f"{path}: is empty (0 bytes); generate it again")
    if start != _HDF5 and not start.startswith(_CLASSIC):
        raise DatasetError(f"{path}: is not a netCDF file")


def _encoding(dataset: xr.Dataset) -> dict[str, dict[str, Any]]:
    """Compression for everything with samples; no fill value where nothing may be missing."""
    encoding: dict[str, dict[str, Any]] = {}
    for name, variable in dataset.variables.items():
        settings: dict[str, Any] = {"_FillValue": None}
        if variable.dtype.kind == "f" and variable.attrs.get("role") in (
            "target",
            "diagnostic",
            "history",
        ):
            settings["_FillValue"] = float("nan")
        if "sample" in variable.dims:
            settings |= {"zlib": True, "complevel": 4, "shuffle": True}
        encoding[str(name)] = settings
    return encoding


def _short(fault: BaseException) -> str:
    return str(fault).splitlines()[0][:120] if str(fault) else type(fault).__name__
