"""One writer in a folder: others are told who it is, and a lock of the dead is none."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from castblast.disk.locks import LOCK_NAME, LockedError, only_writer

HOLD = """
import sys, time
from pathlib import Path
from castblast.disk.locks import only_writer
lock = Path(sys.argv[1])
with only_writer(lock, lock.parent):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def holder(tmp_path: Path):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, tmp_path / LOCK_NAME], stdout=subprocess.PIPE, env=environment
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"held\n"
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


def test_a_second_process_is_told_who_is_at_work(tmp_path: Path, holder) -> None:
    begun = time.monotonic()
    with (
        pytest.raises(LockedError, match=f"process {holder.pid} on .* is writing there") as caught,
        only_writer(tmp_path / LOCK_NAME, tmp_path),
    ):
        pass
    assert str(caught.value).startswith(f"{tmp_path}: ")
    assert "\n" not in str(caught.value)
    assert time.monotonic() - begun < 5.0


def test_a_lock_that_a_killed_process_left_is_none(tmp_path: Path, holder) -> None:
    holder.send_signal(signal.SIGKILL if hasattr(signal, "SIGKILL") else signal.SIGTERM)
    holder.wait()
    assert (tmp_path / LOCK_NAME).exists()
    with only_writer(tmp_path / LOCK_NAME, tmp_path):
        pass
    assert list(tmp_path.iterdir()) == []


def test_the_same_process_is_a_second_writer_too(tmp_path: Path) -> None:
    """Two runs in threads of one process."""
    lock = tmp_path / LOCK_NAME
    with only_writer(lock, tmp_path), pytest.raises(LockedError), only_writer(lock, tmp_path):
        pass
    with only_writer(lock, tmp_path):
        assert lock.exists()
    assert not lock.exists()


def test_it_is_given_back_after_a_fault(tmp_path: Path) -> None:
    lock = tmp_path / LOCK_NAME
    with pytest.raises(ZeroDivisionError), only_writer(lock, tmp_path):
        raise ZeroDivisionError
    assert not lock.exists()
