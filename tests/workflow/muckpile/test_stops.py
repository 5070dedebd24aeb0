"""A muckpile that is stopped, doubled or out of disk loses nothing and says how to go on."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_bench import write_bench

from castblast.disk.locks import LOCK_NAME, LockedError, only_writer
from castblast.errors import OutputError
from castblast.stages.muckpile import compare
from castblast.stages.muckpile import run as muckpile
from castblast.stages.muckpile.compare import run_seeds
from castblast.stages.muckpile.run import run_muckpile

resource = pytest.importorskip("resource", reason="signals and limits of POSIX")


#: Some seconds of small steps.
written = partial(
    write_bench,
    balls={"count": 200},
    stop={"longest_time": "0.4 s"},
    numerics={"time_step": "1e-5 s"},
)


def start(*arguments: str | Path, **options: Any) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "castblast", "muckpile", *map(str, arguments), "--threads", "1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        **options,
    )


def wait_for(process: subprocess.Popen[str], reached: Callable[[str], bool]) -> None:
    """Read the lines of progress until one says that the work is where it shall be stopped."""
    assert process.stderr is not None
    for line in process.stderr:
        if reached(line):
            return
    raise AssertionError("it ended before")


def contents(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and "packings" not in path.parts
    }


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("undisturbed")
    _, errors = (process := start(written(folder), "--out", folder / "out")).communicate()
    assert process.returncode == 0, errors
    return folder / "out"


@pytest.mark.parametrize(
    ("number", "code", "options"),
    [
        (signal.SIGINT, 130, ()),
        (signal.SIGTERM, 143, ("--animation", "gif", "--frame-interval", "0.05 s")),
    ],
)
def test_a_cast_that_is_stopped_goes_on(
    tmp_path: Path, undisturbed: Path, number: int, code: int, options: tuple[str, ...]
) -> None:
    bench, out = written(tmp_path), tmp_path / "out"
    arguments = (bench, "--out", out, "--packings", undisturbed / "packings", *options)
    process = start(*arguments)
    wait_for(process, lambda line: "t = 0." in line and "t = 0.0" not in line)
    process.send_signal(number)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == code, errors
    assert errors.splitlines()[-1].startswith("stopped at t = 0.")
    assert f"its state is kept in {out / 'restart.npz'}; run the same command again" in errors
    shown = [path.name for path in out.iterdir() if not path.name.startswith(".")]
    assert shown == ["restart.npz"]
    with np.load(out / "restart.npz") as kept:
        assert kept["clock"] > 0.05
    again = start(*arguments)
    _, errors = again.communicate(timeout=240)
    assert again.returncode == 0, errors
    assert float(re.findall(r"t = ([\d.]+) s", errors)[0]) > 0.05
    found = contents(out)
    film = found.pop("animation.gif", b"")
    assert film.startswith(b"GIF") == bool(options)
    assert found == contents(undisturbed)


def test_a_packing_that_is_stopped_goes_on(tmp_path: Path) -> None:
    quick = {"balls": {"count": 900}, "numerics": {}, "stop": {"longest_time": "0.02 s"}}
    bench, out = written(tmp_path, **quick), tmp_path / "out"
    process = start(bench, "--out", out)
    wait_for(process, lambda line: "packing" in line)
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 143, errors
    (part,) = (out / "packings").glob("*.part.npz")
    assert f"while the bench was packed; its state is kept in {part}" in errors
    again = start(bench, "--out", out)
    _, errors = again.communicate(timeout=240)
    assert again.returncode == 0, errors
    run_muckpile(bench, tmp_path / "whole", threads=1)
    (one,) = (out / "packings").iterdir()
    (other,) = (tmp_path / "whole" / "packings").iterdir()
    assert one.read_bytes() == other.read_bytes()


QUICK = {"numerics": {}, "stop": {"longest_time": "0.3 s"}}


@pytest.fixture
def finished(tmp_path: Path, undisturbed: Path) -> Iterator[tuple[Path, Path, Path]]:
    """A finished run: bench file, folder, packings."""
    bench, packings = written(tmp_path, **QUICK), undisturbed / "packings"
    run_muckpile(bench, tmp_path / "out", packings=packings)
    return bench, tmp_path / "out", packings


@pytest.mark.parametrize("fault", [OutputError("full"), KeyboardInterrupt()])
def test_results_stay_whole_when_writing_fails(
    finished: tuple[Path, Path, Path], monkeypatch: pytest.MonkeyPatch, fault: BaseException
) -> None:
    """The last picture fails: old results stay as they are, and the cast need not run again."""
    bench, out, packings = finished
    before = contents(out)

    def fail(*_: Any) -> None:
        raise fault

    monkeypatch.setattr("castblast.report.piles.muckpile_figures.draw_energy", fail)
    with pytest.raises(type(fault)):
        run_muckpile(bench, out, velocity="8 m/s", packings=packings)
    after = contents(out)
    assert after.pop("restart.npz")
    assert after == before
    monkeypatch.undo()
    monkeypatch.setattr(
        "castblast.muckpile.engine.simulation.advance", lambda *_: pytest.fail("it ran again")
    )
    run_muckpile(bench, out, velocity="8 m/s", packings=packings)
    assert contents(out).keys() == before.keys()
    assert contents(out)["metrics.json"] != before["metrics.json"]


def test_a_full_disk_is_named(finished: tuple[Path, Path, Path]) -> None:
    """A limit on the size of files stands in for it."""
    bench, out, packings = finished
    before = contents(out)

    def bounded() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (8_000, 8_000))

    process = start(
        bench, "--out", out, "--packings", packings, "--velocity", "8 m/s", "--quiet",
        preexec_fn=bounded,
    )  # fmt: skip
    _, errors = process.communicate(timeout=240)
    assert process.returncode == 2, errors
    (line,) = errors.splitlines()
    assert line.startswith(f"error: {out}")
    assert ".npz: cannot be written: File too large" in line
    assert contents(out) == before


def test_a_second_run_into_the_folder_is_refused(
    finished: tuple[Path, Path, Path],
) -> None:
    bench, out, packings = finished
    before = contents(out)
    with only_writer(out / LOCK_NAME, out):
        process = start(bench, "--out", out, "--packings", packings)
        _, errors = process.communicate(timeout=120)
        with pytest.raises(LockedError):
            run_seeds(bench, out, 2)
    assert process.returncode == 2
    assert errors == (
        f"error: {out}: process {os.getpid()} on {os.uname().nodename} is writing there; wait "
        "until it is done, or choose another place with --out\n"
    )
    assert contents(out) == before


def test_an_impossible_folder_is_told_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    begun = time.monotonic()
    with pytest.raises(OutputError, match=r"file.out: cannot be written to"):
        run_muckpile(written(tmp_path), tmp_path / "file" / "out")
    assert time.monotonic() - begun < 5.0


def test_files_of_an_earlier_run_do_not_stay_beside_new_ones(
    finished: tuple[Path, Path, Path],
) -> None:
    bench, out, packings = finished
    for name in ("ore.png", "animation.gif"):
        (out / name).write_bytes(b"of an earlier run")
    (out / "notes.txt").write_text("mine")
    run_muckpile(bench, out, packings=packings)
    assert {"ore.png", "animation.gif", "notes.txt"} & {p.name for p in out.iterdir()} == {
        "notes.txt"
    }


def test_seeds_that_are_finished_are_not_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, out = written(tmp_path, **QUICK), tmp_path / "out"
    run, ran = muckpile.run_muckpile, []

    def stopped(*arguments: Any, seed: int, **options: Any) -> Any:
        if len(ran) == 1:
            raise KeyboardInterrupt
        ran.append(seed)
        return run(*arguments, seed=seed, **options)

    monkeypatch.setattr(compare, "run_muckpile", stopped)
    with pytest.raises(KeyboardInterrupt):
        run_seeds(bench, out, 2)
    monkeypatch.setattr(
        compare,
        "run_muckpile",
        lambda *a, seed, **o: (ran.append(seed), run(*a, seed=seed, **o))[1],
    )
    run_seeds(bench, out, 2)
    assert ran == [0, 1]
    run_seeds(bench, out, 2)
    assert ran == [0, 1, 0, 1]
    assert not list(out.rglob("made_from.json"))
