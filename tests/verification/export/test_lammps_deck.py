"""The LAMMPS deck: what it holds, and that LAMMPS makes of it what this package computes itself.

Case of the comparison: 240 balls of three radii in two blocks on a floor between frictionless
mirrors, a wall behind, a slope before; the blocks are fired 60 ms apart at 4 and 3 m/s. The limits
of slip and rolling are asked of spring and dashpot together, as LAMMPS does.
"""

from __future__ import annotations

import re
import shutil
from math import pi

import numpy as np
import pytest
from deck_cases import run_engine, two_blocks

from castblast.errors import SpecError
from castblast.export.engines.deck import plan_firings, radius_types, time_step
from castblast.export.engines.lammps_deck import restitution_for, write_lammps_deck
from castblast.muckpile.balls.contact import ContactLaw
from castblast.muckpile.bench.geometry import Bench
from castblast.muckpile.bench.surroundings import bench_walls
from castblast.muckpile.cast.case import CastCase
from castblast.muckpile.cast.solver import run_cast
from castblast.muckpile.ground.terrain import heightmap
from castblast.muckpile.ground.walls import join, rectangle, slope

LAW = ContactLaw(cap_on_total=True, dashpot_mode=1)


def small_case(**changes) -> CastCase:
    case = two_blocks(LAW, [0.0, 0.06], [[4.0, 0.0, 1.0], [3.0, 0.0, 0.0]])
    return case._replace(**changes)


def test_restitution_for_twice_the_share_of_critical_damping():
    """Alpha(e) = 0.4 at e = 0.44035; no damping is e = 1; alpha(e) is 2 b everywhere."""
    assert restitution_for(0.2) == pytest.approx(0.44035, abs=5e-6)
    assert restitution_for(0.0) == 1.0
    for damping in (0.05, 0.3, 0.6):
        e = restitution_for(damping)
        alpha = 1.2728 - 4.2783 * e + 11.087 * e**2 - 22.348 * e**3
        alpha += 27.467 * e**4 - 18.022 * e**5 + 4.8218 * e**6
        assert alpha == pytest.approx(2.0 * damping, abs=1e-9)


def test_few_radii_are_exact_and_many_are_binned():
    """Stiffness of a pair from ten bins: rms error below 8 per cent, mean below 1.5 per cent."""
    few = np.array([0.1, 0.3, 0.1, 0.2])
    types = radius_types(few, 10)
    np.testing.assert_array_equal(types.radius[types.type], few)
    radius = np.random.default_rng(0).uniform(0.1, 0.3, 4000)
    binned = radius_types(radius, 10)
    assert len(binned.radius) == 10
    typical = binned.radius[binned.type]

    def stiffness(r):
        one, two = r[:2000], r[2000:]
        return np.minimum(one, two) ** 2 / (one + two)

    error = stiffness(typical) / stiffness(radius) - 1.0
    assert np.sqrt(np.mean(error**2)) < 0.08
    assert abs(error.mean()) < 0.015


def test_the_deck_holds_the_case(tmp_path):
    """Counts, types, walls, firings and their balls, read back from the files."""
    case = small_case()
    data, script = write_lammps_deck(tmp_path, case)
    text, words = data.read_text(), script.read_text()
    atoms = np.loadtxt(text.split("Atoms\n")[1].split("Velocities")[0].strip().splitlines())
    balls = case.particles
    np.testing.assert_array_equal(atoms[:, 0], np.arange(1, 241))
    np.testing.assert_array_equal(atoms[:, 2], 2.0 * balls.radius)
    np.testing.assert_array_equal(atoms[:, 4:7], balls.position)
    firing = np.loadtxt(text.split("Firing\n")[1].strip().splitlines())[:, 1]
    np.testing.assert_array_equal(firing, balls.block + 1)
    pairs = re.findall(r"pair_coeff (\d) (\d) hooke ([\d.e+]+)", words)
    assert len(pairs) == 6
    radius = np.array([0.08, 0.10, 0.12])
    for i, j, kn in pairs:
        one, two = radius[int(i) - 1], radius[int(j) - 1]
        assert float(kn) == pytest.approx(pi * min(one, two) ** 2 * 1e7 / (one + two), rel=1e-10)
    assert len(re.findall(r"^region ", words, re.MULTILINE)) == 5
    assert len(re.findall(r"wall/gran/region", words)) == 15
    assert words.count("velocity due set") == 2
    step = float(re.search(r"timestep (\S+)", words).group(1))
    steps = sum(map(int, re.findall(r"^run ([1-9]\d*) pre", words, re.MULTILINE)[:1]))
    assert steps * step == pytest.approx(0.06, rel=1e-10)


