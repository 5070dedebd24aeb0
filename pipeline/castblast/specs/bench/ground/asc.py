"""ESRI grids of heights: a header of keys and values, then rows from north to south."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from castblast.disk.reading import read_bytes
from castblast.errors import SpecError, nearest_name
from castblast.specs.tables.text import MOST_BYTES, decode
from castblast.types import FloatArray

_NEEDED = ("ncols", "nrows")
_KEYS = (
    *_NEEDED, "cellsize", "dx", "dy", "xllcorner", "yllcorner", "xllcenter", "yllcenter",
    "nodata_value", "byteorder",
)  # fmt: skip
#: Words for a height that is missing.
_NONE = ("nan", "null", "none", "nodata", "na", "n/a", "*", "-", "1.#qnan", "-1.#ind")
#: A mark is written with fewer digits in the header than in the rows, or more.
_SAME_MARK = 1e-5
#: The mark of files that declare none.
_USUAL_MARK = -9999.0
_LONGEST_HEADER = 20


def is_esri_grid(path: Path) -> bool:
    """Whether a text begins as an ESRI grid does, whatever its name."""
    try:
        with path.open("rb") as stream:
            start = stream.read(64)
    except (OSError, ValueError):
        return False  # whoever reads it says so
    return start.removeprefix(b"\xef\xbb\xbf").lstrip().lower().startswith((b"ncols", b"nrows"))


def read_esri_grid(
    path: Path, most: int, factor: float = 1.0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Read x (nx,), y (ny,) and height (ny, nx), all in m; heights may be missing (NaN).

    Decimal commas, ``dx`` and ``dy`` instead of a cell size, and words such as ``null`` for the
    mark of what is missing are read as well.

    Parameters
    ----------
    path : Path
    most : int
        Largest number of heights.
    factor : float [m]
        Unit of the file.

    Raises
    ------
    SpecError
        One line: no file, no text, keys missing or no numbers, another number of heights than the
        header says.
    """
    lines = decode(path, read_bytes(path, "grid", MOST_BYTES)).splitlines()
    header, rest = _read_header(path, lines)
    nx, ny = (_count(path, key, header[key]) for key in _NEEDED)
    if nx * ny > most:
        raise SpecError(f"{path}: header: {ny} x {nx} = {nx * ny:,} heights; at most {most:,}")
    words = " ".join(rest).replace(",", ".").lower().split()
    if len(words) != nx * ny:
        raise SpecError(
            f"{path}: {len(words)} heights; nrows x ncols = {ny} x {nx} = {nx * ny} are needed"
        )
    mark = header.get("nodata_value", str(_USUAL_MARK))
    height = _numbers(path, words, mark, nx).reshape(ny, nx)[::-1] * factor
    size = {a: _size(path, header, a) * factor for a in "xy"}
    low = {}
    for axis in "xy":
        corner, centre = header.get(f"{axis}llcorner"), header.get(f"{axis}llcenter")
        if corner is None and centre is None:
            raise SpecError(f"{path}: header: missing: {axis}llcorner")
        if centre is not None:
            low[axis] = _number(path, f"{axis}llcenter", centre) * factor
        else:
            low[axis] = _number(path, f"{axis}llcorner", corner or "") * factor + 0.5 * size[axis]
    x, y = (low[a] + size[a] * np.arange(n, dtype=np.float64) for a, n in (("x", nx), ("y", ny)))
    return np.asarray(x), np.asarray(y), np.ascontiguousarray(height)


def _read_header(path: Path, lines: list[str]) -> tuple[dict[str, str], list[str]]:
    """Keys and their words, and the lines behind them."""
    header: dict[str, str] = {}
    first = 0
    for line in lines[:_LONGEST_HEADER]:
        words = line.lower().split()
        if words and (not words[0][0].isalpha() or words[0] in _NONE):
            break
        first += 1
        if not words:
            continue
        if len(words) != 2 or words[0] not in _KEYS:
            hint = nearest_name(words[0], _KEYS) if len(words) == 2 else "; a key and a value"
            raise SpecError(f"{path}: line {first}: '{line.strip()[:60]}': unknown key{hint}")
        if words[0] in header:
            raise SpecError(f"{path}: line {first}: {words[0]}: given twice")
        header[words[0]] = words[1].replace(",", ".")
    missing = [key for key in _NEEDED if key not in header]
    if "cellsize" not in header and not {"dx", "dy"} <= set(header):
        missing.append("cellsize (or dx and dy)")
    if missing:
        raise SpecError(f"{path}: header: missing: {', '.join(missing)}")
    return header, lines[first:]


def _number(path: Path, key: str, word: str) -> float:
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise SpecError(f"{path}: header: {key}: {word[:40]}: a number is needed")
    return number


def _count(path: Path, key: str, word: str) -> int:
    number = _number(path, key, word)
    if number != int(number) or not 2 <= number < 1e9:
        raise SpecError(f"{path}: header: {key}: {word[:40]}: a whole number from 2 is needed")
    return int(number)


def _size(path: Path, header: dict[str, str], axis: str) -> float:
    key = f"d{axis}" if f"d{axis}" in header else "cellsize"
    size = _number(path, key, header[key])
    if size <= 0.0:
        raise SpecError(f"{path}: header: {key}: {size:g}: must be larger than 0")
    return size


def _numbers(path: Path, words: list[str], mark: str, columns: int) -> FloatArray:
    """Heights, NaN where a word stands for none."""
    none = {*_NONE, mark.lower()}
    try:
        values = np.array(words, dtype=np.float64)
    except ValueError:
        plain = ["nan" if word in none else word for word in words]
        try:
            values = np.array(plain, dtype=np.float64)
        except ValueError:
            bad = next(k for k, word in enumerate(plain) if not _is_number(word))
            place = f"row {bad // columns}, column {bad % columns} from the top"
            raise SpecError(f"{path}: {place}: '{words[bad][:40]}' is not a number") from None
    try:
        number = float(mark)
    except ValueError:
        return values
    if math.isfinite(number):
        with np.errstate(invalid="ignore"):
            off = np.abs(values - number) <= _SAME_MARK * max(1.0, abs(number))
        values[off] = np.nan
    return values


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
