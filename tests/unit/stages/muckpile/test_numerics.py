"""Precision of a run: bench file, command line over it, and what a run says it used."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest
from small_bench import write_bench

from castblast.errors import SpecError
from castblast.specs.bench.bench import load_bench
from castblast.stages.muckpile.run import run_muckpile

written = partial(
    write_bench,
    balls={"count": 100},
    stop={"longest_time": "0.05 s"},
    numerics={"step_safety": 0.7},
)


def test_defaults_and_file(tmp_path: Path) -> None:
    """Mixed precision unless the file asks for double; a key of older files is a fault."""
    assert load_bench(written(tmp_path, numerics={})).numerics.precision == "mixed"
    asked = load_bench(written(tmp_path, numerics={"precision": "float64"}))
    assert asked.numerics.precision == "float64"
    with pytest.raises(SpecError, match=r"^[^\n]*numerics\.sleeping: unknown key[^\n]*$"):
        load_bench(written(tmp_path, numerics={"sleeping": True}))
    with pytest.raises(SpecError, match=r"numerics\.precision"):
        load_bench(written(tmp_path, numerics={"precision": "float32"}))


def test_an_unknown_precision_is_refused_before_anything_is_packed(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"--precision: mixd: .*did you mean 'mixed'"):
        run_muckpile(written(tmp_path), tmp_path / "out", precision="mixd")
    assert not (tmp_path / "out").exists()


def test_a_run_says_what_it_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The command line goes over the file; what it leaves out stays as the file has it."""
    monkeypatch.setattr("castblast.stages.muckpile.run.write_results", lambda *_, **__: [])
    seen = []
    run = run_muckpile.__globals__["run_cast"]
    monkeypatch.setattr(
        "castblast.stages.muckpile.run.run_cast",
        lambda case, *rest, **options: (
            seen.append((case.precision, case.step_safety)),
            run(case, *rest, **options),
        )[1],
    )
    path = written(tmp_path)
    document = run_muckpile(path, tmp_path / "out", threads=1, precision="float64").document
    assert document["numerics"]["precision"] == "float64"
    assert document["numerics"]["step_safety"] == 0.7
    document = run_muckpile(path, tmp_path / "out", threads=1).document
    assert document["numerics"]["precision"] == "mixed"
    assert seen == [("float64", 0.7), ("mixed", 0.7)]
