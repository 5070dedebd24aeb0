"""Bench files and files of balls: what they give, and what is said of faulty ones."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from castblast.disk.resources import find_spec, resource
from castblast.errors import SpecError
from castblast.specs.bench.balls.files import read_balls
from castblast.specs.bench.bench import load_bench

BENCH: dict[str, Any] = {
    "name": "small",
    "bench": {"length": "12 m", "width": "9 m", "height": "6 m"},
    "velocity": "10 m/s",
    "balls": {"mean_radius": "0.2 m"},
}


def written(tmp_path: Path, content: object) -> Path:
    path = tmp_path / "bench.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def said(tmp_path: Path, **change: object) -> str:
    with pytest.raises(SpecError) as caught:
        load_bench(written(tmp_path, BENCH | change))
    return str(caught.value)


@pytest.mark.parametrize(
    "path", sorted(resource("data_specs/benches").glob("*.yaml")), ids=lambda p: p.stem
)
def test_shipped_benches(path: Path) -> None:
    spec = load_bench(path)
    assert spec.name == path.stem
    assert find_spec(path.stem, "bench") == path
    assert spec.contact.to_law()._asdict() == load_bench("echelon_84x24").contact.to_law()._asdict()


def test_the_case_of_the_paper() -> None:
    spec = load_bench("echelon_84x24")
    bench, law = spec.bench.to_bench(), spec.contact.to_law()
    delay = spec.firing.block_delay(bench).reshape(8, 28)
    assert (bench.length, bench.width, bench.height, bench.face_angle) == (
        84,
        24,
        12.5,
        math.pi / 2,
    )
    assert delay[0, 0] == 0.0
    assert np.diff(delay, axis=1) == pytest.approx(0.030)
    assert np.diff(delay, axis=0) == pytest.approx(0.030)
    assert (law.effective_modulus, law.stiffness_ratio) == (1e7, 2.0)
    assert (law.friction, law.rolling_friction, law.density) == (0.5, 0.5, 2600.0)
    assert spec.velocity == 12.7
    assert spec.slope.angle == pytest.approx(math.pi / 6)
    assert load_bench("echelon_84x24_flat").slope is None


def test_design_for_the_surrogate_takes_the_geometry_of_the_bench(tmp_path: Path) -> None:
    content = BENCH | {"surrogate": {"explosive": "anfo", "ucs": "90 MPa"}}
    del content["velocity"]
    assert load_bench(written(tmp_path, content)).design() == {
        "explosive": "anfo",
        "ucs": 90e6,
        "burden": 3.0,
        "spacing": 3.0,
        "bench_height": 6.0,
        "face_angle": math.pi / 2,
    }


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"bench": BENCH["bench"] | {"burden": "10 m"}}, "burden 10 m: the block is larger than"),
        ({"bench": BENCH["bench"] | {"face_angle": "30 deg"}}, "the face would reach the rear"),
        ({"bench": BENCH["bench"] | {"height": "0 m"}}, "bench.height: 0 m: must be larger than 0"),
        ({"bench": BENCH["bench"] | {"lenght": "3 m"}}, "unknown key, did you mean 'length'?"),
        (
            {"balls": {"mean_radius": "2 m"}},
            "must fit at least twice into the shortest side of the bench, 6 m",
        ),
        ({"balls": {}}, "exactly one of 'mean_radius', 'count' and 'file' is needed"),
        ({"balls": {"count": 3}}, "balls.count: 3: input should be greater than or equal to 10"),
        (
            {"velocity": "12.7 km/s"},
            "velocity: 12.7 km/s: implausible (12700 m/s); allowed: 0 to 100 m/s",
        ),
        # A bearing and dips of holes, whichever way they count, are no directions of a throw.
        (
            {"direction": {"azimuth": "175.94 deg"}},
            "direction.azimuth: 175.94 deg: implausible (175.94 deg); allowed: -90 to 90 deg; "
            "a bearing or a dip is that of the hole, not of the throw",
        ),
        ({"direction": {"azimuth": "-180 deg"}}, "allowed: -90 to 90 deg; a bearing"),
        ({"direction": {"elevation": "-90 deg"}}, "allowed: -45 to 60 deg; a bearing or a dip"),
        ({"direction": {"elevation": "90 deg"}}, "allowed: -45 to 60 deg; a bearing or a dip"),
        ({"direction": {"elevation": "75 deg"}}, "allowed: -45 to 60 deg; a bearing or a dip"),
        ({"velocity": None}, "either 'velocity' or 'surrogate' is needed"),
        ({"surrogate": {"explosive": "anfo"}}, "either 'velocity' or 'surrogate' is needed"),
        ({"surrogate": {"usc": "3 MPa"}}, "usc: unknown variable, did you mean 'ucs'?"),
        ({"surrogate": {"burden": "3 m"}}, "burden: is taken from 'bench'"),
        ({"firing": {"pattern": "echeln"}}, "'echelon', 'row', 'v', 'holes' or 'none'"),
        ({"firing": {"pattern": "none"}}, "firing.pattern 'none' takes no velocity"),
        ({"slope": {"angle": "30 deg"}}, "slope.distance: is missing"),
    ],
)
def test_faulty_benches(tmp_path: Path, change: dict[str, object], line: str) -> None:
    assert line in said(tmp_path, **change)


def balls_file(tmp_path: Path, **arrays: object) -> Path:
    path = tmp_path / "balls.npz"
    np.savez(path, **arrays)
    return path


GRID = np.stack(np.meshgrid(*[np.arange(3.0)] * 3), axis=-1).reshape(-1, 3) + 0.5
RADII = np.full(27, 0.5)


def test_balls_are_read(tmp_path: Path) -> None:
    balls = read_balls(balls_file(tmp_path, x=GRID.astype(np.float32), r=RADII))
    assert balls.position == pytest.approx(GRID)
    assert balls.position.dtype == np.float64
    assert set(balls.block) == {-1}


@pytest.mark.parametrize(
    ("arrays", "line"),
    [
        ({"x": GRID}, "r: is missing; the file holds x"),
        ({"X": GRID, "r": RADII}, "x: is missing, did you mean 'X'?"),
        ({"x": GRID[:, :2], "r": RADII}, "x: shape (27, 2); (n, 3) is needed"),
        ({"x": GRID, "r": RADII[:5]}, "x has 27 balls, r has 5"),
        ({"x": GRID, "r": RADII[:, None]}, "r: shape (27, 1); (n,) is needed"),
        ({"x": GRID.astype(str), "r": RADII}, "numbers are needed"),
        ({"x": np.empty((0, 3)), "r": np.empty(0)}, "x: shape (0, 3)"),
        ({"x": np.where(GRID == 2.5, np.nan, GRID), "r": RADII}, ""),
        ({"x": GRID, "r": -RADII}, ""),
        ({"x": GRID * 0.7, "r": RADII}, "overlap"),
        ({"x": GRID, "r": RADII, "block": np.zeros(3)}, "block: shape (3,)"),
    ],
)
def test_faulty_balls(tmp_path: Path, arrays: dict[str, object], line: str) -> None:
    path = balls_file(tmp_path, **arrays)
    with pytest.raises(SpecError) as caught:
        read_balls(path)
    assert line in str(caught.value)
    assert all(text.startswith(str(path)) for text in str(caught.value).splitlines())


def test_folder_of_the_same_name_hides_no_shipped_bench(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`castblast demo` leaves a folder `demo`; the bench of that name is still found."""
    with monkeypatch.context() as patch:
        patch.chdir(tmp_path)
        (tmp_path / "demo").mkdir()
        assert find_spec("demo", "bench").name == "demo.yaml"
