"""Files of balls: centres and radii, checked before they enter a simulation."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from castblast.errors import SpecError, nearest_name
from castblast.muckpile.particles import Particles, check_particles, particles_at_rest

_KEYS = ("x", "r")


def read_balls(path: Path) -> Particles:
    """Read an ``.npz`` with x (n, 3) and r (n,) in m, and optionally block (n,).

    Balls without a block have block -1.

    Raises
    ------
    SpecError
        One line per fault: no file, no npz, missing arrays, shapes, NaN, radii, overlaps.
    """
    arrays = _read_arrays(path)
    missing = [key for key in _KEYS if key not in arrays]
    if missing:
        raise SpecError("\n".join(_missing_line(path, key, list(arrays)) for key in missing))
    x, r, block = arrays["x"], arrays["r"], arrays.get("block")
    faults = []
    if x.ndim != 2 or x.shape[-1] != 3 or not x.size:
        faults.append(f"{path}: x: shape {x.shape}; (n, 3) is needed")
    if r.ndim != 1 or not r.size:
        faults.append(f"{path}: r: shape {r.shape}; (n,) is needed")
    if not faults and len(x) != len(r):
        faults.append(f"{path}: x has {len(x)} balls, r has {len(r)}")
    if not faults and block is not None and block.shape != r.shape:
        faults.append(f"{path}: block: shape {block.shape}; {r.shape} as r is needed")
    faults += [
        f"{path}: {key}: type {arrays[key].dtype}; numbers are needed"
        for key in (_KEYS if block is None else (*_KEYS, "block"))
        if arrays[key].dtype.kind not in "fiu"
    ]
    if faults:
        raise SpecError("\n".join(faults))
    balls = particles_at_rest(x, r, None if block is None else block.astype(np.int64))
    faults = [f"{path}: {fault}" for fault in check_particles(balls)]
    if faults:
        raise SpecError("\n".join(faults))
    return balls


def _read_arrays(path: Path) -> dict[str, Any]:
    try:
        with np.load(path, allow_pickle=False) as archive:
            if not hasattr(archive, "files"):
                raise SpecError(f"{path}: holds one array; an .npz with x and r is needed")
            return {key: archive[key] for key in archive.files}
    except FileNotFoundError:
        raise SpecError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise SpecError(f"{path}: is a folder; an .npz file is needed") from None
    except (ValueError, EOFError, zipfile.BadZipFile, KeyError, OSError) as fault:
        line = str(fault).splitlines()[0] if str(fault) else type(fault).__name__
        raise SpecError(f"{path}: is no readable .npz file ({line})") from None


def _missing_line(path: Path, key: str, found: list[str]) -> str:
    names = ", ".join(found) or "nothing"
    return f"{path}: {key}: is missing{nearest_name(key, found)}; the file holds {names}"
