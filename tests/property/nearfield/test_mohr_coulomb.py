"""Mohr-Coulomb return: laboratory strengths by hand and what holds for any trial stress."""

from itertools import permutations

import numpy as np
import pytest

from castblast.kernel import kernel
from castblast.nearfield.rock.mohr_coulomb import (
    ReturnedStress,
    apex_tension,
    edge_return,
    friction_number,
    make_yield_model,
)
from castblast.nearfield.rock.single_plane import single_plane_return

BULK, SHEAR, UCS = 13.3e9, 8e9, 1e8


@kernel
def return_to_yield(model, radial, hoop, axial, ucs, tension):
    """Return a trial stress to the strength surface, as a zone does."""
    one = single_plane_return(model.planes, radial, hoop, axial, ucs, tension)
    if one.solved:
        return ReturnedStress(
            one.radial, one.hoop, one.axial, one.shear_radial, one.shear_hoop, one.shear_axial,
            one.opening_radial, one.opening_hoop, one.opening_axial, one.shear, one.opening, False,
        )  # fmt: skip
    return edge_return(model, radial, hoop, axial, ucs, tension)


def model(friction_deg=40.0, dilation_deg=0.0):
    n = friction_number(np.radians(friction_deg))
    return make_yield_model(BULK, SHEAR, n, friction_number(np.radians(dilation_deg)))


def strains(s):
    return np.array([
        [s.shear_radial, s.shear_hoop, s.shear_axial],
        [s.tensile_radial, s.tensile_hoop, s.tensile_axial],
    ])  # fmt: skip


def test_uniaxial_compression_fails_at_the_ucs() -> None:
    """Lateral strain free: the stress path (-s, 0, 0) stops at s = UCS.

    The lateral strain that keeps the other two stresses at zero is found by bisection.
    """
    m = model()
    lame = BULK - 2.0 * SHEAR / 3.0
    axial = -0.05

    def returned(lateral):
        volume = lame * (axial + 2.0 * lateral)
        return return_to_yield(
            m, volume + 2 * SHEAR * axial, volume + 2 * SHEAR * lateral,
            volume + 2 * SHEAR * lateral, UCS, 0.9 * apex_tension(UCS, np.radians(40.0)),
        )  # fmt: skip

    low, high = 0.0, 0.2
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if returned(middle).hoop < 0.0 else (low, middle)
    assert returned(low).radial == pytest.approx(-UCS, rel=1e-6)
    assert returned(low).axial == pytest.approx(0.0, abs=1e-6 * UCS)


@pytest.mark.parametrize("confinement", [5e6, 50e6])
def test_triaxial_compression_and_extension_strengths_differ_as_the_theory_says(
    confinement: float,
) -> None:
    """Compression: s1 = N s3 - UCS with s2 = s3; extension: the same with s2 = s1.

    A Drucker-Prager cone fitted to compression would miss the extension strength.
    """
    n = friction_number(np.radians(40.0))
    limit = n * confinement + UCS
    for beyond in (1.0 - 1e-9, 1.0 + 1e-3):
        for trial in ((-limit * beyond, -confinement, -confinement),
                      (-limit * beyond, -limit * beyond, -confinement)):  # fmt: skip
            s = return_to_yield(model(), *trial, UCS, 0.0)
            yielded = s.multiplier > 1e-12
            assert yielded == (beyond > 1.0)
            low, high = min(s.radial, s.hoop, s.axial), max(s.radial, s.hoop, s.axial)
            assert n * high - low <= UCS * (1.0 + 1e-9)


def test_tension_stops_at_the_tensile_strength_and_opens_only_the_crack() -> None:
    """Splitting test: only the tensile axis exceeds, only it opens, by excess / (K + 4G/3)."""
    s = return_to_yield(model(), -2e7, 9e6, -1e6, UCS, 5e6)
    assert s.hoop == pytest.approx(5e6, rel=1e-12)
    assert s.tensile_hoop == pytest.approx(4e6 / (BULK + 4 * SHEAR / 3), rel=1e-12)
    assert np.count_nonzero(strains(s)) == 1
    assert s.multiplier == 0.0


def test_pure_tension_returns_to_the_corner() -> None:
    s = return_to_yield(model(), 2e7, 3e7, 2.5e7, UCS, 5e6)
    np.testing.assert_allclose([s.radial, s.hoop, s.axial], 5e6, rtol=1e-9)
    assert not s.fallback


