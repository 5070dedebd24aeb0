"""Packings: the fraction asked for, at rest, apart, the same for the same seed."""

from __future__ import annotations

from math import cos, radians, sin

import numpy as np
import pytest
from scipy.spatial import cKDTree

from castblast.errors import Status
from castblast.muckpile.balls.contact import ContactLaw
from castblast.muckpile.balls.particles import (
    Particles,
    ball_mass,
    check_particles,
    particles_at_rest,
)
from castblast.muckpile.bench.geometry import Bench, assign_blocks
from castblast.muckpile.bench.given import pressed_share
from castblast.muckpile.bench.packing import (
    check_packing,
    count_of,
    fill_bench,
    mean_radius_for_count,
)
from castblast.muckpile.bench.porosity import solid_fraction
from castblast.muckpile.bench.separation import push_apart
from castblast.muckpile.bench.sizes import uniform_sizes
from castblast.muckpile.bench.surroundings import bench_walls
from castblast.muckpile.cast.solver import CastCase, run_cast
from castblast.muckpile.ground.walls import Walls, floor, join, plane

BENCH = Bench(length=6.0, width=9.0, height=6.0, face_angle=radians(75.0), burden=3.0, spacing=3.0)
MEAN_RADIUS = mean_radius_for_count(BENCH, 2000)


@pytest.fixture(scope="module")
def packing():
    return fill_bench(BENCH, mean_radius=MEAN_RADIUS, seed=4, threads=1)


def test_packing_has_the_fraction_asked_for(packing):
    """0.60 inside, to 0.01; the number of balls is as estimated.

    Overlaps are those of the weight on a modulus of 1e7 Pa, 0.01 in the mean; the few of strong
    force chains on small balls pass a tenth of the radius at the foot of the bench.
    """
    assert packing.status == Status.OK
    assert len(packing.particles.radius) == 2000
    assert count_of(BENCH, uniform_sizes(MEAN_RADIUS, 0.5)) == 2000
    assert packing.solid_fraction == pytest.approx(0.60, abs=0.01)
    assert packing.mean_overlap < 0.03
    allowed = pressed_share(packing.particles, ContactLaw())
    assert check_particles(packing.particles, allowed) == []
    assert allowed.min() == 0.10


def test_overlaps_are_those_of_the_weight():
    """Nothing of the generation is left in a packing: four times the modulus, a quarter of it.

    Both the mean overlap and the largest follow weight over modulus; the largest is far below a
    tenth of the radius then. To a quarter, since the two packings are not the same.
    """
    small = Bench(length=4.0, width=4.0, height=4.0)
    radius = mean_radius_for_count(small, 300)
    mean, largest = [], []
    for modulus in (1e7, 4e7):
        law = ContactLaw(effective_modulus=modulus)
        packed = fill_bench(small, mean_radius=radius, seed=1, law=law, threads=1)
        mean.append(packed.mean_overlap)
        largest.append(max_overlap(packed.particles))
    assert check_particles(packed.particles) == []
    assert mean[0] / mean[1] == pytest.approx(4.0, rel=0.25)
    assert largest[0] / largest[1] > 2.0
    assert largest[1] < 0.05


def max_overlap(balls: Particles) -> float:
    """Largest overlap of two balls over their mean radius."""
    pairs = cKDTree(balls.position).query_pairs(2.0 * balls.radius.max(), output_type="ndarray")
    i, j = pairs.T
    apart = np.linalg.norm(balls.position[i] - balls.position[j], axis=1)
    return float((2.0 - 2.0 * apart / (balls.radius[i] + balls.radius[j])).max())


def test_packing_lies_inside_the_bench(packing):
    balls = packing.particles
    x, y, z = balls.position.T
    slack = 0.1 * MEAN_RADIUS  # the overlap of the strongest forces at the floor
    face = -(x * sin(BENCH.face_angle) + z * cos(BENCH.face_angle))
    assert np.all(face > balls.radius - slack)
    assert np.all(x + BENCH.width > balls.radius - slack)
    assert np.all(z > balls.radius - slack)
    assert np.all((y > balls.radius - slack) & (BENCH.length - y > balls.radius - slack))
    assert np.quantile(z + balls.radius, 0.95) == pytest.approx(BENCH.height, rel=0.05)


def test_radii_are_even_and_blocks_are_those_of_the_places(packing):
    """Even between 0.5 and 1.5 mean radii: the quartiles are those of the even distribution."""
    ratio = packing.particles.radius / MEAN_RADIUS
    assert ratio.min() > 0.49
    assert ratio.max() < 1.51
    assert np.quantile(ratio, [0.25, 0.5, 0.75]) == pytest.approx([0.75, 1.0, 1.25], abs=0.03)
    np.testing.assert_array_equal(
        packing.particles.block, assign_blocks(packing.particles.position, BENCH)
    )


