"""Text of a table as people save it: encoding, separator, remarks, heads; bounded in every size.

A table comes from a spreadsheet, a mine-planning package or a script: UTF-8 with or without a mark
at its beginning, UTF-16 or Windows-1252; cells apart by commas, semicolons, tabs or blanks; remarks
behind ``#`` or ``//``. What else there is (workbooks, XML, arrays) is told by its first bytes.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from castblast.disk.reading import read_bytes
from castblast.errors import SpecError

MOST_BYTES = 256 * 2**20
LONGEST_LINE = 2**20
MOST_COLUMNS = 1000
MOST_ROWS = 5_000_000
#: A number as a table may write it, the decimal sign aside.
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)

_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),  # before UTF-16, whose mark is its beginning
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_FOREIGN = (
    (b"PK\x03\x04", "is a workbook or another zip archive; save its sheet as CSV in UTF-8"),
    (b"\xd0\xcf\x11\xe0", "is a workbook of an old Excel; save its sheet as CSV in UTF-8"),
    (b"\x93NUMPY", "is an array of NumPy (.npy), which has no names; write a CSV with heads"),
    (b"\x89HDF", "is an HDF5 file; a CSV with heads is needed"),
    (b"\x1f\x8b", "is packed with gzip; unpack it first"),
    (b"%PDF", "is a PDF; a CSV with heads is needed"),
    (b"<?xml", "is XML, such as IREDES; write its places as a CSV with heads"),
)
_SEPARATORS = (";", "\t", ",")
_SEPARATOR_LINE = re.compile(r"sep=([;,\t|])\s*", re.IGNORECASE)
#: A head between blanks keeps its unit in brackets: ``x [m] y [m]``.
_WORD = re.compile(r"[^\s\[(]+(?:\s*(?:\[[^\]]*\]|\([^)]*\)))?")
_QUOTED_OR_UNIT = re.compile(r'"[^"]*"|\[[^\]]*\]|\([^)]*\)')
_REMARK = ("#", "//")
_ENCODING_REMEDY = "save it as UTF-8 ('CSV UTF-8' in a spreadsheet)"


class Sheet(NamedTuple):
    """A table before its cells are understood.

    Attributes
    ----------
    head_line : int
        Line of the heads in the file.
    heads : list of str
    rows : iterator of (int, list of str)
        Line of the file and cells of each row that is not blank.
    separator : str
        ``" "`` for any number of blanks.
    """

    head_line: int
    heads: list[str]
    rows: Iterator[tuple[int, list[str]]]
    separator: str


def open_sheet(path: Path, lines: list[str] | None = None) -> Sheet:
    """Read a file as far as its heads; rows follow one by one.

    `lines` are those of `read_lines`, where the file has been read already.

    Raises
    ------
    SpecError
        One line: no file, no text, another kind of file, nothing in it, a line or a table beyond
        all bounds. The rows may raise it too, with their line.
    """
    lines = read_lines(path) if lines is None else lines
    remarks: list[tuple[int, str]] = []
    separator, at = "", -1
    for at, line in enumerate(lines):
        bare = line.strip()
        if not bare.strip(",;\t\" '"):
            continue
        if bare.startswith(_REMARK):
            remarks.append((at + 1, bare))
        elif match := _SEPARATOR_LINE.fullmatch(bare):
            separator = match[1]
        else:
            break
    else:
        raise SpecError(f"{path}: is empty")
    separator = separator or _separator(lines[at], lines[at + 1] if at + 1 < len(lines) else "")
    head = _cells(lines[at], separator, path, at + 1)
    if named := _heads_in_remark(remarks, head, separator, path):
        return _sheet(path, *named, _rows(lines, at, separator, path))
    return _sheet(path, at + 1, head, separator, _rows(lines, at + 1, separator, path))


def _sheet(
    path: Path, line: int, heads: list[str], separator: str, rows: Iterator[tuple[int, list[str]]]
) -> Sheet:
    heads = [head.strip() for head in heads]
    while heads and not heads[-1]:
        heads.pop()
    if len(heads) > MOST_COLUMNS:
        raise SpecError(f"{path}: line {line}: {len(heads):,} columns; at most {MOST_COLUMNS:,}")
    return Sheet(line, heads, rows, separator)


def decode(path: Path, data: bytes) -> str:
    """Text of a file in UTF-8, UTF-16, UTF-32 with a mark, or Windows-1252 (Latin-1).

    Raises
    ------
    SpecError
        One line that names the encoding tried and the remedy.
    """
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            return _decoded(path, data[len(mark) :], encoding)
    if b"\0" in data[:4096]:
        # UTF-16 without a mark: Latin letters have a zero in every other byte.
        start = data[:4096]
        for encoding, zeros in (("utf-16-le", start[1::2]), ("utf-16-be", start[0::2])):
            if zeros.count(0) > 0.7 * len(zeros):
                return _decoded(path, data, encoding)
        raise SpecError(f"{path}: holds bytes that are not text; {_ENCODING_REMEDY}")
    try:
        return _decoded(path, data, "utf-8")
    except SpecError:
        return _decoded(path, data, "cp1252")


def _decoded(path: Path, data: bytes, encoding: str) -> str:
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError:
        name = "UTF-8 or Windows-1252" if encoding == "cp1252" else encoding.upper()
        raise SpecError(f"{path}: is not a text file in {name}; {_ENCODING_REMEDY}") from None
    if "\0" in text:
        raise SpecError(f"{path}: holds bytes that are not text; {_ENCODING_REMEDY}")
    return text


def read_lines(path: Path) -> list[str]:
    """Read the lines of a table, with their ends, none of them beyond all bounds.

    Raises
    ------
    SpecError
        One line, as `open_sheet`.
    """
    data = read_bytes(path, "table", MOST_BYTES)
    for mark, words in _FOREIGN:
        if data.startswith(mark):
            raise SpecError(f"{path}: {words}")
    lines = io.StringIO(decode(path, data), newline=None).readlines()
    if max(map(len, lines), default=0) > LONGEST_LINE:
        number = next(k for k, line in enumerate(lines, 1) if len(line) > LONGEST_LINE)
        raise SpecError(
            f"{path}: line {number}: {len(lines[number - 1]):,} characters; at most "
            f"{LONGEST_LINE:,}"
        )
    return lines


def _separator(head: str, following: str) -> str:
    """What stands between the cells of the heads, outside quotation marks and units."""
    outside = _QUOTED_OR_UNIT.sub("", head)
    for separator in _SEPARATORS:
        if separator in outside:
            return separator
    words = _WORD.findall(head)
    return " " if 1 < len(words) == len(following.split()) else ","


def _cells(line: str, separator: str, path: Path, number: int) -> list[str]:
    if separator == " ":
        return _WORD.findall(line)
    return next((cells for _, cells in _rows([line], 0, separator, path, number)), [])


def _heads_in_remark(
    remarks: list[tuple[int, str]], first: list[str], separator: str, path: Path
) -> tuple[int, list[str], str] | None:
    """Heads that stand in the remark above a table of numbers, as NumPy and Yade write them."""
    if not remarks or not all(NUMBER.fullmatch(c.strip().replace(",", ".")) for c in first):
        return None
    number, text = remarks[-1]
    text = text.lstrip("#/ ")
    if separator == "," and len(first) == 1:
        return None
    if text.startswith("format "):
        heads = text.removeprefix("format ").split("_")
    else:
        heads = _cells(text, separator, path, number)
    named = len(heads) == len(first) and all(re.match(r"[^\W\d]", h.strip()) for h in heads)
    return (number, heads, separator) if named else None


def _rows(
    lines: list[str], first: int, separator: str, path: Path, number: int = 1
) -> Iterator[tuple[int, list[str]]]:
    """Line and cells of each line from `first` on that is neither blank nor a remark.

    `number` is that of the first of all lines.
    """
    count = 0
    for line, cells in _split(lines[first:], number + first, separator, path):
        if cells and (cells[0].strip() or "".join(cells).strip()):
            count += 1
            if count > MOST_ROWS:
                raise SpecError(f"{path}: more than {MOST_ROWS:,} rows; split it")
            yield line, cells


def _split(
    lines: list[str], number: int, separator: str, path: Path
) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of each line; a remark has none."""
    if separator == " ":
        for line in lines:
            yield number, [] if line.lstrip().startswith(_REMARK) else line.split()
            number += 1
        return
    current = number - 1
    plain = not any('"' in line or "#" in line or "//" in line for line in lines)

    def feed() -> Iterator[str]:
        nonlocal current
        for line in lines:
            current += 1
            if not line.lstrip().startswith(_REMARK):
                yield line

    reader = csv.reader(
        lines if plain else feed(), delimiter=separator, skipinitialspace=True, strict=True
    )
    try:
        if plain:  # a line is a row
            yield from enumerate(reader, number)
            return
        for cells in reader:
            yield current, cells
    except csv.Error as fault:
        at = number - 1 + reader.line_num if plain else current
        raise SpecError(f"{path}: line {at}: not valid CSV: {fault}") from None
