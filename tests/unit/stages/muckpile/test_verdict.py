"""A result that cannot be believed is written, marked, and ends with exit code 4."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from small_bench import write_bench

from castblast.cli import main
from castblast.muckpile.cast.solver import CastResult, run_cast
from castblast.stages.muckpile import run as muckpile
from castblast.stages.muckpile.compare import compare_runs
from castblast.stages.muckpile.run import run_muckpile

written = partial(write_bench, balls={"count": 200}, stop={"longest_time": "0.3 s"})


@pytest.fixture
def open_ledger(monkeypatch: pytest.MonkeyPatch) -> None:
    """As when balls enter a sheet of facets from behind."""

    def run(*arguments: Any, **options: Any) -> CastResult:
        result = run_cast(*arguments, **options)
        return result._replace(ledger=result.ledger._replace(residual=-22.0))

    monkeypatch.setattr(muckpile, "run_cast", run)


def test_a_sound_result_is_ok(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, stop={"longest_time": "0.3 s", "energy_ratio": 0})
    code = main(["muckpile", str(path), "--out", str(tmp_path / "out"), "--quiet"])
    assert code == 0
    assert "not ok" not in capsys.readouterr().err
    document = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert document["ok"] is True
    assert document["faults"] == []


@pytest.mark.usefixtures("open_ledger")
def test_an_open_energy_balance(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    code = main(["muckpile", str(written(tmp_path)), "--out", str(out), "--quiet"])
    assert code == 4
    line = "not ok: the energy balance is off by -2.2e+03 % (allowed: 1 %)\n"
    assert capsys.readouterr().err == line
    document = json.loads((out / "metrics.json").read_text())
    assert document["ok"] is False
    assert document["faults"] == [line.removeprefix("not ok: ").strip()]
    assert (out / "view.png").is_file()
    assert not (out / "restart.npz").exists()


@pytest.mark.usefixtures("open_ledger")
def test_one_bad_run_of_several_marks_the_comparison(tmp_path: Path) -> None:
    for name in ("a", "b"):
        run_muckpile(written(tmp_path), tmp_path / name, packings=tmp_path)
    outcome = compare_runs([tmp_path / "a", tmp_path / "b"], tmp_path / "both")
    assert [fault.split(":")[0] for fault in outcome.faults] == ["a", "b"]
    stored = json.loads((tmp_path / "both" / "comparison.json").read_text())
    assert stored["ok"] is False


def test_balls_that_run_through_one_another(tmp_path: Path) -> None:
    """A modulus so small that 30 m/s is faster than its waves: the energy balance sees nothing."""
    soft = written(
        tmp_path,
        velocity="60 m/s",
        contact={"effective_modulus": "0.1 MPa"},
        slope={"distance": "1 m", "angle": "80 deg"},
    )
    outcome = run_muckpile(soft, tmp_path / "out")
    assert abs(outcome.document["ledger"]["residual"]) < 0.01
    assert len(outcome.faults) == 1
    assert (
        "of the balls overlapped by more than 0.5 radii at one time (allowed: 1 %)"
        in (outcome.faults[0])
    )
    assert outcome.document["ok"] is False
