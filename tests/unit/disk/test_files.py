"""Files and folders of results: whole or not at all, and a full disk is named."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from castblast.disk.files import (
    UNFINISHED,
    require_writable,
    staged,
    tried,
    write_text,
    write_with,
    written_together,
)
from castblast.errors import OutputError


def full(path: Path) -> None:
    path.write_bytes(b"half")
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def stop_after(written: Path, fault: type[BaseException] = KeyboardInterrupt) -> Path:
    assert written.is_file()
    raise fault


def test_a_full_disk_names_the_file_and_leaves_the_old_one(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "old")
    with pytest.raises(OutputError, match=r"a\.txt: cannot be written: No space left on device"):
        write_with(tmp_path / "a.txt", full)
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]
    assert (tmp_path / "a.txt").read_text() == "old"


def test_a_fault_of_the_library_that_tidied_up_hides_nothing(tmp_path: Path) -> None:
    """As zipfile does: it closes a file that could not be written, and fails again."""

    def write(path: Path) -> None:
        try:
            full(path)
        finally:
            message = "Can't close the ZIP file while there is an open writing handle on it."
            raise ValueError(message)

    with pytest.raises(OutputError, match="No space left"):
        write_with(tmp_path / "a.npz", write)


def test_other_faults_stay_what_they_are(tmp_path: Path) -> None:
    def write(path: Path) -> None:
        raise ValueError

    with pytest.raises(ValueError):  # noqa: PT011 - any
        write_with(tmp_path / "a", write)


@pytest.mark.skipif(os.name == "nt", reason="limits of POSIX")
@pytest.mark.parametrize("call", ["np.savez", "np.savez_compressed"])
def test_a_limit_on_the_size_of_files(tmp_path: Path, call: str) -> None:
    """What numpy really does when there is no room."""
    code = f"""
import resource, sys
from pathlib import Path
import numpy as np
from castblast.errors import OutputError
from castblast.disk.files import write_with
resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))
noise = np.random.default_rng(0).random(9000)
try:
    write_with(Path(sys.argv[1]), lambda name: {call}(name, a=noise, b=noise))
except OutputError as fault:
    print(fault)
"""
    done = subprocess.run(
        [sys.executable, "-c", code, tmp_path / "a.npz"],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    assert done.stdout == f"{tmp_path / 'a.npz'}: cannot be written: File too large\n"
    assert list(tmp_path.iterdir()) == []


def test_results_move_into_place_together(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "old a")
    write_text(tmp_path / "ore.png", "of an earlier run")
    write_text(tmp_path / "mine.txt", "not ours")
    with staged(tmp_path, replaces=["ore.png", "frames/*"]) as scratch:
        write_text(scratch / "a.txt", "new a")
        write_text(scratch / "frames" / "f.txt", "new")
        write_text(scratch / ".spool", "hidden")
        assert (tmp_path / "a.txt").read_text() == "old a"
    found = {p.relative_to(tmp_path).as_posix(): p for p in tmp_path.rglob("*") if p.is_file()}
    assert {name: path.read_text() for name, path in found.items()} == {
        "a.txt": "new a",
        "frames/f.txt": "new",
        "mine.txt": "not ours",
    }
    assert not (tmp_path / UNFINISHED).exists()


@pytest.mark.parametrize("fault", [ValueError, KeyboardInterrupt])
def test_nothing_changes_if_the_work_fails(tmp_path: Path, fault: type[BaseException]) -> None:
    write_text(tmp_path / "a.txt", "old a")
    with pytest.raises(fault), staged(tmp_path, replaces=["a.txt"]) as scratch:
        stop_after(write_text(scratch / "a.txt", "new a"), fault)
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]
    assert (tmp_path / "a.txt").read_text() == "old a"


def test_what_is_kept_is_gone_on_with(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), staged(tmp_path, keep=True) as scratch:
        stop_after(write_text(scratch / "one.txt", "1"))
    with staged(tmp_path, resume=True) as scratch:
        assert (scratch / "one.txt").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["one.txt"]
    with pytest.raises(KeyboardInterrupt), staged(tmp_path, keep=True) as scratch:
        stop_after(write_text(scratch / "two.txt", "2"))
    with staged(tmp_path) as scratch:
        assert list(scratch.iterdir()) == []


def test_no_empty_folder_stays_of_work_that_failed(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(ZeroDivisionError), tried(out):
        raise ZeroDivisionError
    assert not out.exists()
    with pytest.raises(KeyboardInterrupt), tried(out):
        stop_after(write_text(out / "packing.npz", "kept"))
    assert [path.name for path in out.iterdir()] == ["packing.npz"]


def test_several_files_are_written_together(tmp_path: Path) -> None:
    """What a stopped run keeps in the same folder is left alone."""
    write_text(tmp_path / UNFINISHED / ".spool", "kept")
    files = written_together(tmp_path, lambda folder: [write_text(folder / "a.txt", "a")])
    assert files == [tmp_path / "a.txt"]
    with pytest.raises(KeyboardInterrupt):
        written_together(tmp_path, lambda folder: [stop_after(write_text(folder / "b.txt", "b"))])
    assert sorted(path.name for path in tmp_path.iterdir()) == [UNFINISHED, "a.txt"]
    assert (tmp_path / UNFINISHED / ".spool").read_text() == "kept"


def test_a_folder_that_cannot_be_is_named_at_once(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match=r"file.folder: cannot be written to"):
        require_writable(tmp_path / "file" / "folder")
    with pytest.raises(OutputError, match=r"file.folder.a\.csv: cannot be written"):
        write_with(tmp_path / "file" / "folder" / "a.csv", lambda name: np.savetxt(name, [1.0]))
