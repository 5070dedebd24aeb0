"""The shipped benches, small, from file to pile; and what is refused before a run."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_bench import SMALL, write_bench

from castblast.errors import SpecError
from castblast.muckpile.balls.contact import ContactLaw
from castblast.muckpile.balls.particles import particles_at_rest
from castblast.muckpile.balls.state import estimate_memory
from castblast.muckpile.bench.given import initial_state, pressed_share
from castblast.muckpile.ground.terrain import wall_faults
from castblast.muckpile.ground.walls import floor, join, plane, rectangle
from castblast.scene import memory as muckpile_memory
from castblast.specs.bench.balls.files import read_balls
from castblast.stages.muckpile.run import run_muckpile

pytestmark = pytest.mark.usefixtures("no_pictures")


written = partial(write_bench, stop={"longest_time": "0.1 s"})


@pytest.fixture
def no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out files and pictures, which take ten times as long as these small casts."""
    monkeypatch.setattr("castblast.stages.muckpile.run.write_results", lambda *_, **__: [])


def said(folder: Path, **change: Any) -> str:
    with pytest.raises(SpecError) as caught:
        run_muckpile(written(folder, **change), folder / "out", threads=1)
    return str(caught.value)


@pytest.mark.parametrize(
    "name", ["v_pattern", "row_by_row", "holes_from_file", "fragments", "polygon"]
)
def test_shipped_plans_run(name: str, tmp_path: Path) -> None:
    """Each with a few hundred balls: rock goes ahead and down, and the energy balance closes."""
    document = run_muckpile(name, tmp_path, balls=400, threads=2).document
    assert document["status"] == "ok"
    assert document["balls"] == pytest.approx(400, rel=0.06)
    assert document["throw"][0] > 2.0
    assert document["throw"][2] < -1.0
    # The bench of the holes goes over the face line to within a ball or two.
    assert 0.2 < document["cast_fraction"] <= 1.0
    assert abs(document["ledger"]["residual"]) < 0.02
    if name == "fragments":
        assert 0.0 < document["fragments"]["mass_share_finer"] < 1.0
    else:
        assert document["fragments"] is None


def test_packings_are_shared_by_their_content(tmp_path: Path) -> None:
    """Plan, slope and blocks do not change a packing; seed and sizes do."""
    shared = tmp_path / "packings"
    runs = [
        ({}, False),
        ({"velocity": "9 m/s", "slope": {"distance": "5 m"}, "firing": {"pattern": "row"}}, True),
        ({"bench": SMALL["bench"] | {"burden": "1 m", "ends": "wall"}}, True),
        ({"seed": 1}, False),
        ({"balls": {"count": 160}}, False),
    ]
    for k, (change, reused) in enumerate(runs):
        path = written(tmp_path, **change)
        document = run_muckpile(path, tmp_path / str(k), threads=1, packings=shared).document
        assert document["packing_reused"] is reused, change
    assert len(list(shared.iterdir())) == 3


def test_a_damaged_packing_is_made_again(tmp_path: Path) -> None:
    run_muckpile(written(tmp_path), tmp_path / "out", threads=1)
    (stored,) = (tmp_path / "out" / "packings").iterdir()
    stored.write_bytes(stored.read_bytes()[:500])
    document = run_muckpile(tmp_path / "bench.yaml", tmp_path / "out", threads=1).document
    assert not document["packing_reused"]


def test_a_step_above_stability_is_refused(tmp_path: Path) -> None:
    line = said(tmp_path, numerics={"time_step": "20 ms"})
    assert "small: numerics.time_step: 0.02 s: above the stable step of these balls" in line
    assert len(line.splitlines()) == 1
    # The packing is not lost.
    assert len(list((tmp_path / "out" / "packings").iterdir())) == 1
    fine = written(tmp_path, numerics={"time_step": "0.1 ms"})
    assert run_muckpile(fine, tmp_path / "out", threads=1).document["packing_reused"]


def test_too_little_memory_is_said_before_packing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(muckpile_memory, "available_memory", lambda: 2**30)
    line = said(tmp_path, balls={"count": 4_000_000})
    assert "small: 4,000,000 balls need about" in line
    assert "1 GiB are free" in line
    assert not (tmp_path / "out").exists()
    fitting = int(re.search(r"about ([\d,]+) balls fit", line)[1].replace(",", ""))
    assert estimate_memory(fitting) <= 2**30 < estimate_memory(fitting + 2)


def test_memory_of_this_machine_is_known() -> None:
    there = muckpile_memory.available_memory()
    assert there is None or 2**24 < there < 2**50


BALLS = "x,y,z,radius,vx,vy,vz\n-1,1,0.5,0.5,0,0,0\n-1,2.1,0.5,0.5,1,2,3\n"


