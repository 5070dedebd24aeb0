"""One writer at a time in a folder: a lock file that its process holds, and that dies with it.

The lock is that of the operating system, so one that a killed process left behind is none; the
text in the file only tells others who is at work.
"""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from errno import EACCES, EAGAIN
from pathlib import Path

from castblast.errors import SpecError

#: File in a folder of results while somebody writes there.
LOCK_NAME = ".castblast.lock"


class LockedError(SpecError):
    """Another process is at work there (exit code 2)."""


@contextmanager
def only_writer(lock: Path, place: Path) -> Iterator[None]:
    """Hold the file `lock` as long as the context lives; it is removed at the end.

    Parameters
    ----------
    lock : path
        In a folder that exists.
    place : path
        What is being written, for the message.

    Raises
    ------
    LockedError
        Somebody else holds it: says who.
    OSError
        The file cannot be made.
    """
    descriptor = _take(lock, place)
    try:
        os.truncate(descriptor, 0)
        os.write(descriptor, f"process {os.getpid()} on {socket.gethostname()}".encode())
        yield
    finally:
        # Removed while it is held: who opened it meanwhile finds that it is gone, and makes anew.
        if sys.platform != "win32":
            lock.unlink(missing_ok=True)
        os.close(descriptor)
        if sys.platform == "win32":
            _remove_if_free(lock)


def _take(lock: Path, place: Path) -> int:
    """Open and lock the file; make sure that it is still the one that others would open."""
    while True:
        descriptor = os.open(lock, os.O_RDWR | os.O_CREAT, 0o666)
        if not _try_lock(descriptor):
            owner = os.read(descriptor, 200).decode(errors="replace").strip()
            os.close(descriptor)
            message = (
                f"{place}: {owner or 'another process'} is writing there; wait until it is done, "
                "or choose another place with --out"
            )
            raise LockedError(message)
        if _is_same(descriptor, lock):
            return descriptor
        os.close(descriptor)


def _is_same(descriptor: int, lock: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), lock.stat())
    except FileNotFoundError:
        return False


if sys.platform == "win32":
    import msvcrt

    #: Place [byte] of the lock, beyond the text that others read.
    _BEYOND = 1 << 20

    def _try_lock(descriptor: int) -> bool:
        os.lseek(descriptor, _BEYOND, os.SEEK_SET)
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        finally:
            os.lseek(descriptor, 0, os.SEEK_SET)
        return True

    def _remove_if_free(lock: Path) -> None:
        try:
            lock.unlink(missing_ok=True)
        except PermissionError:
            return

else:
    import fcntl

    def _try_lock(descriptor: int) -> bool:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as fault:
            # Some network file systems know no locks at all: better to work without one.
            return fault.errno not in (EAGAIN, EACCES)
        return True

    def _remove_if_free(lock: Path) -> None:
        """Nothing is left to remove."""
