"""Surfaces as mine tools and scanners write them: mended and said, or refused in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ground_files import BENCH, CASES, GRID, SHIFT, ground

from castblast.cli import main
from castblast.errors import SpecError
from castblast.muckpile.ground.walls import ground_height
from castblast.specs.bench.ground.heights import read_heights
from castblast.specs.bench.ground.stl import load_stl
from castblast.specs.bench.ore import read_ore


def stl(path: Path, corner: np.ndarray) -> str:
    """Write a text STL with four decimals; returns its name."""
    lines = ["solid topo"]
    for facet in corner:
        lines += ["facet normal 0 0 0", " outer loop"]
        lines += ["  vertex " + " ".join(f"{value:.4f}" for value in place) for place in facet]
        lines += [" endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid topo"]) + "\n")
    return path.name


@pytest.fixture(scope="module")
def sound() -> np.ndarray:
    pytest.importorskip("trimesh")
    return load_stl(CASES / "s0_control.stl").corner


# ---------------------------------------------------------------------------------- surfaces
@pytest.mark.parametrize(
    ("name", "remark"),
    [
        ("down", "280 facets faced away from the balls (facet 0, 1, 2 and 277 more): turned"),
        ("one", "1 facet faced away from the balls (facet 20): turned"),
        ("doubled", "1 facet lay on another with the same corners (facet 280): dropped"),
        ("sliver", "1 facet had no height (facet 280): dropped"),
    ],
)
def test_surfaces_are_mended_and_it_is_said(
    tmp_path: Path, sound: np.ndarray, name: str, remark: str
) -> None:
    """The sound surface comes back; with `mend: false` the same facets are refused."""
    bad = sound.copy()
    if name == "down":
        bad = sound[:, ::-1]
    elif name == "one":
        bad[20] = sound[20, ::-1]
    elif name == "doubled":
        bad = np.concatenate([sound, sound[[10]]])
    else:
        a, b = sound[0, 0], sound[0, 1]
        bad = np.concatenate([sound, np.stack([a, b, np.round(0.5 * (a + b), 4)])[None]])
    file = stl(tmp_path / f"{name}.stl", bad)
    read = ground(file, tmp_path)
    assert f"{tmp_path / file}: {remark}" in read.remarks
    expected = ground("s0_control.stl").walls
    x, y = np.meshgrid(np.linspace(0.1, 41.9, 60), np.linspace(0.1, 29.9, 40))
    np.testing.assert_array_equal(ground_height(read.walls, x, y), ground_height(expected, x, y))
    with pytest.raises(SpecError) as caught:
        ground(file, tmp_path, mend=False)
    refused = remark.rpartition(":")[0]
    assert f"{refused}; not {remark.split()[-1]}, since 'mend' is false" in str(caught.value)


def test_corners_a_fraction_of_a_millimetre_apart_are_joined(
    tmp_path: Path, sound: np.ndarray
) -> None:
    rng = np.random.default_rng(0)
    loose = sound + rng.uniform(-2e-4, 2e-4, sound.shape) * [1.0, 1.0, 0.0]
    read = ground(stl(tmp_path / "loose.stl", loose), tmp_path)
    assert len(np.unique(read.walls.corner.reshape(-1, 3), axis=0)) == 15 * 11
    assert "had corners just beside those of others" in read.remarks[0]
    # Sheets 2 cm apart are two, until the bench file says otherwise.
    apart = sound * [-1.0, 1.0, 1.0] - [0.02, 0.0, 0.0]
    file = stl(tmp_path / "two.stl", np.concatenate([sound, apart]))
    read = ground(file, tmp_path)
    assert any(
        "22 corners at its rims" in line and "'weld: 20 mm'" in line for line in read.remarks
    )
    read = ground(file, tmp_path, weld="25 mm")
    assert not any("at its rims" in line for line in read.remarks)
    with pytest.raises(SpecError, match=r"weld: 0.9 m: too far for facets with sides of 3"):
        ground(file, tmp_path, weld="0.9 m")


def test_a_surface_in_the_grid_of_the_mine_is_refused_with_its_offset(
    tmp_path: Path, sound: np.ndarray
) -> None:
    far = sound + GRID
    file = stl(tmp_path / "far.stl", far)
    with pytest.raises(SpecError) as caught:
        ground(file, tmp_path)
    line = str(caught.value)
    assert "lies 7,403 km from the bench at its nearest (x from 452300 to 452342 m" in line
    assert "'shift' would have to be [-452300 m, -7389200 m, -597 m]" in line
    shift = ["-452300 m", "-7389200 m", "-597 m"]
    corner = ground(file, tmp_path, shift=shift).walls.corner
    np.testing.assert_allclose(corner.min(axis=(0, 1)), [0.0, 0.0, 0.15], atol=2e-4)
    # A shift in plan only leaves it hundreds of metres above the bench.
    with pytest.raises(SpecError, match=r"591 m above the top of the bench; 'shift' .*-597 m\]"):
        ground(file, tmp_path, shift=[*shift[:2], "0 m"])
    with pytest.raises(SpecError, match=r"g8_control.csv: lies 7,403 km from the bench"):
        ground("g8_control.csv")


def test_the_command_line_refuses_it_before_packing(
    tmp_path: Path, sound: np.ndarray, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line, exit code 2, nothing written."""
    bench = tmp_path / "bench.yaml"
    bench.write_text(
        "name: far\nvelocity: 9 m/s\nballs: {count: 120}\nground: far.stl\n"
        "bench: {length: 12 m, width: 6 m, height: 6 m, burden: 3 m, spacing: 3 m}\n"
    )
    stl(tmp_path / "far.stl", sound + GRID)
    assert main(["muckpile", str(bench), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1
    assert said[0].startswith(f"error: {tmp_path / 'far.stl'}: lies 7,403 km from the bench")
    assert not (tmp_path / "out").exists()


def test_single_precision_in_the_grid_of_the_mine_is_said(
    tmp_path: Path, sound: np.ndarray
) -> None:
    """Half a metre at 7,389,200 m north; nothing to say of a survey of local coordinates."""
    far = sound + GRID
    for name, corner in (("far.stl", far), ("near.stl", sound)):
        facets = np.zeros(len(corner), [("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
        facets["v"] = corner
        data = b" " * 80 + np.uint32(len(corner)).tobytes() + facets.tobytes()
        (tmp_path / name).write_bytes(data)
    remarks = ground("far.stl", tmp_path, shift=SHIFT).remarks
    assert any("up to 7389230 in single precision are rounded to 0.5 m" in r for r in remarks)
    assert not any("single precision" in r for r in ground("near.stl", tmp_path).remarks)
    x, y = np.arange(5.0) * 3.0 + 452300.0, np.arange(4.0) * 3.0 + 7389200.0
    np.savez(
        tmp_path / "g.npz", x=x.astype(np.float32), y=y.astype(np.float32), height=np.ones((4, 5))
    )
    assert "rounded to 0.5 m" in read_heights(tmp_path / "g.npz").remarks[0]


def test_a_surface_in_millimetres_is_refused_with_its_unit(
    tmp_path: Path, sound: np.ndarray
) -> None:
    file = stl(tmp_path / "mm.stl", 1e3 * sound)
    with pytest.raises(SpecError, match=r"is 42 km long, .* in mm\? then say 'unit: mm'"):
        ground(file, tmp_path)
    corner = ground(file, tmp_path, unit="mm").walls.corner
    np.testing.assert_allclose(corner, ground("s0_control.stl").walls.corner, atol=1e-9)
    with pytest.raises(SpecError, match=r"is 4.2 cm long, .* in km\? then say 'unit: km'"):
        ground(stl(tmp_path / "km.stl", 1e-3 * sound), tmp_path)


def test_ground_far_from_the_bench_is_remarked_upon() -> None:
    """A berm 100 m ahead may be right; ground below the floor is never touched."""
    remarks = ground("g8_ramp_control.csv", shift=["98 m", "0 m", "0 m"]).remarks
    assert any("lies 100 m from the bench at its nearest" in line for line in remarks)
    remarks = ground("g8_ramp_control.csv", shift=["0 m", "0 m", "-3 m"]).remarks
    assert any("lie below the floor at 0 m, the lowest at -3 m" in line for line in remarks)
    assert ground("g8_ramp_control.csv").remarks == ()


def test_ore_in_the_grid_of_the_mine_is_refused_with_its_offset(tmp_path: Path) -> None:
    def ore(x: float, y: float, factor: float = 1.0) -> Path:
        corners = factor * np.array([[x, y], [x + 3, y], [x + 3, y + 4], [x, y + 4]])
        path = tmp_path / "ore.csv"
        path.write_text("name,x,y\n" + "".join(f"a,{p},{q}\n" for p, q in corners.tolist()))
        return path

    assert len(read_ore(ore(-5.0, 3.0), BENCH)) == 1
    with pytest.raises(SpecError) as caught:
        read_ore(ore(452295.0, 7389204.0), BENCH)
    assert "km from the bench at its nearest" in str(caught.value)
    assert "move the corners by [-452300 m, -7389200 m], or say in 'frame'" in str(caught.value)
    with pytest.raises(SpecError, match=r"in mm\? give heads with it, 'x \[mm\]'"):
        read_ore(ore(-5.0, 3.0, 1e3), BENCH)
