"""Fragment sizes: Kuz-Ram and Swebrec by hand, and balls whose sieve curve is the one asked for."""

from __future__ import annotations

from math import log, pi, sqrt

import numpy as np
import pytest

from castblast.muckpile.bench.fragments import (
    Pattern,
    RosinRammler,
    Swebrec,
    coarsest,
    cut_sizes,
    joint_factor,
    kuz_ram,
    passing,
    rock_factor,
    smallest_for_count,
    swebrec_like,
    timing_factor,
)
from castblast.muckpile.bench.sizes import (
    draw_radii,
    mean_ball_volume,
    mean_of_power,
    normal_sizes,
    random_close_fraction,
    sizes_by_volume,
    uniform_sizes,
)

#: 100 kg of ANFO in 3 m x 4 m x 10 m of rock of factor 6: 0.8333 kg/m3.
HOLE = Pattern(6.0, 3.0, 4.0, 10.0, 0.150, 7.0, 100.0)


def test_kuz_ram_by_hand() -> None:
    """6 x 0.8333^-0.8 x 100^(1/6) x 1.15^(19/30) = 6 x 1.1570 x 2.1544 x 1.0926 = 16.34 cm.

    n (1987) = (2.2 - 14 x 3/150) sqrt(7/6) 1.1^0.1 x 0.7 = 1.92 x 1.0801 x 1.00958 x 0.7 = 1.4656;
    n (2005) = 1.206 sqrt(2 - 0.6) sqrt(7/6) 0.7^0.3 = 1.206 x 1.1832 x 1.0801 x 0.8985 = 1.3849.
    """
    old, new = kuz_ram(HOLE, "1987"), kuz_ram(HOLE, "2005")
    assert old.median == new.median == pytest.approx(0.1634, abs=1e-4)
    assert old.uniformity == pytest.approx(1.4656, abs=2e-4)
    assert new.uniformity == pytest.approx(1.3849, abs=2e-4)


def test_worked_example_of_ouchterlony() -> None:
    """Round 4 of Bararp (Ouchterlony 2005): x50 = 44.8 cm, n = 1.17 and b = 2.431.

    A = 13, 9.24 kg a hole of 62.2 % of the strength of ANFO, 0.55 kg/m3 above grade, holes of 51 mm
    on 1.8 m x 2.2 m with a deviation of 0.25 m, charged over 3.9 m of 5.2 m; largest block 2.0 m.
    The height here is the one that gives that specific charge, charged over the same share.
    """
    height = 9.24 / (0.55 * 1.8 * 2.2)
    charged = height * 3.9 / 5.2
    round_4 = Pattern(13.0, 1.8, 2.2, height, 0.051, charged, 9.24, 0.622, drilling_deviation=0.25)
    curve = kuz_ram(round_4, "1987")
    assert curve.median == pytest.approx(0.448, abs=5e-4)
    assert curve.uniformity == pytest.approx(1.17, abs=5e-3)
    assert swebrec_like(curve, 2.0).undulation == pytest.approx(2.431, abs=5e-3)


@pytest.mark.parametrize("year", ["1987", "2005"])
def test_kuz_ram_goes_the_right_way(year: str) -> None:
    """More or stronger explosive gives finer rock, harder rock coarser; bad drilling less even."""
    base = kuz_ram(HOLE, year)
    assert kuz_ram(HOLE._replace(charge_mass=120.0), year).median < base.median
    assert kuz_ram(HOLE._replace(weight_strength=1.2), year).median < base.median
    assert kuz_ram(HOLE._replace(rock_factor=9.0), year).median == pytest.approx(1.5 * base.median)
    assert kuz_ram(HOLE._replace(drilling_deviation=0.3), year).uniformity < base.uniformity
    assert kuz_ram(HOLE._replace(charge_length=3.0), year).uniformity < base.uniformity
    assert 0.7 <= kuz_ram(HOLE._replace(hole_diameter=0.03), year).uniformity <= 2.2


def test_timing_of_2005() -> None:
    """The finest rock where the slope of 0.66 t^3 - 0.13 t^2 - 1.58 t + 2.1 ends, at t = 1."""
    best = 15.6e-3 * HOLE.burden / 5.0
    assert timing_factor(HOLE) == 1.0
    near, at, far = (timing_factor(HOLE._replace(delay=t * best)) for t in (0.9, 1.0, 2.0))
    assert near > at
    assert far > at
    assert at == pytest.approx(0.9)
    assert timing_factor(HOLE._replace(delay=0.5 * best)) == pytest.approx(1.36, abs=1e-9)
    rough = kuz_ram(HOLE._replace(delay=best, delay_deviation=best / 6.0))
    assert rough.uniformity / kuz_ram(HOLE).uniformity == pytest.approx((0.206 + 0.75**0.8) / 1.206)


def test_rock_factor_by_hand() -> None:
    """0.06 (50 + 15 + 20/3) = 4.3 for massive rock of 2600 kg/m3 and 20 GPa; UCS/5 when stiff."""
    rock = {"density": 2600.0, "ucs": 1e8}
    assert rock_factor(description=50.0, young_modulus=20e9, **rock) == pytest.approx(4.3)
    stiff = rock_factor(description=50.0, young_modulus=60e9, **rock)
    assert stiff == pytest.approx(0.06 * (50 + 15 + 20))
    assert rock_factor(description=10.0, young_modulus=1e9, density=2000.0, ucs=1e6) == 0.8
    assert joint_factor(0.2, sqrt(12.0), "along_face", "relaxed") == 1.5 * 20 + 30
    assert [joint_factor(s, 2.0, "out_of_face") for s in (0.05, 1.0, 1.95)] == [30, 100, 70]


