"""The LIGGGHTS deck: what it holds, and that LIGGGHTS makes of it what theory and this package say.

LIGGGHTS asks for slip and rolling limits with the normal force of spring and dashpot together, and
its shear dashpot rests while a contact slips; this package does one or the other. So energies of a
flow agree to a per cent, where those of LAMMPS agree to a tenth of that.
"""

from __future__ import annotations

import re
import shutil
from math import atan2, exp, pi, sqrt
from pathlib import Path

import numpy as np
import pytest
from deck_cases import run_engine, two_blocks

from castblast.errors import SpecError
from castblast.export.engines.deck import read_loop_times
from castblast.export.engines.liggghts_deck import write_liggghts_deck
from castblast.export.engines.liggghts_walls import wall_kinds
from castblast.muckpile.balls.contact import ContactLaw
from castblast.muckpile.balls.particles import particles_at_rest
from castblast.muckpile.bench.geometry import Bench
from castblast.muckpile.bench.surroundings import bench_walls
from castblast.muckpile.cast.case import CastCase
from castblast.muckpile.cast.solver import run_cast
from castblast.muckpile.ground.terrain import heightmap
from castblast.muckpile.ground.walls import floor, join, slope

needs_liggghts = pytest.mark.skipif(
    shutil.which("liggghts") is None, reason="LIGGGHTS (liggghts) is not installed"
)
NO_BLOCKS = (np.zeros(0), np.zeros((0, 3)))


def final_state(folder: Path) -> np.ndarray:
    """Rows id type radius x y z vx vy vz wx wy wz, in the order of the balls of the case."""
    rows = np.loadtxt(folder / "final.dump", skiprows=9, ndmin=2)
    ball = np.loadtxt(folder / "balls.csv", delimiter=",", skiprows=1, ndmin=2)[:, 1].astype(int)
    return rows[np.argsort(ball)]


def thrown() -> CastCase:
    return two_blocks(ContactLaw(), [0.06, 0.0], [[3.0, 0.0, 0.0], [4.0, 0.0, 1.0]])


def test_atoms_are_numbered_as_they_are_fired_and_the_law_is_that_of_their_types(tmp_path):
    case = thrown()
    write_liggghts_deck(tmp_path, case, steps=100)
    words = (tmp_path / "cast.in").read_text()
    order = np.loadtxt(tmp_path / "balls.csv", delimiter=",", skiprows=1)[:, 1].astype(int)
    late = case.particles.block[order] == 0
    assert not late[: np.sum(~late)].any()
    assert f"group due id 1:{np.sum(~late)}\n" in words
    assert f"group due id {np.sum(~late) + 1}:240\n" in words
    assert words.count("velocity due set") == 2
    assert "run 100 pre no" in words
    text = (tmp_path / "balls.data").read_text().split("Atoms\n")[1].split("Velocities")[0]
    atoms = np.loadtxt(text.strip().splitlines())
    np.testing.assert_array_equal(atoms[:, 4:7], case.particles.position[order])
    # Three types of radius, one for rough walls, one for smooth ones.
    tables = {
        name: np.array(values.split(), dtype=float).reshape(5, 5)
        for name, values in re.findall(r"fix \w+ all property/global (\w+) \w+ 5 (.*)", words)
    }
    one, two, small = 0.08, 0.12, 4.0 / 3.0 * pi * 2600.0 * 0.08**3
    kn = pi * one**2 * 1e7 / (one + two)
    assert tables["kn"][0, 2] == tables["kn"][2, 0] == pytest.approx(kn, rel=1e-10)
    assert tables["kt"][0, 2] == pytest.approx(0.5 * kn, rel=1e-10)
    shared = small / (1.0 + (one / two) ** 3)
    assert tables["gamman"][0, 2] == pytest.approx(0.4 * sqrt(kn / shared), rel=1e-10)
    assert set(tables["coefficientFriction"][:3, 3:].ravel()) == {0.0, 0.5}


def test_walls_become_planes_and_triangles_within_reach():
    """Area of a clipped slope and of the rock around a bench, in a box that cuts them."""
    low, high = np.array([-10.0, -5.0, -1.0]), np.array([20.0, 15.0, 6.0])
    (kind,) = wall_kinds(join(floor(), slope(4.0, pi / 6.0)), low, high)
    assert kind.planes == ["zplane 0"]

    def area(corner):
        sides = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        return 0.5 * np.linalg.norm(sides, axis=1).sum()

    # The slope rises from the bottom of the box to its top over the whole of y.
    assert area(kind.corner) == pytest.approx(20.0 * 7.0 / np.sin(pi / 6.0))
    bench = Bench(length=8.0, width=6.0, height=4.0)
    (kind,) = wall_kinds(bench_walls(bench), low, high)
    assert area(kind.corner) == pytest.approx(20.0 * 5.0 + 20.0 * 4.0)
    ground = heightmap(np.arange(3.0), np.arange(3.0), np.ones((3, 3)), 0.1)
    kinds = wall_kinds(join(floor(), ground), low, high)
    assert sorted(len(kind.corner) for kind in kinds) == [0, len(ground.corner)]


def test_a_shear_dashpot_that_acts_while_slipping_is_refused(tmp_path):
    case = thrown()
    with pytest.raises(SpecError, match="LIGGGHTS deck: dashpot_mode = 1"):
        write_liggghts_deck(tmp_path, case._replace(law=ContactLaw(dashpot_mode=1)))
    assert not list(tmp_path.iterdir())


