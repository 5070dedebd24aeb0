"""Ground as mine tools, surveys and scanners write it: read, mended and said, or one clear line."""

from __future__ import annotations

import resource
from pathlib import Path

import numpy as np
import pytest
from ground_files import CASES, GRID, SHIFT, ground

from castblast.errors import SpecError
from castblast.muckpile.ground.terrain import surface_faults
from castblast.muckpile.ground.walls import ground_height
from castblast.specs.bench.ground.heights import Heights, read_heights
from castblast.specs.bench.ground.spec import GroundSpec, smooth_heights
from castblast.specs.loading import make_spec


def control(name: str) -> Heights:
    return read_heights(CASES / name)


# -------------------------------------------------------------------------------- ESRI grids
@pytest.mark.parametrize("name", ["g3_comma.asc", "g4_dx_dy.asc", "g6_bom.asc", "g7b_null.asc"])
def test_grids_of_other_tools_are_the_control(name: str) -> None:
    """Decimal commas, dx and dy, a mark of the encoding, a word for what is missing.

    `g4` gives its lower left corner half a cell further east and north.
    """
    found, expected = control(name), control("g0_control.asc")
    moved = 1.5 if name == "g4_dx_dy.asc" else 0.0
    np.testing.assert_array_equal(found.height, expected.height)
    np.testing.assert_allclose(found.x - moved, expected.x, rtol=1e-15)
    np.testing.assert_allclose(found.y - moved, expected.y, rtol=1e-15)
    assert found.remarks == ()
    assert (expected.x[0], expected.y[0]) == (452300.0, 7389200.0)


def test_a_rim_without_heights_ends_the_ground() -> None:
    """Six marks in a corner: said once, the rest is the control, and the facets make a surface."""
    found, expected = control("g1_nodata_rim.asc"), control("g0_control.asc")
    assert found.remarks == (
        "6 heights missing of 165: 6 of 140 cells have a missing corner and make no facet",
    )
    known = np.isfinite(found.height)
    assert (~known).sum() == 6
    np.testing.assert_array_equal(found.height[known], expected.height[known])
    read = ground("g1_nodata_rim.asc", shift=SHIFT, floor="-100 m")
    assert surface_faults(read.walls.corner) == []
    assert sum("missing" in line for line in read.remarks) == 1


def test_words_for_nothing_at_the_beginning_are_heights() -> None:
    assert control("g7_nan_first_no_nodata.asc").remarks[0].startswith("2 heights missing of 165")


@pytest.mark.parametrize(
    ("mark", "written"),
    [
        ("-3.4028234663852886e+38", "-3.40282e+38"),
        ("-9999", "-9999.001"),
        ("-9999.0", "-9999"),
        ("1e31", "1.0000000E+31"),
        ("null", "NULL"),
        ("-32768", "-32768"),
    ],
)
def test_marks_are_held_to_their_digits(tmp_path: Path, mark: str, written: str) -> None:
    """A mark written with other digits than in the header is still one."""
    text = (CASES / "g1_nodata_rim.asc").read_text()
    text = text.replace("NODATA_value -9999", f"NODATA_value {mark}").replace("-9999.00", written)
    (tmp_path / "g.asc").write_text(text)
    found = read_heights(tmp_path / "g.asc")
    np.testing.assert_array_equal(found.height, control("g1_nodata_rim.asc").height)


def test_marks_that_no_file_declares_are_no_heights(tmp_path: Path) -> None:
    """-99999 and 1e38 in an .npz, a CSV; a level of 10,350 m of a mine's own datum stays."""
    x, y = np.arange(5.0), np.arange(4.0)
    height = np.full((4, 5), 10350.0)
    height[0, 0], height[0, 1] = -99999.0, 1e38
    np.savez(tmp_path / "g.npz", x=x, y=y, height=height)
    points = np.column_stack([v.ravel() for v in (*np.meshgrid(x, y), height)])
    np.savetxt(tmp_path / "g.csv", points, delimiter=",", header="x,y,z", comments="")
    for name in ("g.npz", "g.csv"):
        found = read_heights(tmp_path / name)
        assert np.isnan(found.height[0, :2]).all()
        assert np.isfinite(found.height).sum() == 18
        assert found.remarks[0] == "2 heights beyond -9000 to 90000 m are taken as missing"