def test_balls_from_csv(tmp_path: Path) -> None:
    path = tmp_path / "balls.csv"
    path.write_text("# made by hand\n" + BALLS)
    balls = read_balls(path)
    assert balls.velocity[1].tolist() == [1.0, 2.0, 3.0]
    path.write_text(BALLS.replace("radius", "radius [cm]").replace("0.5,0.5", "0.5,50"))
    assert read_balls(path).radius.tolist() == [0.5, 0.5]
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    names = ("x", "y", "z", "radius", "vx", "vy", "vz")
    np.savez(
        tmp_path / "same.npz", **dict(zip(names, table.T, strict=True)) | {"radius": [0.5, 0.5]}
    )
    again = read_balls(tmp_path / "same.npz")
    assert again.position.tolist() == balls.position.tolist()
    assert again.velocity.tolist() == balls.velocity.tolist()


def test_a_file_of_moving_balls_is_run(tmp_path: Path) -> None:
    """Two free balls, one of them moving: it keeps its level velocity, no block fires it."""
    (tmp_path / "balls.csv").write_text(BALLS.replace("0.5,0.5,1,2,3", "9,0.5,1,0,0"))
    bench = written(tmp_path, balls="balls.csv", firing={"pattern": "none"}, velocity=None)
    document = run_muckpile(bench, tmp_path / "out", threads=1).document
    assert document["throw"][0] == pytest.approx(0.05, abs=0.002)


def test_balls_of_blocks_that_are_not_there(tmp_path: Path) -> None:
    text = "x,y,z,radius,block\n-1,1,0.5,0.5,0\n-1,2.1,0.5,0.5,77\n"
    (tmp_path / "balls.csv").write_text(text)
    line = said(tmp_path, balls="balls.csv")
    assert "balls.csv: block: 77 of ball 1: the plan has the blocks 0 to 3" in line


def test_a_wall_that_cuts_the_balls_is_refused(tmp_path: Path) -> None:
    """A slope through two balls of a file: the second is 0.5 - 0.5 cos 30 + 3.5 sin 30 deep."""
    text = "x,y,z,radius\n-1,1,0.5,0.5\n3,1,0.5,0.5\n6,2,0.5,0.5\n"
    (tmp_path / "balls.csv").write_text(text)
    slope = {"distance": "2.5 m", "angle": "30 deg"}
    line = said(tmp_path, balls="balls.csv", slope=slope)
    assert (
        "small: wall 3 cuts 2 balls of the packing; worst: ball 2 at (6.00, 2.00, 0.50) m" in line
    )
    assert "1.8 m deep" in line


def test_depth_in_walls() -> None:
    """Planes hold balls at any depth; behind a bounded wall is another place; a shelf cuts none."""
    balls = particles_at_rest([[0, 0, 1], [3, 0, 0.9], [0, 0, -9.0]], [1, 1, 1])
    first = balls._replace(position=balls.position[:2], radius=balls.radius[:2])
    assert wall_faults(floor(), first) == []
    assert "cuts 1 ball of the packing; worst: ball 2" in wall_faults(floor(), balls)[0]
    side = plane((2.5, 0, 0), (1, 0, 0))
    faults = wall_faults(join(floor(-20.0), side), balls)
    assert "wall 1 cuts 3 balls" in faults[0]
    shelf = rectangle((0, 0, 5.0), (1, 0, 0), (0, 1, 0), (-1, 1, -1, 1))
    assert (
        "2 balls of the packing below the ground"
        in wall_faults(join(floor(-20.0), shelf), balls)[0]
    )


def test_overlaps_that_weight_explains_are_none() -> None:
    """A column of balls, each 15 % of the radius into the next, on a modulus of 1 MPa.

    The foot of 12 m of rock may be pressed so far, its top may not; without a law nothing may.
    """
    place = [[0.0, 0.0, 0.5 + 0.925 * k] for k in range(14)]
    soft, usual = ContactLaw(effective_modulus=1e6), ContactLaw()
    top, foot = place[-3:], place[:3]
    assert "by 15 %" in initial_state(place, [0.5] * 14)[1][0]
    assert "2 pairs" in initial_state(top, [0.5] * 3, law=usual)[1][0]
    allowed = pressed_share(particles_at_rest(place, [0.5] * 14), soft)
    assert allowed[-1] == 0.10
    assert allowed[0] == pytest.approx(25.0 * 0.6 * 2600.0 * 9.81 * 0.925 * 13 / 1e6)
    pressed = [*foot, place[-1]]
    assert initial_state(pressed, [0.5] * 4, law=soft)[1] == []
    assert "balls 0 and 1" in initial_state(pressed, [0.5] * 4)[1][0]
