"""Burden motion against closed forms, limits, conservation laws and an independent integration."""

from __future__ import annotations

from functools import partial
from math import cos, exp, log, pi, sin, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from castblast.burden.batch import BurdenColumns, solve_burden_motions
from castblast.burden.case import BurdenGeometry, BurdenParameters, BurdenResult
from castblast.burden.motion import solve_burden_motion
from castblast.design.variables import BURDEN_PARAMETER_SETS, VARIABLES
from castblast.errors import Status
from castblast.explosive.isentrope import (
    Explosive,
    jwl_isentrope,
    pressure,
    tabulated_isentrope,
)

AIR = 101_325.0
# density, CJ velocity, heat of explosion, E0; A, B, C [GPa], R1, R2, omega. Derived by this
# project from a BKW-type thermochemical fit.
PRODUCTS = {
    "anfo": (800.0, 4806.0, 3.75e6, 3.2938e9, 141.731, 2.4178, 0.8586, 5.4081, 1.2931, 0.3510),
    "heavy_anfo": (950.0, 5391.0, 3.53e6, 3.5953e9, 272.005, 4.3544, 1.0629, 5.6736, 1.4765,
                   0.4294),
    "emulsion": (1150.0, 6129.0, 2.62e6, 3.6304e9, 563.384, 6.7052, 0.7578, 5.7557, 1.4798,
                 0.3898),
    "doped": (1280.0, 6845.0, 2.96e6, 4.4260e9, 822.822, 8.7125, 0.8673, 5.7618, 1.4683, 0.4020),
}  # fmt: skip


def explosive(name: str = "anfo") -> Explosive:
    density, velocity, heat, total, a, b, c, r1, r2, omega = PRODUCTS[name]
    isentrope = jwl_isentrope(a * 1e9, b * 1e9, c * 1e9, r1, r2, omega)
    return Explosive(density, velocity, heat, total, 0.211, 0.84, isentrope)


def parameters(parameter_set: str = "field", **changes: float) -> BurdenParameters:
    values = {name: VARIABLES[name].default for name in BurdenParameters._fields}
    values |= BURDEN_PARAMETER_SETS[parameter_set] | changes
    return BurdenParameters(**{name: float(value) for name, value in values.items()})


def geometry(
    d: float = 0.102,
    B: float = 3.0,
    S: float = 3.0,
    H: float = 12.5,
    stem: float = 0.7,
    face: float = 90.0,
    rho: float = 2600.0,
) -> BurdenGeometry:
    return BurdenGeometry(B, S, H, face * pi / 180.0, stem * B, H - stem * B, rho, d, d)


def hole_radius(product: Explosive, p: float, d: float) -> float:
    """Radius of a hole that has opened to gas pressure `p` from diameter `d`."""
    ratio = brentq(lambda q: log(pressure(product.isentrope, q * q) / p), 1.0, 6.0, xtol=1e-13)
    return 0.5 * d * ratio


def base(changes: dict[str, float] | None = None, **model: float) -> BurdenResult:
    """ANFO in a 102 mm hole, 3 m x 3 m x 12.5 m, equilibrium pressure 249 MPa."""
    bench = geometry(**(changes or {}))
    product = explosive()
    radius = hole_radius(product, 249e6, bench.hole_diameter)
    return solve_burden_motion(product, bench, parameters(**model), radius)


SEALED = {"fracture_opening_ratio": 0.0, "stemming_wall_friction": 1.0, "stemming_porosity": 0.0}


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


def test_result_is_smooth_in_the_inputs() -> None:
    """No noise of step sizes or switches in the velocity: fourth differences over a sweep.

    A sweep of the burden in steps of 2.5 mm; a truncation noise of 1e-6 would show as 1e-5. The
    second sweep has the stemming leave the hole, ever later and then never.
    """
    for d, burdens, spacing in (
        (0.102, np.linspace(2.5, 3.0, 201), 3.0),
        (0.2, np.linspace(1.55, 2.05, 201), 3.0),
    ):
        results = [base({"d": d, "B": float(b), "S": spacing}) for b in burdens]
        v = np.array([result.burden_velocity for result in results])
        assert np.abs(np.diff(v, 4)).max() / v.max() < 2e-8
    gone = [np.isfinite(result.ejection_time) for result in results]
    assert any(gone)
    assert not all(gone)


def sharpness(y: np.ndarray) -> float:
    """Largest fourth difference of a curve, over that of every eighth of its points.

    About 8^-4 for a smooth curve and 8^-2 where the second derivative jumps, but 1/32 to 1/2 for
    a kink, depending on where it lies between points. Below 1e-8 of the range there is only
    noise.
    """
    fine, coarse = (np.abs(np.diff(values, 4)).max() for values in (y, y[::8]))
    floor = 1e-8 * np.ptp(y)
    return float(max(fine, floor) / max(coarse, 8.0 * 8.0 * floor))


