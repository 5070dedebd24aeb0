"""One rule of a design for every reader: `predict` and the physics accept, complete, refuse alike.

The designs are drawn over all inputs, valid and not; the two networks that are shipped see
different parts of them.
"""

from __future__ import annotations

from math import inf, isclose, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from castblast.blast.inputs import resolve_inputs
from castblast.blast.run import make_case
from castblast.design.hole import expanded_hole_faults
from castblast.design.rule import (
    COMPLETIONS,
    DESIGN_RULES,
    lines_by_row,
    require_possible,
    resolve_design,
    rules_as_data,
)
from castblast.design.variables import INPUTS, VARIABLES
from castblast.errors import SpecError
from castblast.nearfield.solver import solve_near_field
from castblast.prediction.answer import load_network, predict
from castblast.prediction.columns import predict_columns
from castblast.specs.explosive import load_explosive

ANFO = load_explosive("anfo").to_explosive()
NETWORKS = {name: load_network(name) for name in ("full", "paper")}
#: What shapes a bench, often possible; the rest of the table over its bounds and beyond.
SHAPE = {
    "bench_height": st.floats(2.0, 30.0),
    "burden": st.floats(0.2, 12.0),
    "spacing": st.floats(0.2, 15.0),
    "stemming_length": st.floats(0.0, 12.0),
    "charge_length": st.floats(0.05, 25.0),
    "hole_diameter": st.floats(0.05, 0.6),
    "charge_diameter": st.floats(0.05, 0.6),
    "friction_angle": st.floats(0.1, 1.2),
    "dilation_angle": st.floats(0.0, 0.6),
}
REST = {
    v.name: st.one_of(
        st.floats(v.lower, v.upper), st.sampled_from([0.0, nan, inf, -1.0, 2.0 * v.upper])
    )
    for v in INPUTS
    if v.name not in SHAPE
}


@st.composite
def designs(draw):
    """A mapping of some inputs to numbers, its order drawn too."""
    shape = draw(st.lists(st.sampled_from(sorted(SHAPE)), unique=True))
    rest = draw(st.lists(st.sampled_from(sorted(REST)), unique=True, max_size=3))
    names = draw(st.permutations(shape + rest))
    return {name: draw((SHAPE | REST)[name]) for name in names}


def outcome(call):
    """Result of a call, or the lines it complains with."""
    try:
        return call()
    except SpecError as fault:
        return str(fault).splitlines()


def assert_outgrown(inputs, lines):
    """The hole of the physics, at most 3 percent wider, breaks the same limits."""
    case = make_case(ANFO, inputs)
    near = solve_near_field(case.explosive, case.rock, case.hole, case.near_field)
    full = {name: np.array([value]) for name, value in inputs.items()}
    faults = expanded_hole_faults(full, np.array([1.03 * near.expanded_hole_radius]))
    named = [fault.say(0).split()[0] for fault in faults if fault.rows[0]]
    assert {line.split()[0] for line in lines} <= set(named)


@pytest.mark.parametrize("name", sorted(NETWORKS))
@given(designs())
@settings(max_examples=250, deadline=None)
def test_predict_and_the_physics_accept_complete_and_refuse_alike(name, values):
    """Only predict refuses a charge that the network cannot see, and it knows the hole at once."""
    network = NETWORKS[name]
    physics = outcome(lambda: resolve_inputs(values, ANFO))
    answer = outcome(lambda: predict(values, "anfo", network))
    if isinstance(physics, list):
        assert answer == physics
        return
    if isinstance(answer, list) and "too small for a hole" in answer[0]:
        assert_outgrown(physics, answer)
        return
    if isinstance(answer, list):
        assert all("the network was trained on" in line for line in answer)
        seen = set(values) & {"stemming_length", "charge_length"}
        assert len(seen) == 2
        room = physics["bench_height"] - physics["charge_length"]
        assert not isclose(physics["stemming_length"], room, rel_tol=1e-9, abs_tol=1e-12)
        return
    assert answer["inputs"] == {n: physics[n] for n in network.input_names}
    for hidden in {"charge_diameter", "spacing"} - set(network.input_names):
        tied = {"charge_diameter": "hole_diameter", "spacing": "burden"}[hidden]
        differs = not isclose(physics[hidden], physics[tied], rel_tol=1e-9)
        assert (hidden in answer["out_of_domain"]) == differs
        assert not (differs and answer["in_domain"])


