"""Completing and checking a design, and the chain from near field to burden."""

from __future__ import annotations

from math import isnan, pi, radians

import pytest

from castblast.blast.inputs import design_faults, resolve_inputs
from castblast.blast.run import BlastSettings, make_case, result_values, run_blast
from castblast.burden.case import BurdenParameters
from castblast.design.variables import BURDEN_PARAMETER_SETS, INPUT_NAMES, INPUTS, OUTPUT_NAMES
from castblast.errors import SpecError, Status
from castblast.explosive.isentrope import in_hole_velocity
from castblast.nearfield.case import EndMode, TensionMode
from castblast.specs.explosive import load_explosive

ANFO = load_explosive("anfo").to_explosive()


def faults(**values: float) -> list[str]:
    with pytest.raises(SpecError) as caught:
        resolve_inputs(values, ANFO)
    return str(caught.value).split("\n")


def test_defaults_make_a_whole_design() -> None:
    full = resolve_inputs({}, ANFO)
    assert tuple(full) == INPUT_NAMES
    assert full["spacing"] == full["burden"] == 3.0
    assert full["charge_diameter"] == full["hole_diameter"] == 0.15
    assert full["stemming_length"] == pytest.approx(0.7 * 3.0)
    assert full["charge_length"] == pytest.approx(12.5 - 0.7 * 3.0)
    assert full["rise_time"] == pytest.approx(0.15 / in_hole_velocity(ANFO, 0.15))
    assert full["outer_radius"] == full["zones"] == 0.0


def test_given_values_win_over_what_is_derived() -> None:
    given = {"spacing": 4.0, "charge_diameter": 0.1, "rise_time": 0.0, "gas_front_velocity": 500.0}
    full = resolve_inputs(given, ANFO)
    assert {name: full[name] for name in given} == given


def test_stemming_and_charge_share_the_hole() -> None:
    assert resolve_inputs({"charge_length": 9.0}, ANFO)["stemming_length"] == pytest.approx(3.5)
    assert resolve_inputs({"stemming_length": 2.5}, ANFO)["charge_length"] == pytest.approx(10.0)
    short = resolve_inputs({"stemming_length": 2.5, "charge_length": 8.0}, ANFO)
    assert (short["stemming_length"], short["charge_length"]) == (2.5, 8.0)
    full = resolve_inputs({"bench_height": 0.1 + 6.2, "charge_length": 6.3}, ANFO)
    assert full["stemming_length"] == 0.0


def test_burden_parameters_are_those_of_the_table() -> None:
    assert set(BurdenParameters._fields) == {v.name for v in INPUTS if v.role == "burden_model"}
    for name, changes in BURDEN_PARAMETER_SETS.items():
        full = resolve_inputs({}, ANFO, name)
        assert {key: full[key] for key in changes} == changes
    assert resolve_inputs({}, ANFO) == resolve_inputs({}, ANFO, "authors")


def test_every_fault_is_named_at_once_with_value_unit_and_limit() -> None:
    lines = faults(ucs=100.0, hole_diameter=0.3, charge_diameter=0.31, dilation_angle=radians(50.0))
    assert lines == [
        "ucs 0.0001 MPa is not plausible: 1 MPa to 600 MPa",
        "charge_diameter 310 mm must not exceed the hole_diameter of 300 mm",
        "dilation_angle 50 deg must not exceed the friction_angle of 45 deg",
    ]