@needs_liggghts
def test_liggghts_bounces_and_rolls_a_ball_as_theory_says(tmp_path):
    """Two lone balls on a floor: one falls at 1 m/s, the other rolls at 1 m/s.

    The first leaves with e = exp(-(b/q) (pi - atan2(2 b q, 1 - 2 b^2))), q = sqrt(1 - b^2), without
    gravity; the second, under gravity, stops after 7 v^2/(10 mu_r g). Stiffness, dashpot, rolling
    spring and its limit of the deck are all in these.
    """
    radius = np.array([0.1])
    law = ContactLaw(rolling_friction=0.1)
    b = law.damping_normal
    q = sqrt(1.0 - b * b)
    restitution = exp(-(b / q) * (pi - atan2(2.0 * b * q, 1.0 - 2.0 * b * b)))
    ball = particles_at_rest([[0.0, 0.0, 0.1]], radius, velocity=[[0.0, 0.0, -1.0]])
    bounce = CastCase(ball, law, floor(), *NO_BLOCKS, gravity=0.0, time_step=1e-5)
    write_liggghts_deck(tmp_path / "bounce", bounce, steps=2000)
    run_engine("liggghts", tmp_path / "bounce")
    assert final_state(tmp_path / "bounce")[0, 8] == pytest.approx(restitution, rel=2e-3)

    weight = 4.0 / 3.0 * pi * 0.1**3 * law.density * 9.81
    sunk = weight / (pi * 0.1 * law.effective_modulus)
    ball = particles_at_rest([[0.0, 0.0, 0.1 - sunk]], radius, velocity=[[1.0, 0.0, 0.0]])
    ball.angular_velocity[0, 1] = 10.0
    roll = CastCase(ball, law, floor(), *NO_BLOCKS, time_step=1e-4)
    write_liggghts_deck(tmp_path / "roll", roll, steps=20000)
    run_engine("liggghts", tmp_path / "roll")
    assert final_state(tmp_path / "roll")[0, 3] == pytest.approx(0.7 / (0.1 * 9.81), rel=3e-3)


@needs_liggghts
def test_liggghts_throws_the_same_pile(tmp_path):
    """Energy to 1 per cent up to 0.2 s, while the flow is not yet chaotic; then the profile.

    Mass centre and median place of the mass within 0.1 m, mean height to 5 per cent.
    """
    case = thrown()
    write_liggghts_deck(tmp_path, case)
    log = run_engine("liggghts", tmp_path)
    rows = re.findall(r"^ *\d+ +(\S+) +240 +(\S+) *$", log, re.MULTILINE)
    time, energy = np.array(rows, dtype=float).T
    own = run_cast(case)
    for when in (0.05, 0.1, 0.2):
        there = np.interp(when, time, energy)
        here = np.interp(when, own.history.time, own.history.translational_energy)
        assert there == pytest.approx(here, rel=0.01), when
    theirs = final_state(tmp_path)
    mass = case.particles.radius**3 / np.sum(case.particles.radius**3)
    np.testing.assert_allclose(theirs[:, 2], case.particles.radius, rtol=1e-5)
    mine = own.particles.position
    np.testing.assert_allclose(mass @ theirs[:, 3], mass @ mine[:, 0], atol=0.1)
    np.testing.assert_allclose(np.median(theirs[:, 3]), np.median(mine[:, 0]), atol=0.1)
    assert mass @ theirs[:, 5] == pytest.approx(mass @ mine[:, 2], rel=0.05)


@needs_liggghts
def test_a_packed_block_that_is_fired_is_not_braked_by_the_deck(tmp_path):
    """Balls that touch, half of them fired at 8 m/s past the others: energy to 1 per cent.

    At the beginning of a run LIGGGHTS evaluates dashpots without the limit of slip. A deck that
    begins anew at a firing loses 7 per cent here. This package has the limits of LIGGGHTS here, and
    a step that is fine against the firing.
    """
    grid = np.stack(np.meshgrid(*[np.arange(6)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    place = 0.1 + 0.199 * grid
    balls = particles_at_rest(place, np.full(216, 0.1), (grid[:, 1] < 3).astype(int))
    case = CastCase(
        balls, ContactLaw(), floor(), np.array([1.0, 0.002]), np.tile([8.0, 0.0, 0.0], (2, 1)),
        max_time=0.03, sample_interval=1e-3,
    )  # fmt: skip
    write_liggghts_deck(tmp_path, case)
    rows = re.findall(
        r"^ *\d+ +(\S+) +216 +(\S+) *$", run_engine("liggghts", tmp_path), re.MULTILINE
    )
    time, energy = np.array(rows, dtype=float).T
    limits = ContactLaw(cap_on_total=True)
    own = run_cast(case._replace(law=limits, time_step=2e-5)).history
    for when in (0.006, 0.012, 0.024):
        here = np.interp(when, own.time, own.translational_energy)
        assert np.interp(when, time, energy) == pytest.approx(here, rel=0.01), when


@needs_liggghts
def test_loop_times_are_read_from_the_log(tmp_path):
    case = thrown()._replace(block_delay=NO_BLOCKS[0], block_velocity=NO_BLOCKS[1])
    balls = case.particles._replace(block=np.full(240, -1))
    write_liggghts_deck(tmp_path, case._replace(particles=balls), radius_bins=1, steps=50)
    run_engine("liggghts", tmp_path)
    (first,) = read_loop_times(tmp_path / "log.engine")
    assert first.seconds > 0.0
    assert (first.processes, first.steps, first.balls) == (1, 50, 240)
