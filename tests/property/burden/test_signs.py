"""Which way the burden velocity must move with each input, over the whole training domain."""

from __future__ import annotations

from math import pi

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from near_field_problems import ANFO

from castblast.burden.case import BurdenGeometry, BurdenParameters
from castblast.burden.motion import solve_burden_motion
from castblast.design.variables import BURDEN_PARAMETER_SETS, VARIABLES
from castblast.errors import Status

DESIGN = st.fixed_dictionaries(
    {
        "parameter_set": st.sampled_from(sorted(BURDEN_PARAMETER_SETS)),
        "hole_diameter": st.floats(0.08, 0.3),
        "burden": st.floats(1.0, 15.0),
        "spacing_ratio": st.floats(0.8, 1.6),
        "bench_height": st.floats(5.0, 30.0),
        "stemming_ratio": st.floats(0.4, 1.0),
        "face_angle": st.floats(60.0, 88.0),
        "rock_density": st.floats(1800.0, 3000.0),
        "expansion": st.floats(1.4, 2.6),
    }
)


def velocity(design: dict[str, float], **change: float) -> float:
    """Burden velocity of a design, after multiplying some of its entries.

    Designs whose stemming does not hold are left out: there, more stemming keeps more gas.
    """
    d = {k: v * change.get(k, 1.0) for k, v in design.items() if k != "parameter_set"}
    stemming = design["burden"] * d["stemming_ratio"]
    spacing = design["burden"] * d["spacing_ratio"]
    charge = d["bench_height"] - stemming
    assume(charge > 6.0 * d["hole_diameter"])
    model = {n: float(VARIABLES[n].default or 0.0) for n in BurdenParameters._fields}
    model |= BURDEN_PARAMETER_SETS[str(design["parameter_set"])]
    model |= {n: v * change.get(n, 1.0) for n, v in model.items()}
    bench = BurdenGeometry(
        d["burden"], spacing, d["bench_height"], d["face_angle"] * pi / 180.0, stemming, charge,
        d["rock_density"], d["hole_diameter"], d["hole_diameter"],
    )  # fmt: skip
    radius = 0.5 * d["expansion"] * d["hole_diameter"]
    result = solve_burden_motion(ANFO, bench, BurdenParameters(**model), radius)
    assert result.status == Status.OK
    assert abs(result.burden_energy_residual) < 1e-7
    assert 0.0 <= result.vented_fraction < 1.0
    assume(result.ejection_time > result.acceleration_time)
    return result.burden_velocity


@pytest.mark.parametrize(
    ("name", "sign"),
    [
        ("rock_density", -1),
        ("burden", -1),  # stemming and spacing held
        ("spacing_ratio", -1),
        ("hole_diameter", 1),
        ("bench_height", 1),  # upright face: the share of the stemming falls
        ("stemming_ratio", -1),
        ("face_angle", 1),
        ("expansion", -1),  # less energy left in the gas: weaker rock
        ("fracture_opening_ratio", -1),
        ("fracture_friction_factor", 1),
        ("fracture_storage_ratio", -1),
        ("gas_front_velocity", -1),
        ("floor_friction", 0),
    ],
)
def test_velocity_moves_the_right_way(name: str, sign: int) -> None:
    """More rock, more room for the gas or earlier venting: slower. More gas energy: faster."""

    @settings(max_examples=40, derandomize=True, deadline=None, database=None)
    @given(design=DESIGN)
    def check(design: dict[str, float]) -> None:
        if name == "bench_height":
            design = design | {"face_angle": 90.0}  # else a higher bench has more toe burden
        change = velocity(design, **{name: 1.02}) - velocity(design)
        assert change * sign > 0.0 if sign else change == 0.0

    check()
