"""Files of ore polygons: both formats hold the same, and every fault is one clear line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from castblast.errors import SpecError
from castblast.muckpile.bench.geometry import Bench
from castblast.specs.bench.ore import read_ore

YAML = """
polygons:
  - name: north
    grade: 1.4
    corners: [[-6, 12], [0, 12], [0, 18], [-6, 18]]
  - name: south
    corners: [[-6, 0], [-1, 0], [-1, 6], [-6, 0]]
"""
CSV = """name, x, y, grade
north, -6, 12, 1.4
north, 0, 12,
north, 0, 18,
north, -6, 18,
south, -6, 0,
south, -1, 0,
south, -1, 6,
"""


def written(folder: Path, text: str, name: str = "ore.yaml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_both_formats_hold_the_same(tmp_path: Path) -> None:
    """The last corner of south repeats its first in YAML and is dropped."""
    from_yaml = read_ore(written(tmp_path, YAML))
    from_csv = read_ore(written(tmp_path, CSV, "ore.csv"), Bench())
    for one, two in zip(from_yaml, from_csv, strict=True):
        assert one.name == two.name
        np.testing.assert_array_equal(one.corners, two.corners)
        np.testing.assert_array_equal(one.grade, two.grade)
    assert from_yaml[0].grade == 1.4
    assert len(from_yaml[1].corners) == 3


def square(x: float, name: str = "a") -> str:
    corners = f"[[{x}, 0], [{x + 2}, 0], [{x + 2}, 2], [{x}, 2]]"
    return f"  - {{name: {name}, corners: {corners}}}\n"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("polygons: []", "polygons"),
        ("polygons:\n  - {name: a, corners: [[0, 0], [1, 1]]}", "polygons[0].corners"),
        ("polygons:\n  - {name: a, corner: [[0, 0], [1, 1], [1, 0]]}", "did you mean 'corners'"),
        ("polygons:\n" + square(-4) + square(-9), "'a': the name is used 2 times"),
        ("polygons:\n" + square(-4) + square(-3, "b"), "'a' and 'b' overlap by 2 m2"),
        ("polygons:\n" + square(7), "'a': lies beside the bench, which has x from -24 to 0 m"),
        (
            "polygons:\n  - {name: a, corners: [[-4, 0], [-2, 2], [-2, 0], [-4, 2]]}",
            "'a': is not a simple polygon (Self-intersection",
        ),
        ("polygons:\n  - {name: a, corners: [[-4, 0], [-3, 0], [-2, 0]]}", "(no area)"),
        (
            "polygons:\n  - {name: a, corners: [[-4, .nan], [-3, 0], [-2, 0]]}",
            "'a': a corner is not a finite number",
        ),
        (
            "polygons:\n  - {name: a, corners: [[-4, 1e300], [-3, 0], [-2, 0]]}",
            "is 1e+297 km long, beside a bench of 84 m",
        ),
    ],
)
def test_faults_of_yaml(tmp_path: Path, text: str, line: str) -> None:
    with pytest.raises(SpecError) as caught:
        read_ore(written(tmp_path, text), Bench())
    assert line in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path))


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("nam,x,y\na,1,2", "column 'nam': unknown column, did you mean 'name'?"),
        ("x,y\n1,2", "the column 'name' is missing"),
        ("name,x,y\na,-1,two", "line 2: y: two: a number is needed"),
        ("name,x,y\na,-1,", "line 2: y: empty: a number is needed"),
        ("name,x,y\na,-1", "line 2: 2 cells for 3 heads"),
        ("name,x,y,grade\na,-1,0,1\na,-2,0,2\na,-2,1,1", "line 3: grade: 'a' has another grade"),
        ("name,x,y\n", "has a header but no data rows"),
        ("", "is empty"),
    ],
)
def test_faults_of_csv(tmp_path: Path, text: str, line: str) -> None:
    with pytest.raises(SpecError) as caught:
        read_ore(written(tmp_path, text, "ore.csv"))
    assert line in str(caught.value)


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="no such file"):
        read_ore(tmp_path / "ore.csv")
