"""Folders of a user's own cache, and the test that nobody else can put files into them.

What lies in such a folder is run or unpickled, so a folder that another user made, or may write
to, is none. Where no folder is safe (no home, a disk that is full or read-only), there is no cache
and everything is computed again.
"""

from __future__ import annotations

import os
import stat
import sys
import tempfile
from pathlib import Path


def cache_folder(*parts: str) -> Path | None:
    """Give a writable folder of this user's cache, made if need be; None if there is none.

    Parameters
    ----------
    *parts : str
        Names below the root: ``$CASTBLAST_CACHE_DIR``, else ``castblast`` in the cache folder of
        the system. Where that cannot be used, a private folder in the folder for temporary files
        takes its place.

    Notes
    -----
    A root that ``CASTBLAST_CACHE_DIR`` names is taken as it is: whoever shares one with others
    says so by naming it.
    """
    named = os.environ.get("CASTBLAST_CACHE_DIR")
    if named:
        chosen = Path(named).joinpath(*parts)
        if _is_made(chosen):
            return chosen
    elif root := _system_root():
        usual = root.joinpath(*parts)
        if _is_made(usual) and is_private(usual):
            return usual
    return _temporary_folder("-".join(parts))


def is_private(folder: Path) -> bool:
    """Say whether a folder is a folder, this user's own, and writable by nobody else.

    A symbolic link is not: whoever made it may point it elsewhere later. Windows keeps the folders
    of its users apart by itself.
    """
    try:
        found = folder.lstat()
    except OSError:
        return False
    if not stat.S_ISDIR(found.st_mode):
        return False
    if sys.platform == "win32":
        return True
    return found.st_uid == os.geteuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _system_root() -> Path | None:
    """Folder for caches of this user by the rules of the system; None without a home."""
    variable = "LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME"
    base = os.environ.get(variable)
    if base and Path(base).is_absolute():
        return Path(base) / "castblast"
    try:
        home = Path.home()
    except RuntimeError:  # neither HOME nor an entry of this user in the password file
        return None
    return (home if sys.platform == "win32" else home / ".cache") / "castblast"


def _temporary_folder(label: str) -> Path | None:
    """Private folder among the temporary files; its name holds the user, so that two never meet."""
    user = "" if sys.platform == "win32" else f"-{os.geteuid()}"
    try:
        folder = Path(tempfile.gettempdir()) / f"castblast{user}-{label}"
    except OSError:  # no folder for temporary files either
        return None
    return folder if _is_made(folder) and is_private(folder) else None


def _is_made(folder: Path) -> bool:
    """Make a folder for this user alone, unless it is there, and try to write to it."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError:
        return False
    return True
