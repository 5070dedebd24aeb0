"""Finished fits kept on this machine, so that the same spec on the same rows is not fitted twice.

A working store like compiled code, not a format of exchange: it holds pickled estimators, is read
by the version that wrote it only, and lies in the user's own cache (`kept`), never beside a dataset
or in a folder of fits. What travels are ``fit.json`` and ``network.json``.
"""

from __future__ import annotations

import json
import pickle
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from castblast.errors import SpecError
from castblast.identity import digest, file_hash, library_version, source_hash
from castblast.specs.models.model import CustomSpec, ModelSpec
from castblast.surrogate.fitting.families.custom import importable
from castblast.surrogate.fitting.features import Table
from castblast.surrogate.fitting.kept import keep, kept
from castblast.surrogate.fitting.training import Fit
from castblast.version import __version__

#: Folders that turn a spec and rows into a fit: a change in one makes every fit stale.
FIT_SOURCES = ("network", "specs/models", "surrogate/fitting")
_LIBRARIES = ("numpy", "scikit-learn", "torch")


def table_hash(table: Table) -> str:
    """SHA-256 (hex) of the rows as a fit sees them: values, explosives, split, descriptors."""
    values = ((name, table.frame[name].to_numpy(dtype=np.float64)) for name in table.feature_names)
    return digest(
        *(part for name, column in values for part in (name, column.tobytes())),
        " ".join(table.target_names),
        np.asarray(table.targets, dtype=np.float64).tobytes(),
        *("\n".join(map(str, labels)) for labels in (table.frame["explosive"], table.split)),
        json.dumps(table.descriptors, sort_keys=True),
    )


def fit_key(spec: ModelSpec, table: Table) -> dict[str, str]:
    """Everything that a fit is made from: spec, rows, code and libraries."""
    own = table.select(spec.features, spec.targets)
    return {
        "spec": spec.sha256(),
        "name": spec.name,
        "description": spec.description,
        "dataset": table.source.get("content_sha256", ""),
        "rows": table_hash(own),
        **_code_key(spec),
    }


def _code_key(spec: ModelSpec) -> dict[str, str]:
    """The part of a key that is known without the rows: code and libraries."""
    return {
        "castblast": __version__,
        "code": source_hash(FIT_SOURCES),
        "factory": _factory_hash(spec),
        **{library: library_version(library) for library in _LIBRARIES},
    }


def _factory_hash(spec: ModelSpec) -> str:
    """SHA-256 of the module of a user's own ``module:factory``; empty where there is none."""
    if not isinstance(spec, CustomSpec):
        return ""
    with importable(str(spec.folder)):
        try:
            found = find_spec(spec.factory.partition(":")[0])
        except (ImportError, ValueError):
            return ""
    if found is None or not found.origin or not Path(found.origin).is_file():
        return ""
    return file_hash(Path(found.origin))


def save_kept(place: Path, value: Any, key: Mapping[str, str], spec: Any = None) -> bool:
    """Keep a result with what it was made from; False where nothing can be kept.

    Parameters
    ----------
    place : path
        What it belongs to: the folder of a fit, for one.
    value : object
        One that cannot be pickled, as a user's own estimator may be, is not kept.
    key : mapping
        What it was made from.
    spec : ModelSpec, optional
    """
    inside = packed(value)
    if inside is None:
        return False
    return keep(place, pickle.dumps({"key": dict(key), "spec": spec, "value": inside}, protocol=5))


def packed(value: Any) -> bytes | None:
    """Pickle a result; None where it cannot be."""
    try:
        return pickle.dumps(value, protocol=5)
    except (pickle.PicklingError, AttributeError, TypeError):
        return None


def unpacked(content: bytes, spec: ModelSpec) -> Fit | None:
    """Open what a process of our own has just packed; never call it on a file."""
    with importable(str(getattr(spec, "folder", ""))):
        fit = _unpickle(content)
    return fit if isinstance(fit, Fit) else None


def load_kept(place: Path, key: Mapping[str, str]) -> Any:
    """Give what was made from exactly `key`; None if there is none or it is unreadable."""
    stored = _opened(place)
    if not isinstance(stored, dict) or stored.get("key") != dict(key):
        return None
    with importable(str(getattr(stored.get("spec"), "folder", ""))):
        return _unpickle(stored["value"])


def load_fit(place: Path, key: Mapping[str, str]) -> Fit | None:
    """Give the fit of a folder that was made from exactly `key`, if it is there."""
    fit = load_kept(place, key)
    return fit if isinstance(fit, Fit) else None


def is_kept(place: Path) -> bool:
    """Whether this user keeps a fit of a folder on this machine."""
    return kept(place) is not None


def kept_spec(place: Path) -> ModelSpec | None:
    """Spec as it was given to the fit of a folder that is kept on this machine, if one is."""
    stored = _opened(place)
    spec: ModelSpec | None = stored.get("spec") if isinstance(stored, dict) else None
    return spec


def open_fit(place: Path) -> Fit:
    """Give the fit of a folder that is kept on this machine, whatever rows it was fitted on.

    Raises
    ------
    SpecError
        None is kept here, it needs what is missing here, or it was made by other code, with which
        it may answer otherwise than when it was trained.
    """
    stored = _opened(place)
    spec = stored.get("spec") if isinstance(stored, dict) else None
    if spec is None:
        message = f"{place}: its fit is not kept on this machine; run castblast train again"
        raise SpecError(message)
    now = _code_key(spec)
    changed = [name for name, value in now.items() if stored["key"].get(name) != value]
    if changed:
        message = (
            f"{place}: was fitted with other {', '.join(changed)} than there is now; "
            "run castblast train again"
        )
        raise SpecError(message)
    try:
        with importable(str(getattr(spec, "folder", ""))):
            fit = pickle.loads(stored["value"])
    except Exception as fault:  # whatever a module of a user's own raises when it is imported
        message = f"{place}: its fit cannot be read: {fault}"
        raise SpecError(message) from fault
    if not isinstance(fit, Fit):
        message = f"{place}: holds a {type(fit).__name__}, no fit"
        raise SpecError(message)
    return fit


def _opened(place: Path) -> Any:
    """What is kept under a place, once its seal was found to be our own; None if there is none."""
    content = kept(place)
    return None if content is None else _unpickle(content)


def _unpickle(content: bytes) -> Any:
    try:
        return pickle.loads(content)
    except Exception:  # whatever a damaged or older file raises: the result is made again
        return None
