"""Files of ground: heights and STL surfaces are read as written, faults are named by place."""

from __future__ import annotations

import re
from math import inf, pi

import numpy as np
import pytest

from castblast.errors import SpecError
from castblast.muckpile.balls.particles import particles_at_rest
from castblast.muckpile.ground.terrain import heightmap, surface_faults, wall_faults
from castblast.muckpile.ground.walls import floor, ground_height, join, slope, surface
from castblast.specs.bench.ground.heights import Heights, read_heights
from castblast.specs.bench.ground.spec import GroundSpec, one_or_many, read_ground, smooth_heights
from castblast.specs.bench.ground.stl import load_stl
from castblast.specs.loading import make_spec

X, Y = np.array([0.0, 1.0, 2.0, 3.0]), np.array([10.0, 11.0, 12.0])
HEIGHT = np.arange(12.0).reshape(3, 4) ** 2 / 50.0


def same(found: Heights):
    for got, given in zip(found[:3], (X, Y, HEIGHT), strict=True):
        np.testing.assert_allclose(got, given, atol=1e-12)


def test_all_formats_give_the_same_grid(tmp_path):
    np.savez(tmp_path / "axes.npz", x=X, y=Y, height=HEIGHT)
    np.savez(tmp_path / "step.npz", x0=0.0, y0=10.0, dx=1.0, height=HEIGHT)
    points = np.column_stack([g.ravel() for g in (*np.meshgrid(X, Y), HEIGHT)])
    mixed = points[np.random.default_rng(0).permutation(12)]
    np.savetxt(tmp_path / "p.csv", mixed, delimiter=",", header="x [m],y [m],z [m]", comments="")
    rows = "\n".join(" ".join(f"{v:.17g}" for v in row) for row in HEIGHT[::-1])
    header = "ncols 4\nnrows 3\nxllcorner -0.5\nyllcorner 9.5\ncellsize 1\nNODATA_value -9999\n"
    (tmp_path / "g.asc").write_text(header + rows)
    for name in ("axes.npz", "step.npz", "p.csv", "g.asc"):
        same(read_heights(tmp_path / name))


def test_heights_between_the_places_are_those_of_the_facets():
    """Corners exact; a bilinear twist stays between its diagonals; beyond the map the floor."""
    ground = heightmap(X, Y, HEIGHT)
    grid = np.meshgrid(X, Y)
    np.testing.assert_allclose(ground_height(ground, *grid), HEIGHT, atol=1e-12)
    level = heightmap(X, Y, np.tile(0.3 * X, (3, 1)) + 0.2 * Y[:, None])
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0.0, 3.0, 200), rng.uniform(10.0, 12.0, 200)
    np.testing.assert_allclose(ground_height(level, x, y), 0.3 * x + 0.2 * y, atol=1e-12)
    outside = ground_height(join(floor(), level), np.array([-1.0, 4.0]), np.array([11.0, 11.0]))
    np.testing.assert_array_equal(outside, 0.0)


def test_faults_of_heights_are_named_by_row_and_column(tmp_path):
    bad = HEIGHT.copy()
    bad[1, 2] = np.nan
    np.savez(tmp_path / "nan.npz", x=X, y=Y[::-1], height=bad)
    with pytest.raises(SpecError, match="y: must rise"):
        read_heights(tmp_path / "nan.npz")
    bad = np.ones((6, 5))
    bad[2, 2] = np.nan
    np.savez(tmp_path / "nan.npz", x=np.arange(5.0), y=np.arange(6.0), height=bad)
    with pytest.raises(SpecError, match="hole, first in row 2, column 2"):
        read_heights(tmp_path / "nan.npz")
    (tmp_path / "p.csv").write_text("x,y,z\n0,0,1\n1,0,one\n")
    with pytest.raises(SpecError, match="line 3"):
        read_heights(tmp_path / "p.csv")
    (tmp_path / "p.csv").write_text("x,y,z\n0,0,1\n1,0,1\n0,1,1\n")
    with pytest.raises(SpecError, match="row 1, column 1"):
        read_heights(tmp_path / "p.csv")
    (tmp_path / "p.csv").write_text("x,y,z\n0,0,1\n1,0,1\n0,1,1\n0,0,2\n")
    with pytest.raises(SpecError, match="two heights"):
        read_heights(tmp_path / "p.csv")
    header = "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n"
    (tmp_path / "g.asc").write_text(header + "1 2\n3 -9999\n")
    with pytest.raises(SpecError, match="row 0, column 1"):
        read_heights(tmp_path / "g.asc")
    np.savez(tmp_path / "k.npz", x=X, y=Y, heigth=HEIGHT)
    with pytest.raises(SpecError, match="height"):
        read_heights(tmp_path / "k.npz")
    for name in ("gone.npz", "gone.csv", "gone.asc", "gone.txt"):
        with pytest.raises(SpecError, match=name):
            read_heights(tmp_path / name)