def test_swebrec_has_median_and_slope_of_rosin_rammler() -> None:
    """Half passes the median of both; dP/d ln x there is n ln 2 / 2; all passes the largest."""
    rosin = RosinRammler(0.25, 1.3)
    curve = swebrec_like(rosin, 1.5)
    step = 1e-5
    around = 0.25 * np.exp([-step, 0.0, step])
    for shape in (rosin, curve):
        low, half, high = passing(shape, around)
        assert half == pytest.approx(0.5)
        assert (high - low) / (2 * step) == pytest.approx(1.3 * log(2) / 2, rel=1e-6)
    assert passing(curve, np.array([1.5, 2.0])).tolist() == [1.0, 1.0]
    # More fines than Rosin-Rammler: the point of the Swebrec curve.
    assert passing(curve, np.array([0.002]))[0] > 3 * passing(rosin, np.array([0.002]))[0]
    assert passing(rosin, np.array([coarsest(rosin)]))[0] == pytest.approx(0.99)
    with pytest.raises(ValueError, match="above the median"):
        swebrec_like(rosin, 0.2)


def volume_below(sizes, diameter):
    """Share of the volume in balls below `diameter` (n,) [m]: the sieve curve, in closed form."""
    low, high = sizes.radius[:-1], sizes.radius[1:]
    share = np.diff(sizes.below) * 0.25 * (low + high) * (low**2 + high**2)
    part = np.clip(0.5 * diameter[:, None], low, high)
    return ((part**4 - low**4) / (high**4 - low**4)) @ share / share.sum()


@pytest.mark.parametrize("curve", [Swebrec(0.4, 1.6, 2.2), RosinRammler(0.4, 1.1)])
def test_balls_sieved_again_give_the_curve(curve: Swebrec | RosinRammler) -> None:
    """Draw 20,000 balls, weigh what passes each mesh: the cut curve, to the volume of a ball.

    The share by number is quite another: nine balls of ten are in the finest part.
    """
    cut = cut_sizes(curve, 0.1, 1.2)
    radius = draw_radii(cut.sizes, 20_000, np.random.default_rng(3))
    mesh = np.geomspace(0.12, 1.15, 12)
    volume = radius**3
    sieved = np.array([volume[2 * radius < m].sum() for m in mesh]) / volume.sum()
    whole = passing(curve, mesh)
    asked = (whole - cut.finer) / (1.0 - cut.finer - cut.coarser)
    assert np.abs(sieved - asked).max() < 1.2**3 / np.sum((2 * radius) ** 3) + 1e-3
    np.testing.assert_allclose(volume_below(cut.sizes, mesh), asked, atol=2e-4)
    assert 2 * radius.min() >= 0.1
    assert 2 * radius.max() <= 1.2
    by_number = np.mean(2 * radius < 0.3)
    assert by_number > asked[np.searchsorted(mesh, 0.3)] + 0.3
    assert cut.finer == passing(curve, np.array([0.1]))[0]
    assert cut.coarser == pytest.approx(1.0 - passing(curve, np.array([1.2]))[0])


def test_smallest_ball_for_a_number_of_balls() -> None:
    """Volume over mean volume is the number asked for."""
    curve = Swebrec(0.4, 1.6, 2.2)
    smallest = smallest_for_count(curve, 1.6, 500.0, 3000)
    cut = cut_sizes(curve, smallest, 1.6)
    assert 500.0 / mean_ball_volume(cut.sizes) == pytest.approx(3000, rel=1e-3)
    with pytest.raises(ValueError, match="20 balls cannot fill the bench"):
        smallest_for_count(curve, 1.6, 500.0, 20)


def test_moments_of_uniform_and_normal_sizes() -> None:
    """Uniform: mean cube R^3 (1 + d^2). Normal cut at two deviations: mean R, sd 0.8796 d."""
    even = uniform_sizes(0.2, 0.5)
    assert mean_ball_volume(even) == pytest.approx(4 / 3 * pi * 0.008 * 1.25)
    bell = normal_sizes(0.2, 0.3)
    radius = draw_radii(bell, 50_000, np.random.default_rng(1))
    assert radius.mean() == pytest.approx(0.2, rel=1e-4)
    assert radius.std() == pytest.approx(0.8796 * 0.06, rel=1e-3)
    assert mean_of_power(bell, 3) == pytest.approx(np.mean(radius**3), rel=1e-3)
    assert radius.min() >= 0.08
    assert radius.max() <= 0.32


def test_drawn_radii_are_even_and_in_random_order() -> None:
    radius = draw_radii(uniform_sizes(1.0, 0.5), 1000, np.random.default_rng(0))
    assert np.sort(radius)[::100] == pytest.approx(np.linspace(0.5, 1.4, 10), abs=1e-3)
    assert abs(np.corrcoef(radius[:-1], radius[1:])[0, 1]) < 0.1


def test_random_close_packing_of_two_sizes() -> None:
    """Equal balls 0.634; even radii have no skewness: 0.634 + 0.0658 d / sqrt(3)."""
    assert random_close_fraction(uniform_sizes(1.0, 0.0)) == pytest.approx(0.634)
    even = random_close_fraction(uniform_sizes(2.0, 0.5))
    assert even == pytest.approx(0.634 + 0.0658 * 0.5 / sqrt(3.0))
    one_sided = sizes_by_volume(np.array([1.0, 1.01, 2.0]), np.array([0.0, 0.5, 1.0]))
    assert random_close_fraction(one_sided) > even