def test_blocks_of_one_time_and_velocity_go_together_and_others_are_held():
    case = small_case(
        block_delay=np.array([0.06, np.inf, 0.06]),
        block_velocity=np.array([[4.0, 0, 0], [3.0, 0, 0], [4.0, 0, 0]]),
    )
    block = case.particles.block.copy()
    block[:10], block[10:20] = 2, -1
    case = case._replace(particles=case.particles._replace(block=block))
    firings = plan_firings(case)
    np.testing.assert_array_equal(firings.time, [0.06])
    number = np.where(block == 1, 2, np.where(block == -1, 0, 1))
    np.testing.assert_array_equal(firings.number, number)
    loose = plan_firings(case._replace(hold_unfired=False))
    assert set(loose.number[block == 1]) == {0}


def test_rock_around_a_bench_becomes_boxes(tmp_path):
    """Rear and both ends: a box each instead of two or three rectangles; the slope is a plane."""
    bench = Bench(length=1.25, width=1.6, height=2.0)
    walls = join(bench_walls(bench, ends="wall"), slope(3.0, np.pi / 6.0))
    _, script = write_lammps_deck(tmp_path, small_case(walls=walls))
    regions = re.findall(r"^region \S+ (\S+) (.*)$", script.read_text(), re.MULTILINE)
    assert [style for style, _ in regions] == ["plane", "plane", "block", "block", "block"]
    assert ("block", "INF -1.6000000000000001 INF INF INF 2 side out") in regions
    assert ("block", "INF 0 INF 0 INF 2 side out") in regions
    assert ("block", "INF 0 1.25 INF INF 2 side out") in regions


def test_refusals_name_what_cannot_be_written(tmp_path):
    ground = heightmap(np.arange(3.0), np.arange(3.0), np.zeros((3, 3)))
    lone = rectangle((0, 0, 0), (0, 1, 0), (0, 0, 1), (0, 1, 0, 1))
    leaning = rectangle((0, 0, 0), (1, 0, 1), (0, 1, 0), (0, 1, 0, 1))
    case = small_case(walls=join(ground, lone, leaning), law=LAW._replace(damping_normal=0.9))
    with pytest.raises(SpecError) as caught:
        write_lammps_deck(tmp_path, case, radius_bins=99)
    text = str(caught.value)
    for part in ("8 facets", "wall 0", "wall 1 is bounded", "damping_normal", "radius_bins"):
        assert part in text
    assert not list(tmp_path.iterdir())


def test_time_step_fills_the_interval_between_firings():
    case = small_case()
    step = time_step(case, plan_firings(case))
    assert 0.06 / step == pytest.approx(round(0.06 / step), abs=1e-9)
    assert time_step(case._replace(time_step=1e-4), plan_firings(case)) == 1e-4
    # Not above the rule for a ball on a wall, the smallest of the case.
    mass = 4.0 / 3.0 * pi * 2600.0 * 0.08**3
    alone = 0.8 * np.sqrt(0.4 * mass / (2.0 * 0.5 * pi * 0.08 * 1e7))
    assert step < alone


def quantiles(balls, x, z):
    """Mass centre, places that hold shares of the mass, mean height."""
    mass = balls.radius**3
    order = np.argsort(x)
    share = np.cumsum(mass[order]) / mass.sum()
    at = [x[order][np.searchsorted(share, s)] for s in (0.25, 0.5, 0.75, 0.95)]
    return np.array([mass @ x / mass.sum(), *at]), mass @ z / mass.sum()


@pytest.mark.skipif(shutil.which("lmp") is None, reason="LAMMPS (lmp) is not installed")
def test_lammps_throws_the_same_pile(tmp_path):
    """Energy before the flow becomes chaotic, then the profile within what a few balls can move.

    Translational energy to 0.1 per cent at 0.1 s, 0.3 at 0.2 s and 2 at 0.4 s; mass centre and the
    places behind which 25 to 95 per cent of the mass lie within 0.15 m, mean height to 5 per cent.
    """
    case = small_case()
    write_lammps_deck(tmp_path, case)
    lines = run_engine("lmp", tmp_path).splitlines()
    rows = [line.split() for line in lines if re.match(r"^\s*\d+\s+\S+\s+240\s+\S+\s*$", line)]
    time, energy = np.array(rows, dtype=float)[:, [1, 3]].T
    own = run_cast(case)
    for when, tolerance in ((0.1, 1e-3), (0.2, 3e-3), (0.4, 0.02)):
        there = np.interp(when, time, energy)
        here = np.interp(when, own.history.time, own.history.translational_energy)
        assert there == pytest.approx(here, rel=tolerance), when
    final = np.loadtxt(tmp_path / "final.dump", skiprows=9)
    theirs, their_height = quantiles(case.particles, final[:, 3], final[:, 5])
    ours, our_height = quantiles(case.particles, *own.particles.position[:, [0, 2]].T)
    np.testing.assert_allclose(theirs, ours, atol=0.15)
    assert their_height == pytest.approx(our_height, rel=0.05)
