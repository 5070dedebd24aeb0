"""The annulus against exact solutions: Lame, Selberg, Salencon, Yu & Houlsby."""

import numpy as np
import pytest
from closed_forms import (
    CavityRock,
    cavity_expansion,
    cavity_plastic_ratio,
    lame_displacement,
    salencon,
)
from near_field_problems import annulus, rock, wave_speed

from castblast.nearfield.case import Rock
from castblast.nearfield.march import march
from castblast.nearfield.rock.lagrangian import graded_radii
from castblast.nearfield.rock.ledger import VISCOUS


def cauchy(body):
    """Mean radius (n,) and compressive Cauchy stresses (radial, hoop, axial) of all zones."""
    swelling = body.width * body.mean_radius / body.initial_area
    return body.mean_radius, *(-s / swelling for s in (body.radial, body.hoop, body.axial))


def test_lame_thick_elastic_cylinder() -> None:
    """Hole 0.05 m, outer radius 5 m, p 0.1 MPa, free outer face: u(a) = 2.083646e-7 m, to 1e-3."""
    case = rock(young_modulus=3e10)
    transit = 5.0 / wave_speed(case)
    run = march(annulus(
        case, inner=0.05, outer=5.0, zones=40, first=0.005, target=1e5, rise=40 * transit,
        end=45 * transit, quiet=False, elastic=True,
    ))  # fmt: skip
    exact = lame_displacement(1e5, 0.05, 0.05, 5.0, 3e10, 0.25)
    assert exact == pytest.approx(2.083646e-7, rel=1e-6)
    assert run.body.radius[0] - 0.05 == pytest.approx(exact, rel=1e-3)
    radius, radial, hoop, axial = cauchy(run.body)
    near = radius < 0.5
    share = (0.05 / 5.0) ** 2
    scale = 1e5 * share / (1.0 - share)
    np.testing.assert_allclose(radial[near], scale * ((5 / radius[near]) ** 2 - 1), rtol=0.01)
    np.testing.assert_allclose(hoop[near], -scale * ((5 / radius[near]) ** 2 + 1), rtol=0.01)
    np.testing.assert_allclose(axial[near], -0.5 * scale, atol=20.0)


# Selberg's cavity: inverse Laplace transform of the Bessel solution, evaluated by this project.
SELBERG_TIME = [0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 10.0, 20.0]
SELBERG_WALL = [0.15770, 0.29198, 0.47916, 0.57013, 0.59555, 0.56316, 0.50490, 0.50188]
SELBERG_HOOP = [0.08720, 0.44529, 0.94443, 1.18702, 1.25480, 1.16842, 1.01306, 1.00501]


def selberg(zones, end=20.0, linear=0.05):
    """Suddenly pressurised elastic cavity of radius 1 m, nu 0.25, p 0.1 MPa."""
    case = rock()
    return case, march(annulus(
        case, zones=zones, first=8.0 / zones, target=1e5, end=end / wave_speed(case),
        linear=linear, elastic=True,
    ))  # fmt: skip


def test_selberg_wave_from_a_suddenly_pressurised_cavity() -> None:
    """Wall displacement u mu / (p a) at c t / a = 0.5 to 20 (Selberg 1952), to 1 percent."""
    case, run = selberg(400)
    shear = case.young_modulus / 2.5
    at = np.interp(np.array(SELBERG_TIME) / wave_speed(case), run.record[:, 0], run.record[:, 1])
    np.testing.assert_allclose((at - 1.0) * shear / 1e5, SELBERG_WALL, rtol=0.01)
    _, _, hoop, _ = cauchy(run.body)
    assert -hoop[0] / 1e5 == pytest.approx(SELBERG_HOOP[-1], rel=0.03)


def test_selberg_wave_converges_with_first_order() -> None:
    """The error at early time, behind a jump, falls at least like the zone width."""
    errors = []
    for zones in (100, 200):
        case, run = selberg(zones, end=1.0, linear=0.05)
        at = np.interp(0.5 / wave_speed(case), run.record[:, 0], run.record[:, 1])
        errors.append(abs((at - 1.0) * case.young_modulus / 2.5 / 1e5 - SELBERG_WALL[0]))
    assert errors[0] / errors[1] > 1.7


