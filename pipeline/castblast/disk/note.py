"""The note of a folder that says what its files were made from."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from castblast.disk.files import write_text
from castblast.disk.reading import read_json
from castblast.errors import SpecError

_NAME = "made_from.json"


def read_note(folder: Path) -> dict[str, Any]:
    """Give what the files of a folder were made from; empty where no note can be read."""
    try:
        content = read_json(folder / _NAME)
    except SpecError:
        return {}
    return content if isinstance(content, dict) else {}


def write_note(folder: Path, origin: Mapping[str, Any]) -> None:
    """Say what the files of a folder were made from; for a finished result call it last."""
    write_text(folder / _NAME, json.dumps(dict(origin), indent=1, sort_keys=True) + "\n")


def forget_note(folder: Path) -> None:
    """Take the note away: the next run makes the folder anew."""
    (folder / _NAME).unlink(missing_ok=True)