def test_edge_with_two_equal_least_stresses_flows_on_both_planes() -> None:
    """(-a, -b, -b) beyond strength: the two equal stresses stay equal and share the flow."""
    s = return_to_yield(model(), -4e8, -2e7, -2e7, UCS, 0.0)
    assert s.hoop == pytest.approx(s.axial, rel=1e-9)
    assert s.shear_hoop == pytest.approx(s.shear_axial, rel=1e-9)
    n = friction_number(np.radians(40.0))
    assert s.radial == pytest.approx(n * s.hoop - UCS, rel=1e-9)


def test_flow_without_dilation_keeps_the_volume_and_with_dilation_swells_by_the_rule() -> None:
    for dilation in (0.0, 10.0, 40.0):
        s = return_to_yield(model(40.0, dilation), -4e8, -1e8, -1e7, UCS, 0.0)
        growth = friction_number(np.radians(dilation)) - 1.0
        assert strains(s)[0].sum() == pytest.approx(growth * s.multiplier, rel=1e-9, abs=1e-12)


@kernel
def _check(trials, friction, psi, tension):
    """Count, over many trials, the breaches of each property."""
    breaches = np.zeros(6)
    for k in range(trials.shape[0]):
        n = (1.0 + np.sin(friction[k])) / (1.0 - np.sin(friction[k]))
        m = make_yield_model(BULK, SHEAR, n, (1.0 + np.sin(psi[k])) / (1.0 - np.sin(psi[k])))
        cut = tension[k] * UCS / (n - 1.0)
        a, b, c = trials[k, 0], trials[k, 1], trials[k, 2]
        s = return_to_yield(m, a, b, c, UCS, cut)
        scale = abs(a) + abs(b) + abs(c) + UCS
        low, high = min(s.radial, s.hoop, s.axial), max(s.radial, s.hoop, s.axial)
        breaches[0] += n * high - low - UCS > 1e-7 * n * scale or high - cut > 1e-7 * scale
        again = return_to_yield(m, s.radial, s.hoop, s.axial, UCS, cut)
        moved = abs(again.radial - s.radial) + abs(again.hoop - s.hoop)
        breaches[1] += moved > 1e-7 * scale
        breaches[2] += s.multiplier < -1e-12
        opening = min(s.tensile_radial, s.tensile_hoop, s.tensile_axial)
        breaches[2] += opening < -1e-12
        turned = return_to_yield(m, c, a, b, UCS, cut)
        gap = abs(turned.radial - s.axial) + abs(turned.hoop - s.radial)
        breaches[3] += gap + abs(turned.axial - s.hoop) > 1e-9 * scale
        breaches[4] += s.fallback
        # Plastic strain and stress account for the whole trial: trial - D e_p = stress.
        e_r = s.shear_radial + s.tensile_radial
        volume = e_r + s.shear_hoop + s.tensile_hoop + s.shear_axial + s.tensile_axial
        left = a - (BULK - 2.0 * SHEAR / 3.0) * volume - 2.0 * SHEAR * e_r - s.radial
        breaches[5] += abs(left) > 1e-9 * scale
    return breaches


def test_a_hundred_thousand_random_returns() -> None:
    """Trials of 10 times the strength, phi 25-55 deg, psi 0-phi, cut-off 0-0.95 of the apex.

    Admissible, idempotent, multipliers >= 0, the same in any order of axes, never the fall-back,
    and stress plus plastic strain make up the trial.
    """
    rng = np.random.default_rng(1)
    count = 100_000
    spread = UCS * 10.0 ** rng.uniform(-1.0, 1.5, (count, 1))
    trials = rng.normal(-0.3, 1.0, (count, 3)) * spread
    friction = np.radians(rng.uniform(25.0, 55.0, count))
    psi = friction * rng.random(count) * (rng.random(count) > 0.3)
    tension = 0.95 * rng.random(count) * (rng.random(count) > 0.3)
    np.testing.assert_array_equal(_check(trials, friction, psi, tension), np.zeros(6))


def test_elastic_stress_is_left_alone() -> None:
    s = return_to_yield(model(), -5e7, -2e7, -3e7, UCS, 1e6)
    assert (s.radial, s.hoop, s.axial, s.multiplier) == pytest.approx((-5e7, -2e7, -3e7, 0.0))


def test_every_order_of_axes_gives_the_same_stresses() -> None:
    trial = np.array([-4e8, 3e6, -6e7])
    reference = return_to_yield(model(), *trial, UCS, 0.0)
    wanted = np.array([reference.radial, reference.hoop, reference.axial])
    for order in permutations(range(3)):
        s = return_to_yield(model(), *trial[list(order)], UCS, 0.0)
        np.testing.assert_allclose([s.radial, s.hoop, s.axial], wanted[list(order)], rtol=1e-12)
