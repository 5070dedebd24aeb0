"""Blasts against two other codes: converged reference cases and a table of sensitivities."""

import csv
from pathlib import Path

import numpy as np
import pytest
from near_field_problems import ANFO, DOPED, EMULSION, HEAVY_ANFO, base_hole, blast, explosive, rock

from castblast.errors import Status
from castblast.nearfield.case import EndMode, Hole

CASES = list(csv.DictReader((Path(__file__).parents[1] / "data/near_field_cases.csv").open()))
REFERENCE_EXPLOSIVES = {
    "ANFO": explosive(931.0, 4160.0, (49.46, 1.891, 0.47761, 3.907, 1.118, 0.333333), 2.484),
    "EMULSION": explosive(1180.0, 5000.0, (276.2, 8.44, 1.36039, 5.2, 2.1, 0.5), 5.0),
}


#: Shares [percent] of the end time at which that code states pressure and radius, and the largest
#: relative deviations from it. At 10 percent it is widest in the softest rock (10 to 17 GPa) and no
#: smaller with 1,024 zones: there the two elastic laws, Kirchhoff and Cauchy, differ most.
HISTORY = {10: (0.015, 0.003), 25: (0.005, 0.002), 50: (0.005, 0.002), 75: (0.005, 0.002)}


@pytest.mark.parametrize("row", CASES, ids=lambda row: f"case {row['case']}")
def test_converged_cases_of_another_code(row: dict[str, str]) -> None:
    """Eighteen cases, `paper` mode, of an independent code (1,024 zones, Cauchy stress).

    Cases 2, 9 and 15 to 18 yield in the wave front. With a viscosity over a physical length case 15
    was off by 1.4 percent in pressure, 0.45 in hole radius and 1.2 in the 1 percent strain radius.
    Pressure to 0.3 percent, hole radius 0.1, 1 percent strain radius 0.5, outermost shear yield 2,
    gas work 0.5, all plastic work (shear and tension, which that code does not separate) 1, and
    the same end time. Ours has Kirchhoff stress and 256 zones. Pressure and radius on the way at
    10 to 75 percent of that time, so that an end state reached by a wrong path does not pass.
    """
    product = REFERENCE_EXPLOSIVES[row["explosive"]]
    v = {name: float(text) for name, text in row.items() if name not in ("case", "explosive")}
    case = rock(
        density=v["density"], young_modulus=v["young_GPa"] * 1e9, poisson_ratio=v["poisson"],
        ucs=v["ucs_MPa"] * 1e6, friction_angle=v["friction_deg"],
        dilation_angle=v["dilation_deg"], tensile_strength=v["tension_MPa"] * 1e6,
    )  # fmt: skip
    diameter = v["diameter_mm"] * 1e-3
    hole = Hole(diameter, diameter, v["rise_us"] * 1e-6, v["in_situ_MPa"] * 1e6)
    result = blast(product, case, hole, mode=EndMode.PAPER, history_points=401)
    radius = 0.5 * diameter
    dissipated = result.plastic_work + result.tensile_work
    assert result.status == Status.OK
    assert result.end_time == pytest.approx(v["end_ms"] * 1e-3, rel=1e-6)
    assert result.equilibrium_pressure == pytest.approx(v["pressure_MPa"] * 1e6, rel=0.003)
    assert result.expanded_hole_radius == pytest.approx(v["radius_ratio"] * radius, rel=0.001)
    assert result.crushed_zone_radius == pytest.approx(v["crushed_ratio"] * radius, rel=0.005)
    assert result.plastic_zone_radius == pytest.approx(v["plastic_ratio"] * radius, rel=0.02)
    assert result.gas_work == pytest.approx(v["work_MJ_m"] * 1e6, rel=0.005)
    assert dissipated == pytest.approx(v["plastic_MJ_m"] * 1e6, rel=0.01)
    for share, (of_pressure, of_radius) in HISTORY.items():
        time = share / 100.0 * result.end_time
        pressure = np.interp(time, result.history_time, result.history_pressure)
        wall = np.interp(time, result.history_time, result.history_radius)
        assert pressure == pytest.approx(v[f"pressure_{share}_MPa"] * 1e6, rel=of_pressure)
        assert wall == pytest.approx(v[f"radius_{share}_ratio"] * radius, rel=of_radius)


