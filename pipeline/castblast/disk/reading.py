"""Files from elsewhere, read in bounded time and memory: text, JSON and NumPy archives.

Whatever a file holds, the outcome is its content or one line that names the file. Nothing in a
file is ever unpickled, and no message advises anybody to.
"""

from __future__ import annotations

import json
import math
import struct
import zipfile
import zlib
from pathlib import Path
from typing import IO, Any, NoReturn

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from castblast.errors import SpecError, nearest_name
from castblast.names import printable

#: Most bytes of a text file; a table of a million rows has less.
LARGEST_TEXT = 1 << 29
#: An archive may hold this many bytes, and this many times its own size beyond that. Numbers that
#: a simulation made hardly shrink; only made-up ones shrink a thousandfold.
_ALWAYS, _TIMES = 1 << 27, 25
_MEGA = 1 << 20


def read_bytes(path: Path, kind: str = "file", largest: int = LARGEST_TEXT) -> bytes:
    """Read a file that a person named.

    Parameters
    ----------
    path : Path
    kind : str
        What is needed, for the message about a folder: ``"YAML file"``.
    largest : int
        Most bytes that are read, from a pipe or a device too.

    Raises
    ------
    SpecError
        One line: the file is missing, a folder, unreadable or too large.
    """
    try:
        with path.open("rb") as stream:
            content = stream.read(largest + 1)
    except FileNotFoundError:
        raise SpecError(f"{_shown(path)}: no such file{nearest_file(path)}") from None
    except IsADirectoryError:
        raise SpecError(f"{_shown(path)}: is a folder; a {kind} is needed") from None
    except OSError as fault:
        raise SpecError(f"{_shown(path)}: cannot be read: {fault.strerror or fault}") from None
    except ValueError:  # a NUL character
        raise SpecError(f"{_shown(path)}: is not a valid file name") from None
    except MemoryError:
        raise SpecError(f"{_shown(path)}: is too large for the memory of this machine") from None
    if len(content) > largest:
        limit = f"{largest / _MEGA:.0f} MB"
        raise SpecError(f"{_shown(path)}: is larger than {limit}, the most a {kind} may have")
    return content


def read_text(path: Path, kind: str = "text file", largest: int = LARGEST_TEXT) -> str:
    """Read a text file in UTF-8; a byte order mark is left out.

    Raises
    ------
    SpecError
        As `read_bytes`, or it is not UTF-8.
    """
    try:
        text = read_bytes(path, kind, largest).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise SpecError(f"{_shown(path)}: is not a text file in UTF-8") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_json(path: Path, largest: int = LARGEST_TEXT) -> Any:
    """Read a JSON file.

    Raises
    ------
    SpecError
        As `read_text` and `parse_json`; the message names the file.
    """
    return parse_json(read_text(path, "JSON file", largest), f"{_shown(path)}: ")


def parse_json(text: str, where: str = "") -> Any:
    """Read a JSON text; `where` stands before a message.

    Raises
    ------
    SpecError
        One line: no JSON, NaN or an infinity in it, nested too deeply, an integer too long.
    """
    try:
        return json.loads(text, parse_constant=_refuse_constant)
    except json.JSONDecodeError as fault:
        raise SpecError(f"{where}line {fault.lineno}: not JSON ({fault.msg})") from None
    except RecursionError:
        raise SpecError(f"{where}not usable: nested too deeply") from None
    except ValueError as fault:  # Python reads no integer of more than 4,300 digits
        problem = str(fault) if isinstance(fault, _ConstantError) else "an integer is too long"
        raise SpecError(f"{where}not usable: {problem}") from None


class _ConstantError(ValueError):
    """NaN or an infinity, which Python would read although JSON has neither."""


def _refuse_constant(name: str) -> NoReturn:
    message = f"{name} is not a JSON number"
    raise _ConstantError(message)


