"""Geometry, outflow and stemming of the burden model against hand values and limits."""

from __future__ import annotations

from math import e, exp, nan, pi, radians, sqrt

import numpy as np
import pytest
from near_field_problems import ANFO

from castblast.burden.case import BurdenGeometry, BurdenParameters
from castblast.burden.dop853 import (
    FIFTH_ORDER_ERROR,
    NODES,
    STAGES,
    THIRD_ORDER_ERROR,
    WEIGHTS,
)
from castblast.burden.geometry import (
    breakout_width,
    burden_mass,
    explosive_mass,
    mean_burden,
    pressurised_plane,
)
from castblast.burden.motion import HISTORY_POINTS, no_burden_motion, solve_burden_motion
from castblast.burden.stemming import leakage_flux, stemming_acceleration
from castblast.burden.venting import ATMOSPHERIC_PRESSURE, fracture_flux, gas_outflow
from castblast.design.variables import VARIABLES
from castblast.errors import Status

BENCH = BurdenGeometry(3.0, 4.0, 10.0, radians(60.0), 2.0, 8.0, 2500.0, 0.1, 0.08)
MODEL = BurdenParameters(**{n: float(VARIABLES[n].default or 0) for n in BurdenParameters._fields})
STATE = (200e6, 242.0, 1.83)
DENSE = gas_outflow(*STATE)


def nozzle_flux(*state: float) -> float:
    return gas_outflow(*state).nozzle_flux


def friction_integral(*state: float) -> float:
    return gas_outflow(*state).friction_integral


def test_inclined_face_adds_rock_at_the_toe() -> None:
    """M = rho S (B H + H^2 / 2 cot beta); beta = 90 degrees is the plain block."""
    cot = 1.0 / sqrt(3.0)
    assert burden_mass(BENCH) == pytest.approx(2500 * 4 * (3 * 10 + 50 * cot), rel=1e-14)
    assert mean_burden(BENCH) == pytest.approx(3 + 5 * cot, rel=1e-14)
    vertical = BENCH._replace(face_angle=0.5 * pi)
    assert burden_mass(vertical) == pytest.approx(2500 * 4 * 3 * 10, rel=1e-14)


def test_charge_fills_its_own_diameter() -> None:
    mass = 800 * pi / 4 * 0.08**2 * 8
    assert explosive_mass(BENCH, 800.0) == pytest.approx(mass, rel=1e-14)


def test_breakout_plane_is_the_spacing_or_twice_the_burden() -> None:
    """(S^-12 + (2 B)^-12)^(-1/12): both limits, below the smaller one, 2^(-1/12) where they meet.

    For usual spacings, up to 1.4 mean burdens, it is the spacing within 0.12 percent.
    """
    double = 2.0 * mean_burden(BENCH)

    def width(spacing: float) -> float:
        return breakout_width(BENCH._replace(spacing=spacing))

    assert width(0.1 * double) == pytest.approx(0.1 * double, rel=1e-12)
    assert width(10.0 * double) == pytest.approx(double, rel=1e-12)
    assert width(double) == pytest.approx(2.0 ** (-1 / 12) * double, rel=1e-14)
    assert 0.9988 * 0.7 * double < width(0.7 * double) < 0.7 * double


def test_loaded_width_is_the_derivative_of_the_opened_section() -> None:
    """A_p = dV_b/dx, by complex step on the written-out section, so to round-off."""
    for x in (0.0, 1e-6, 1e-3, 0.1, 2.0):
        z = x + 1e-30j
        section = 0.3 * z + (4.0 - 0.3) * (z - 0.2 * (1 - np.exp(-z / 0.2)))
        slope = section.imag / 1e-30
        found = pressurised_plane(x, 0.3, 4.0, 0.2)
        assert found[0] == pytest.approx(slope, rel=1e-13)
        assert found[1] == pytest.approx(section.real, rel=1e-9)
    assert pressurised_plane(0.0, 0.3, 4.0, 0.2) == (0.3, 0.0)
    assert pressurised_plane(10.0, 0.3, 4.0, 0.2)[0] == pytest.approx(4.0, rel=1e-12)


def test_choked_flux_of_dense_products() -> None:
    """200 MPa, 242 kg/m3, k = 1.83: G0 = sqrt(k P rho) (2 / (k + 1))^1.705 = 1.6e5 kg/m2s."""
    expected = sqrt(1.83 * 200e6 * 242.0) * (2 / 2.83) ** (2.83 / 1.66)
    assert nozzle_flux(*STATE) == pytest.approx(expected, rel=1e-14)
    assert nozzle_flux(*STATE) == pytest.approx(1.6e5, rel=0.03)


@pytest.mark.parametrize("k", [1.35, 1.83, 2.5])
def test_nozzle_is_smooth_where_it_chokes(k: float) -> None:
    """Value and slope in the pressure are continuous at the critical pressure."""
    critical = ATMOSPHERIC_PRESSURE * (2 / (k + 1)) ** (-k / (k - 1))
    h = 1e-4 * critical
    below, here, above = (nozzle_flux(critical + s * h, 1.0, k) for s in (-1, 0, 1))
    assert below < here < above
    assert above - here == pytest.approx(here - below, rel=1e-3)