def test_selberg_pulse_at_five_radii() -> None:
    """Velocity mu v / (p c) and radial stress at r = 5 a after the front has passed."""
    delays = [1.0, 2.0, 4.0]
    velocity = [0.08051, 0.02802, -0.01601]
    stress = [0.25560, 0.10887, -0.01270]
    for delay, v, s in zip(delays, velocity, stress, strict=True):
        case, run = selberg(800, end=4.0 + delay)
        nodes = run.body.radius
        here = np.interp(5.0, nodes, run.body.velocity)
        scaled = here * case.young_modulus / 2.5 / (1e5 * wave_speed(case))
        assert scaled == pytest.approx(v, abs=0.003)
        radius, radial, _, _ = cauchy(run.body)
        assert np.interp(5.0, radius, radial) / 1e5 == pytest.approx(s, abs=0.005)


def plane_shock(push: float) -> tuple[float, float, float]:
    """Width ratio, shock speed over wave speed and dissipated energy over that of the push.

    Plane shock driven by a pressure of `push` moduli into rock whose Cauchy stress is
    -M ln(J) / J: momentum p = rho U^2 (1 - J); energy p (1 - J) / 2 - M ln(J)^2 / 2 is lost.
    """
    low, high = 0.2, 1.0
    for _ in range(100):
        ratio = 0.5 * (low + high)
        low, high = (ratio, high) if -np.log(ratio) / ratio > push else (low, ratio)
    squeezed = 1.0 - ratio
    lost = 0.5 * squeezed - 0.5 * np.log(ratio) ** 2 / push
    return ratio, float(np.sqrt(push / squeezed)), float(lost)


def test_a_plane_shock_has_a_monotone_front_and_loses_what_it_must() -> None:
    """Rock compressed to 0.70 of its width by a sudden push of half its modulus, no yield.

    It stiffens, so the push runs as a shock at 1.30 times the wave speed. Rankine & Hugoniot
    state speed, particle velocity and lost energy without knowing of any viscosity. Behind the
    front the velocity is flat to 1 percent and overshoots by less than 7; the quadratic viscosity
    does that: without it the front rings by 34 percent.
    """
    push, width = 0.5, 0.05
    ratio, speed, lost = plane_shock(push)
    case = rock()
    unit = wave_speed(case)
    pressure = push * case.density * unit**2

    def run(**changes):
        return march(annulus(
            case, inner=1000.0, outer=1010.0, zones=200, first=width, target=pressure,
            end=6.0 / (speed * unit), linear=0.0, elastic=True, **changes,
        ))  # fmt: skip

    shock = run()
    distance = shock.body.initial_radius - 1000.0
    velocity = shock.body.velocity / (speed * unit * (1.0 - ratio))
    assert velocity.max() < 1.07
    behind = velocity[(distance > 1.0) & (distance < 6.0 - 8.0 * width)]
    np.testing.assert_allclose(behind, 1.0, atol=0.01)
    crest = int(velocity.argmax())
    assert (np.diff(velocity[crest:]) < 5e-4).all()
    place = np.interp(-0.5, -velocity[crest:], distance[crest:])
    assert place == pytest.approx(6.0, abs=0.5 * width)
    assert shock.work[VISCOUS] == pytest.approx(lost * pressure * 1000.0 * 6.0, rel=0.05)
    assert run(quadratic=0.0).body.velocity.max() > 1.2 * shock.body.velocity.max()