def read_npz(path: Path, what: str = "an .npz file") -> dict[str, NDArray[Any]]:
    """Read all arrays of an archive of NumPy.

    Parameters
    ----------
    path : Path
    what : str
        What the file should be, for messages: ``"a restart file of a cast"``.

    Raises
    ------
    SpecError
        One line: missing, unreadable, no archive of arrays (a single ``.npy`` is none), damaged,
        encrypted, holding Python objects, or far larger unpacked than packed.
    """
    try:
        with path.open("rb") as stream:
            start = stream.read(6)
            if start == npy.MAGIC_PREFIX:
                message = f"{_shown(path)}: is a single array (.npy); {what} is needed"
                raise SpecError(message)
            return _read_archive(stream, path.stat().st_size)
    except _DamageError as fault:
        raise SpecError(f"{_shown(path)}: is not {what}: {fault}") from None
    except FileNotFoundError:
        raise SpecError(f"{_shown(path)}: no such file{nearest_file(path)}") from None
    except IsADirectoryError:
        raise SpecError(f"{_shown(path)}: is a folder; {what} is needed") from None
    except OSError as fault:
        raise SpecError(f"{_shown(path)}: cannot be read: {fault.strerror or fault}") from None
    except MemoryError:
        raise SpecError(f"{_shown(path)}: is too large for the memory of this machine") from None
    except _DAMAGES:
        raise SpecError(f"{_shown(path)}: is not {what}: damaged") from None


class _DamageError(Exception):
    """What is wrong with an archive, in words."""


#: What `zipfile`, `zlib` and the reader of array heads raise on bytes that are not theirs.
_DAMAGES = (
    ValueError, TypeError, KeyError, IndexError, OverflowError, EOFError, RecursionError,
    SyntaxError, NotImplementedError, RuntimeError, struct.error, zlib.error, zipfile.BadZipFile,
    zipfile.LargeZipFile,
)  # fmt: skip


def _read_archive(stream: IO[bytes], size: int) -> dict[str, NDArray[Any]]:
    arrays = {}
    with zipfile.ZipFile(stream) as archive:
        entries = archive.infolist()
        if any(entry.flag_bits & 1 for entry in entries):
            raise _DamageError("encrypted")
        unpacked = sum(entry.file_size for entry in entries)
        if unpacked > _ALWAYS + _TIMES * size:
            packed, full = f"{size / _MEGA:.3g} MB", f"{unpacked / _MEGA:,.0f} MB"
            raise _DamageError(f"{packed} that unpack to {full} hold no measured numbers")
        for entry in entries:
            if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise _DamageError("packed in a way that NumPy does not write")
            if not entry.filename.endswith(".npy"):
                raise _DamageError(f"'{printable(entry.filename)[:60]}' in it is not an array")
            name = entry.filename.removesuffix(".npy")
            with archive.open(entry) as part:
                arrays[name] = _read_array(part, entry.file_size, printable(name)[:60])
    return arrays


def _read_array(part: IO[bytes], size: int, name: str) -> NDArray[Any]:
    """One array; its head is held against the bytes that are there before anything is allocated."""
    version = npy.read_magic(part)
    read_head = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, column_major, kind = read_head(part)
    if kind.hasobject:
        raise _DamageError(f"array '{name}' holds Python objects, not numbers")
    if not all(isinstance(length, int) and length >= 0 for length in shape):
        raise _DamageError(f"array '{name}' is damaged")
    count = math.prod(shape)
    if count * kind.itemsize != size - part.tell() or kind.itemsize == 0:
        raise _DamageError(f"array '{name}' is cut short")
    raw = np.empty(count * kind.itemsize, dtype=np.uint8)
    done = 0
    # To the very end, where the checksum is compared.
    while chunk := part.read(_MEGA):
        raw[done : done + len(chunk)] = np.frombuffer(chunk, dtype=np.uint8)
        done += len(chunk)
    if done != len(raw):
        raise _DamageError(f"array '{name}' is cut short")
    flat = raw.view(kind)
    return flat.reshape(shape[::-1]).T if column_major else flat.reshape(shape)


def _shown(path: Path) -> str:
    return printable(str(path))


def nearest_file(path: Path) -> str:
    """Return a hint at the file of that folder whose name is nearest, or an empty string."""
    try:
        names = [entry.name for entry in path.parent.iterdir() if entry.suffix == path.suffix]
    except OSError:
        return f": the folder {_shown(path.parent)} does not exist"
    return nearest_name(path.name, names)
