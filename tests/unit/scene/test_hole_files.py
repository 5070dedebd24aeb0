"""Files of holes as mines have them: read to the same plan, or one line says what is needed."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from castblast.api.muckpile.tables import block_columns
from castblast.errors import SpecError
from castblast.muckpile.bench.geometry import Bench
from castblast.scene.plan import make_plan
from castblast.specs.bench.bench import load_bench
from castblast.specs.bench.frame import FrameSpec, suggest_frame
from castblast.specs.bench.holes import Holes, read_holes
from castblast.specs.bench.ore import read_ore
from castblast.specs.loading import make_spec

DATA = Path(__file__).parents[1] / "data" / "holes"
BENCH = Bench(18.0, 9.0, 10.0, burden=3.0, spacing=3.6)
#: In which the places of a12 are those of a0, and of a1 and a3 to the centimetre.
FRAME = make_spec(
    {"easting": "452318.40 m", "northing": "7389211.20 m", "bearing": "63 deg"}, FrameSpec, "frame"
)


def read(name: str, **options: object) -> Holes:
    return read_holes(DATA / name, BENCH, by_block=False, **options)


def said(name: str, **options: object) -> list[str]:
    with pytest.raises(SpecError) as caught:
        read(name, **options)
    return str(caught.value).replace(f"{DATA}/", "").splitlines()


CONTROL = read("a0_control.csv")


@pytest.mark.parametrize(
    "name",
    [
        "a4_semicolon_comma.csv", "a5_latin1.csv", "a6_blank_tail.csv", "a8_unit_row.csv",
        "a9_round_units.csv", "a10_tabs.csv", "a14_utf16.csv", "a22_charge_mass.csv",
    ],
)  # fmt: skip
def test_read_as_the_control(name: str) -> None:
    holes = read(name)
    assert holes.place.tolist() == CONTROL.place.tolist()
    assert holes.delay.tolist() == CONTROL.delay.tolist()
    if name in ("a4_semicolon_comma.csv", "a6_blank_tail.csv"):
        assert holes.design == CONTROL.design


def test_columns_of_the_control_go_where_they_belong() -> None:
    assert CONTROL.place[7].tolist() == [-4.5, 8.1]
    assert CONTROL.delay[7] == 0.184
    assert CONTROL.design[7] == {"charge_mass": 96.0}
    assert read("a9_round_units.csv").design[0] == {"charge_mass": 105.0, "hole_diameter": 0.15}
    assert read("a5_latin1.csv").direction.tolist() == [0.0] * 15


REFUSED = {
    "a3_no_head.csv": "line 1: holds 9 numbers where the heads of 14 columns are needed, such as",
    "a7_ids.csv": "lines 15 and 16: hole 'H14': given twice",
    "a11_imperial.csv": "line 2: hole_diameter: 6 1/4: a number is needed",
    "a15_quoted.csv": "line 5: delay: 1,260: a number is needed, without thousands separators",
    "a16_minus_one.csv": "line 9: delay: empty: a number is needed",
    "a17.xlsx": "is a workbook or another zip archive; save its sheet as CSV",
    "a18_iredes.xml": "is XML, such as IREDES; write its places as a CSV with heads",
    "a19.str": "is a string file (.str), without heads and delays; a CSV with x [m]",
    "a1_collar_toe.csv": "line 1: the heads are 'Hole Name', 'Collar X', 'Collar Y'",
    "a20_bearing.csv": "line 2: direction: 175.94 deg: implausible (175.94 deg); allowed: -90 to",
    "a21_dip.csv": "line 2: elevation: -90 deg: implausible (-90 deg); allowed: -45 to 60 deg",
}


@pytest.mark.parametrize(("name", "line"), REFUSED.items())
def test_refused_by_line_and_column(name: str, line: str) -> None:
    lines = said(name)
    assert lines[0].startswith(f"{name}: {line}")
    whole = ("a1_collar_toe.csv", "a3_no_head.csv", "a7_ids.csv", "a16_minus_one.csv")
    if name in whole or not name.endswith(".csv"):
        assert len(lines) == 1


def test_what_a_mine_grid_needs_is_one_line_that_works() -> None:
    """The line names a frame; with that frame the pattern lies on the bench as it was drawn."""
    (line,) = said("a12_minegrid_own_heads.csv")
    assert "all holes stand outside the bench, -9 to 0 m in x and 0 to 18 m in y: x is 4523" in line
    values = dict(re.findall(r"(easting|northing|bearing): ([\d.]+ \w+)", line))
    frame = make_spec(values, FrameSpec, "said")
    assert math.degrees(frame.bearing) == pytest.approx(63.0, abs=0.15)
    there = read("a12_minegrid_own_heads.csv", frame=frame).place
    shift = there - CONTROL.place
    assert np.ptp(shift, axis=0).max() < 0.06
    assert np.abs(shift.mean(axis=0)).max() < 0.5


def test_a_mine_grid_with_its_frame() -> None:
    holes = read("a12_minegrid_own_heads.csv", frame=FRAME)
    assert np.abs(holes.place - CONTROL.place).max() < 2e-3
    assert holes.delay.tolist() == CONTROL.delay.tolist()
    wrong = FRAME.model_copy(update={"easting": FRAME.easting + 500.0})
    (line,) = said("a12_minegrid_own_heads.csv", frame=wrong)
    assert "the frame of the bench file may be 'frame: {easting: 452318.6" in line


def test_a_frame_turns_and_shifts() -> None:
    """Throw to the north: x is the northing, and y, to its left, goes west."""
    frame = make_spec({"easting": "100 m", "northing": "50 m", "bearing": "0 deg"}, FrameSpec, "f")
    assert frame.to_bench(np.array([[100.0, 57.0], [97.0, 50.0]])) == pytest.approx(
        np.array([[7.0, 0.0], [0.0, 3.0]])
    )


@pytest.mark.parametrize("bearing", [0.0, 37.0, 90.0, 181.3, 300.0])
def test_any_direction_is_found(bearing: float) -> None:
    """The front row fires first, so that a pattern is not turned back to front."""
    angle = math.radians(bearing)
    axes = np.array([[math.sin(angle), -math.cos(angle)], [math.cos(angle), math.sin(angle)]])
    grid = CONTROL.place @ axes.T + np.array([452000.0, 7389000.0])
    found = suggest_frame(grid, CONTROL.delay, BENCH)
    assert found is not None
    apart = (math.degrees(found.bearing) - bearing + 180.0) % 360.0 - 180.0
    assert abs(apart) < 0.15
    assert suggest_frame(10.0 * grid, CONTROL.delay, BENCH) is None


def test_millimetres_are_not_taken_for_metres(tmp_path: Path) -> None:
    path = tmp_path / "holes.csv"
    rows = [f"{1e3 * x:g},{1e3 * y:g},{k}" for k, (x, y) in enumerate(CONTROL.place.tolist())]
    path.write_text("x [m],y [m],delay [ms]\n" + "\n".join(rows))
    with pytest.raises(SpecError, match=r"6000 x 1.53e\+04 m are more than the bench holds: check"):
        read_holes(path, BENCH, by_block=False)
    path.write_text("x [mm],y [mm],delay [ms]\n" + "\n".join(rows))
    assert read_holes(path, BENCH, by_block=False).place.tolist() == CONTROL.place.tolist()


def test_columns_of_other_heads_and_connectors() -> None:
    """a3 has no heads: places by number, and delays from hole to hole, summed to firing times."""
    columns = {"id": "3", "x": "4 [m]", "y": "5 [m]", "from_hole": "12",
               "connector_delay": "13 [ms]"}  # fmt: skip
    holes = read("a3_no_head.csv", frame=FRAME, columns=columns)
    assert holes.label == [str(k) for k in range(1, 16)]
    assert np.abs(holes.place - CONTROL.place).max() < 2e-3
    rows = [line.split(",") for line in (DATA / "a3_no_head.csv").read_text().splitlines()]
    expected: dict[str, float] = {}
    for row in rows:
        expected[row[2]] = expected.get(row[11].rpartition(":")[2], 0.0) + float(row[12])
    assert holes.delay.tolist() == pytest.approx([1e-3 * t for t in expected.values()])
    # a1 has no times at all, and says so in one line.
    columns = {"x": "Collar X [m]", "y": "Collar Y [m]"}
    assert said("a1_collar_toe.csv", frame=FRAME, columns=columns) == [
        "a1_collar_toe.csv: the column 'delay' is missing"
    ]


@pytest.mark.parametrize(
    ("rows", "line"),
    [
        ("A,A,0\nB,A,25\nC,B,17\n", ""),
        ("C,B,17\nB,A,25\nA,,0\n", ""),
        ("A,A,0\nB,C,25\nC,B,17\n", "line 3 (hole 'B'): its connectors lead round in a ring"),
        ("A,A,0\nB,X,25\n", "line 3 (hole 'B'): from_hole: 'X' is none of the holes"),
        ("A,A,0\nB,A,\n", "line 3 (hole 'B'): connector_delay: empty: a number is needed"),
    ],
)
def test_connectors(rows: str, line: str, tmp_path: Path) -> None:
    path = tmp_path / "holes.csv"
    places = [f"-1.5,{1.8 + 3.6 * k}" for k in range(3)]
    body = [f"{p},{row}" for p, row in zip(places, rows.splitlines(), strict=False)]
    path.write_text("x [m],y [m],hole,from_hole,connector_delay [ms]\n" + "\n".join(body))
    if line:
        with pytest.raises(SpecError, match=re.escape(line)):
            read_holes(path, BENCH, by_block=False)
        return
    holes = read_holes(path, BENCH, by_block=False)
    times = dict(zip(holes.label, holes.delay.tolist(), strict=True))
    assert times == pytest.approx({"A": 0.0, "B": 0.025, "C": 0.042})


def test_ids_reach_messages_and_the_table_of_blocks(tmp_path: Path) -> None:
    text = (DATA / "bench.yaml").read_text().replace("HOLES", "holes.csv")
    (tmp_path / "bench.yaml").write_text(text)
    text = (DATA / "a7_ids.csv").read_text().replace("H14,-7.500,16", "H15,-7.500,16")
    (tmp_path / "holes.csv").write_text(text)
    spec = load_bench(tmp_path / "bench.yaml")
    bench = spec.bench.to_bench()
    plan = make_plan(spec, bench, tmp_path)
    assert list(plan.label) == [f"H{k}" for k in range(1, 16)]
    by_block = spec.model_copy(update={"firing": spec.firing.model_copy(update={"blocks": "grid"})})
    grid = make_plan(by_block, bench, tmp_path)
    assert set(grid.label) == set(plan.label)
    (tmp_path / "holes.csv").write_text(text.replace("H3,-1.500,9.000", "H3,-1.500,90"))
    with pytest.raises(SpecError, match=r"line 4 \(hole 'H3'\): the hole at x = -1.5 m, y = 90 m"):
        make_plan(spec, bench, tmp_path)
    (tmp_path / "holes.csv").write_text(text.replace("H3,-1.500,9.000", "H3,-1.500,5.500"))
    with pytest.raises(SpecError, match=r"lines 3 and 4 \(H2, H3\): two holes on one block"):
        make_plan(spec, bench, tmp_path)


def test_the_table_of_blocks_names_the_holes() -> None:
    from castblast.muckpile.balls.contact import ContactLaw
    from castblast.muckpile.balls.particles import particles_at_rest
    from castblast.muckpile.cast.case import CastCase
    from castblast.muckpile.ground.walls import floor

    balls = particles_at_rest([[-1.5, 5.4, 1.0], [-4.5, 4.5, 1.0]], [0.5, 0.5], [1, 6])
    delay, velocity = CONTROL.delay, np.zeros((15, 3))
    case = CastCase(balls, ContactLaw(), floor(), delay, velocity)
    columns = block_columns(case, balls, BENCH, [f"H{k}" for k in range(1, 16)])
    assert columns["hole"] == ["H2", "H7"]
    assert columns["block"].tolist() == [1, 6]


def test_ore_lies_in_the_frame_of_the_bench_too(tmp_path: Path) -> None:
    path = tmp_path / "ore.csv"
    corners = FRAME.to_bench(np.array([[452318.4, 7389211.2]]))
    assert corners == pytest.approx(np.zeros((1, 2)))
    axes = np.array([[0.8910065, -0.4539905], [0.4539905, 0.8910065]])
    local = np.array([[-6.0, 3.0], [-2.0, 3.0], [-2.0, 9.0], [-6.0, 9.0]])
    grid = local @ axes.T + np.array([452318.4, 7389211.2])
    rows = "".join(f"A,{e:.4f},{n:.4f}\n" for e, n in grid)
    path.write_text("name,Easting [m],Northing [m]\n" + rows)
    (polygon,) = read_ore(path, BENCH, FRAME)
    assert polygon.corners == pytest.approx(local, abs=1e-3)
