"""Files of balls: centres, radii and maybe velocities, checked before they enter a simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from castblast.disk.reading import read_npz
from castblast.errors import SpecError, nearest_name
from castblast.muckpile.balls.contact import ContactLaw
from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.bench.given import initial_state
from castblast.specs.bench.balls.tables import PLACE, RADIUS, VELOCITY, balls_at, read_ball_table
from castblast.specs.quantity import QuantityError
from castblast.types import FloatArray

_KEYS = ("x", "r")
_PLACE, _MOTION = ("x", "y", "z"), ("vx", "vy", "vz")
_LIMITS = {"x": PLACE, "r": RADIUS, "v": VELOCITY}


def read_balls(path: Path, law: ContactLaw | None = None) -> Particles:
    """Read balls from a table, from the file of another engine, or from an ``.npz``.

    A table has the columns x, y, z, radius (or diameter) and optionally id, vx, vy, vz, wx, wy, wz
    and block, with units in its heads or in SI without. Dump and data files of LAMMPS and
    extended XYZ are read in the order of their ids. An ``.npz`` has arrays of the same names, or
    x (n, 3) and r (n,), and optionally v (n, 3), w (n, 3) and block (n,), as runs write their final
    state. Balls without a block have block -1.

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
    if path.suffix.lower() != ".npz":
        return balls_at(read_ball_table(path), law)
    arrays = read_npz(path, "an .npz with the x and r of balls")
    if "x" in arrays and arrays["x"].ndim == 1 and "y" in arrays:
        arrays = _stacked(path, arrays)
    missing = [key for key in _KEYS if key not in arrays]
    if missing:
        raise SpecError("\n".join(_missing_line(path, key, list(arrays)) for key in missing))
    if faults := _shape_faults(path, arrays) or _value_faults(path, arrays):
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


def _value_faults(path: Path, arrays: dict[str, Any]) -> list[str]:
    """Hold the arrays against the bounds that tables have; the first ball of each is named."""
    faults = []
    for key, rule in _LIMITS.items():
        values = np.asarray(arrays.get(key, np.empty(0)), dtype=np.float64)
        bad = np.argwhere(~rule.within(values) & np.isfinite(values))
        if len(bad):
            try:
                rule.check(float(values[tuple(bad[0])]))
            except QuantityError as fault:
                faults.append(f"{path}: {key}: ball {bad[0][0]}: {fault}")
    return faults


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


def _missing_line(path: Path, key: str, found: list[str]) -> str:
    names = ", ".join(found) or "nothing"
    return f"{path}: {key}: is missing{nearest_name(key, found)}; the file holds {names}"