def test_slow_outflow_is_bernoulli() -> None:
    """Slightly above the open air the flux is sqrt(2 rho dP), whatever the gas."""
    p = ATMOSPHERIC_PRESSURE * (1 + 1e-5)
    expected = sqrt(2 * 3.0 * 1e-5 * ATMOSPHERIC_PRESSURE)
    assert nozzle_flux(p, 3.0, 1.4) == pytest.approx(expected, rel=1e-4)
    for flux in (nozzle_flux(0.9 * p, 3.0, 1.4), friction_integral(0.9 * p, 3.0, 1.4)):
        assert flux == 0.0


def test_friction_integral_is_the_integral_of_density_over_pressure() -> None:
    """Against quadrature of rho(P) = rho_1 (P / P_1)^(1/k) from the open air."""
    p, rho, k = STATE
    nodes, weights = np.polynomial.legendre.leggauss(60)
    half = 0.5 * (p - ATMOSPHERIC_PRESSURE)
    grid = ATMOSPHERIC_PRESSURE + half * (nodes + 1)
    integral = half * np.sum(weights * rho * (grid / p) ** (1 / k))
    assert friction_integral(p, rho, k) == pytest.approx(integral, rel=1e-5)


def test_fracture_flow_has_its_three_limits() -> None:
    """Wide: the nozzle. Rough and narrow: G^2 = 2 I D_h / (f L). Laminar: G = w^2 I / (12 mu L)."""
    integral = friction_integral(*STATE)
    assert fracture_flux(DENSE, 1e6, 3.0, 0.1, 6e-5) == pytest.approx(nozzle_flux(*STATE), rel=1e-6)
    rough = sqrt(2 * integral * 2e-6 / (0.1 * 3.0))
    assert fracture_flux(DENSE, 1e-6, 3.0, 0.1, 0.0) == pytest.approx(rough, rel=1e-4)
    laminar = 1e-14 * integral / (12 * 6e-5 * 3.0)
    assert fracture_flux(DENSE, 1e-7, 3.0, 0.0, 6e-5) == pytest.approx(laminar, rel=1e-4)
    assert fracture_flux(DENSE, 0.0, 3.0, 0.1, 6e-5) == 0.0


def test_fracture_flow_solves_its_implicit_friction_law() -> None:
    """1/G^2 = 1/G0^2 + f L / (2 I D_h) with f = f_D + 96 mu / (G D_h)."""
    w, path, rough, viscosity = 2e-4, 2.5, 0.07, 1e-3
    flux = fracture_flux(DENSE, w, path, rough, viscosity)
    friction = rough + 96 * viscosity / (flux * 2 * w)
    resistance = friction * path / (2 * friction_integral(*STATE) * 2 * w)
    assert 1 / flux**2 == pytest.approx(1 / nozzle_flux(*STATE) ** 2 + resistance, rel=1e-12)


def test_frictionless_stemming_is_a_piston() -> None:
    """Without wall friction a = (P - P_a) / (rho_s L), all the way out."""
    push = (200e6 - ATMOSPHERIC_PRESSURE) / (1800.0 * 2.0)
    for moved in (0.0, 1.0, 2.0):
        for kappa in (0.0, 1e-9):
            found = stemming_acceleration(200e6, moved, 2.0, kappa, 1800.0)
            assert found == pytest.approx(push, rel=1e-7)


def test_wall_friction_locks_a_long_column() -> None:
    """Janssen: kappa l = 6 moves (e^6 - 1) / 6 = 67 times slower than without friction."""
    free = stemming_acceleration(1e12, 0.0, 2.0, 0.0, 1800.0)
    held = stemming_acceleration(1e12, 0.0, 2.0, 3.0, 1800.0)
    assert free / held == pytest.approx((e**6 - 1) / 6, rel=1e-4)
    assert free / held == pytest.approx(67.0, rel=2e-3)
    limit = ATMOSPHERIC_PRESSURE * exp(6.0)
    assert stemming_acceleration(0.999 * limit, 0.0, 2.0, 3.0, 1800.0) == 0.0
    assert stemming_acceleration(1.001 * limit, 0.0, 2.0, 3.0, 1800.0) > 0.0


def test_stemming_obeys_momentum_of_its_slices() -> None:
    """Half out of the hole: marching the column slice by slice ends at the pressure of the air.

    d(sigma)/dy = -kappa sigma - rho a inside, -rho a outside (fourth-order Runge-Kutta).
    """
    p, moved, length, kappa, rho = 80e6, 0.8, 2.0, 3.2, 1800.0
    a = stemming_acceleration(p, moved, length, kappa, rho)

    def march(stress: float, distance: float, rate: float) -> float:
        n = 400
        h = distance / n
        for _ in range(n):
            k1 = -rate * stress - rho * a
            k2 = -rate * (stress + 0.5 * h * k1) - rho * a
            k3 = -rate * (stress + 0.5 * h * k2) - rho * a
            k4 = -rate * (stress + h * k3) - rho * a
            stress += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return stress

    at_collar = march(p, length - moved, kappa)
    assert at_collar > ATMOSPHERIC_PRESSURE
    assert march(at_collar, moved, 0.0) == pytest.approx(ATMOSPHERIC_PRESSURE, rel=1e-4)


