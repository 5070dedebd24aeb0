"""Bad input on the command line: a clear line, the right exit code, no traceback, nothing left.

Each case is a mistake a person makes; the message has to name the place, the value and what is
allowed. Exit codes: 2 bad input, 3 failed simulation, 4 a check that did not pass.
"""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., "subprocess.CompletedProcess[str]"]

RECIPE = """
name: tiny
version: 1.0.0
title: tiny
size: 8
seed: 1
explosives: [anfo]
variables:
  ucs: {lower: 10 MPa, upper: 200 MPa, distribution: log_uniform}
"""

EXPLOSIVE = """
name: test
density: 931 kg/m3
detonation_velocity: 4160 m/s
heat_of_explosion: 3.7 MJ/kg
jwl: {A: 49.46 GPa, B: 1.891 GPa, C: 0.47761 GPa, E0: 2.484 GPa,
      R1: 3.907, R2: 1.118, omega: 0.333333}
source: consistent set of a hydrocode material library
"""


@pytest.fixture
def castblast(castblast_here: Run) -> Run:
    """Seventy mistakes need no process each; the last test of the file starts one."""
    return castblast_here


def expect_fault(done: "subprocess.CompletedProcess[str]", code: int, *words: str) -> None:
    """Assert the exit code, every word in the message, and no traceback."""
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr + done.stdout
    assert "internal error" not in done.stderr
    for word in words:
        assert word in done.stderr, done.stderr


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("ucs=100", ("ucs", "unit")),
        ("ucs=100 MPaa", ("ucs", "MPaa", "MPa")),
        ("ucs=100 m", ("ucs", "m")),
        ("ucs=100 Pa", ("ucs", "MPa")),
        ("ucs=-5 MPa", ("ucs", "-5")),
        ("ucss=100 MPa", ("ucss", "did you mean 'ucs'")),
        ("ucs", ("ucs", "VALUE UNIT")),
        ("ucs=nan MPa", ("ucs",)),
        ("bench_height=1.5 m", ("bench_height", "charge")),
        ("dilation_angle=50 deg", ("dilation_angle", "friction_angle")),
        ("zones=abc", ("zones", "abc")),
    ],
)
def test_simulate_refuses(castblast: Run, setting: str, words: tuple[str, ...]) -> None:
    expect_fault(castblast("simulate", "--set", setting), 2, *words)


def test_all_faults_are_named_at_once(castblast: Run) -> None:
    done = castblast("simulate", "--set", "ucs=1 m", "--set", "burdn=3 m")
    expect_fault(done, 2, "ucs", "burdn", "did you mean 'burden'")


def test_unknown_explosive(castblast: Run) -> None:
    expect_fault(castblast("simulate", "--explosive", "anfoo"), 2, "anfoo", "did you mean 'anfo'")
    expect_fault(castblast("predict", "--explosive", "anfoo"), 2, "anfoo", "did you mean 'anfo'")


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        (("49.46 GPa", "49.46"), 2, ("jwl.A", "unit")),
        (("density:", "densty:"), 2, ("densty", "did you mean 'density'")),
        (("1.891 GPa", "189.1 GPa"), 4, ("CJ state",)),
        (("0.47761 GPa", "0.07761 GPa"), 4, ("tangency",)),
        (("source: c", "source2: c"), 2, ("source",)),
        (("R1: 3.907", "R1: [3"), 2, ("line",)),
    ],
)
def test_explosive_file(
    castblast: Run, tmp_path: Path, change: tuple[str, str], code: int, words: tuple[str, ...]
) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(EXPLOSIVE.replace(*change))
    expect_fault(castblast("explosive", "check", path), code, *words)
    expect_fault(castblast("simulate", "--explosive", path), code, *words)


def test_explosive_file_that_is_right(castblast: Run, tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(EXPLOSIVE)
    assert castblast("explosive", "check", path).returncode == 0
    assert castblast("explosive", "check", tmp_path / "none.yaml").returncode == 2


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("10 MPa", "10 MPaa"), ("ucs", "MPaa")),
        (("10 MPa", "300 MPa"), ("ucs", "lower", "upper")),
        (("200 MPa", "200 GPa"), ("ucs",)),
        (("size: 8", "sise: 8"), ("sise", "did you mean 'size'")),
        (("anfo", "anfu"), ("anfu", "anfo")),
        (("ucs:", "usc:"), ("usc", "ucs")),
        (("variables:", "variables: ["), ("line",)),
    ],
)
def test_recipe(
    castblast: Run, tmp_path: Path, change: tuple[str, str], words: tuple[str, ...]
) -> None:
    path = tmp_path / "recipe.yaml"
    path.write_text(RECIPE.replace(*change))
    expect_fault(castblast("generate", path, "--out", tmp_path / "out"), 2, "recipe.yaml", *words)
    assert not list((tmp_path / "out").rglob("*.nc"))


def test_missing_files(castblast: Run, tmp_path: Path) -> None:
    missing = tmp_path / "none.yaml"
    for command in (["generate", missing], ["muckpile", missing], ["simulate", missing]):
        expect_fault(castblast(*command), 2, "none.yaml")
    for command in (["train", tmp_path / "none.nc"], ["dataset", "check", tmp_path / "none.nc"]):
        expect_fault(castblast(*command), 2, "none.nc")


@pytest.mark.parametrize("content", [b"", b"not a netCDF file", b"\x89HDF\r\n\x1a\n truncated"])
def test_broken_dataset(castblast: Run, tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "data.nc"
    path.write_bytes(content)
    for command in ("check", "describe", "reproduce"):
        expect_fault(castblast("dataset", command, path), 2, "data.nc")
    expect_fault(castblast("train", path, "--out", tmp_path / "fits"), 2, "data.nc")


def test_unwritable_folder(castblast: Run, tmp_path: Path) -> None:
    """A file stands where the folder should be: as good as a folder without permission."""
    blocked = tmp_path / "blocked"
    blocked.write_text("")
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text(RECIPE)
    for command in (["simulate"], ["generate", recipe]):
        expect_fault(castblast(*command, "--out", blocked / "inside"), 2, "blocked")


def test_broken_network(castblast: Run, tmp_path: Path) -> None:
    path = tmp_path / "network.json"
    path.write_text("{")
    expect_fault(castblast("predict", "--network", path), 2, "network.json")


def test_unknown_verb_and_option(castblast: Run) -> None:
    assert castblast("simulat").returncode == 2
    assert castblast("simulate", "--nonsense").returncode == 2


def test_errors_as_json() -> None:
    command = [sys.executable, "-m", "castblast", "simulate", "--set", "ucs=1 m", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 2
    assert json.loads(done.stdout)["exit_code"] == 2