@given(st.lists(designs(), min_size=2, max_size=6))
@settings(max_examples=80, deadline=None)
def test_columns_are_answered_as_single_designs(rows):
    """Numbers to rounding, verdicts and words exactly; a refused row does not touch the others."""
    names = list(rows[0])
    rows = [{n: row.get(n, rows[0][n]) for n in names} for row in rows]
    network = NETWORKS["full"]
    values = {name: np.array([row[name] for row in rows]) for name in names}
    index = np.arange(len(rows)) % len(network.explosives)
    together = predict_columns(values, index, network)
    lines = lines_by_row(together.designs.faults)
    for i, row in enumerate(rows):
        alone = outcome(lambda r=row, k=index[i]: predict(r, network.explosives[k], network))
        if isinstance(alone, list):
            assert together.refused[i]
            assert lines[i] == alone
            assert np.isnan(together.rows.values[i]).all()
            continue
        assert not together.refused[i]
        assert together.domain[i] == alone["domain"]
        assert together.rows.values[i] == pytest.approx(
            [alone[n] for n in network.output_names], rel=1e-9, nan_ok=True
        )


@given(designs())
@settings(max_examples=100, deadline=None)
def test_faults_do_not_depend_on_the_order_in_which_inputs_are_given(values):
    backwards = dict(reversed(values.items()))
    assert outcome(lambda: resolve_design(values)) == outcome(lambda: resolve_design(backwards))


@given(designs())
@settings(max_examples=100, deadline=None)
def test_a_completed_design_completes_to_itself(values):
    once = outcome(lambda: resolve_design(values))
    if isinstance(once, dict):
        assert resolve_design(once) == once


def test_a_limit_met_by_rounding_is_met():
    """A charge as wide as its hole, one written in mm and the other in inches."""
    wide = 0.15 * (1.0 + 1e-12)
    full = resolve_design({"hole_diameter": 0.15, "charge_diameter": wide})
    assert full["charge_diameter"] == 0.15
    with pytest.raises(SpecError, match="must not exceed the hole_diameter"):
        resolve_design({"hole_diameter": 0.15, "charge_diameter": 0.15 * (1.0 + 1e-6)})


def test_rock_is_needed_between_holes_and_before_them():
    with pytest.raises(SpecError, match=r"spacing 0\.3 m leaves no rock .* 600 mm"):
        resolve_design({"spacing": 0.3, "hole_diameter": 0.6})
    with pytest.raises(SpecError) as fault:
        resolve_design({"burden": 0.25, "hole_diameter": 0.6})
    assert [line.split()[0] for line in str(fault.value).splitlines()] == ["spacing", "burden"]


def test_a_value_that_is_no_number_is_named():
    for value in ("3 m", [1.0, 2.0], 10**5000):
        with pytest.raises(SpecError, match=r"^burden: .*a number in SI units is needed"):
            predict({"burden": value}, "anfo", NETWORKS["full"])
    with pytest.raises(SpecError, match="stemming_length 95 m is not plausible"):
        resolve_design({"bench_height": 100.0, "charge_length": 5.0})


def test_an_infinite_value_is_told_alone():
    for name in ("burden", "bench_height", "hole_diameter"):
        with pytest.raises(SpecError) as fault:
            resolve_design({name: inf})
        lines = str(fault.value).splitlines()
        assert lines[0].startswith(f"{name} inf")
        assert not any(" 0 m" in line for line in lines)


def test_the_rule_as_data_names_inputs_only():
    data = rules_as_data()
    names = {name for entry in data["completions"] + data["rules"] for name in entry["terms"]}
    assert names <= {v.name for v in INPUTS}
    assert len(data["completions"]) == len(COMPLETIONS)
    assert len(data["rules"]) == len(DESIGN_RULES)
    assert data["defaults"]["burden"] == VARIABLES["burden"].default
    require_possible([])
