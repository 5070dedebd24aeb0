"""Writing and reading dataset files: whole or not at all, and the same bytes every time.

NetCDF-4 through the netCDF4 library, deflate level 4 with shuffle, which every reader knows. A file
is written block by block under another name, read back by whoever writes it, flushed to the disk
and renamed. Chunks and blocks have a fixed number of rows, so that the bytes depend on the content
alone and neither writing nor reading ever holds more than one block, however long the dataset.
One lock guards the HDF5 library, which keeps global state and must not be entered by two threads.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import RLock
from typing import Any

import xarray as xr

from castblast.dataset.file.schema import SCHEMA, SCHEMA_VERSION, role_of
from castblast.disk.files import write_with
from castblast.errors import DatasetError, OutputError
from castblast.names import is_label, shortened

#: Rows of a chunk of the file: what has to be read for one sample.
CHUNK_ROWS = 4096
#: Rows that are written or read at a time, a multiple of the chunk.
BLOCK_ROWS = 4 * CHUNK_ROWS
_LOCK = RLock()
_HDF5 = b"\x89HDF\r\n\x1a\n"
_CLASSIC = b"CDF"
_HOLES = ("target", "diagnostic", "history")


def write_blocks(
    name: Path, rows: int, blocks: Iterable[xr.Dataset], attributes: Mapping[str, Any] | None = None
) -> None:
    """Write a dataset of `rows` samples from blocks of consecutive rows, at `name` itself.

    Parameters
    ----------
    rows : int
        Samples of all blocks together.
    blocks : iterable of xr.Dataset
        At most one may have another number of rows than a multiple of `CHUNK_ROWS`: the last.
        The first decides on variables and their attributes.
    attributes : mapping, optional
        Global attributes, looked at after the last block; default: those of the first block.
    """
    import netCDF4

    with _LOCK, netCDF4.Dataset(name, "w", format="NETCDF4") as file:
        begin, form = 0, None
        for block in blocks:
            if form is None:
                form = block
                _define(file, block, rows)
            stop = begin + block.sizes.get("sample", 0)
            for key, variable in block.variables.items():
                if "sample" in variable.dims:
                    file[str(key)][begin:stop] = variable.to_numpy()
                elif begin == 0:
                    file[str(key)][...] = variable.to_numpy()
            begin = stop
        if begin != rows or form is None:
            message = f"{name}: {begin} rows came, {rows} were announced"
            raise ValueError(message)
        file.setncatts(dict(form.attrs if attributes is None else attributes))


def write_dataset(dataset: xr.Dataset, path: Path) -> Path:
    """Write a dataset from memory so that `path` is complete once it exists.

    Raises
    ------
    DatasetError
        The folder cannot be written to, or the disk is full.
    """

    def write(name: Path) -> None:
        with disk_faults(path):
            write_blocks(name, dataset.sizes.get("sample", 0), row_blocks(dataset))
            flush(name)

    with disk_faults(path):
        return write_with(path, write)


@contextmanager
def disk_faults(path: Path) -> Iterator[None]:
    """Turn what the libraries raise on a full or forbidden disk into one line about `path`.

    Raises
    ------
    DatasetError
        In place of an OSError, or of a RuntimeError of HDF5 (so it tells of a full disk).
    """
    try:
        yield
    except OutputError as fault:
        raise DatasetError(str(fault)) from None
    except (OSError, RuntimeError) as fault:
        message = f"{path}: cannot be written (is the disk full?): {_short(fault)}"
        raise DatasetError(message) from None


def flush(path: Path) -> None:
    """Make sure that a file survives a loss of power."""
    with path.open("rb+") as stream:
        os.fsync(stream.fileno())


def row_blocks(dataset: xr.Dataset, rows: int = BLOCK_ROWS) -> Iterator[xr.Dataset]:
    """Cut a dataset into blocks of consecutive rows, loaded one at a time."""
    for begin in range(0, max(dataset.sizes.get("sample", 0), 1), rows):
        part = dataset
        if "sample" in dataset.sizes:
            part = dataset.isel(sample=slice(begin, begin + rows))
        with _LOCK:
            loaded: xr.Dataset = part.load()
        yield loaded


@contextmanager
def reading(path: Path) -> Iterator[xr.Dataset]:
    """Open a netCDF file of any kind without reading its values; they are read when asked for.

    Nothing that was read is kept: a column costs its own memory only while the caller holds it.

    Raises
    ------
    DatasetError
        One line: missing, a folder, empty, not netCDF, truncated; also for values that cannot be
        read later on.
    """
    import netCDF4

    _require_netcdf(path)
    with _LOCK:
        try:
            file = netCDF4.Dataset(path)
        except (OSError, RuntimeError) as fault:
            raise _damaged(path, fault) from None
        with file:
            for variable in file.variables.values():
                with suppress(RuntimeError):  # only chunked ones have a cache, of 64 MB each
                    variable.set_var_chunk_cache(0, 1, 0.0)
            try:
                store: Any = xr.backends.NetCDF4DataStore(file)  # type: ignore[no-untyped-call]
                dataset = xr.open_dataset(store, decode_times=False, cache=False)
            except (OSError, RuntimeError, ValueError, KeyError) as fault:
                raise _damaged(path, fault) from None
            try:
                yield dataset
            except (OSError, RuntimeError) as fault:  # of HDF5, when values are asked for
                raise _damaged(path, fault) from None


@contextmanager
def reading_dataset(path: Path) -> Iterator[xr.Dataset]:
    """Open a near-field dataset without reading its values; see `reading`.

    Raises
    ------
    DatasetError
        As `reading`, or the file is of another kind or a newer format.
    """
    with reading(path) as dataset:
        _require_format(dataset, path)
        yield dataset


def open_dataset(path: Path) -> xr.Dataset:
    """Read a near-field dataset into memory.

    Raises
    ------
    DatasetError
        As `reading`, or the file is of another kind or a newer format.
    """
    with reading_dataset(path) as dataset:
        loaded: xr.Dataset = dataset.load()
    return loaded


def _define(file: Any, form: xr.Dataset, rows: int) -> None:
    """Create dimensions and variables; a fill value only where something may be missing."""
    for name, size in form.sizes.items():
        file.createDimension(name, rows if name == "sample" else size)
    for key, variable in form.variables.items():
        holes = variable.dtype.kind == "f" and role_of(variable) in _HOLES
        settings: dict[str, Any] = {}
        if "sample" in variable.dims and rows:
            chunk = (min(rows, CHUNK_ROWS), *variable.shape[1:])
            settings = {"zlib": True, "complevel": 4, "shuffle": True, "chunksizes": chunk}
        created = file.createVariable(
            key,
            str if variable.dtype.kind in "OUT" else variable.dtype,
            variable.dims,
            fill_value=float("nan") if holes else None,
            **settings,
        )
        if settings:  # whole chunks go straight to the file: no cache is needed
            created.set_var_chunk_cache(0, 1, 0.0)
        created.setncatts(variable.attrs)


def _require_format(dataset: xr.Dataset, path: Path) -> None:
    kind = dataset.attrs.get("schema")
    if not isinstance(kind, str) or kind != SCHEMA:
        other = "is netCDF, but not written by castblast"
        what = other if kind is None else f"is a '{shortened(kind)}'"
        message = f"{path}: {what}; a {SCHEMA} is needed"
        raise DatasetError(message)
    version = str(dataset.attrs.get("schema_version", ""))
    if version.split(".")[0] != SCHEMA_VERSION.split(".")[0]:
        message = f"{path}: has format {shortened(version)}; this castblast reads {SCHEMA_VERSION}"
        raise DatasetError(message)
    for key in ("name", "dataset_version", "content_sha256", "castblast_version"):
        # They go into every model that is trained on it, and from there into source code.
        if not is_label(dataset.attrs.get(key, "none")):
            shown = shortened(dataset.attrs[key])
            message = f"{path}: attribute {key}: '{shown}' is not plain text"
            raise DatasetError(message)


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


def _damaged(path: Path, fault: BaseException) -> DatasetError:
    return DatasetError(f"{path}: is truncated or damaged: {_short(fault)}")


def _short(fault: BaseException) -> str:
    return str(fault).splitlines()[0][:120] if str(fault) else type(fault).__name__