HEAD = "ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEAD + "1 2 3\n4 five 6\n", "row 1, column 1 from the top: 'five' is not a number"),
        (HEAD + "1 2 3\n4 5\n", "5 heights; nrows x ncols = 2 x 3 = 6 are needed"),
        (HEAD.replace("cellsize 1", "cellsize 0") + "1 2 3\n4 5 6\n", "cellsize: 0: must be larg"),
        (HEAD.replace("cellsize", "celsize") + "1 2 3\n", "unknown key, did you mean 'cellsize'"),
        (HEAD.replace("ncols 3", "ncols 3e9"), "ncols: 3e9: a whole number from 2 is needed"),
        (
            HEAD.replace("ncols 3", "ncols 900000000") + "1 2",
            "2 x 900000000 = 1,800,000,000 heights; at most",
        ),
        (HEAD.replace("xllcorner 0\n", "") + "1 2 3 4 5 6", "header: missing: xllcorner"),
        (HEAD.replace("nrows 2\n", "") + "1 2 3 4 5 6", "header: missing: nrows"),
        ("ncols 3\nncols 3\n", "line 2: ncols: given twice"),
        ("", "header: missing: ncols, nrows"),
    ],
)
def test_faulty_grids_are_one_line(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "g.asc"
    path.write_text(text)
    with pytest.raises(SpecError) as caught:
        read_heights(path)
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


# ------------------------------------------------------------------------------------ points
@pytest.mark.parametrize(
    "name",
    ["g8_bom.csv", "g8_blank_last_line.csv", "g8_remark.csv", "g8_enz.csv", "g8_no_head.csv"],
)
def test_points_of_other_tools_are_the_control(name: str) -> None:
    found, expected = control(name), control("g8_control.csv")
    for one, two in zip(found[:3], expected[:3], strict=True):
        np.testing.assert_array_equal(one, two)
    assert ("no heads" in "".join(found.remarks)) == (name == "g8_no_head.csv")


def test_other_columns_of_a_scan_are_left_out(tmp_path: Path) -> None:
    """Numbers of points before, colours behind; without heads the first three columns count."""
    lines = (CASES / "g8_ramp_control.csv").read_text().splitlines()
    named = [
        "point;X;Y;Z;R;class",
        *(f"P{k};{v.replace(',', ';')};12;rock" for k, v in enumerate(lines[1:])),
    ]
    (tmp_path / "named.txt").write_text("\n".join(named))
    bare = [f"{v.replace(',', ' ')} 12 0.5" for v in lines[1:]]
    (tmp_path / "bare.xyz").write_text("\n".join(bare))
    for name in ("named.txt", "bare.xyz"):
        found = read_heights(tmp_path / name)
        np.testing.assert_array_equal(found.height, control("g8_ramp_control.csv").height)


@pytest.mark.parametrize("name", ["g8_mm.csv", "g8_ramp_mm.csv"])
def test_units_of_heads_are_honoured(name: str) -> None:
    """In millimetres the same ground: so a cast onto the ramp goes as far, 8.99 m."""
    found, expected = control(name), control(name.replace("mm", "control"))
    for one, two in zip(found[:3], expected[:3], strict=True):
        np.testing.assert_allclose(one, two, rtol=0.0, atol=1e-9)


def test_a_unit_of_the_bench_file_is_for_files_without(tmp_path: Path) -> None:
    text = (CASES / "g8_ramp_mm.csv").read_text()
    (tmp_path / "bare.csv").write_text(text.replace(" [mm]", ""))
    found = read_heights(tmp_path / "bare.csv", "mm")
    np.testing.assert_allclose(found.height, control("g8_ramp_control.csv").height, atol=1e-9)
    with pytest.raises(SpecError, match=r"'x \[mm\]': its head gives the unit"):
        read_heights(CASES / "g8_ramp_mm.csv", "mm")
    with pytest.raises(SpecError, match="unit: kg: 'kg' is a mass; a length is needed"):
        make_spec({"heightmap": "a.csv", "unit": "kg"}, GroundSpec, "bench")


def test_scattered_points_are_brought_onto_a_grid() -> None:
    """165 points a metre off their grid of 3 m: said, and the ground of the control to 0.35 m."""
    found = control("g9_cloud.xyz")
    assert found.remarks[0].startswith("165 scattered points: brought onto a grid of 2.85 m")
    expected = ground("g8_control.csv", shift=SHIFT, floor="-100 m").walls
    read = ground("g9_cloud.xyz", shift=SHIFT, floor="-100 m").walls
    x, y = np.meshgrid(np.linspace(3.0, 38.0, 30), np.linspace(3.0, 26.0, 20))
    off = ground_height(read, x, y) - ground_height(expected, x, y)
    assert np.abs(off).max() < 1.0  # the points of the cloud keep the heights of the grid
    assert np.sqrt((off**2).mean()) < 0.35


def test_thirty_thousand_points_take_bounded_memory(tmp_path: Path) -> None:
    """A plane comes back as a plane; 30,000 x 30,000 places would be 7 GB."""
    rng = np.random.default_rng(0)
    plan = rng.uniform(0.0, 300.0, (30_000, 2)) + GRID[:2]
    height = 0.1 * (plan[:, 0] - 452300.0) - 0.05 * (plan[:, 1] - 7389200.0) + 600.0
    np.savetxt(tmp_path / "c.xyz", np.column_stack([plan, height]), fmt="%.4f", delimiter=";")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    found = read_heights(tmp_path / "c.xyz")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300_000  # kB
    known = np.isfinite(found.height)
    assert known.mean() > 0.95
    plane = 0.1 * (found.x[None, :] - 452300.0) - 0.05 * (found.y[:, None] - 7389200.0) + 600.0
    np.testing.assert_allclose(found.height[known], plane[known], atol=1e-3)
    coarse = read_heights(tmp_path / "c.xyz", spacing=10.0)
    assert np.diff(coarse.x).mean() == pytest.approx(10.0)
    with pytest.raises(SpecError, match=r"a grid of 0.01 m .* heights; .* set 'spacing'"):
        read_heights(tmp_path / "c.xyz", spacing=0.01)


def test_a_fine_grid_is_thinned(tmp_path: Path) -> None:
    """Linear in between, missing heights stay so; more than can be searched is one line."""
    x, y = np.arange(0.0, 30.25, 0.25), np.arange(-4.0, 20.25, 0.25)
    height = 0.2 * x[None, :] - 0.1 * y[:, None] + 3.0
    height[:3, :5] = np.nan
    np.savez(tmp_path / "g.npz", x=x, y=y, height=height)
    found = read_heights(tmp_path / "g.npz", spacing=1.6)
    assert "interpolated on a grid of 1.6 m (16 x 19 heights)" in found.remarks[0]
    plane = 0.2 * found.x[None, :] - 0.1 * found.y[:, None] + 3.0
    known = np.isfinite(found.height)
    np.testing.assert_allclose(found.height[known], plane[known], atol=1e-12)
    assert not known[0, 0]
    same = read_heights(tmp_path / "g.npz", spacing=0.25)
    np.testing.assert_array_equal(np.isnan(same.height[4:, 6:]), False)
    np.testing.assert_allclose(same.height[4:, 6:], height[4:, 6:], atol=1e-12)
    with pytest.raises(SpecError, match=r"spacing: 40 m: gives 1 x 1 heights over 30 x 24 m"):
        read_heights(tmp_path / "g.npz", spacing=40.0)
    np.savez(tmp_path / "g.npz", x0=0.0, y0=0.0, dx=0.1, height=np.ones((1000, 900)))
    with pytest.raises(SpecError, match=r"900,000 heights; at most 500,000 .* 'spacing: 0.15 m'"):
        read_heights(tmp_path / "g.npz")
    assert read_heights(tmp_path / "g.npz", spacing=0.2).height.size == 500 * 450


def test_points_on_one_line_are_no_surface(tmp_path: Path) -> None:
    (tmp_path / "l.csv").write_text("x,y,z\n" + "".join(f"{k},{k},1\n" for k in range(20)))
    with pytest.raises(SpecError, match="lie on one line"):
        read_heights(tmp_path / "l.csv")
    (tmp_path / "l.csv").write_text("x,y,z\n1,1,1\n2,2,2\n")
    with pytest.raises(SpecError, match="2 points; at least 3 are needed"):
        read_heights(tmp_path / "l.csv")


def test_missing_heights_do_not_spread_when_smoothed() -> None:
    x, y = np.arange(0.0, 12.0), np.arange(0.0, 9.0)
    height = np.full((9, 12), 3.0)
    height[0, :3] = np.nan
    found = smooth_heights(x, y, height, 1.5)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(height))
    np.testing.assert_allclose(found[np.isfinite(found)], 3.0, rtol=1e-12)
