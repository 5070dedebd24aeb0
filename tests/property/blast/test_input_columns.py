"""Columns and single blasts complete and refuse designs alike, whatever is given."""

from __future__ import annotations

from math import inf, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from castblast.blast.inputs import (
    design_fault_columns,
    design_faults,
    resolve_columns,
    resolve_inputs,
)
from castblast.design.variables import BURDEN_PARAMETER_SETS, INPUT_NAMES, INPUTS
from castblast.errors import SpecError
from castblast.explosive.isentrope import Explosive, in_hole_velocity, jwl_isentrope

ISENTROPE = jwl_isentrope(141.731e9, 2.4178e9, 0.8586e9, 5.4081, 1.2931, 0.3510)
EXPLOSIVES = (
    Explosive(800.0, 4806.0, 3.75e6, 3.2938e9, 0.211, 0.84, ISENTROPE),
    Explosive(1150.0, 6100.0, 3.2e6, 3.9e9, 0.05, 1.1, ISENTROPE),
)
#: Lengths and angles that possible and impossible designs are made of.
DESIGN = {
    "bench_height": st.floats(1.0, 20.0),
    "burden": st.floats(0.2, 15.0),
    "stemming_length": st.floats(0.0, 12.0),
    "charge_length": st.floats(0.05, 20.0),
    "hole_diameter": st.floats(0.02, 0.6),
    "charge_diameter": st.floats(0.015, 0.6),
    "friction_angle": st.floats(0.02, 1.2),
    "dilation_angle": st.floats(0.0, 1.0),
    "rise_time": st.floats(0.0, 1e-2),
    "spacing": st.floats(0.2, 20.0),
}
#: The whole table, now and then beyond its bounds.
TABLE = {
    v.name: st.one_of(
        st.floats(v.lower, v.upper), st.sampled_from([0.0, nan, inf, -inf, 2.0 * v.upper])
    )
    for v in INPUTS
}


@st.composite
def blasts(draw, entries, most):
    """Rows that give the same names, an explosive for each, and a parameter set."""
    names = draw(st.lists(st.sampled_from(sorted(entries)), unique=True, min_size=1))
    count = draw(st.integers(1, most))
    rows = st.lists(st.fixed_dictionaries({n: entries[n] for n in names}), min_size=count)
    rows = draw(rows)[:count]
    index = draw(st.lists(st.integers(0, 1), min_size=len(rows), max_size=len(rows)))
    parameter_set = draw(st.sampled_from(sorted(BURDEN_PARAMETER_SETS)))
    return rows, np.array(index, dtype=np.int8), parameter_set


def columns_of(rows):
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def words(call):
    """Result of a call, or what it complains of."""
    try:
        return call()
    except SpecError as fault:
        return str(fault)


@given(blasts(DESIGN, 12))
@settings(max_examples=150, deadline=None)
def test_rows_are_possible_together_as_alone(case):
    rows, index, _ = case
    kinds = design_fault_columns(columns_of(rows), len(rows))
    for i, row in enumerate(rows):
        assert [kind.say(i) for kind in kinds if kind.rows[i]] == design_faults(row)
    assert all(kind.rows.shape == index.shape for kind in kinds)


@given(blasts(DESIGN, 8))
@settings(max_examples=150, deadline=None)
def test_possible_rows_are_completed_together_as_alone(case):
    """Every number to the bit; and twice is once."""
    rows, index, parameter_set = case
    keep = [i for i, row in enumerate(rows) if not design_faults(row)]
    if not keep:
        return
    rows, index = [rows[i] for i in keep], index[keep]
    given_columns = columns_of(rows)
    alone = [
        words(lambda r=row, e=EXPLOSIVES[i]: resolve_inputs(r, e, parameter_set))
        for row, i in zip(rows, index, strict=True)
    ]
    together = words(lambda: resolve_columns(given_columns, EXPLOSIVES, index, parameter_set))
    if isinstance(together, str):  # within the rules, but a length outside its bounds
        assert together == next(words for words in alone if isinstance(words, str))
        return
    assert tuple(together) == INPUT_NAMES
    for i, row in enumerate(alone):
        assert row == {name: column[i] for name, column in together.items()}
    again = resolve_columns(together, EXPLOSIVES, index, "field")
    assert all(np.array_equal(again[name], together[name]) for name in INPUT_NAMES)


@given(blasts(TABLE, 5))
@settings(max_examples=150, deadline=None)
def test_the_first_faulty_row_is_told_as_if_alone(case):
    rows, index, parameter_set = case
    told = words(lambda: resolve_columns(columns_of(rows), EXPLOSIVES, index, parameter_set))
    for row, i in zip(rows, index, strict=True):
        alone = words(lambda r=row, e=EXPLOSIVES[i]: resolve_inputs(r, e, parameter_set))
        if isinstance(alone, str):
            assert told == alone
            return
    assert isinstance(told, dict)


@given(blasts({k: v for k, v in DESIGN.items() if "length" not in k and "_angle" not in k}, 6))
@settings(max_examples=60, deadline=None)
def test_derived_values_are_the_rules_of_the_table(case):
    """Written out once more, in plain arithmetic, for single numbers."""
    rows, index, _ = case
    for row, i in zip(rows, index, strict=True):
        full = words(lambda r=row, e=EXPLOSIVES[i]: resolve_inputs(r, e))
        if isinstance(full, str):
            continue
        assert full["stemming_length"] == 0.7 * full["burden"]
        assert full["charge_length"] == full["bench_height"] - full["stemming_length"]
        assert full["spacing"] == row.get("spacing", full["burden"])
        assert full["charge_diameter"] == row.get("charge_diameter", full["hole_diameter"])
        velocity = in_hole_velocity(EXPLOSIVES[i], full["hole_diameter"])
        assert full["rise_time"] == row.get("rise_time", full["hole_diameter"] / velocity)


def test_one_value_stands_for_all_rows():
    index = np.array([0, 1, 0])
    burden = np.array([2.0, 3.0, 4.0])
    short = resolve_columns({"burden": burden, "ucs": 5e7}, EXPLOSIVES, index)
    long = resolve_columns({"burden": burden, "ucs": np.full(3, 5e7)}, EXPLOSIVES, index)
    for name in INPUT_NAMES:
        assert np.array_equal(short[name], long[name])
        assert short[name].shape == (3,)
    with pytest.raises(SpecError, match="unknown input 'ucx', did you mean 'ucs'"):
        resolve_columns({"ucx": burden}, EXPLOSIVES, index)
