"""The muckpile stage: what it writes, that it repeats itself, and what it says of bad input."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from castblast.errors import SpecError
from castblast.stages.muckpile import run_muckpile

SMALL: dict[str, Any] = {
    "name": "small",
    "bench": {"length": "4 m", "width": "4 m", "height": "3 m", "burden": "2 m", "spacing": "2 m"},
    "velocity": "6 m/s",
    "balls": {"count": 250},
}
FILES = (
    "blocks.csv",
    "energy.png",
    "final_state.npz",
    "history.csv",
    "metrics.json",
    "movement.png",
    "plan.png",
    "profile.csv",
    "profiles.png",
    "section.png",
    "sections.png",
    "view.png",
)


def written(folder: Path, content: object) -> Path:
    path = folder / "bench.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("muckpile")
    bench = written(folder, SMALL)
    shares: list[float] = []
    outcome = run_muckpile(
        bench, folder / "out", threads=1, progress=lambda share, _: shares.append(share)
    )
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    return bench, folder / "out", outcome.document


def test_every_file_is_written(run: tuple[Path, Path, dict[str, Any]]) -> None:
    _, out, document = run
    assert sorted(p.name for p in out.iterdir() if p.name != "packings") == list(FILES)
    stored = json.loads((out / "metrics.json").read_text())
    assert stored["throw"] == document["throw"]
    for name in ("profile.csv", "history.csv", "blocks.csv"):
        table = np.loadtxt(out / name, delimiter=",", skiprows=1)
        assert np.isfinite(table).all()
    for name in (name for name in FILES if name.endswith(".png")):
        assert (out / name).read_bytes().startswith(b"\x89PNG")


def test_the_pile_is_thrown_and_keeps_its_mass(run: tuple[Path, Path, dict[str, Any]]) -> None:
    """Balls end in front of the face, none below the floor; mass is that before."""
    _, out, document = run
    with np.load(out / "final_state.npz") as final:
        x, r, before = final["x"], final["r"], final["x_before"]
    mass = r**3 / (r**3).sum()
    moved = mass @ (x - before)
    assert moved == pytest.approx(document["throw"], rel=1e-9, abs=1e-12)
    assert moved[0] > 1.0
    assert moved[2] < 0.0
    assert (x[:, 2] > 0.9 * r).all()
    assert document["cast_fraction"] == pytest.approx(mass[x[:, 0] > 0.0].sum(), abs=0.02)
    # A random packing of rough balls at rest; denser than 0.68 would be overlaps.
    assert 0.50 < document["solid_fraction"] < 0.68


def test_a_second_run_reuses_the_packing_and_repeats_every_file(
    run: tuple[Path, Path, dict[str, Any]], tmp_path: Path
) -> None:
    bench, out, document = run
    before = {name: (out / name).read_bytes() for name in FILES}
    again = run_muckpile(bench, out, threads=2).document
    assert again["packing_reused"]
    assert not document["packing_reused"]
    assert {name for name in FILES if (out / name).read_bytes() != before[name]} == set()


def test_a_file_of_balls(run: tuple[Path, Path, dict[str, Any]], tmp_path: Path) -> None:
    """Balls that collapse from a column under their own weight, without being fired."""
    _, out, _ = run
    with np.load(out / "final_state.npz") as final:
        np.savez(tmp_path / "balls.npz", x=final["x_before"], r=final["r"])
    content = SMALL | {"balls": "balls.npz", "firing": {"pattern": "none"}}
    del content["velocity"]
    content["bench"] = SMALL["bench"] | {"rear": False}
    document = run_muckpile(written(tmp_path, content), tmp_path / "out", threads=1).document
    assert document["initial_velocity"] == 0.0
    assert document["balls"] == len(np.load(tmp_path / "balls.npz")["r"])
    assert document["throw"][2] < -0.2
    # It spreads to both sides: no direction is preferred.
    assert abs(document["throw"][0]) < 0.3
    with pytest.raises(SpecError, match="takes its balls from"):
        run_muckpile(tmp_path / "bench.yaml", tmp_path / "out", balls=100)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"velocity": "12.7"}, "--velocity: 12.7: no unit given"),
        ({"velocity": "200 m/s"}, "--velocity: 200 m/s: implausible"),
        ({"balls": 10}, "must fit at least twice into the shortest side of the bench, 3 m"),
    ],
)
def test_options_that_cannot_be(tmp_path: Path, options: dict[str, Any], line: str) -> None:
    with pytest.raises(SpecError) as caught:
        run_muckpile(written(tmp_path, SMALL), tmp_path / "out", **options)
    assert line in str(caught.value)
    assert not any((tmp_path / "out").glob("*.npz"))
