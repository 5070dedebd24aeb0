"""Exports to engines, workbook and lookup table, and the export verb with bad input."""

import csv
import errno
import json
import os
import re
import shutil
import subprocess
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from castblast.bands import BASIS
from castblast.errors import CheckError, OutputError, SpecError
from castblast.export.parity import TOLERANCE
from castblast.export.sheet.runner import recalculated
from castblast.export.sheet.workbook import TOP
from castblast.export.source.answers import NotVerifiedError, answers
from castblast.export.source.runners import oldest_python, run_program, written
from castblast.export.targets import TARGETS
from castblast.network import (
    Network,
)
from castblast.stages.export import export

pytest.importorskip("onnxruntime", reason="ONNX files are run with onnxruntime")


def predicted_speeds(network: Network, files) -> np.ndarray:
    """Velocities of the two blocks of the shipped table of a bench."""
    rows = list(csv.DictReader(files["bench.csv"].decode().splitlines()))
    numeric = np.array([[float(row[name]) for name in network.input_names] for row in rows])
    return answers(network, numeric, np.zeros(2, dtype=np.int64)).values[:, 0]


def test_pfc_example_throws_the_balls_of_its_groups(network: Network) -> None:
    """The shipped script with a stand-in of `itasca`; a group without balls is told."""
    stand_in = """
class Ball:
    def __init__(self, group):
        self.group, self.velocity = group, (0.0, 0.0, 0.0)
    def in_group(self, name, slot):
        return (name, slot) == (self.group, "block")
    def set_vel(self, velocity):
        self.velocity = velocity
        print(self.group, *map(repr, velocity))
class ball:
    kept = [Ball(g) for g in open("groups.txt").read().split()]
    @classmethod
    def list(cls):
        return iter(cls.kept)
"""
    files = TARGETS["pfc"].write(network)
    files |= {"itasca.py": stand_in.encode(), "groups.txt": b"block_1 floor block_2 block_2"}
    python = oldest_python()[0]
    with written(files) as folder:
        lines = run_program([python, "pfc_bench.py"], folder=folder).splitlines()
        (folder / "groups.txt").write_text("block_1 floor")
        with pytest.raises(CheckError, match="no ball is in group block_2 of slot block"):
            run_program([python, "pfc_bench.py"], folder=folder)
    assert lines[-2:] == ["block_1: 1 balls", "block_2: 2 balls"]
    truth = predicted_speeds(network, files)
    assert BASIS in lines[0]
    speeds = [float(line.split()[1]) for line in lines[1:-2]]
    np.testing.assert_allclose(speeds, truth[[0, 1, 1]], rtol=1e-12)
    written_in = re.findall(rb"velocity-x (\S+)", files["pfc_bench.dat"])
    np.testing.assert_allclose([float(speed) for speed in written_in], truth, rtol=1e-12)


def test_lammps_example_runs(network: Network) -> None:
    """LAMMPS itself: the two blocks start with the predicted velocities."""
    lammps = shutil.which("lmp")
    if lammps is None:
        pytest.skip("LAMMPS (lmp) is not installed")
    files = TARGETS["lammps"].write(network)
    with written(files) as folder:
        script = ["lammps_bench.py", "bench.csv", "velocities.in"]
        run_program([oldest_python()[0], *script], folder=folder)
        said = run_program([lammps, "-in", "lammps_bench.in", "-log", "none"], folder=folder)
    left, right = re.search(r"^block_1 (\S+) block_2 (\S+)", said, re.MULTILINE).groups()
    truth = predicted_speeds(network, files)
    np.testing.assert_allclose([float(left), float(right)], truth, rtol=1e-12)


@pytest.mark.parametrize("target", ["pfc", "lammps"])
def test_a_network_without_velocity_throws_nothing(network: Network, target: str) -> None:
    still = replace(network, outputs=(replace(network.outputs[0], name="swell"),
                                      network.outputs[1]))  # fmt: skip
    with pytest.raises(SpecError, match="gives no burden_velocity"):
        TARGETS[target].write(still)


