"""Finished muckpile runs read back from their folders, checked before anything is made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from castblast.api.muckpile.tables import GROUND_COLUMN, MEAN_COLUMN, X_COLUMN
from castblast.disk.reading import read_json, read_text
from castblast.errors import SpecError
from castblast.muckpile.bench.geometry import Bench, check_bench
from castblast.muckpile.results.metrics import UNITS
from castblast.muckpile.results.profile import Profile
from castblast.types import FloatArray

_METRICS, _PROFILE = "metrics.json", "profile.csv"
#: A file of metrics of 100,000 blocks stays below it [bytes].
_LARGEST = 200_000_000
_NOTHING = np.empty((0, 3))


class FinishedRun(NamedTuple):
    """What a run left.

    Attributes
    ----------
    folder : Path
    document : dict
        Of ``metrics.json``.
    bench : Bench
    pile, ground : Profile
        Mean surface, and the ground below it.
    """

    folder: Path
    document: dict[str, Any]
    bench: Bench
    pile: Profile
    ground: Profile


def read_runs(folders: Sequence[Path]) -> list[FinishedRun]:
    """Read the results of `castblast muckpile`.

    Raises
    ------
    SpecError
        One line for each folder that holds none, or damaged ones.
    """
    runs, faults = [], []
    for folder in folders:
        try:
            runs.append(_read_run(folder))
        except SpecError as fault:
            faults += str(fault).splitlines()
    if faults:
        raise SpecError("\n".join(faults))
    return runs


def _read_run(folder: Path) -> FinishedRun:
    missing = [name for name in (_METRICS, _PROFILE) if not (folder / name).is_file()]
    if missing:
        raise SpecError(
            "\n".join(
                f"{folder}: {name} is missing; run castblast muckpile --out {folder} first"
                for name in missing
            )
        )
    document, bench = _read_metrics(folder / _METRICS)
    pile, ground = _read_profile(folder / _PROFILE)
    return FinishedRun(folder, document, bench, pile, ground)


def _read_metrics(path: Path) -> tuple[dict[str, Any], Bench]:
    document = read_json(path, _LARGEST)
    if not isinstance(document, dict):
        raise _foreign(path, "holds no group of keys")
    missing = [name for name in UNITS if name not in document]
    if missing:
        raise _foreign(path, f"{missing[0]}: is missing")
    for name in UNITS:
        if not _is_numbers(document[name]):
            raise _foreign(path, f"{name}: holds something other than numbers")
    told = document.get("faults", [])
    if not isinstance(told, list) or not all(isinstance(fault, str) for fault in told):
        raise _foreign(path, "faults: holds something other than texts")
    return document, _read_geometry(path, document.get("geometry"))


def _read_geometry(path: Path, written: Any) -> Bench:
    if not isinstance(written, Mapping) or not set(written) <= set(Bench._fields):
        raise _foreign(path, "geometry: is missing or not that of a bench")
    try:
        corners = tuple((float(x), float(y)) for x, y in written.get("corners") or ())
        edges = tuple(str(edge) for edge in written.get("edges") or ())
        lengths = {
            name: float(value)
            for name, value in written.items()
            if name not in ("corners", "edges")
        }
        bench = Bench(**lengths, corners=corners, edges=edges)
        faults = check_bench(bench)
    except (TypeError, ValueError, IndexError, OverflowError):
        raise _foreign(path, "geometry: is not that of a bench") from None
    if faults:
        raise _foreign(path, f"geometry: {faults[0]}")
    return bench


def _read_profile(path: Path) -> tuple[Profile, Profile]:
    head, *rows = read_text(path, "table", _LARGEST).splitlines() or [""]
    heads = head.strip().split(",")
    rows = [line for line in rows if line.strip()]
    try:
        wanted = [heads.index(name) for name in (X_COLUMN, MEAN_COLUMN, GROUND_COLUMN)]
        table = np.loadtxt(rows, delimiter=",", usecols=wanted, ndmin=2) if rows else _NOTHING
    except (ValueError, IndexError) as fault:
        raise _foreign(path, str(fault).splitlines()[0]) from None
    x, mean, ground = table.T.astype(np.float64)
    if len(x) == 0 or not np.isfinite(table).all() or (np.diff(x) <= 0.0).any():
        raise _foreign(path, "the columns are empty, hold no numbers, or x does not increase")
    return Profile(x, mean), Profile(x, ground)


def numbers(value: Any) -> FloatArray:
    """Array of what JSON holds, null as NaN."""
    if isinstance(value, list):
        return np.array([numbers(item) for item in value], dtype=np.float64)
    return np.array(np.nan if value is None else value, dtype=np.float64)


def _is_numbers(value: Any) -> bool:
    try:
        numbers(value)
    except (TypeError, ValueError, OverflowError, RecursionError):
        return False
    return not _holds_text(value)


def _holds_text(value: Any) -> bool:
    """Text such as "1.5" would pass for a number."""
    if isinstance(value, list):
        return any(_holds_text(item) for item in value)
    return isinstance(value, str | bool)


def _foreign(path: Path, why: str) -> SpecError:
    return SpecError(f"{path}: not the result of a muckpile, or damaged: {why}")
