"""One process at a time works on the file of a study, and a killed one leaves it usable.

The lock belongs to the process, so the kernel drops it whatever becomes of the process. What a
killed process may leave behind, half a line at the end of the file and the lock of a single write,
is cleared by the next one that holds the study.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from castblast.errors import SpecError

#: How every record of a journal begins.
_RECORD = b'{"op_code":'


@contextmanager
def hold_study(journal: Path) -> Iterator[None]:
    """Hold the file of a study for this process.

    Raises
    ------
    SpecError
        Another process holds it, it is a folder, or no journal.
    OSError
        The folder cannot be written to.
    """
    if journal.is_dir():
        message = f"{journal}: is a folder; a file for the study is needed"
        raise SpecError(message)
    journal.parent.mkdir(parents=True, exist_ok=True)
    guard = journal.with_name(f".{journal.name}.held")
    with guard.open("w", encoding="utf-8") as stream:
        if not _lock(stream):
            message = f"{journal}: another process is at work on this study"
            raise SpecError(message)
        journal.with_name(f"{journal.name}.lock").unlink(missing_ok=True)
        _mend(journal)
        yield


def _lock(stream: IO[str]) -> bool:
    """Lock an open file for this process; where the system has no such locks nothing is held."""
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _mend(journal: Path) -> None:
    """Cut off a record that was never written whole; refuse a file that is no journal."""
    if not journal.is_file():
        return
    with journal.open("r+b") as stream:
        *lines, rest = stream.read().split(b"\n")
        for number, line in enumerate(lines, start=1):
            if not _is_record(line):
                message = f"{journal}: is not a study journal, or is damaged (line {number})"
                raise SpecError(message)
        if not rest.startswith(_RECORD[: len(rest)]):
            message = f"{journal}: is not a study journal, or is damaged (its end)"
            raise SpecError(message)
        stream.truncate(sum(len(line) + 1 for line in lines))


def _is_record(line: bytes) -> bool:
    try:
        return line.startswith(_RECORD) and isinstance(json.loads(line), dict)
    except (ValueError, RecursionError):
        return False
