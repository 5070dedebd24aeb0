"""Piles of other engines: throw, profile and ore from their balls before and after."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from castblast.errors import SpecError
from castblast.specs.bench.balls.files import read_balls
from castblast.stages.muckpile.compare import compare_runs
from castblast.stages.muckpile.extras import Extras
from castblast.stages.muckpile.measure import measure_muckpile

DATA = Path(__file__).parents[2] / "data" / "balls"
BENCH = """name: measured
bench: {length: 12 m, width: 6 m, height: 6 m, burden: 3 m, spacing: 3 m}
firing: {pattern: row, delay: 25 ms}
velocity: 9 m/s
balls: q2_lammps.data
"""
ORE = "name,x,y,grade\nA,-6,0,2\nA,-3,0,2\nA,-3,12,2\nA,-6,12,2\n"
MOVED = np.array([7.0, 0.5, 0.0])


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    (tmp_path / "q2_lammps.data").write_bytes((DATA / "q2_lammps.data").read_bytes())
    (tmp_path / "ore.csv").write_text(ORE)
    path = tmp_path / "bench.yaml"
    path.write_text(BENCH)
    return path


def dump_of(folder: Path, position: np.ndarray, radius: np.ndarray, order: np.ndarray) -> Path:
    """A dump as LAMMPS writes it: in any order, six figures."""
    lines = ["ITEM: TIMESTEP", "9", "ITEM: NUMBER OF ATOMS", str(len(order))]
    lines += ["ITEM: BOX BOUNDS ss ss ss", "-10 40", "-5 20", "-1 20"]
    lines.append("ITEM: ATOMS id type diameter x y z vx vy vz")
    lines += [
        f"{k + 1} 1 {2 * radius[k]:g} {' '.join(f'{v:g}' for v in position[k])} 0 0 0"
        for k in order.tolist()
    ]
    path = folder / "final.dump"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_pile_that_moved_as_one_is_measured(bench: Path, tmp_path: Path) -> None:
    """All balls 7 m on and half a metre aside: the throw is that, and ore goes with its balls."""
    start = read_balls(DATA / "q2_lammps.data")
    order = np.random.default_rng(0).permutation(len(start.radius))
    final = dump_of(tmp_path, start.position + MOVED, start.radius, order)
    out = tmp_path / "out"
    found = measure_muckpile(bench, final, out, extras=Extras(ore=tmp_path / "ore.csv"))
    document = json.loads((out / "metrics.json").read_text())
    assert document["throw"] == pytest.approx(MOVED.tolist(), abs=1e-4)
    assert document["cast_fraction"] == pytest.approx(1.0, abs=1e-9)
    (ore,) = document["ore"]["polygons"]
    assert ore["displacement"][:2] == pytest.approx([7.0, 0.5], abs=1e-4)
    profile = np.genfromtxt(out / "profile.csv", delimiter=",", names=True)
    raised = profile["x_m"][profile["mean_height_m"] > 1.0]
    assert 0.5 < raised.min() < 1.8  # the rear balls, from -5.5 m, with their radius
    assert 5.9 < raised.max() < 7.1
    blocks = np.genfromtxt(out / "blocks.csv", delimiter=",", names=True)
    assert blocks["moved_x_m"] == pytest.approx(np.full(8, 7.0), abs=1e-4)
    assert blocks["throw_m"] == pytest.approx(np.full(8, np.hypot(7.0, 0.5)), abs=1e-4)
    names = {path.name for path in found.files}
    assert {"section.png", "profiles.png", "ore.png", "final_state.npz"} <= names
    assert all(path.is_file() for path in found.files)
    assert ("throw of the centre of mass", "7", "m") in found.rows
    assert found.document["velocity_source"] == "given"
    assert found.rows[0] == (
        "burden velocity",
        f"{found.document['initial_velocity']:.3g}, as given",
        "m/s",
    )
    # Our own reader takes the state, and the comparison takes the folder.
    again = read_balls(out / "final_state.npz")
    assert again.position == pytest.approx(start.position + MOVED, abs=1e-4)
    other = measure_muckpile(bench, DATA / "q1_lammps.dump", tmp_path / "still")
    assert other.document["throw"] == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    compared = compare_runs([out, tmp_path / "still"], tmp_path / "both")
    assert compared.document["bands"]["throw"]["mean"][0] == pytest.approx(3.5, abs=1e-4)


def test_the_start_of_a_deck_is_found_beside_the_end(bench: Path, tmp_path: Path) -> None:
    bench.write_text(BENCH.replace("balls: q2_lammps.data", "balls: {count: 250}"))
    deck = tmp_path / "deck"
    deck.mkdir()
    start = read_balls(DATA / "q2_lammps.data")
    order = np.arange(len(start.radius))
    final = dump_of(deck, start.position + MOVED, start.radius, order)
    with pytest.raises(SpecError, match="the balls before firing are needed too: --start FILE"):
        measure_muckpile(bench, final, tmp_path / "out")
    (deck / "balls.data").write_bytes((DATA / "q2_lammps.data").read_bytes())
    found = measure_muckpile(bench, final, tmp_path / "out")
    assert found.document["throw"][0] == pytest.approx(7.0, abs=1e-4)


def test_other_balls_are_refused(bench: Path, tmp_path: Path) -> None:
    start = read_balls(DATA / "q2_lammps.data")
    final = dump_of(tmp_path, start.position, start.radius, np.arange(249))
    with pytest.raises(SpecError, match=r"249 balls; .* has 250: all of them are needed"):
        measure_muckpile(bench, final, tmp_path / "out")
    final = dump_of(tmp_path, start.position, np.roll(start.radius, 1), np.arange(250))
    with pytest.raises(SpecError, match=r"ball 0 has a radius of .* m: the order differs"):
        measure_muckpile(bench, final, tmp_path / "out")
    assert not (tmp_path / "out").exists()