def test_salencon_unloaded_hole() -> None:
    """G 2.8, K 3.9 GPa, c 3.45 MPa, phi = psi = 30 deg, far stress 30 MPa (Itasca's own case).

    Salencon 1969: R0 = 1.7350 a. The hole closes by 3 percent, so the exact stresses are taken
    about its present radius. Checks the return with the hoop stress as the major one.
    """
    bulk, shear = 3.9e9, 2.8e9
    ucs = 2.0 * 3.45e6 * np.tan(np.radians(60.0))
    case = Rock(
        2000.0, 9 * bulk * shear / (3 * bulk + shear),
        (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear)), ucs, np.radians(30), np.radians(30), 0.0,
    )  # fmt: skip
    assert salencon(1.0, 0.0, 30e6, ucs, np.radians(30)).radius == pytest.approx(1.7350, abs=1e-4)
    unit = 1.0 / wave_speed(case)
    run = march(annulus(
        case, start=30e6, target=0.0, in_situ=30e6, zones=80, rise=4000 * unit, end=4400 * unit,
    ))  # fmt: skip
    exact = salencon(run.body.radius[0], 0.0, 30e6, ucs, case.friction_angle)
    radius, radial, hoop, _ = cauchy(run.body)
    wanted_radial, wanted_hoop = exact.stresses(radius)
    # The hoop stress has its peak at R0: leave out the zone that R0 runs through.
    clear = np.abs(radius - exact.radius) > run.body.width
    np.testing.assert_allclose(radial[clear], wanted_radial[clear], atol=0.01 * 30e6)
    np.testing.assert_allclose(hoop[clear], wanted_hoop[clear], atol=0.01 * 30e6)
    yielded = run.body.shear_multiplier > 0.0
    reach = run.body.radius[1:][yielded].max()
    assert abs(reach - exact.radius) <= run.body.width[yielded][-1]


@pytest.mark.parametrize(
    ("dilation", "pressure", "published"),
    [(0.0, 1e8, 1.02075), (0.0, 2e8, 1.11196), (20.0, 2e8, 1.05251), (0.0, 3e8, 1.41105)],
)
def test_yu_houlsby_large_strain_cavity_expansion(
    dilation: float, pressure: float, published: float
) -> None:
    """E 20 GPa, nu 0.25, UCS 100 MPa, phi 40 deg, no cut-off, infinite body; 1 percent of a/a0-1.

    A ramp of finite length overshoots in proportion to its rate, so two ramps are extrapolated
    to an infinitely slow one.
    """
    case = rock(friction_angle=40.0, dilation_angle=dilation)
    cavity = CavityRock(2e10, 0.25, 1e8, case.friction_angle, case.dilation_angle)
    exact = cavity_expansion(pressure, cavity)
    assert exact == pytest.approx(published, abs=1e-5)
    unit = 1.0 / wave_speed(case)
    growth = []
    for ramp in (2000.0, 4000.0):
        run = march(annulus(
            case, outer=200.0, zones=90, target=pressure, rise=ramp * unit,
            end=1.2 * ramp * unit,
        ))  # fmt: skip
        growth.append(run.record[-1, 1] - 1.0)
        assert run.fallbacks == 0
    slow = 2.0 * growth[1] - growth[0]
    assert slow == pytest.approx(exact - 1.0, rel=0.01)
    # The plastic radius is a free surface of the solution, found to a zone.
    yielded = run.body.shear_multiplier > 0.0
    reach = run.body.radius[1:][yielded].max() / run.body.radius[0]
    assert reach == pytest.approx(cavity_plastic_ratio(pressure, cavity), rel=0.06)


def test_cavity_limit_pressure_gives_no_finite_radius() -> None:
    soft = CavityRock(2e10, 0.25, 1e8, float(np.radians(40)), 0.0)
    assert np.isnan(cavity_expansion(1e9, soft))


def test_a_mesh_of_broken_number_moves_its_nodes_smoothly() -> None:
    """112.4 zones are 112; all nodes but the last move by little from 112.4 to 112.5, none leaps.

    At a whole number the mesh is that of the whole number, and the last node is the outer radius.
    """
    meshes = [graded_radii(1.0, 1000.0, n, 0.2, 100.0) for n in (112.0, 112.4, 112.5, 113.0)]
    assert [m.size for m in meshes] == [113, 113, 113, 114]
    assert all(m[0] == 1.0 and m[-1] == 1000.0 and (np.diff(m) > 0.0).all() for m in meshes)
    moved = np.abs(meshes[2] / meshes[1] - 1.0)[:-1]
    assert moved[1:].min() > 0.0
    assert moved.max() < 0.02
    before = graded_radii(1.0, 1000.0, 113.0 - 1e-9, 0.2, 100.0)
    np.testing.assert_allclose(before[:-1], meshes[3][:112], rtol=1e-7)
