"""Copies of the specs that come with castblast, to start one's own from."""

from __future__ import annotations

from pathlib import Path

from castblast.disk.files import write_text
from castblast.disk.resources import resource
from castblast.errors import SpecError

#: What is copied: folder of the installation to folder of the copy.
_COPIED = {
    "data_specs/cases": "cases",
    "data_specs/explosives": "explosives",
    "data_specs/recipes": "recipes",
    "data_specs/benches": "benches",
    "data_specs/ore": "ore",
    "models/specs": "models",
}


def copy_examples(folder: str | Path) -> list[Path]:
    """Copy every shipped spec; files that are already there are never overwritten.

    Parameters
    ----------
    folder : Path
        Made if it does not exist.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    SpecError
        Files of the same names are there, or `folder` is a file; nothing is written then.
    """
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise SpecError(f"{folder}: is a file; give a folder")
    sources = {
        folder / name / source.name: source
        for origin, name in _COPIED.items()
        for source in sorted(resource(origin).iterdir())
        if source.is_file()
    }
    taken = [path for path in sources if path.exists()]
    if taken:
        more = f" and {len(taken) - 1} more" if len(taken) > 1 else ""
        raise SpecError(f"{taken[0]}{more}: already exists; give another folder")
    for path, source in sources.items():
        write_text(path, source.read_text(encoding="utf-8"))
    return list(sources)
