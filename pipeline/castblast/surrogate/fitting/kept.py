"""Results kept for one user on one machine, each under the seal of a key that stays there.

What is kept holds pickles, and a pickle runs code when it is opened. So nothing of the kind lies
beside a dataset, where it may come from anybody: it lies in the user's own cache, under the place
it belongs to, and its seal (HMAC-SHA-256, RFC 2104) is checked before anything looks inside. A file
that another machine or another user wrote, or that was changed, is not there.
"""

from __future__ import annotations

import hashlib
import hmac
import os
import secrets
import shutil
import stat
import sys
from pathlib import Path

from castblast.caches import cache_folder
from castblast.disk.files import write_with
from castblast.errors import OutputError

_KEY_BYTES = 32
_SEAL_BYTES = hashlib.sha256().digest_size
#: In each folder of the store: the folder that its entries belong to.
_ORIGIN = "belongs_to.txt"


def keep(place: Path, content: bytes) -> bool:
    """Keep bytes under the place that they belong to, in place of earlier ones.

    Parameters
    ----------
    place : path
        Need not exist; its last part names the entry.
    content : bytes

    Returns
    -------
    bool
        False where this user has no private folder, or it cannot be written: nothing is kept.
    """
    key, entry = _machine_key(), _entry(place)
    if key is None or entry is None:
        return False
    seal = _seal(key, place, content)
    try:
        if not entry.parent.is_dir():
            _forget_what_is_gone(entry.parent.parent)
            origin = str(place.parent.resolve())
            write_with(entry.with_name(_ORIGIN), lambda name: name.write_text(origin, "utf-8"))
        write_with(entry, lambda name: name.write_bytes(seal + content))
    except OutputError:
        return False
    return True


def kept(place: Path) -> bytes | None:
    """Give what this user kept under a place on this machine; None if there is nothing."""
    key, entry = _machine_key(), _entry(place)
    if key is None or entry is None:
        return None
    try:
        whole = entry.read_bytes()
    except OSError:
        return None
    seal, content = whole[:_SEAL_BYTES], whole[_SEAL_BYTES:]
    return content if hmac.compare_digest(seal, _seal(key, place, content)) else None


def _entry(place: Path) -> Path | None:
    """File of an entry: a folder of the store for each folder that entries belong to."""
    store = cache_folder("kept")
    if store is None:
        return None
    origin = hashlib.sha256(os.fsencode(place.parent.resolve())).hexdigest()
    return store / origin[:32] / f"{place.name}.sealed"


def _seal(key: bytes, place: Path, content: bytes) -> bytes:
    """Seal of a content and of its place, so that no entry can stand in for another."""
    owner = os.fsencode(place.parent.resolve() / place.name)
    return hmac.digest(key, hashlib.sha256(owner).digest() + content, "sha256")


def _machine_key() -> bytes | None:
    """Random key of this user on this machine, made when it is first asked for."""
    store = cache_folder("kept")
    if store is None:
        return None
    path = store / "key"
    try:
        if not path.is_file():
            _make_key(path)
        return _read_key(path)
    except OSError:
        return None


def _make_key(path: Path) -> None:
    """Put a key in place for this user alone; whoever comes second takes that of the first."""
    own = path.with_name(f".key.{secrets.token_hex(8)}")
    descriptor = os.open(own, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(secrets.token_bytes(_KEY_BYTES))
        try:
            os.link(own, path)
        except FileExistsError:
            pass
        except OSError:  # a file system without links
            own.replace(path)
    finally:
        own.unlink(missing_ok=True)


def _read_key(path: Path) -> bytes | None:
    """Key of a file that nobody else can read or has made; None for any other file."""
    found = path.lstat()
    if not stat.S_ISREG(found.st_mode):
        return None
    if sys.platform != "win32" and (
        found.st_uid != os.geteuid() or found.st_mode & (stat.S_IRWXG | stat.S_IRWXO)
    ):
        return None
    key = path.read_bytes()
    return key if len(key) == _KEY_BYTES else None


def _forget_what_is_gone(store: Path) -> None:
    """Remove what belongs to folders that are no longer there."""
    for note in store.glob(f"*/{_ORIGIN}"):
        try:
            gone = not Path(note.read_text(encoding="utf-8")).is_dir()
        except (OSError, ValueError):
            continue
        if gone:
            shutil.rmtree(note.parent, ignore_errors=True)