def test_packing_stays_at_rest_behind_its_walls(packing):
    """Let go between the same walls, the balls shift by a part of a radius and stand.

    A state of balls holds no springs. Shear and rolling springs start at zero, and the balls
    settle until they carry again: by about the overlap (0.01 radii) in each of a dozen layers.
    """
    face = (-sin(BENCH.face_angle), 0.0, -cos(BENCH.face_angle))
    walls: Walls = join(
        floor(), plane((0, 0, 0), face, 0.0), plane((-BENCH.width, 0, 0), (1, 0, 0), 0.0),
        plane((0, 0, 0), (0, 1, 0), 0.0), plane((0, BENCH.length, 0), (0, -1, 0), 0.0),
    )  # fmt: skip
    balls = packing.particles._replace(block=np.full(len(packing.particles.radius), -1))
    case = CastCase(
        balls, ContactLaw(), walls, np.empty(0), np.empty((0, 3)), max_time=1.0, min_time=1.0,
        threads=1,
    )  # fmt: skip
    result = run_cast(case)
    moved = np.linalg.norm(result.particles.position - balls.position, axis=1)
    assert np.median(moved) < 12 * 0.015 * MEAN_RADIUS
    after = solid_fraction(result.particles, BENCH)
    assert after == pytest.approx(packing.solid_fraction, abs=0.01)
    weight = 9.81 * np.sum(ball_mass(balls.radius, 2600.0))
    assert result.history.translational_energy[-1] < 0.01 * weight * MEAN_RADIUS


def test_equal_seeds_give_equal_bits_and_other_seeds_other_packings():
    small = Bench(length=4.0, width=4.0, height=4.0)
    radius = mean_radius_for_count(small, 300)
    first, again, other = (
        fill_bench(small, mean_radius=radius, seed=seed, threads=threads).particles
        for seed, threads in ((1, 1), (1, 2), (2, 1))
    )
    assert first.position.tobytes() == again.position.tobytes()
    assert first.radius.tobytes() == again.radius.tobytes()
    assert first.position.tobytes() != other.position.tobytes()


def test_smooth_balls_pack_denser():
    """Mu = 0.3 without rolling friction, radii +-50 %: 0.62 to 0.64, to 0.01."""
    bench = Bench(length=6.0, width=6.0, height=6.0)
    law = ContactLaw(friction=0.3, rolling_friction=0.0)
    packing = fill_bench(
        bench, mean_radius=mean_radius_for_count(bench, 1500), solid_fraction=0.62, law=law,
        threads=1,
    )  # fmt: skip
    assert 0.61 < packing.solid_fraction < 0.65


def test_pushing_apart_leaves_no_overlap():
    """Against a search by k-d tree: no overlap above 1 % of the mean radius at fraction 0.55."""
    rng = np.random.default_rng(8)
    radius = rng.uniform(0.05, 0.15, 1500)
    side = float((4.0 / 3.0 * np.pi * np.sum(radius**3) / 0.55) ** (1.0 / 3.0))
    box = join(
        *(plane(point, normal) for axis in range(3) for point, normal in (
            (np.zeros(3), np.eye(3)[axis]), (side * np.eye(3)[axis], -np.eye(3)[axis]),
        ))
    )  # fmt: skip
    place = push_apart(rng.uniform(0.15, side - 0.15, (1500, 3)), radius, box)
    pairs = cKDTree(place).query_pairs(0.3, output_type="ndarray")
    apart = np.linalg.norm(place[pairs[:, 0]] - place[pairs[:, 1]], axis=1)
    overlap = radius[pairs[:, 0]] + radius[pairs[:, 1]] - apart
    assert overlap.max() < 0.011 * radius.mean()
    assert (place - radius[:, None]).min() > -0.011 * radius.mean()


def test_solid_fraction_of_a_lattice():
    """Simple cubic balls fill pi/6 of space."""
    n, r = 12, 0.25
    grid = (np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), axis=-1) + 0.5) * 2 * r
    place = grid.reshape(-1, 3) - [2 * r * n, 0, 0]
    balls = particles_at_rest(place, np.full(n**3, r))
    bench = Bench(length=2 * r * n, width=2 * r * n, height=2 * r * n)
    assert solid_fraction(balls, bench, margin=2 * r) == pytest.approx(np.pi / 6, abs=0.01)


def test_faults_are_all_named():
    faults = check_packing(Bench(length=-1.0), 0.2, 1.2, 0.9)
    text = "; ".join(faults)
    assert "length = -1 m" in text
    assert "relative_deviation = 1.2" in text
    assert "solid_fraction = 0.9" in text
    with pytest.raises(ValueError, match="mean_radius = 5 m"):
        fill_bench(Bench(), mean_radius=5.0)
    assert bench_walls(Bench()).origin.shape == (3, 3)