def test_leakage_is_ergun_for_long_and_pores_for_short_columns() -> None:
    beta = 1.75 * 0.6 / (0.4**3 * 0.01)
    long = leakage_flux(DENSE, 1e4, 0.4, 0.01)
    assert long == pytest.approx(sqrt(friction_integral(*STATE) / (beta * 1e4)), rel=1e-4)
    assert leakage_flux(DENSE, 0.0, 0.4, 0.01) == pytest.approx(0.4 * nozzle_flux(*STATE))
    assert leakage_flux(DENSE, 2.0, 0.0, 0.01) == 0.0


def test_coefficients_of_the_integrator_meet_its_order() -> None:
    """Conditions of quadrature up to order 8 (Butcher 1963), and of its error formulas 5 and 3.

    Sum of b_i c_i^q = 1 / (q + 1), row sums of a_ij = c_i, and the condition of order 8 that
    chains seven stages, b A^6 c = 1 / 8!.
    """
    assert STAGES.sum(axis=1) == pytest.approx(NODES, abs=1e-14)
    for q in range(8):
        assert WEIGHTS @ NODES**q == pytest.approx(1 / (q + 1), rel=1e-13)
    assert abs(WEIGHTS @ NODES**8 - 1 / 9) > 1e-9
    for q in range(5):
        assert FIFTH_ORDER_ERROR @ NODES**q == pytest.approx(0.0, abs=1e-14)
    for q in range(3):
        assert THIRD_ORDER_ERROR @ NODES**q == pytest.approx(0.0, abs=1e-14)
    square = np.column_stack([STAGES, np.zeros(NODES.size)])
    chain = WEIGHTS @ np.linalg.matrix_power(square, 6) @ NODES
    assert chain == pytest.approx(1 / 40320, rel=1e-10)


@pytest.mark.parametrize(
    ("bench", "model", "radius"),
    [
        (BENCH._replace(charge_length=0.0), MODEL, 0.08),
        (BENCH._replace(charge_length=-1.0), MODEL, 0.08),
        (BENCH._replace(burden=nan), MODEL, 0.08),
        (BENCH._replace(face_angle=2.0), MODEL, 0.08),
        (BENCH, MODEL._replace(fracture_count=0.0), 0.08),
        (BENCH, MODEL._replace(gas_front_velocity=float("inf")), 0.08),
        (BENCH, MODEL, nan),
        (BENCH, MODEL, 0.03),  # narrower than the charge
        (BENCH, MODEL, 2.1),  # wider than the break-out plane
    ],
)
def test_impossible_case_is_a_status_not_an_exception(
    bench: BurdenGeometry, model: BurdenParameters, radius: float
) -> None:
    result = solve_burden_motion(ANFO, bench, model, radius)
    assert result.status == Status.BAD_INPUT
    assert np.isnan(result.burden_velocity)
    assert result.history_pressure.shape == (HISTORY_POINTS,)


def test_empty_result_has_the_types_of_a_real_one() -> None:
    real = solve_burden_motion(ANFO, BENCH, MODEL, 0.08)
    empty = no_burden_motion(Status.UNSTABLE_STEP)
    assert real.status == Status.OK
    for name, value in real._asdict().items():
        assert type(getattr(empty, name)) is type(value), name
        assert np.shape(getattr(empty, name)) == np.shape(value)


def test_floor_friction_above_the_push_holds_the_burden() -> None:
    """The gas cannot lift the friction of the floor: no motion, no share of the energy."""
    heavy = BENCH._replace(rock_density=6e3, burden=30.0, spacing=60.0)
    result = solve_burden_motion(ANFO, heavy, MODEL._replace(floor_friction=2.0), 0.05)
    assert result.status == Status.OK
    assert result.burden_velocity == 0.0
    assert result.acceleration_time == 0.0
    assert result.final_gas_energy == result.initial_gas_energy


def test_histories_run_from_the_near_field_to_the_open_air() -> None:
    result = solve_burden_motion(ANFO, BENCH, MODEL, 0.08)
    assert result.history_time[0] == 0.0
    assert result.history_time[-1] == result.motion_time
    assert np.all(np.diff(result.history_pressure) < 0)
    assert np.all(np.diff(result.history_velocity) > 0)
    assert result.history_velocity[-1] == result.burden_velocity
    assert result.history_pressure[-1] == pytest.approx(1.01 * ATMOSPHERIC_PRESSURE, rel=1e-9)
    v95 = np.interp(result.acceleration_time, result.history_time, result.history_velocity)
    assert v95 == pytest.approx(0.95 * result.burden_velocity, rel=1e-3)