def test_the_reference_table_is_whole() -> None:
    """All eighteen cases, each with every figure: a case that is lost must not go unnoticed."""
    assert [int(row["case"]) for row in CASES] == list(range(1, 19))
    assert all(float(text) >= 0.0 for row in CASES for key, text in row.items()
               if key != "explosive")  # fmt: skip


SENSITIVITIES = [
    ({}, ANFO, 211, 1.802),
    ({"ucs": 1e7}, ANFO, 113, 2.16),
    ({"ucs": 5e7}, ANFO, 142, 2.02),
    ({"ucs": 2e8}, ANFO, 323, 1.61),
    ({"young_modulus": 5e9}, ANFO, 123, 2.10),
    ({"young_modulus": 5e10}, ANFO, 308, 1.63),
    ({"friction_angle": 25.0}, ANFO, 196, 1.84),
    ({"friction_angle": 55.0}, ANFO, 177, 1.89),
    ({"dilation_angle": 10.0}, ANFO, 315, 1.62),
    ({"dilation_angle": 22.5}, ANFO, 445, 1.48),
    ({"poisson_ratio": 0.15}, ANFO, 203, 1.82),
    ({"poisson_ratio": 0.35}, ANFO, 219, 1.79),
    ({}, HEAVY_ANFO, 203, 1.87),
    ({}, EMULSION, 185, 1.84),
    ({}, DOPED, 180, 1.92),
]


@pytest.mark.parametrize(("changes", "product", "pressure", "ratio"), SENSITIVITIES)
def test_sensitivities_of_a_prototype(changes, product, pressure, ratio) -> None:
    """Hole 150 mm, tensile strength UCS / 12, `paper` mode: pressure to 1 percent, radius 0.01.

    Derived by this project with another program (Cauchy stress, 200 zones).
    """
    case = rock(**changes)
    sine = np.sin(case.friction_angle)
    apex = case.ucs * (1.0 - sine) / (2.0 * sine)
    case = case._replace(tensile_strength=min(case.ucs / 12.0, 0.95 * apex))
    result = blast(product, case, mode=EndMode.PAPER)
    assert result.equilibrium_pressure == pytest.approx(pressure * 1e6, rel=0.01)
    assert result.expanded_hole_radius / 0.075 == pytest.approx(ratio, abs=0.011)
    assert abs(result.energy_residual) < 1e-4


def test_a_large_hole_has_not_settled_in_paper_mode_and_says_so() -> None:
    """300 mm: 239 MPa with the wall still moving at 25 m/s; the settled pressure is 211 MPa."""
    case = rock(tensile_strength=1e8 / 12.0)
    paper = blast(ANFO, case, base_hole(0.3), mode=EndMode.PAPER)
    assert paper.equilibrium_pressure == pytest.approx(239e6, rel=0.01)
    assert paper.wall_velocity > 15.0
    assert not paper.settled
    settled = blast(ANFO, case, base_hole(0.3))
    assert settled.settled
    assert settled.equilibrium_pressure == pytest.approx(211.3e6, rel=0.003)


def test_settled_state_in_cut_off_free_rock_is_level_with_the_published_tool() -> None:
    """ANFO, phi 40 deg, E 10 GPa, no tensile strength: levels shown by the authors' public tool.

    UCS 100 and 20 MPa, E 6 and 45 GPa, phi 28 and 52 deg, within 6 percent (nothing is fitted;
    their rock data are partly unknown).
    """
    base = {"ucs": 1e8, "young_modulus": 1e10, "friction_angle": 40.0}
    shown = [({}, 190), ({"ucs": 2e7}, 74), ({"young_modulus": 6e9}, 158),
             ({"young_modulus": 4.5e10}, 328), ({"friction_angle": 28.0}, 175),
             ({"friction_angle": 52.0}, 195)]  # fmt: skip
    for changes, pressure in shown:
        result = blast(ANFO, rock(**(base | changes)))
        assert result.equilibrium_pressure == pytest.approx(pressure * 1e6, rel=0.07)
