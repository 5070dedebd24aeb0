"""Burden motion against closed forms, limits, conservation laws and an independent integration."""

from __future__ import annotations

from math import exp, pi, sqrt

import numpy as np
import pytest
from burden_problems import (
    AIR,
    PRODUCTS,
    SEALED,
    base,
    explosive,
    geometry,
    hole_radius,
    parameters,
)
from scipy.optimize import brentq

from castblast.burden.motion import solve_burden_motion
from castblast.errors import Status
from castblast.explosive.isentrope import (
    pressure,
)


def test_sealed_gas_gives_the_closed_form_velocity() -> None:
    """No venting, no storage, stemming locked: KE = m0 [e(V0) - e(V1)] - P_a (volume swept).

    The end volume follows from P_s(V1) = 1.01 P_a alone, so that the velocity has a closed form.
    """
    result = base(fracture_storage_ratio=0.0, **SEALED)
    a, b, c, r1, r2, w = PRODUCTS["anfo"][4:]

    def p(v: float) -> float:
        return 1e9 * (a * exp(-r1 * v) + b * exp(-r2 * v) + c * v ** -(1 + w))

    def e(v: float) -> float:
        return 1e9 * (a / r1 * exp(-r1 * v) + b / r2 * exp(-r2 * v) + c / w * v**-w)

    bench = geometry()
    start = brentq(lambda v: p(v) - 249e6, 1.0, 20.0, xtol=1e-14)
    end = brentq(lambda v: p(v) - 1.01 * AIR, 100.0, 5000.0, xtol=1e-10)
    charge = pi / 4 * bench.charge_diameter**2 * bench.charge_length
    work = charge * (e(start) - e(end) - AIR * (end - start))
    mass = 2600.0 * 3.0 * 3.0 * 12.5
    assert result.status == Status.OK
    assert result.burden_velocity == pytest.approx(sqrt(2 * work / mass), rel=1e-8)
    assert result.vented_fraction == 0.0


def test_ever_wider_vents_take_all_velocity() -> None:
    """Open fractures of 1 mm from the start, 100 to a million times as many: v falls to zero.

    Where the gas leaves long before the burden moves, the impulse is proportional to the time of
    outflow, so that v falls as one over the number of fractures.
    """
    velocity = []
    for factor in (1e2, 1e4, 1e6):
        result = base(
            initial_aperture=1e-3 * factor,
            fracture_opening_ratio=factor,
            fracture_count=4.0 * factor,
            gas_front_velocity=1e12,
        )
        assert result.status == Status.OK
        assert result.vented_fraction > 0.98
        velocity.append(result.burden_velocity)
    assert velocity[0] < 0.2 * base().burden_velocity
    assert velocity[1] / velocity[2] == pytest.approx(100.0, rel=1e-2)


def test_heavy_burden_does_not_move_and_loses_its_gas() -> None:
    """Burden mass to infinity: v falls as 1/mass and the gas leaves through open cracks."""
    model = {"initial_aperture": 1e-4, "fracture_opening_ratio": 0.0}
    results = [base({"rho": rho}, **model) for rho in (1e13, 1e15)]
    assert all(result.status == Status.OK for result in results)
    assert results[0].burden_velocity / results[1].burden_velocity == pytest.approx(100.0, rel=1e-3)
    assert results[1].burden_velocity < 1e-4
    assert results[1].vented_fraction > 0.98


def test_heavy_sealed_burden_keeps_the_pressure_of_the_filled_cracks() -> None:
    """Burden mass to infinity, nothing vents: the pressure settles at P_s(V0 (1 + zeta))."""
    product = explosive()
    bench = geometry(rho=1e15)
    radius = hole_radius(product, 249e6, 0.102)
    result = solve_burden_motion(product, bench, parameters(**SEALED), radius)
    relative = (radius / 0.051) ** 2
    filled = np.searchsorted(result.history_time, 1.0)
    expected = pressure(product.isentrope, 2.0 * relative)
    assert result.history_pressure[filled] == pytest.approx(expected, rel=1e-4)
    assert result.history_velocity[filled] < 1e-6


def test_half_the_gas_in_the_same_volume_has_the_pressure_of_double_volume() -> None:
    """The state of the gas follows its mass: P = P_s(V_g rho0 / m), not P_s(V_g / V_charge)."""
    from castblast.burden.balance import GAS_MASS, STATE_SIZE, make_balance, rates

    product = explosive()
    balance = make_balance(product, geometry(), parameters(), 0.09)
    state, rate = np.zeros(STATE_SIZE), np.zeros(STATE_SIZE)
    state[GAS_MASS] = 0.5 * balance.gas_mass
    found = rates(balance, False, True, 0.0, state, rate)
    assert found == pytest.approx(pressure(product.isentrope, 2.0 * (0.09 / 0.051) ** 2), rel=1e-13)


def test_velocity_does_not_know_the_scale() -> None:
    """All lengths times 0.5, 1, 2: same velocity, times and distances in proportion.

    Exact without viscosity of the gas, which brings in a length; with it to 1e-3.
    """
    for viscosity, tolerance in ((0.0, 1e-9), (6e-5, 1e-3)):
        results = [
            base({"d": 0.102 * s, "B": 3.0 * s, "S": 3.0 * s, "H": 12.5 * s},
                 gas_viscosity=viscosity)
            for s in (1.0, 0.5, 2.0)
        ]  # fmt: skip
        for result, s in zip(results, (1.0, 0.5, 2.0), strict=True):
            assert result.burden_velocity == pytest.approx(
                results[0].burden_velocity, rel=tolerance
            )
            for name in ("acceleration_time", "acceleration_distance", "motion_time"):
                expected = s * getattr(results[0], name)
                assert getattr(result, name) == pytest.approx(expected, rel=10 * tolerance)


def test_motion_starts_as_under_constant_pressure() -> None:
    """First instants: P A / M acceleration on the projected hole, u = a t and x = a t^2 / 2."""
    result = base(fracture_storage_ratio=0.0)
    product = explosive()
    width = 2.0 * hole_radius(product, 249e6, 0.102)
    acceleration = (249e6 - AIR) * width * 10.4 / (2600.0 * 3 * 3 * 12.5)
    t = result.history_time[1]
    assert t < 1e-5
    assert result.history_velocity[1] == pytest.approx(acceleration * t, rel=1e-3)
    assert result.history_displacement[1] == pytest.approx(0.5 * acceleration * t**2, rel=1e-3)


def test_short_stemming_leaves_early_and_long_stemming_holds() -> None:
    """Ejection after t95 for stemming longer than 15 diameters, before it below 3 diameters.

    The field rule that 20 to 25 diameters hold is what wall friction (Janssen 1895) gives.
    """
    short = base({"d": 0.3, "B": 1.0, "S": 1.0})
    assert short.ejection_time < short.acceleration_time
    assert short.burden_velocity > 0.0
    assert short.collar_fraction > 2 * base({"d": 0.3, "B": 3.0}).collar_fraction
    for stem in (15.5, 25.0):
        long = base({"d": 0.102, "stem": stem * 0.102 / 3.0})
        assert long.ejection_time > long.acceleration_time
    piston = base({"d": 0.102, "stem": 15.5 * 0.102 / 3.0}, stemming_wall_friction=0.0)
    assert piston.ejection_time < piston.acceleration_time