def test_sharpness_finds_a_kink_of_a_tenth_of_a_percent() -> None:
    """A slope that changes by 0.1 percent at any place between the points; and none at all."""
    x = np.linspace(0.0, 1.0, 199 * 8 + 1)
    assert sharpness(np.exp(x)) < 0.02
    for place in 0.5 + np.linspace(0.0, 1.0, 33) / 199:
        assert sharpness(np.exp(x) + 2e-3 * np.abs(x - place)) > 0.025


SWEEPS = {
    "burden": (1.5, 8.0),
    "spacing": (2.0, 14.0),  # beyond twice the burden: from a row of holes to a single one
    "bench_height": (6.0, 30.0),
    "face_angle": (pi / 3, pi / 2),
    "stemming_length": (0.1, 4.5),
    "rock_density": (1800.0, 3000.0),
    "hole_diameter": (0.08, 0.3),
    "expansion": (1.4, 2.8),
    "gas_front_velocity": (50.0, 2000.0),
    "fracture_opening_ratio": (0.1, 3.0),  # towards 0 as its power 1.5: rough narrow fractures
    "fracture_storage_ratio": (0.0, 3.0),
    "stemming_wall_friction": (0.0, 0.3),
}


def sweep(name: str, parameter_set: str, diameter: float, points: int) -> np.ndarray:
    """Velocity of a bench of 3 m burden along one input, the others held."""
    values = parameters(parameter_set)._asdict() | {
        "burden": 3.0, "spacing": 3.5, "bench_height": 12.0, "face_angle": 1.3,
        "stemming_length": 2.1, "rock_density": 2600.0, "hole_diameter": diameter,
        "expansion": 1.8,
    }  # fmt: skip
    columns = {key: np.full(points, value) for key, value in values.items()}
    columns[name] = np.linspace(*SWEEPS[name], points)
    columns["charge_length"] = columns["bench_height"] - columns["stemming_length"]
    columns["charge_diameter"] = columns["hole_diameter"]
    columns["expanded_hole_radius"] = 0.5 * columns.pop("expansion") * columns["hole_diameter"]
    cases = BurdenColumns(explosive=np.zeros(points, dtype=np.int64), **columns)
    batch = solve_burden_motions([explosive()], cases)
    assert np.all(batch.status == Status.OK)
    return batch.burden_velocity


@pytest.mark.parametrize("name", SWEEPS)
def test_velocity_has_no_kink_along_any_input(name: str) -> None:
    """200 points along an input, then 8 times as many: no jump of the first derivative.

    The sweeps pass choked and unchoked outflow, stemming that holds, moves, leaves the hole
    before or after venting starts, venting after the end of the push, and spacings beyond twice
    the burden. The stemming of the 250 mm hole is short for it and leaves.
    """
    for parameter_set, diameter in (("field", 0.102), ("authors", 0.25)):
        assert sharpness(sweep(name, parameter_set, diameter, 199 * 8 + 1)) < 0.025


@pytest.mark.parametrize("last_volume", [700.0, 42.0])
def test_table_and_formula_agree(last_volume: float) -> None:
    """A table of the same isentrope gives the velocity of the JWL law within 0.2 percent.

    Also where the table ends at 5 MPa, the least a valid table has to reach: beyond, the last
    slope of the near-ideal gas continues.
    """
    product = explosive()
    volume = np.geomspace(0.73, last_volume, 40)
    p = [pressure(product.isentrope, float(v)) for v in volume]
    table = product._replace(isentrope=tabulated_isentrope(volume, p))
    radius = hole_radius(product, 249e6, 0.102)
    solve = partial(solve_burden_motion, geometry=geometry(), parameters=parameters())
    reference = solve(product, expanded_hole_radius=radius)
    found = solve(table, expanded_hole_radius=radius)
    assert found.status == Status.OK
    assert found.burden_velocity == pytest.approx(reference.burden_velocity, rel=2e-3)
    assert abs(found.burden_energy_residual) < 1e-7


def test_table_that_ends_at_high_pressure_is_refused() -> None:
    """A table that stops at 100 MPa cannot be continued to the open air."""
    product = explosive()
    volume = np.geomspace(0.73, 5.0, 15)
    p = [pressure(product.isentrope, float(v)) for v in volume]
    table = product._replace(isentrope=tabulated_isentrope(volume, p))
    result = solve_burden_motion(table, geometry(), parameters(), 0.09)
    assert result.status == Status.OUT_OF_ISENTROPE
