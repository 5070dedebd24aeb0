"""Files of balls as engines and tools write them: the same 250 balls, or a line with the remedy."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from castblast.errors import SpecError
from castblast.muckpile.balls.particles import Particles
from castblast.specs.bench.balls.files import read_balls

DATA = Path(__file__).parents[2] / "data" / "balls"
CONTROL = read_balls(DATA / "q0_control.csv")

SAME = {
    "q1_lammps.dump": 0.0,
    "q2_lammps.data": 0.0,
    "q4_yade.txt": 0.0,
    "q5_ext.xyz": 0.0,
    "q7_pfc_ids.csv": 0.0,
    "q9_diameter.csv": 0.0,
    "q10_semicolon.csv": 0.0,
    "q11_paraview.csv": 0.0,
    "q14_caps.csv": 0.0,
    "q15_spaces.csv": 0.0,
    "q18_ft.csv": 2e-5,  # feet to four decimals
}


def said(path: Path) -> str:
    with pytest.raises(SpecError) as caught:
        read_balls(path)
    return str(caught.value).replace(f"{path.parent}/", "")


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


@pytest.mark.parametrize(("name", "apart"), SAME.items())
def test_the_same_balls_in_any_form(name: str, apart: float) -> None:
    balls = read_balls(DATA / name)
    assert balls.position == pytest.approx(CONTROL.position, rel=1e-12, abs=apart)
    assert balls.radius == pytest.approx(CONTROL.radius, rel=1e-12, abs=apart)
    assert not balls.velocity.any()
    assert (balls.block == -1).all()


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("q13_dup.csv", "lines 2 and 252: two balls at one place"),
        ("q21_fortran_d.csv", "line 2: x: -5.5000D+00: a number is needed; write its exponent"),
        ("q23_single.npy", "is an array of NumPy (.npy), which has no names"),
        ("q6_packing.xyzd", "holds bytes that are not text; save it as UTF-8"),
    ],
)
def test_what_is_not_read_is_said(name: str, line: str) -> None:
    words = said(DATA / name)
    assert words.startswith(f"{name}: {line}")
    if not name.endswith(".csv"):
        assert words.endswith(".npz, dump and data files of LAMMPS, and extended XYZ")
        assert len(words.splitlines()) == 1


DUMP = """ITEM: TIMESTEP
0
ITEM: NUMBER OF ATOMS
2
ITEM: BOX BOUNDS ff ff ff
-10 40
-5 20
-1 20
ITEM: ATOMS id type diameter x y z vx vy vz mol omegax omegay omegaz
2 1 1.0 9 9 9 0 0 0 0 0 0 0
1 1 0.5 8 8 8 0 0 0 0 0 0 0
"""


def test_the_last_frame_of_a_dump_in_the_order_of_ids(tmp_path: Path) -> None:
    """As `write_dump ... final.dump` of our decks: other order, radii as diameters, spins."""
    last = DUMP.replace("9 9 9 0 0 0 0 0 0 0", "1 2 0.5 3 0 -1 7 0 0 4")
    balls = read_balls(written(tmp_path, "final.dump", DUMP + last))
    assert balls.position.tolist() == [[8.0, 8.0, 8.0], [1.0, 2.0, 0.5]]
    assert balls.radius.tolist() == [0.25, 0.5]
    assert balls.velocity[1].tolist() == [3.0, 0.0, -1.0]
    assert balls.angular_velocity[1].tolist() == [0.0, 0.0, 4.0]


def test_a_data_file_with_motion_and_images(tmp_path: Path) -> None:
    text = (
        "made by a deck\n\n2 atoms\n1 atom types\n\n0 1 xlo xhi\n\nAtoms\n\n"
        "2 1 1.0 2600 1 2 0.5 0 0 0\n1 1 0.5 2600 8 8 8 0 0 0\n\n"
        "Velocities\n\n1 0 0 0 0 0 0\n2 3 0 -1 0 0 4\n\nFiring\n\n1 0\n2 1\n"
    )
    balls = read_balls(written(tmp_path, "balls.data", text))
    assert balls.position[1].tolist() == [1.0, 2.0, 0.5]
    assert balls.velocity[1].tolist() == [3.0, 0.0, -1.0]


def test_the_balls_of_our_own_deck_come_back(tmp_path: Path) -> None:
    from castblast.export.engines.lammps_deck import write_lammps_deck
    from castblast.muckpile.balls.contact import ContactLaw
    from castblast.muckpile.cast.case import CastCase
    from castblast.muckpile.ground.walls import floor

    count = len(CONTROL.radius)
    balls: Particles = CONTROL._replace(block=np.zeros(count, dtype=np.int64))
    case = CastCase(balls, ContactLaw(), floor(), np.zeros(1), np.array([[5.0, 0.0, 0.0]]))
    data, _ = write_lammps_deck(tmp_path, case)
    again = read_balls(data)
    assert again.position.tolist() == balls.position.tolist()
    assert again.radius == pytest.approx(balls.radius, rel=1e-12)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (("ITEM: NUMBER OF ATOMS\n2", "ITEM: NUMBER OF ATOMS\n3"), "has 2 of 3 balls: cut short?"),
        ((" x y z ", " xs ys zs "), "line 9: places are scaled by the box; dump x y z"),
        (("diameter", "mass"), "the column 'radius' is missing"),
        (("1 1 0.5 8", "2 1 0.5 8"), "lines 10 and 11: id '2': given twice"),
        (("1 1 0.5 8", "1 1 nan 8"), "line 11 (id '1'): diameter: nan: a number is needed"),
        (("1 1 0.5 8", "1 1 500 8"), "diameter: 500 m: implausible (500 m); allowed: 0.002 to 36"),
        (("1 1 0.5 8", "x 1 0.5 8"), "id: a whole number is needed"),
        (("ITEM: ATOMS", "ITEM: ATOMZ"), "is a dump without 'ITEM: ATOMS'"),
    ],
)
def test_faulty_dumps(change: tuple[str, str], line: str, tmp_path: Path) -> None:
    assert line in said(written(tmp_path, "final.dump", DUMP.replace(*change)))


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("2 atoms\n\nMasses\n\n1 1\n", "is a LAMMPS data file without a section 'Atoms'"),
        ("1 atoms\n\nAtoms # bond\n\n1 1 1 0 0 0\n", "atoms of style 'bond'; 'atom_style sphere'"),
        ("1 atoms\n\nAtoms\n\n1 1 0 0 0\n", "atoms of 5 columns; 'atom_style sphere' is read"),
        ("3\nProperties=pos:R:3:radius:R:1\n0 0 0 1\n", "1 of 3 balls: cut short?"),
        ("2\nProperties=pos:R:3\n0 0 0\n5 0 0\n", "the column 'radius' is missing"),
        ("x,y,z,radius,diameter\n0,0,0,1,1\n", "line 2: the diameter is not twice the radius"),
        ("x,y,z,radius\n0,0,0,20\n", "line 2: radius: 20 m: implausible (20 m); allowed: 0.001"),
        ("x,y,z,radius\n0,0,0,-0.5\n", "radius: -0.5 m: implausible (-0.5 m); allowed: 0.001 to"),
        ("x,y,z,radius\n7389212,0,0,1\n", "x: 7.38921e+06 m: implausible"),
        ("x,y,z,r\n0,0,0,1\n0,0,1.5,1\n", "worst: balls 0 (line 2) and 1 (line 3) by 50 %"),
    ],
)
def test_faulty_tables(text: str, line: str, tmp_path: Path) -> None:
    assert line in said(written(tmp_path, "balls.txt", text))


def test_arrays_have_the_bounds_of_tables(tmp_path: Path) -> None:
    path = tmp_path / "balls.npz"
    np.savez(path, x=[[0.0, 0.0, 0.0], [50.0, 0.0, 0.0]], r=[1.0, 20.0])
    assert re.search(r"r: ball 1: implausible \(20 m\); allowed: 0.001 to 18 m", said(path))
