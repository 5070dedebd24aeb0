"""Several muckpiles side by side: bands are those of the metrics, every fault is named."""

from __future__ import annotations

import json
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from castblast.errors import SpecError
from castblast.files import write_csv
from castblast.muckpile.bench import Bench
from castblast.muckpile.metrics import UNITS
from castblast.stages.muckpile_compare import compare_runs
from castblast.stages.muckpile_tables import GROUND_COLUMN, MEAN_COLUMN, X_COLUMN


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