def sheet(n=4):
    """Corners of a flat sheet of n by n cells."""
    return heightmap(np.arange(n + 1.0), np.arange(n + 1.0), np.zeros((n + 1, n + 1))).corner


def test_faults_of_facets_are_named_by_number():
    good = sheet()
    assert surface_faults(good) == []
    broken = good.copy()
    broken[5, 2] = broken[5, 1]
    assert "facet 5" in surface_faults(broken)[0]
    broken = good.copy()
    broken[7, 0, 0] = np.nan
    assert "facet 7" in surface_faults(broken)[0]
    broken = good.copy()
    broken[9] = broken[9, ::-1]
    assert any("turned" in line and "9" in line for line in surface_faults(broken))
    fin = np.array([[good[10][0], good[10][1], good[10][0] + [0, 0, 1.0]]])
    assert any("more than one" in line for line in surface_faults(np.concatenate([good, fin])))
    inner = 2 * (4 * 1 + 1)
    assert any("hole" in line for line in surface_faults(np.delete(good, inner, axis=0)))
    assert surface_faults(good[:0]) != []
    # Two sheets apart have a rim each, and that is no hole.
    assert surface_faults(np.concatenate([good, good + np.array([100.0, 0.0, 0.0])])) == []


def test_stl_files_are_read_and_refused(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    corner = sheet()
    mesh = trimesh.Trimesh(corner.reshape(-1, 3), np.arange(len(corner) * 3).reshape(-1, 3))
    mesh.export(tmp_path / "sheet.stl")
    found = load_stl(tmp_path / "sheet.stl")
    assert found.single
    np.testing.assert_allclose(found.corner, corner, atol=1e-6)
    holed = np.delete(corner, 10, axis=0)
    mesh = trimesh.Trimesh(holed.reshape(-1, 3), np.arange(len(holed) * 3).reshape(-1, 3))
    mesh.export(tmp_path / "holed.stl")
    with pytest.raises(SpecError, match="hole"):
        read_ground((make_spec({"stl": "holed.stl"}, GroundSpec, "b"),), tmp_path)
    spec = make_spec({"stl": "sheet.stl", "shift": ["0 m", "0 m", "2 m"]}, GroundSpec, "b")
    walls = read_ground((spec,), tmp_path).walls
    assert ground_height(walls, np.array([1.3]), np.array([2.2]))[0] == pytest.approx(2.0)


def test_damaged_stl_files_are_one_line(tmp_path):
    """Cut off, of another length than stated, huge by its word, or no STL: one line each."""
    trimesh = pytest.importorskip("trimesh")
    corner = sheet()
    mesh = trimesh.Trimesh(corner.reshape(-1, 3), np.arange(len(corner) * 3).reshape(-1, 3))
    binary = mesh.export(file_type="stl")
    text = mesh.export(file_type="stl_ascii").encode()
    bad = np.frombuffer(binary, np.uint8).copy()
    bad[84 + 12 : 84 + 16] = np.frombuffer(np.float32(np.nan).tobytes(), np.uint8)
    cases = {
        "short.stl": (binary[:-7], "stated take"),
        "huge.stl": (binary[:80] + b"\xff\xff\xff\xff" + binary[84:], "4,294,967,295 facets"),
        "nan.stl": (bad.tobytes(), "facet 0: a corner is not a number"),
        "cut.stl": (text[: len(text) // 2], "is cut off: its last line"),
        "open.stl": (text[: text.rfind(b"endsolid")], "is cut off: its last line"),
        "words.stl": (text.replace(b"vertex 1", b"vertex one", 1), ""),
        "bad.stl": (b"solid nothing\n", ""),
        "none.stl": (b"solid a\nendsolid a\n", "holds no facet"),
        "empty.stl": (b"", "is not an STL file: 0 bytes"),
        "zip.stl": (b"PK" + bytes(200), "is not an STL file"),
    }
    for name, (content, words) in cases.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(SpecError) as caught:
            load_stl(tmp_path / name)
        line = str(caught.value)
        assert line.startswith(f"{tmp_path / name}: "), line
        assert words in line
        assert "\n" not in line
    with pytest.raises(SpecError, match=r"gone.stl: no such file"):
        load_stl(tmp_path / "gone.stl")
    # Solids one after the other, and decimal commas, are read whole.
    (tmp_path / "two.stl").write_bytes(text + text)
    np.testing.assert_allclose(load_stl(tmp_path / "two.stl").corner, np.tile(corner, (2, 1, 1)))
    (tmp_path / "comma.stl").write_bytes(text.replace(b".", b","))
    np.testing.assert_allclose(load_stl(tmp_path / "comma.stl").corner, corner, atol=1e-6)


def test_ground_in_a_bench_file(tmp_path):
    """A name, a group or a list; shift and friction reach the walls; both kinds are too many."""
    assert one_or_many("pile.npz") == [{"heightmap": "pile.npz"}]
    assert one_or_many("pit.STL") == [{"stl": "pit.STL"}]
    np.savez(tmp_path / "pile.npz", x=X, y=Y, height=HEIGHT)
    spec = make_spec(
        {"heightmap": "pile.npz", "shift": ["1 m", "0 m", "50 cm"], "friction": 0.7},
        GroundSpec,
        "bench.yaml",
    )
    walls = read_ground((spec,), tmp_path).walls
    assert ground_height(walls, np.array([4.0]), np.array([12.0]))[0] == HEIGHT[-1, -1] + 0.5
    assert (walls.facet_friction == 0.7).all()
    with pytest.raises(SpecError, match="exactly one"):
        make_spec({"heightmap": "a.npz", "stl": "b.stl"}, GroundSpec, "bench.yaml")
    assert len(read_ground((), tmp_path).walls.corner) == 0


def test_heights_are_smoothed_and_extended(tmp_path):
    """Level ground stays, an inclined plane stays inside, a spike keeps its volume and spreads.

    Over an uneven grid as well; the spread is the variance of the weights.
    """
    x = np.concatenate([np.arange(0.0, 20.0, 0.5), np.arange(20.0, 40.1, 0.25)])
    y = np.arange(0.0, 30.0, 0.4)
    plane = 1.0 + 0.3 * x[None, :] + 0.2 * y[:, None]
    inside = np.ix_((y > 8.0) & (y < 22.0), (x > 8.0) & (x < 16.0))
    np.testing.assert_allclose(smooth_heights(x, y, plane, 1.0)[inside], plane[inside], rtol=1e-6)
    assert np.ptp(smooth_heights(x, y, np.full_like(plane, 3.0), 2.0)) < 1e-12
    spike = np.zeros_like(plane)
    spike[37, 20] = 5.0
    found = smooth_heights(x, y, spike, 1.0)
    assert found.sum() * 0.5 * 0.4 == pytest.approx(5.0 * 0.5 * 0.4, rel=1e-6)
    spread = (found.sum(axis=0) @ (x - x[20]) ** 2) / found.sum()
    assert spread == pytest.approx(1.0, rel=1e-3)
    np.savez(tmp_path / "pile.npz", x=X, y=Y, height=HEIGHT)
    names = {"heightmap": "pile.npz", "smooth": "1 m", "extend": "2 m"}
    walls = read_ground((make_spec(names, GroundSpec, "bench.yaml"),), tmp_path).walls
    assert walls.corner[..., 0].min() == X[0] - 2.0
    assert walls.corner[..., 1].max() == Y[-1] + 2.0
    with pytest.raises(SpecError, match="go with a heightmap"):
        make_spec({"stl": "a.stl", "smooth": "1 m"}, GroundSpec, "bench.yaml")


def test_a_wall_that_cuts_balls_is_named():
    """A slope through a packing, facets through it, and balls under the ground."""
    places = np.arange(5) * 0.2 + 0.1
    position = np.array([[x, 0.5, z] for x in places for z in places])
    balls = particles_at_rest(position, np.full(len(position), 0.1))
    assert wall_faults(floor(), balls) == []
    assert wall_faults(join(floor(), slope(1.2, pi / 6.0)), balls) == []
    assert "wall 1 cuts" in wall_faults(join(floor(), slope(0.6, pi / 6.0)), balls)[0]
    across = [
        [[-1, -1, 0.5], [3, -1, 0.5], [3, 3, 0.5]],
        [[-1, -1, 0.5], [3, 3, 0.5], [-1, 3, 0.5]],
    ]
    faults = wall_faults(join(floor(), surface(across)), balls)
    assert any("facet" in line for line in faults)
    ends = np.array([-1.0, 2.0])
    buried = wall_faults(heightmap(ends, ends, np.full((2, 2), 0.95), base=-inf), balls)
    # Those that the ground holds count as cut, those deeper as below it.
    counted = [int(re.search(r"(\d+) balls? of the packing", line)[1]) for line in buried]
    assert sum(counted) == 25
    assert any("below the ground" in line for line in buried)
