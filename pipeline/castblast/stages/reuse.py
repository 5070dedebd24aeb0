"""Reuse of earlier results: a folder is valid as long as everything it came from is unchanged."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from castblast.disk.files import write_text

_PACKAGE = Path(__file__).resolve().parent.parent
_KEY_FILE = "made_from.json"


@cache
def package_hash(without: tuple[str, ...] = ()) -> str:
    """SHA-256 over all sources of the package: any change of code makes results stale.

    Parameters
    ----------
    without : tuple of str
        Folders of the package that have no part in the result.
    """
    digest = hashlib.sha256()
    for source in sorted(_PACKAGE.rglob("*.py")):
        if source.relative_to(_PACKAGE).parts[0] in without:
            continue
        digest.update(source.relative_to(_PACKAGE).as_posix().encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()


def file_hash(path: Path) -> str:
    """SHA-256 of a file."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def make_key(**inputs: object) -> dict[str, str]:
    """Key of a result: the inputs as text (files by their hash) and the package's sources."""
    key = {name: file_hash(v) if isinstance(v, Path) else str(v) for name, v in inputs.items()}
    return {**key, "package": package_hash()}


def is_valid(folder: Path, key: Mapping[str, str]) -> bool:
    """Say whether `folder` was finished from exactly these inputs."""
    try:
        stored = json.loads((folder / _KEY_FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return bool(stored == dict(key))


def mark_valid(folder: Path, key: Mapping[str, str]) -> None:
    """Remember what a finished folder was made from; call it last."""
    write_text(folder / _KEY_FILE, json.dumps(dict(key), indent=2, sort_keys=True) + "\n")


def forget(folder: Path) -> None:
    """Take the mark of `mark_valid` away: the next run makes the folder anew."""
    (folder / _KEY_FILE).unlink(missing_ok=True)
