"""Several muckpiles side by side: bands are those of the metrics, every fault is named."""

from __future__ import annotations

import contextlib
import json
import warnings
from collections.abc import Callable
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from castblast.api.muckpile.tables import GROUND_COLUMN, MEAN_COLUMN, X_COLUMN
from castblast.disk.files import write_csv
from castblast.errors import SpecError
from castblast.muckpile.bench.geometry import Bench
from castblast.muckpile.results.metrics import UNITS
from castblast.stages.muckpile.compare import compare_runs
from castblast.stages.muckpile.read import read_runs


def run(folder: Path, throw: float, angle: float | None = 0.3, blocks: int = 2) -> Path:
    folder.mkdir()
    metrics: dict[str, Any] = dict.fromkeys(UNITS, 1.0)
    metrics |= {"cast_fraction": throw, "repose_angle": angle, "geometry": Bench()._asdict()}
    metrics |= {"throw": [throw, 0.0, -1.0], "block_throw": [[throw, 0.0, None]] * blocks}
    metrics["block_spread"] = [[0.1, 0.1, 0.1]] * blocks
    (folder / "metrics.json").write_text(json.dumps(metrics))
    x = np.linspace(-24.0, 30.0 + throw, 60)
    height = np.maximum(8.0 - 0.2 * np.abs(x), 0.0)
    columns = {X_COLUMN: x, MEAN_COLUMN: height, GROUND_COLUMN: np.zeros_like(x)}
    write_csv(folder / "profile.csv", columns)
    return folder


def test_bands_over_three_runs(tmp_path: Path) -> None:
    folders = [run(tmp_path / f"seed_{k}", throw) for k, throw in enumerate((1.0, 2.0, 6.0))]
    outcome = compare_runs(folders, tmp_path)
    bands = outcome.document["bands"]
    assert bands["cast_fraction"] == {"mean": 3.0, "sd": pytest.approx(sqrt(7.0)), "n": 3}
    assert bands["throw"]["mean"] == [3.0, 0.0, -1.0]
    assert bands["block_throw"]["n"] == [[3, 3, 0], [3, 3, 0]]
    assert ("cast fraction", "3 ± 2.6", "1") in outcome.rows
    assert list(outcome.document["runs"]) == ["seed_0", "seed_1", "seed_2"]
    stored = json.loads((tmp_path / "comparison.json").read_text())
    assert stored["bands"]["cast_fraction"] == bands["cast_fraction"]
    assert stored["bands"]["block_throw"]["mean"][0][2] is None
    assert (tmp_path / "profiles.png").read_bytes().startswith(b"\x89PNG")


def test_runs_that_know_less(tmp_path: Path) -> None:
    """A run without slope angle does not count for it; other blocks have no common band."""
    folders = [run(tmp_path / "a", 1.0, None), run(tmp_path / "b", 2.0, 0.4, blocks=3)]
    document = compare_runs(folders, tmp_path).document
    assert document["bands"]["repose_angle"]["n"] == 1
    assert document["bands"]["repose_angle"]["mean"] == pytest.approx(0.4)
    assert "block_throw" not in document["bands"]


def test_faults(tmp_path: Path) -> None:
    one = run(tmp_path / "a", 1.0)
    with pytest.raises(SpecError, match="at least two runs"):
        compare_runs([one], tmp_path)
    with pytest.raises(SpecError) as caught:
        compare_runs([one, tmp_path / "none"], tmp_path)
    assert str(caught.value).count("is missing; run castblast muckpile") == 2


HEADS = "x [m],mean_height [m],ground [m]\n"


def without_geometry(folder: Path) -> None:
    metrics = json.loads((folder / "metrics.json").read_text())
    del metrics["geometry"]
    (folder / "metrics.json").write_text(json.dumps(metrics))


def with_value(name: str, value: Any) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        metrics = json.loads((folder / "metrics.json").read_text())
        (folder / "metrics.json").write_text(json.dumps(metrics | {name: value}))

    return change


def with_text(name: str, text: str | bytes) -> Callable[[Path], None]:
    content = text if isinstance(text, bytes) else text.encode()
    return lambda folder: (folder / name).write_bytes(content) and None


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (with_text("metrics.json", ""), "metrics.json"),
        (with_text("metrics.json", "[1, 2]"), "holds no group of keys"),
        (with_text("metrics.json", '{"throw": '), "metrics.json"),
        (with_text("metrics.json", b"\xff\xfe"), "metrics.json"),
        (with_text("metrics.json", "[" * 100_000), "metrics.json"),
        (with_text("metrics.json", '{"loss": 1}'), "throw: is missing"),
        (with_value("cast_fraction", "much"), "cast_fraction: holds something other than numbers"),
        (with_value("cast_fraction", "1.5"), "cast_fraction: holds something other than numbers"),
        (with_value("throw", [[1.0], 2.0]), "throw: holds something other than numbers"),
        (with_value("throw", {"x": 1.0}), "throw: holds something other than numbers"),
        (without_geometry, "geometry: is missing"),
        (with_value("geometry", {"length": -1.0}), "geometry: length = -1 m: must be positive"),
        (with_value("geometry", {"length": "long"}), "geometry: is not that of a bench"),
        (with_value("geometry", {"depth": 1.0}), "geometry: is missing or not that of a bench"),
        (with_value("geometry", {"corners": [[1.0]]}), "geometry: is not that of a bench"),
        (with_text("profile.csv", ""), "profile.csv"),
        (with_text("profile.csv", "x,y\n1,2\n"), "profile.csv"),
        (with_text("profile.csv", "x [m],mean_height [m],ground [m]\n1,2\n"), "profile.csv"),
        (
            with_text("profile.csv", "x [m],mean_height [m],ground [m]\n1,nan,0\n"),
            "hold no numbers",
        ),
        (with_text("profile.csv", "x [m],mean_height [m],ground [m]\n"), "columns are empty"),
        (with_text("profile.csv", b"\x89PNG\r\n\x1a\n\xff\xff"), "profile.csv"),
    ],
)
def test_damaged_and_foreign_folders(
    tmp_path: Path, damage: Callable[[Path], None], words: str
) -> None:
    """One line with folder and file for each, and nothing is written."""
    folders = [run(tmp_path / name, 1.0) for name in ("a", "b")]
    damage(folders[1])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(SpecError) as caught:
            compare_runs(folders, tmp_path / "out")
    (line,) = str(caught.value).splitlines()
    assert line.startswith(f"{folders[1]}")
    assert words in line
    assert not (tmp_path / "out").exists()


@given(st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=5) | st.integers(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=8,
), st.sampled_from([*UNITS, "geometry", "faults"]))  # fmt: skip
@settings(max_examples=60, deadline=None)
def test_whatever_stands_in_a_file_of_metrics(
    tmp_path_factory: pytest.TempPathFactory, value: Any, name: str
) -> None:
    """The outcome is a comparison or one clear fault."""
    folder = tmp_path_factory.mktemp("fuzz")
    folders = [run(folder / each, 1.0) for each in ("a", "b")]
    with_value(name, value)(folders[0])
    with contextlib.suppress(SpecError):
        read_runs(folders)
