"""The burden velocity is smooth in every input, by formula and by table."""

from __future__ import annotations

from functools import partial
from math import pi

import numpy as np
import pytest
from burden_problems import base, explosive, geometry, hole_radius, parameters

from castblast.burden.batch import BurdenColumns, solve_burden_motions
from castblast.burden.motion import solve_burden_motion
from castblast.errors import Status
from castblast.explosive.isentrope import (
    pressure,
    tabulated_isentrope,
)


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
