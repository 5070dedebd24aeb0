"""The burden motion against the same model written a second time, and its ledgers."""

from __future__ import annotations

from math import cos, exp, pi, sin, sqrt

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
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from castblast.burden.case import BurdenGeometry, BurdenParameters
from castblast.burden.motion import solve_burden_motion
from castblast.errors import Status


class Reference:
    """The same model written a second time, in plain Python, for scipy to integrate."""

    def __init__(self, name: str, g: BurdenGeometry, q: BurdenParameters, radius: float) -> None:
        rho0, _, _, _, a, b, c, self.r1, self.r2, self.w = PRODUCTS[name]
        self.jwl = a * 1e9, b * 1e9, c * 1e9
        self.g, self.q, self.rho0, self.radius = g, q, rho0, radius
        cot = cos(g.face_angle) / sin(g.face_angle)
        self.mass = g.rock_density * g.spacing * (g.burden + 0.5 * g.bench_height * cot)
        self.mass *= g.bench_height
        self.path = g.burden + 0.5 * g.bench_height * cot
        self.m0 = rho0 * pi * g.charge_diameter**2 / 4 * g.charge_length
        self.bore = pi * g.hole_diameter**2 / 4
        self.vent_time = self.path / q.gas_front_velocity
        self.venting = self.ejected = False

    def gas(self, t: float, y: np.ndarray) -> tuple[float, float, float, float]:
        """Pressure, density, isentropic exponent, specific enthalpy."""
        (a, b, c), r1, r2, w = self.jwl, self.r1, self.r2, self.w
        m, x, _, s = y[:4]
        tau = self.path / 2 / self.q.crack_velocity
        narrow, xp = 2 * self.radius, self.q.pressurised_width_ratio * self.path
        wide = (self.g.spacing**-12 + (2 * self.path) ** -12) ** (-1 / 12)
        hole = pi * self.radius**2 * self.g.charge_length
        volume = hole * (1 + self.q.fracture_storage_ratio * (1 - exp(-t / tau)))
        volume += self.bore * s + self.g.charge_length * (
            narrow * x + (wide - narrow) * (x - xp * (1 - exp(-x / xp)))
        )
        self.storing = hole * self.q.fracture_storage_ratio / tau * exp(-t / tau)
        self.area = self.g.charge_length * (narrow + (wide - narrow) * (1 - exp(-x / xp)))
        v = volume * self.rho0 / m
        terms = a * exp(-r1 * v), b * exp(-r2 * v), c * v ** -(1 + w)
        p = sum(terms)
        k = (r1 * v * terms[0] + r2 * v * terms[1] + (1 + w) * terms[2]) / p
        e = terms[0] / r1 + terms[1] / r2 + terms[2] * v / w
        return p, self.rho0 / v, k, (e + p * v) / self.rho0

    def rates(self, t: float, y: np.ndarray) -> list[float]:
        q = self.q
        p, rho, k, h = self.gas(t, y)
        x, u, s, w = y[1:5]
        ratio = AIR / p
        if ratio < (2 / (k + 1)) ** (k / (k - 1)):
            free = sqrt(k * p * rho) * (2 / (k + 1)) ** ((k + 1) / 2 / (k - 1))
        else:
            free = sqrt(2 * k / (k - 1) * p * rho * (ratio ** (2 / k) - ratio ** ((k + 1) / k)))
        integral = p * rho * k / (k + 1) * (1 - ratio ** ((k + 1) / k))
        face = 0.0
        opening = q.initial_aperture + q.fracture_opening_ratio * x
        if self.venting and opening > 0:
            # 1/G^2 = 1/G0^2 + K / 2I with K = (f_D + 96 mu / G D) L / D, solved for G by iteration.
            d = 2 * opening / q.fracture_count
            flux = free
            for _ in range(200):
                friction = q.fracture_friction_factor + 96 * q.gas_viscosity / flux / d
                new = 1 / sqrt(1 / free**2 + friction * self.path / d / 2 / integral)
                done = abs(new - flux) < 1e-15 * new
                flux = new
                if done:
                    break
            face = flux * opening * self.g.charge_length
        push, ws = 0.0, 0.0
        if self.ejected:
            collar = q.collar_discharge_coefficient * free
        else:
            ws = w
            left = self.g.stemming_length - s
            kappa = 4 * q.stemming_wall_friction / self.g.hole_diameter
            grip = exp(kappa * left)
            mobile = q.stemming_density * ((grip - 1) / kappa + s * grip)
            push = max(0.0, (p - AIR * grip) / mobile)
            n, grain = q.stemming_porosity, q.stemming_grain_ratio * self.g.hole_diameter
            ergun = 1.75 * (1 - n) / n**3 / grain
            collar = 1 / sqrt(1 / (n * free) ** 2 + ergun * max(left, 0.0) / integral)
        collar *= self.bore
        return [
            -face - collar,
            u,
            ((p - AIR) * self.area - q.floor_friction * self.mass * 9.80665) / self.mass,
            ws,
            push,
            p * self.storing,
            h * (face + collar),
        ]

    def drive(self, t: float, y: np.ndarray) -> float:
        p = self.gas(t, y)[0]
        return (p - 1.01 * AIR) - self.q.floor_friction * self.mass * 9.80665 / self.area

    def solve(self, method: str) -> dict[str, float]:
        """Integrate in pieces between the switches."""

        def end(t: float, y: np.ndarray) -> float:
            return self.drive(t, y)

        def out(t: float, y: np.ndarray) -> float:
            return self.g.stemming_length - y[3] if not self.ejected else 1.0

        end.terminal = out.terminal = True  # type: ignore[attr-defined]
        t, y = 0.0, np.array([self.m0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        ejection, pieces = np.inf, []
        scale = [self.m0, 0.1, 10.0, 1.0, 100.0, 1e7, 1e7]
        while True:
            stop = 10.0 if self.venting else self.vent_time
            path = solve_ivp(
                self.rates, (t, stop), y, method, events=[end, out], dense_output=True,
                rtol=1e-11, atol=[1e-14 * s for s in scale], first_step=1e-9,
            )  # fmt: skip
            assert path.success
            t, y = path.t[-1], path.y[:, -1]
            pieces.append(path)
            if path.t_events[0].size:
                break
            if path.t_events[1].size:
                self.ejected, ejection = True, t
            else:
                self.venting = True
        self.pieces = pieces
        target = 0.95 * y[2]
        piece = next(piece for piece in pieces if piece.y[2, -1] >= target)
        t95 = brentq(lambda s: piece.sol(s)[2] - target, piece.t[0], piece.t[-1], xtol=1e-15)
        return {
            "burden_velocity": y[2],
            "vented_fraction": 1 - y[0] / self.m0,
            "fracture_work": y[5],
            "vented_enthalpy": y[6],
            "acceleration_time": t95,
            "acceleration_distance": piece.sol(t95)[1],
            "motion_time": t,
            "ejection_time": ejection,
        }

    def at(self, t: float) -> np.ndarray:
        piece = next(piece for piece in self.pieces if t <= piece.t[-1])
        return np.asarray(piece.sol(t))


CASES = {
    "field": ("anfo", geometry(), parameters(), 1.72),
    "authors": ("emulsion", geometry(d=0.2, B=5.0, S=6.0, H=15.0, face=70.0),
                parameters("authors"), 1.65),
    "stemming leaves": ("anfo", geometry(d=0.3, B=1.0, S=1.2, H=6.0), parameters(), 1.6),
    "wide vents at once": ("doped", geometry(d=0.25, B=6.0, S=7.0, H=10.0),
                           parameters(initial_aperture=0.003, gas_front_velocity=5000.0,
                                      gas_viscosity=1e-3, floor_friction=0.3), 1.9),
}  # fmt: skip


@pytest.mark.parametrize("method", ["DOP853", "LSODA"])
@pytest.mark.parametrize("case", CASES)
def test_scipy_integrates_the_same_model_to_the_same_result(case: str, method: str) -> None:
    """An independent right-hand side, integrated by scipy at 1e-11, agrees to 1e-6.

    Also at the switches: start of venting, stemming out of the hole, end of the push.
    """
    name, bench, model, expansion = CASES[case]
    radius = expansion * 0.5 * bench.hole_diameter
    result = solve_burden_motion(explosive(name), bench, model, radius)
    reference = Reference(name, bench, model, radius)
    expected = reference.solve(method)
    assert result.status == Status.OK
    for key, value in expected.items():
        assert getattr(result, key) == pytest.approx(value, rel=1e-6), key
    assert np.isfinite(result.ejection_time) == (case == "stemming leaves")
    for i in range(1, result.history_time.size - 1, 6):
        t = result.history_time[i]
        y = reference.at(t)
        assert result.history_displacement[i] == pytest.approx(y[1], rel=1e-5)
        assert result.history_velocity[i] == pytest.approx(y[2], rel=1e-5)
        assert result.history_pressure[i] == pytest.approx(reference.gas(t, y)[0], rel=1e-5)


def test_rate_of_gas_energy_is_work_and_enthalpy() -> None:
    """d(m e)/dt = -P dV_g/dt - h (mass flow): an identity of the isentrope, at any state.

    The left side by central differences along the path, the right from the rates.
    """
    from castblast.burden import balance as bal
    from castblast.explosive.isentrope import energy

    product = explosive()
    b = bal.make_balance(product, geometry(d=0.2), parameters(initial_aperture=0.002), 0.17)
    state, rate = np.zeros(bal.STATE_SIZE), np.zeros(bal.STATE_SIZE)
    state[[bal.GAS_MASS, bal.DISPLACEMENT, bal.VELOCITY]] = 0.8 * b.gas_mass, 0.03, 7.0
    state[[bal.PLUG_DISPLACEMENT, bal.PLUG_VELOCITY]] = 0.1, 15.0
    t = 0.004
    bal.rates(b, True, True, t, state, rate)

    def gas_energy(h: float) -> float:
        moved = state + h * rate
        volume = bal.relative_volume(b, t + h, moved)
        return float(moved[bal.GAS_MASS] / product.density * energy(product.isentrope, volume))

    h = 1e-7
    change = (gas_energy(h) - gas_energy(-h)) / (2 * h)
    spent = rate[[bal.BURDEN_WORK, bal.FRACTURE_WORK, bal.PLUG_WORK, bal.VENTED_ENTHALPY]]
    assert np.all(spent > 0)
    assert change == pytest.approx(-spent.sum(), rel=1e-7)


@pytest.mark.parametrize("case", CASES)
def test_ledgers_close(case: str) -> None:
    """Mass to round-off and energy to 1e-7 of the gas energy, with and without ejection."""
    name, bench, model, expansion = CASES[case]
    result = solve_burden_motion(
        explosive(name), bench, model, expansion * 0.5 * bench.hole_diameter
    )
    assert abs(result.mass_residual) < 1e-13
    assert abs(result.burden_energy_residual) < 1e-8
    terms = (
        result.burden_kinetic_energy, result.fracture_work, result.stemming_work,
        result.vented_enthalpy, result.atmospheric_work, result.floor_work,
        result.final_gas_energy,
    )  # fmt: skip
    assert sum(terms) == pytest.approx(result.initial_gas_energy, rel=1e-8)
    assert min(terms) >= 0.0


@pytest.mark.parametrize(
    ("name", "bench", "p_eq", "velocity", "kinetic", "fracture", "t95", "x95"),
    [
        ("anfo", {"d": 0.089}, 249, 12.8, 12.4, 12.9, 16, 10),
        ("anfo", {}, 249, 14.8, 12.5, 12.9, 17, 13),
        ("anfo", {"d": 0.089, "B": 2.7, "S": 3.2, "H": 12.0, "rho": 2650.0},
         337, 14.8, 16.0, 14.4, 14, 11),
        ("anfo", {"B": 3.5, "S": 4.0, "H": 15.0}, 202, 10.7, 10.2, 12.1, 21, 11),
        ("emulsion", {"d": 0.229, "B": 6.0, "S": 7.0, "H": 12.0, "stem": 0.8, "rho": 3000.0},
         379, 10.3, 9.0, 14.0, 40, 22),
        ("heavy_anfo", {"d": 0.251, "B": 7.0, "S": 8.0, "H": 15.0}, 234, 11.7, 8.9, 11.9, 45, 27),
        ("anfo", {"d": 0.27, "B": 6.0, "S": 9.0, "H": 25.0, "face": 75.0, "rho": 2400.0},
         117, 9.9, 6.9, 10.3, 61, 31),
        ("emulsion", {"d": 0.165, "B": 4.5, "S": 5.2, "H": 10.0}, 261, 11.1, 8.5, 11.8, 31, 19),
        ("doped", {"d": 0.2, "B": 5.0, "S": 5.0, "H": 15.0}, 210, 14.1, 7.1, 9.2, 34, 26),
        ("anfo", {"d": 0.08, "B": 1.0, "S": 1.0, "H": 5.0}, 249, 36.2, 13.1, 12.9, 6, 13),
        ("doped", {"d": 0.3, "B": 15.0, "S": 15.0, "H": 30.0, "stem": 0.5},
         264, 7.1, 7.4, 10.0, 86, 32),
    ],
)  # fmt: skip
def test_designs_of_an_independent_prototype(
    name: str,
    bench: dict[str, float],
    p_eq: float,
    velocity: float,
    kinetic: float,
    fracture: float,
    t95: float,
    x95: float,
) -> None:
    """Eleven production designs, `field` parameters, computed once with other code and solver.

    Given to three digits there: velocity within 1 percent, shares of the heat of explosion within
    0.1 percent points (plus rounding). That run ended at twice the pressure of the open air, this
    one where the push ends, which adds up to 0.6 percent; t95 and x95 within 8 percent.
    """
    product, g = explosive(name), geometry(**bench)
    radius = hole_radius(product, p_eq * 1e6, g.hole_diameter)
    result = solve_burden_motion(product, g, parameters(), radius)
    heat = product.density * pi / 4 * g.charge_diameter**2 * g.charge_length
    heat *= product.heat_of_explosion
    assert result.burden_velocity == pytest.approx(velocity, rel=0.01)
    assert 100 * result.burden_kinetic_energy / heat == pytest.approx(kinetic, abs=0.15)
    assert 100 * result.fracture_work / heat == pytest.approx(fracture, abs=0.1)
    assert 1e3 * result.acceleration_time == pytest.approx(t95, abs=1.5)
    assert 1e2 * result.acceleration_distance == pytest.approx(x95, abs=1.1)


@pytest.mark.parametrize(
    ("bench", "model", "velocity"),
    [
        ({"rho": 2000.0}, {}, 18.8),
        ({"B": 2.0, "S": 2.0}, {}, 23.8),
        ({"B": 4.0, "S": 4.0}, {}, 10.3),
        ({"S": 4.0}, {}, 12.7),
        ({"H": 6.0}, {}, 11.7),
        ({"H": 20.0}, {}, 15.8),
        ({"stem": 0.4}, {}, 15.9),
        ({"stem": 1.0}, {}, 13.6),
        ({"face": 75.0}, {}, 12.1),
        ({"d": 0.165}, {}, 24.2),
        ({}, {"fracture_opening_ratio": 0.5}, 17.2),
        ({}, {"fracture_opening_ratio": 2.0}, 13.2),
        ({}, {"pressurised_width_ratio": 0.05}, 18.2),
        ({}, {"pressurised_width_ratio": 0.2}, 11.9),
        ({}, {"fracture_storage_ratio": 0.0}, 23.1),
        ({}, {"fracture_storage_ratio": 2.0}, 10.8),
        ({}, {"gas_front_velocity": 196.0}, 16.7),
        ({}, {"crack_velocity": 489.0}, 15.1),
        ({}, {"fracture_friction_factor": 0.3}, 15.8),
        ({}, {"fracture_count": 2.0}, 14.3),
        ({}, {"stemming_wall_friction": 0.02}, 14.7),
        ({}, {"fracture_storage_ratio": 0.0, "gas_front_velocity": 1300.0}, 14.0),
        ({}, SEALED, 24.0),
        ({}, SEALED | {"fracture_storage_ratio": 0.0}, 28.3),
    ],
)
def test_sensitivities_of_an_independent_prototype(
    bench: dict[str, float], model: dict[str, float], velocity: float
) -> None:
    """Velocities around the 14.8 m/s base case, one change at a time, within 1 percent."""
    assert base(bench, **model).burden_velocity == pytest.approx(velocity, rel=0.01)
