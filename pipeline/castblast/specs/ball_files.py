"""Files of balls: centres, radii and maybe velocities, checked before they enter a simulation."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from castblast.errors import SpecError, nearest_name
from castblast.muckpile.contact import ContactLaw
from castblast.muckpile.initial_state import initial_state
from castblast.muckpile.particles import FloatArray, Particles
from castblast.specs.balls import RADII
from castblast.specs.quantity import QuantityIn
from castblast.specs.table import Form, Table, read_table

_KEYS = ("x", "r")
_PLACE, _MOTION = ("x", "y", "z"), ("vx", "vy", "vz")
_NO_RADIUS = "the column 'radius' is missing"
_MOST_PAIRS = 20
_FORM = Form(
    columns={
        **dict.fromkeys(_PLACE, QuantityIn("m", -1e5, 1e5)),
        "radius": QuantityIn("m", *RADII),
        "diameter": QuantityIn("m", 2.0 * RADII[0], 2.0 * RADII[1]),
        **dict.fromkeys(_MOTION, QuantityIn("m s-1", -500.0, 500.0)),
        "block": QuantityIn("1", -1.0, 1e7),
    },
    required=_PLACE,
    # As ParaView writes the points of a file.
    aliases={"r": "radius", "points_0": "x", "points_1": "y", "points_2": "z"},
    ids=("id", "particle_id"),
    unique_ids=True,
    bare=True,
)


def read_balls(path: Path, law: ContactLaw | None = None) -> Particles:
    """Read balls from a CSV or ``.npz`` file.

    A CSV has the columns x, y, z, radius and optionally vx, vy, vz and block, with units in its
    heads or in SI without; lines that begin with ``#`` are remarks. An ``.npz`` has arrays of the
    same names, or x (n, 3) and r (n,), and optionally v (n, 3), w (n, 3) and block (n,), as runs
    write their final state. Balls without a block have block -1.

    Parameters
    ----------
    path : Path
    law : ContactLaw, optional
        Balls at rest may overlap as far as their own weight presses them for this law.

    Raises
    ------
    SpecError
        One line per fault: no such file, unreadable, missing columns, shapes, what is no number
        (with its line), radii, balls that overlap by more than a tenth of their radius
        (or more than the weight above them can cause).
    """
    if path.suffix.lower() == ".csv":
        return _read_csv(path, law)
    arrays = _read_arrays(path)
    if "x" in arrays and arrays["x"].ndim == 1 and "y" in arrays:
        arrays = _stacked(path, arrays)
    missing = [key for key in _KEYS if key not in arrays]
    if missing:
        raise SpecError("\n".join(_missing_line(path, key, list(arrays)) for key in missing))
    if faults := _shape_faults(path, arrays):
        raise SpecError("\n".join(faults))
    block = arrays.get("block")
    balls, faults = initial_state(
        arrays["x"],
        arrays["r"],
        velocity=arrays.get("v"),
        spin=arrays.get("w"),
        block=None if block is None else block.astype(np.int64),
        law=law,
    )
    if faults:
        raise SpecError("\n".join(f"{path}: {fault}" for fault in faults))
    return balls


def _read_csv(path: Path, law: ContactLaw | None) -> Particles:
    table = read_table(path, _FORM)
    number = table.number
    given = [name for name in _MOTION if name in number]
    faults = [f"{path}: the column '{n}' is missing" for n in _MOTION if given and n not in given]
    sizes = [name for name in ("radius", "diameter") if name in number]
    if len(sizes) != 1:
        word = "only one of 'radius' and 'diameter' is needed" if sizes else _NO_RADIUS
        faults.append(f"{path}: {word}")
    for name in (*sizes, *given, *(["block"] if "block" in number else [])):
        bad = table.line[~np.isfinite(number[name])]
        faults += [f"{path}: line {line}: {name}: empty: a number is needed" for line in bad[:5]]
    if faults:
        raise SpecError("\n".join(faults))
    block = number.get("block")
    radius = number["radius"] if sizes == ["radius"] else 0.5 * number["diameter"]
    place = _columns(number, _PLACE)
    _require_single(table, place)
    balls, faults = initial_state(
        place,
        radius,
        velocity=_columns(number, _MOTION) if given else None,
        block=None if block is None else block.astype(np.int64),
        law=law,
    )
    if faults:
        raise SpecError("\n".join(f"{path}: {_with_lines(fault, table)}" for fault in faults))
    return balls


def _require_single(table: Table, place: FloatArray) -> None:
    """Refuse balls that stand in the table twice."""
    order = np.lexsort(place.T)
    same = np.flatnonzero((np.diff(place[order], axis=0) == 0.0).all(axis=1))
    if len(same):
        pairs = sorted(sorted((int(order[k]), int(order[k + 1]))) for k in same)[:_MOST_PAIRS]
        raise SpecError(
            "\n".join(
                f"{table.path}: lines {table.line[one]} and {table.line[two]}: two balls at one "
                f"place"
                for one, two in pairs
            )
        )


def _with_lines(fault: str, table: Table) -> str:
    """Name the line of each ball that a fault names by its number."""

    def named(match: re.Match[str]) -> str:
        return f"{match[1]}{match[2]} (line {table.line[int(match[2])]})"

    return re.sub(r"(\bballs? |\band (?=\d+ by))(\d+)", named, fault)


def _columns(columns: dict[str, Any], names: tuple[str, ...]) -> FloatArray:
    return np.column_stack([columns[name] for name in names])


def _stacked(path: Path, arrays: dict[str, Any]) -> dict[str, Any]:
    """Arrays x, y, z, radius, vx, vy, vz as x (n, 3), r and v (n, 3)."""
    names = (*_PLACE, "radius", *(_MOTION if "vx" in arrays else ()))
    missing = [name for name in names if name not in arrays]
    if missing:
        raise SpecError("\n".join(_missing_line(path, key, list(arrays)) for key in missing))
    if len({arrays[name].shape for name in names}) > 1 or arrays["x"].dtype.kind not in "fiu":
        shapes = ", ".join(f"{name} {arrays[name].shape}" for name in names)
        raise SpecError(f"{path}: {shapes}: equal shapes (n,) of numbers are needed")
    stacked = {"x": _columns(arrays, _PLACE), "r": arrays["radius"]}
    if "vx" in arrays:
        stacked["v"] = _columns(arrays, _MOTION)
    return stacked | {key: arrays[key] for key in ("block",) if key in arrays}


def _shape_faults(path: Path, arrays: dict[str, Any]) -> list[str]:
    x, r = arrays["x"], arrays["r"]
    faults = []
    if x.ndim != 2 or x.shape[-1] != 3 or not x.size:
        faults.append(f"{path}: x: shape {x.shape}; (n, 3) is needed")
    if r.ndim != 1 or not r.size:
        faults.append(f"{path}: r: shape {r.shape}; (n,) is needed")
    if not faults and len(x) != len(r):
        faults.append(f"{path}: x has {len(x)} balls, r has {len(r)}")
    for key, shape in (("block", r.shape), ("v", x.shape), ("w", x.shape)):
        if not faults and key in arrays and arrays[key].shape != shape:
            like = "r" if key == "block" else "x"
            faults.append(f"{path}: {key}: shape {arrays[key].shape}; {shape} as {like} is needed")
    faults += [
        f"{path}: {key}: type {arrays[key].dtype}; numbers are needed"
        for key in ("x", "r", "block", "v", "w")
        if key in arrays and arrays[key].dtype.kind not in "fiu"
    ]
    return faults


def _read_arrays(path: Path) -> dict[str, Any]:
    try:
        with np.load(path, allow_pickle=False) as archive:
            if not hasattr(archive, "files"):
                raise SpecError(f"{path}: holds one array; an .npz with x and r is needed")
            return {key: archive[key] for key in archive.files}
    except FileNotFoundError:
        raise SpecError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise SpecError(f"{path}: is a folder; an .npz or .csv file is needed") from None
    except (ValueError, EOFError, zipfile.BadZipFile, KeyError, OSError) as fault:
        line = str(fault).splitlines()[0] if str(fault) else type(fault).__name__
        raise SpecError(f"{path}: is no readable .npz file ({line})") from None


def _missing_line(path: Path, key: str, found: list[str]) -> str:
    names = ", ".join(found) or "nothing"
    return f"{path}: {key}: is missing{nearest_name(key, found)}; the file holds {names}"
