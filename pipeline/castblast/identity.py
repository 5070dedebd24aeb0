"""What a result was made from, as hashes: a kept result is valid as long as its hashes are.

Each kind of result names the folders of sources that decide it; `castblast.disk.note` keeps what
a folder was made from beside its files. All hashes are SHA-256 in hexadecimal.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

_PACKAGE = Path(__file__).resolve().parent


def digest(*parts: Any) -> str:
    """Hash of texts, bytes and arrays, one after the other; arrays with their type and shape."""
    found = hashlib.sha256()
    for part in parts:
        if isinstance(part, str):
            found.update(part.encode())
        elif isinstance(part, bytes):
            found.update(part)
        else:
            found.update(f"{part.dtype.str} {part.shape}".encode())
            found.update(part.tobytes())
    return found.hexdigest()


def document_hash(document: Mapping[str, Any], **options: Any) -> str:
    """Hash of plain JSON values, whatever their order; `options` as `json.dumps` takes them."""
    return digest(json.dumps(dict(document), sort_keys=True, **options))


def file_hash(path: Path) -> str:
    """Hash of a file."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@cache
def source_hash(entries: tuple[str, ...]) -> str:
    """Hash of sources of the package: folders, each with all below it, and files."""
    found = hashlib.sha256()
    for entry in entries:
        path = _PACKAGE / entry
        for source in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            found.update(source.relative_to(_PACKAGE).as_posix().encode())
            found.update(source.read_bytes())
    return found.hexdigest()


@cache
def package_hash(without: tuple[str, ...] = ()) -> str:
    """Hash of all sources but those of the folders `without`: any change makes results stale."""
    entries = sorted({path.relative_to(_PACKAGE).parts[0] for path in _PACKAGE.rglob("*.py")})
    return source_hash(tuple(entry for entry in entries if entry not in without))


@cache
def library_version(name: str) -> str:
    """Version of an installed library; empty where it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


def make_key(**inputs: object) -> dict[str, str]:
    """Key of a result: its inputs as text, files by their hash, and all sources."""
    key = {name: file_hash(v) if isinstance(v, Path) else str(v) for name, v in inputs.items()}
    return {**key, "package": package_hash()}
