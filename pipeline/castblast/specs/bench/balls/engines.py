"""Balls as other engines write them: dump and data files of LAMMPS and LIGGGHTS, extended XYZ.

Each becomes a sheet of heads and rows, and is read and checked as any other table of balls. Numbers
are taken as SI, which is what decks of castblast ask for (``units si``).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from castblast.errors import SpecError
from castblast.specs.tables.text import Sheet

#: Sections of a data file, by their first word; what stands behind ``#`` is the style.
_SECTION = re.compile(r"([A-Z][A-Za-z ]*?)\s*(?:#\s*(\S+).*)?")
_SPHERE = ["id", "type", "diameter", "density", "x", "y", "z"]
_IMAGES = ["ix", "iy", "iz"]
_MOTION = ["id", "vx", "vy", "vz", "wx", "wy", "wz"]
_PROPERTY = re.compile(r"(\w+):([SRIL]):(\d+)")
#: Heads of an extended XYZ by the name of a property.
_OF_PROPERTY = {
    "pos": ["x", "y", "z"],
    "velocity": ["vx", "vy", "vz"],
    "velo": ["vx", "vy", "vz"],
    "angular_velocity": ["wx", "wy", "wz"],
}


def engine_sheets(path: Path, lines: list[str]) -> list[Sheet]:
    """Sheets of a file of another engine: balls, and maybe their motion; []: it is none.

    Parameters
    ----------
    path : Path
        For messages.
    lines : list of str
        Of the whole file.

    Raises
    ------
    SpecError
        One line: cut short, no balls in it, or a form that is not read.
    """
    if lines and lines[0].startswith("ITEM:"):
        return [_dump(path, lines)]
    if len(lines) > 1 and lines[0].strip().isdecimal() and "Properties=" in lines[1]:
        return [_extended_xyz(path, lines)]
    if any(re.fullmatch(r"\s*\d+\s+atoms\s*", line) for line in lines[:30]):
        return _data(path, lines)
    return []


def _dump(path: Path, lines: list[str]) -> Sheet:
    """Last frame of a dump."""
    starts = [k for k, line in enumerate(lines) if line.startswith("ITEM: ATOMS")]
    if not starts:
        raise SpecError(f"{path}: is a dump without 'ITEM: ATOMS'")
    start = starts[-1]
    heads = lines[start].split()[2:]
    if "xs" in heads:
        message = f"{path}: line {start + 1}: places are scaled by the box; dump x y z or xu yu zu"
        raise SpecError(message)
    counts = [
        lines[k + 1].strip()
        for k, line in enumerate(lines[: start - 1])
        if line.startswith("ITEM: NUMBER OF ATOMS")
    ]
    wanted = int(counts[-1]) if counts and counts[-1].isdecimal() else -1
    rows = list(_rows(lines, start + 1, "ITEM:"))
    if wanted >= 0 and len(rows) != wanted:
        raise SpecError(f"{path}: the last frame has {len(rows)} of {wanted} balls: cut short?")
    return Sheet(start + 1, heads, iter(rows), " ")


def _data(path: Path, lines: list[str]) -> list[Sheet]:
    """Balls of a data file, and their motion if it is there."""
    found: dict[str, tuple[int, str]] = {}
    for k, line in enumerate(lines):
        if line[:1].isalpha() and (match := _SECTION.fullmatch(line.strip())):
            found.setdefault(match[1], (k, match[2] or ""))
    if "Atoms" not in found:
        raise SpecError(f"{path}: is a LAMMPS data file without a section 'Atoms'")
    start, style = found["Atoms"]
    rows = list(_rows(lines, start + 1))
    width = len(rows[0][1]) if rows else len(_SPHERE)
    if style not in ("", "sphere") or width not in (len(_SPHERE), len(_SPHERE + _IMAGES)):
        what = f"style '{style}'" if style else f"{width} columns"
        raise SpecError(f"{path}: line {start + 1}: atoms of {what}; 'atom_style sphere' is read")
    heads = _SPHERE + _IMAGES if width > len(_SPHERE) else _SPHERE
    sheets = [Sheet(start + 1, list(heads), iter(rows), " ")]
    if "Velocities" in found:
        at = found["Velocities"][0]
        sheets.append(Sheet(at + 1, list(_MOTION), _rows(lines, at + 1), " "))
    return sheets


def _extended_xyz(path: Path, lines: list[str]) -> Sheet:
    """First frame of an extended XYZ, whose second line says what the columns are."""
    written = re.search(r"Properties=(\S+)", lines[1])
    parts = _PROPERTY.findall(written[1]) if written else []
    heads: list[str] = []
    for name, _, count in parts:
        own = _OF_PROPERTY.get(name.lower(), [name.lower()])
        heads += own if len(own) == int(count) else [f"{name}_{k}" for k in range(int(count))]
    count = int(lines[0])
    rows = list(_rows(lines[: count + 2], 2))
    if len(rows) != count:
        raise SpecError(f"{path}: {len(rows)} of {count} balls: cut short?")
    return Sheet(2, heads, iter(rows), " ")


def _rows(lines: list[str], first: int, end: str = "") -> Iterator[tuple[int, list[str]]]:
    """Lines and cells from `first` on, up to the next section."""
    for number, line in enumerate(lines[first:], first + 1):
        if (end and line.startswith(end)) or (not end and line[:1].isalpha() and first > 2):
            return
        if cells := line.split():
            yield number, cells
