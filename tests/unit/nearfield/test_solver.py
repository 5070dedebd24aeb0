"""Statuses, shapes and bookkeeping of `solve_near_field`; helpers that read the end state."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from near_field_problems import ANFO, BASE_ROCK, DOPED, base_hole, blast, rock

from castblast.design.variables import VARIABLES
from castblast.errors import Status
from castblast.explosive.isentrope import pressure, tabulated_isentrope
from castblast.nearfield import march as march_module
from castblast.nearfield import solver
from castblast.nearfield.case import EndMode, Hole, NearFieldSettings
from castblast.nearfield.mesh import EQUILIBRIUM_ZONES
from castblast.nearfield.outcome import (
    STATE_NAMES,
    end_state,
    histories,
    last_time_outside,
    mean_over,
    steep_radius,
    threshold_radius,
    yield_radius,
)
from castblast.nearfield.solver import NearFieldResult, solve_near_field


def test_every_number_of_the_result_is_in_the_table_of_variables_and_in_its_bounds() -> None:
    result = blast()
    extra = {"status", "n_steps", "zone_steps", "return_map_fallbacks"}
    names = {n for n in NearFieldResult._fields if not n.startswith("history_")} - extra
    assert names <= VARIABLES.keys()
    for name in names:
        assert VARIABLES[name].lower <= getattr(result, name) <= VARIABLES[name].upper


def test_types_are_plain() -> None:
    """No NumPy scalars or enums: results go to JSON as they are."""
    for field, value in blast()._asdict().items():
        expected = np.ndarray if field.startswith("history_") else (float, int, bool)
        assert type(value) in (expected if isinstance(expected, tuple) else (expected,)), field


@pytest.mark.parametrize(
    ("case", "hole", "settings"),
    [
        (rock(friction_angle=0.0), {}, {}),
        (rock(friction_angle=-10.0), {}, {}),
        (rock(friction_angle=90.0), {}, {}),
        (rock(friction_angle=30.0, dilation_angle=31.0), {}, {}),
        (rock(dilation_angle=-1.0), {}, {}),
        (rock(ucs=0.0), {}, {}),
        (rock(young_modulus=-1.0), {}, {}),
        (rock(poisson_ratio=0.5), {}, {}),
        (rock(density=0.0), {}, {}),
        (rock(tensile_strength=-1.0), {}, {}),
        (rock(ucs=float("nan")), {}, {}),
        (rock(young_modulus=float("inf")), {}, {}),
        (BASE_ROCK, {"diameter": 0.0}, {}),
        (BASE_ROCK, {"charge_diameter": 0.2}, {}),
        (BASE_ROCK, {"charge_diameter": 0.0}, {}),
        (BASE_ROCK, {"rise_time": -1e-6}, {}),
        (BASE_ROCK, {"in_situ_stress": -1.0}, {}),
        (BASE_ROCK, {}, {"outer_radius": 0.05}),
        (BASE_ROCK, {}, {"outer_radius": -5.5}),
        (BASE_ROCK, {}, {"zones": 2}),
        (BASE_ROCK, {}, {"mode": 7}),
        (BASE_ROCK, {}, {"tension": -1}),
        (BASE_ROCK, {}, {"linear_viscosity": -0.1}),
        (BASE_ROCK, {}, {"history_points": 1}),
    ],
)
def test_impossible_input_is_a_status_and_not_an_exception(case, hole, settings) -> None:
    result = blast(of=case, hole=base_hole()._replace(**hole), **settings)
    assert result.status == Status.BAD_INPUT
    assert np.isnan(result.equilibrium_pressure)
    assert np.isnan(result.history_pressure).all()
    assert not result.settled


def test_gas_that_leaves_its_table_is_reported() -> None:
    """A table that ends at V = 1.05 may be continued to 3.15; weak rock opens the hole further."""
    volume = np.geomspace(0.7, 1.05, 12)
    short = tabulated_isentrope(volume, [pressure(ANFO.isentrope, v) for v in volume])
    result = blast(ANFO._replace(isentrope=short), rock(ucs=2e7))
    assert result.status == Status.OUT_OF_ISENTROPE
    assert result.n_steps > 0
    wide = Hole(0.3, 0.1, 1e-5, 0.0)
    assert blast(ANFO._replace(isentrope=short), hole=wide).status == Status.OUT_OF_ISENTROPE


def test_step_limit_is_not_converged() -> None:
    case = solver._annulus(ANFO, BASE_ROCK, base_hole(), NearFieldSettings())
    run = march_module.march(case._replace(max_steps=50))
    assert (run.status, run.steps) == (Status.NOT_CONVERGED, 50)
    state = np.empty(len(STATE_NAMES))
    end_state(case, run, ANFO.total_energy, state)
    assert state[0] == Status.NOT_CONVERGED
    assert state[STATE_NAMES.index("n_steps")] == 50
    assert np.isnan(state[STATE_NAMES.index("expanded_hole_radius")])


def test_an_open_ledger_and_a_failed_return_are_statuses() -> None:
    """Work that the rock has not received, and a return that no set of planes admits."""
    case = solver._annulus(ANFO, BASE_ROCK, base_hole(), NearFieldSettings())
    run = march_module.march(case)
    state = np.empty(len(STATE_NAMES))
    end_state(case, run, ANFO.total_energy, state)
    assert state[0] == Status.OK
    end_state(case, run._replace(fallbacks=3), ANFO.total_energy, state)
    assert state[0] == Status.RETURN_MAP_FAILED
    assert state[STATE_NAMES.index("return_map_fallbacks")] == 3
    end_state(case, run._replace(work=run.work * 1.01), ANFO.total_energy, state)
    assert state[0] == Status.LEDGER_OPEN


def test_a_state_that_blows_up_is_unstable() -> None:
    """A first step far beyond the stable limit (reached only by hand) turns a zone inside out."""
    case = solver._annulus(DOPED, BASE_ROCK, base_hole(rise_time=0.0), NearFieldSettings())
    run = march_module.march(case._replace(courant=1e5))
    assert run.status == Status.UNSTABLE_STEP


def test_same_numbers_in_any_thread() -> None:
    """The kernel holds no lock and no state: threads give what one run alone gives, to the bit."""
    designs = [rock(ucs=u) for u in np.linspace(4e7, 1.5e8, 12)]
    alone = [blast(of=d).equilibrium_pressure for d in designs]
    with ThreadPoolExecutor(4) as pool:
        together = [r.equilibrium_pressure for r in pool.map(lambda d: blast(of=d), designs)]
    assert together == alone


def test_histories_have_fixed_length_and_end_at_the_end() -> None:
    for points in (2, 33):
        result = blast(history_points=points, mode=EndMode.PAPER)
        assert result.history_time.shape == (points,)
        assert result.history_time[0] == 0.0
        assert result.history_time[-1] == pytest.approx(result.end_time, rel=1e-12)
        assert result.history_radius[0] == pytest.approx(0.075)
        assert result.history_radius[-1] == pytest.approx(result.expanded_hole_radius, rel=1e-12)
        assert (np.diff(result.history_time) > 0.0).all()


def test_integers_and_numpy_numbers_are_accepted() -> None:
    case = rock(young_modulus=np.float64(2e10), ucs=100_000_000)
    result = solve_near_field(
        ANFO, case, base_hole(), NearFieldSettings(mode=1, zones=np.int64(EQUILIBRIUM_ZONES))
    )
    assert result.equilibrium_pressure == blast().equilibrium_pressure


def test_equilibrium_time_is_the_last_time_outside_one_percent() -> None:
    result = blast(history_points=2000, mode=EndMode.PAPER)
    outside = np.abs(result.history_radius / result.expanded_hole_radius - 1.0) > 0.01
    last = result.history_time[outside][-1]
    assert result.equilibrium_time == pytest.approx(last, abs=2.0 * result.end_time / 2000.0)


def test_threshold_radius_follows_a_power_law_of_zone_means() -> None:
    """What a zone holds is the mean over its area, in zones as wide as a third of their radius."""
    nodes = np.geomspace(1.0, 100.0, 17)
    area = 0.5 * np.diff(nodes**2)
    for wanted in (2.0, 7.3, 31.0):
        for power in (-3.5, -2.5, -1.2):
            order = power + 2.0
            mean = 0.01 * wanted**-power * np.diff(nodes**order) / order / area
            assert threshold_radius(nodes, mean, 0.01) == pytest.approx(wanted, rel=1e-6)
            assert steep_radius(nodes, mean, 0.01) == pytest.approx(wanted, rel=1e-6)
    assert threshold_radius(nodes, np.full(16, 0.001), 0.01) == 1.0
    assert threshold_radius(nodes, np.ones(16), 0.01) == 100.0


def test_steep_radius_follows_what_is_no_power_of_the_radius() -> None:
    """Three zones see the bend of a strain near the wall, which two do not."""
    nodes = np.geomspace(1.0, 10.0, 24)
    radius = np.linspace(1.0, 10.0, 2_000_001)
    strain = 0.05 * radius**-2.0 * np.exp(-0.3 * (radius - 1.0))
    zone = np.clip(np.searchsorted(nodes, radius, side="right") - 1, 0, 22)
    mean = np.bincount(zone, strain * radius) / np.bincount(zone, radius)
    wanted = np.interp(-0.01, -strain, radius)
    two, three = (f(nodes, mean, 0.01) / wanted - 1.0 for f in (threshold_radius, steep_radius))
    assert abs(three) < 2e-4
    assert abs(three) < 0.6 * abs(two)


def test_yield_radius_moves_continuously_from_zone_to_zone() -> None:
    """As the multiplier of a zone passes zero, the radius passes its centre without a jump."""
    nodes = np.array([1.0, 2.0, 4.0, 8.0])
    before, after = (
        yield_radius(nodes, np.array([0.02, 1e-6 + small, -0.003])) for small in (-1e-12, 1e-12)
    )
    assert before == pytest.approx(3.0, rel=1e-6)
    assert after == pytest.approx(before, rel=1e-6)
    grown = yield_radius(nodes, np.array([0.03, 0.004, -0.002]))
    assert 3.0 < grown < 6.0
    assert yield_radius(nodes, np.array([-0.1, -0.2, -0.3])) == 1.0


def test_window_mean_cuts_steps_at_its_ends() -> None:
    """With r = 1 + t on uneven steps: the mean over [0.25, 0.75] is 1.5, extremes 1.25, 1.75."""
    time = np.array([0.0, 0.1, 0.4, 0.6, 1.0])
    record = np.column_stack([time, 1.0 + time, np.zeros(5)])
    assert mean_over(record, 0.25, 0.75) == pytest.approx((1.5, 1.25, 1.75))
    assert last_time_outside(record, 2.0, 0.3) == pytest.approx(0.7)
    points = np.empty((3, 3))
    histories(record, points)
    np.testing.assert_allclose(points[0], [0.0, 0.25, 1.0])
    np.testing.assert_allclose(points[2], [1.0, 1.25, 2.0])