def typed(network: Network, explosive: str, *design: float) -> dict[str, tuple]:
    """Lines of the sheet Predict for a design that is typed in, calculated by LibreOffice."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.load_workbook(BytesIO(TARGETS["excel"].write(network)["model.xlsx"]))
    book["Predict"]["B4"] = explosive
    for row, value in zip((6, 7, 8), design, strict=True):
        book["Predict"].cell(row, 2, value)
    changed = BytesIO()
    book.save(changed)
    try:
        found = recalculated(changed.getvalue())["Predict"]
    except NotVerifiedError as reason:
        pytest.skip(str(reason))
    return {row[0]: row[1:] for row in found.iter_rows(values_only=True) if row[0]}


def test_workbook_answers_what_is_typed(network: Network) -> None:
    """A design out of range and a cell that holds a text."""
    cells = typed(network, "heavy_anfo", 12.0, 5.0, 20.0)
    truth = answers(network, np.array([[12.0, 5.0, 20.0]]), np.array([1]))
    assert cells["Domain"][0] == "outside"
    assert cells["Inputs at fault"][0] == "bench_height burden"
    assert cells["burden at the crest"][4] == "at fault"
    assert cells["charge length"][4] == "ok"
    value, lower, upper, unit = cells["final velocity of the burden"][:4]
    assert value == pytest.approx(truth.values[0, 0], rel=1e-13)
    assert (lower, upper, unit) == ("unknown", "unknown", "m s-1")


def test_a_workbook_refuses_what_no_bench_can_hold(network: Network) -> None:
    """14 m of charge in 12 m of bench: the reason, and no value."""
    cells = typed(network, "anfo", 12.0, 14.0, 3.0)
    assert cells["Domain"][0] == "impossible"
    assert cells["Design"][0] == (
        "charge length 14 m leaves no room for stemming: at most the bench height of 12 m."
    )
    assert cells["final velocity of the burden"][0] == "no value"


def test_a_workbook_says_which_band_is_which(network: Network) -> None:
    """Both bands stand on Predict, each under its name, and point at the columns of that name."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.load_workbook(BytesIO(TARGETS["excel"].write(network)["model.xlsx"]))
    lines = {row[0].value: row for row in book["Predict"].iter_rows() if row[0].value}
    assert any(BASIS in str(text) for text in lines)
    heads = {cell.value: cell.column_letter for cell in book["Working"][TOP - 1]}
    row = lines["final velocity of the burden"]
    titles = ("value", "prediction lower", "prediction upper", None, "network lower",
              "network upper")  # fmt: skip
    for cell, title in zip(row[1:], titles, strict=True):
        if title is not None:
            assert f"Working!${heads[title]}${TOP}*" in cell.value


def test_lookup_table_holds_answers_of_the_network(network: Network) -> None:
    lines = list(
        csv.DictReader(TARGETS["excel"].write(network)["lookup.csv"].decode().splitlines())
    )
    assert {line["domain"] for line in lines} <= {"inside", "unusual"}
    assert {line["explosive"] for line in lines} == set(network.explosives)
    for line in lines[::7]:
        row = np.array([[float(line[f"{name} [m]"]) for name in network.input_names]])
        index = np.array([network.explosives.index(line["explosive"])])
        truth = answers(network, row, index)
        found = float(line["burden_velocity [m s-1]"])
        assert found == pytest.approx(truth.values[0, 0], rel=1e-3)  # six figures in the table
        upper = float(line["burden_velocity_prediction_upper [m s-1]"])
        assert upper == pytest.approx(truth.prediction.upper[0, 0], rel=1e-3)


@pytest.mark.parametrize(
    ("to", "words"),
    [
        ("pyton", "'pyton': not known, did you mean 'python'?"),
        ("json,exel", "did you mean 'excel'?"),
        (",", "no export target given"),
        ("all,json", "'all': stands alone"),
        ("lammps-deck", "castblast muckpile BENCH --lammps DIR"),
    ],
)
def test_unknown_targets(source, to: str, words: str) -> None:
    with pytest.raises(SpecError) as fault:
        export(source, targets=to.split(","))
    assert words in str(fault.value)
    assert fault.value.exit_code == 2


def test_places_without_a_network(tmp_path) -> None:
    with pytest.raises(SpecError, match="no such file or folder"):
        export(tmp_path / "none")
    with pytest.raises(SpecError, match="holds no network"):
        export(tmp_path)


def test_a_folder_that_cannot_be_written(source, tmp_path, monkeypatch) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="cannot be written to: "):
        export(source, tmp_path / "file" / "out")
    monkeypatch.setattr("pathlib.Path.write_bytes", _refused)
    with pytest.raises(OutputError, match="cannot be written to: Permission denied"):
        export(source, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def _refused(path: Path, content: bytes) -> int:
    raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))


def test_a_missing_tool_is_said(source, tmp_path, monkeypatch) -> None:
    """The file is written, the line and the document say that nobody ran it."""
    monkeypatch.setattr(shutil, "which", lambda *_, **__: None)
    outcome = export(source, tmp_path / "out", targets=["json", "c", "js", "lammps", "excel"])
    states = {name: entry["status"] for name, entry in outcome.document["parity"].items()}
    assert states == {
        "json": "passed",
        "c": "not verified: no C compiler (gcc) is installed",
        "js": "not verified: node is not installed",
        "lammps": "not verified: LAMMPS (lmp) is not installed",
        "excel": "not verified: LibreOffice (soffice) is not installed",
    }
    assert sum("not verified" in line for line in outcome.lines) == 4
    assert (tmp_path / "out" / "model.c").is_file()


def test_a_file_that_does_not_compile_is_not_written(source, tmp_path, monkeypatch) -> None:
    broken = tmp_path / "gcc"
    broken.write_text("#!/bin/sh\necho no such instruction >&2\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setattr(shutil, "which", lambda *_, **__: str(broken))
    with pytest.raises(CheckError, match="c: gcc failed with exit code 1") as fault:
        export(source, tmp_path / "out", targets=["c"])
    assert "no such instruction" in str(fault.value)
    assert fault.value.exit_code == 4
    assert not (tmp_path / "out").exists()


def test_the_verb_prints_the_deviation(castblast, source, tmp_path) -> None:
    done: subprocess.CompletedProcess[str] = castblast(
        "export", source, "--to", "json,python", "--out", tmp_path / "out", "--json"
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)["parity"]["python"]
    assert found["status"] == "passed"
    assert found["golden_rows"] == 200
    assert max(found["relative"].values()) <= TOLERANCE
    assert "CPython 3." in found["tool"]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["model.py", "network.json"]