def test_unknown_name_is_answered_with_the_nearest() -> None:
    assert faults(burdn=3.0, youngs_modulus=1.0) == [
        "unknown input 'burdn', did you mean 'burden'?",
        "unknown input 'youngs_modulus', did you mean 'young_modulus'?",
    ]
    with pytest.raises(SpecError, match="parameter set 'autors': one of authors, field, did you"):
        resolve_inputs({}, ANFO, "autors")


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"bench_height": 5.0, "burden": 7.2}, ["charge_length -0.04 m", "0.9 m", "5.04 m"]),
        ({"bench_height": 5.0, "burden": 6.0}, ["charge_length 0.8 m", "6 hole diam", "0.9 m"]),
        ({"charge_length": 13.0}, ["charge_length 13 m", "no room for stemming", "12.5 m"]),
        (
            {"charge_length": 11.0, "stemming_length": 2.0},
            ["stemming_length 2 m", "charge_length 11 m", "bench_height of 12.5 m"],
        ),
        ({"ucs": float("nan")}, ["ucs nan MPa", "not plausible"]),
        ({"rock_density": 2.6}, ["rock_density 2.6 kg/m3", "1000 kg/m3 to 6000 kg/m3"]),
        ({"zones": 3.0}, ["zones 3", "16 to 20000"]),
    ],
)  # fmt: skip
def test_impossible_design_is_refused(values: dict[str, float], words: list[str]) -> None:
    line = "\n".join(faults(**values))
    assert line.count("\n") == 0
    for word in words:
        assert word in line


def test_design_faults_need_no_explosive_and_accept_part_of_a_design() -> None:
    assert design_faults({}) == []
    assert design_faults({"burden": 4.0, "bench_height": 12.0}) == []
    assert len(design_faults({"burden": 9.0, "bench_height": 6.0})) == 1


def test_case_sorts_the_inputs_into_records() -> None:
    settings = BlastSettings(EndMode.PAPER, TensionMode.BRITTLE, 32, "field")
    case = make_case(
        ANFO,
        {"ucs": 60e6, "tensile_strength": 4e6, "strength_rate_factor": 2.0, "zones": 200.0,
         "outer_radius": 5.5, "linear_viscosity": 0.2, "charge_diameter": 0.12},
        settings,
    )  # fmt: skip
    assert (case.rock.ucs, case.rock.tensile_strength) == (120e6, 8e6)
    assert (case.hole.diameter, case.hole.charge_diameter) == (0.15, 0.12)
    near = case.near_field
    assert (near.mode, near.tension, near.history_points) == (
        EndMode.PAPER,
        TensionMode.BRITTLE,
        32,
    )
    assert (near.zones, near.outer_radius, near.linear_viscosity) == (200, 5.5, 0.2)
    assert case.parameters.gas_front_velocity == 240.0
    assert case.geometry.charge_diameter == 0.12


def test_chain_hands_the_gas_over_without_loss() -> None:
    """The burden starts with the gas of the near field: its energy per metre times the charge.

    The near field reports the energy of its last instant, the burden starts from the settled
    radius, the mean over the last oscillations; the two differ by less than 0.5 percent.
    """
    case = make_case(ANFO, {})
    result = run_blast(case)
    assert result.status == Status.OK
    length = case.geometry.charge_length
    energy = result.near_field.gas_energy * length
    assert result.burden.initial_gas_energy == pytest.approx(energy, rel=5e-3)
    at_start = result.burden.history_pressure[0]
    assert at_start == pytest.approx(result.near_field.equilibrium_pressure, rel=1e-3)
    mass = ANFO.density * pi / 4 * 0.15**2 * length
    values = result_values(result)
    assert tuple(values) == OUTPUT_NAMES
    assert values["powder_factor"] == pytest.approx(mass / (3 * 3 * 12.5))
    assert values["end_time"] == result.near_field.end_time
    assert values["burden_velocity"] == result.burden.burden_velocity
    assert all(isinstance(value, float) for value in values.values())
    heat = ANFO.heat_of_explosion * mass
    assert 0.03 < values["burden_kinetic_energy"] / heat < 0.21


def test_rate_factor_is_a_stronger_rock() -> None:
    weak = {"ucs": 5e7, "tensile_strength": 1e6, "strength_rate_factor": 2.0}
    strong = {"ucs": 1e8, "tensile_strength": 2e6}
    a, b = (result_values(run_blast(make_case(ANFO, values))) for values in (weak, strong))
    assert a == b


def test_failed_near_field_leaves_no_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    case = make_case(ANFO, {})
    near = run_blast(case).near_field._replace(status=int(Status.RETURN_MAP_FAILED))
    monkeypatch.setattr("castblast.blast.run.solve_near_field", lambda *_: near)
    result = run_blast(case)
    assert result.status == result.burden.status == Status.RETURN_MAP_FAILED
    assert all(isnan(value) for value in result_values(result).values())
