"""Quantities written by people: units, bounds, and what is said of a faulty one."""

from __future__ import annotations

import math
import re
import subprocess
import sys
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from castblast.design.variables import VARIABLES
from castblast.errors import SpecError
from castblast.specs.quantity import (
    QuantityError,
    QuantityIn,
    parse_quantity,
    parse_variable,
)


@pytest.mark.parametrize(
    ("written", "unit", "value"),
    [
        ("165 mm", "m", 0.165),
        ("82.5mm", "m", 0.0825),
        ("3 ft", "m", 0.9144),
        ("45 deg", "rad", math.pi / 4.0),
        ("45°", "rad", math.pi / 4.0),
        ("20 GPa", "Pa", 2e10),
        ("1450 psi", "Pa", 1450 * 6894.757293168361),
        ("12.7 m/s", "m s-1", 12.7),
        ("12.7 m s-1", "m s-1", 12.7),
        ("4.8 km/s", "m s-1", 4800.0),
        ("0.8 g/cm3", "kg m-3", 800.0),
        ("2.6 t/m^3", "kg m-3", 2600.0),
        ("3.75 MJ/kg", "J kg-1", 3.75e6),
        ("3.2938 MJ/L", "Pa", 3.2938e9),
        ("6e-5 Pa s", "Pa s", 6e-5),
        ("30 ms", "s", 0.03),
        ("250 µs", "s", 2.5e-4),
        ("30 %", "1", 0.3),
        (0.25, "1", 0.25),
        ("1e-3", "1", 1e-3),
        ("-2 m", "m", -2.0),
    ],
)
def test_units(written: object, unit: str, value: float) -> None:
    assert parse_quantity(written, unit) == pytest.approx(value, rel=1e-14)


def test_usual_decimal_values_are_exact() -> None:
    """A dataset must not depend on whether a length was written in mm or in m."""
    assert parse_quantity("165 mm", "m") == 0.165
    assert parse_quantity("141.731 GPa", "Pa") == 141.731e9
    assert parse_quantity("30 ms", "s") == 0.03


@pytest.mark.parametrize(
    ("written", "unit", "said"),
    [
        (3, "m", "no unit given; a length is needed, such as '3 m'"),
        ("45", "rad", "no unit given; an angle is needed"),
        ("0.3 rad", "1", "'rad' is an angle; a number without a unit is needed"),
        ("3 kg", "m", "'kg' is a mass; a length is needed"),
        ("3 MPa", "kg m-3", "'MPa' is a pressure; a density is needed"),
        ("100 Mpa", "Pa", "unknown unit 'Mpa', did you mean 'MPa'?"),
        ("3 mmm", "m", "unknown unit 'mmm', did you mean 'mm'?"),
        ("3,5 m", "m", "decimal point"),
        ("wide", "m", "does not start with a number"),
        ("nan m", "m", "does not start with a number"),
        ("1e999 m", "m", "not a finite number"),
        (math.inf, "1", "not a finite number"),
        (True, "1", "not a quantity"),
        (None, "m", "not a quantity"),
        ("3 m(", "m", "not a unit"),
        ("2 __import__('os')", "m", "not a unit"),
        ("2 m ** m", "m", "not a unit"),
        ("", "m", "does not start with a number"),
    ],
)
def test_one_clear_line(written: object, unit: str, said: str) -> None:
    with pytest.raises(SpecError) as caught:
        parse_quantity(written, unit, "case.yaml: field")
    message = str(caught.value)
    assert message.startswith("case.yaml: field: ")
    assert said in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("name", "written", "said"),
    [
        ("ucs", "100 GPa", "implausible (100000 MPa); allowed: 1 to 600 MPa"),
        ("ucs", 1e8, "no unit given"),
        ("dilation_angle", "61 deg", "implausible (61 deg); allowed: 0 to 60 deg"),
        ("poisson_ratio", 0.5, "allowed: 0.01 to 0.49"),
        ("usc", "100 MPa", "unknown variable 'usc', did you mean 'ucs'?"),
    ],
)
def test_implausible_variables(name: str, written: object, said: str) -> None:
    with pytest.raises(SpecError) as caught:
        parse_variable(name, written)
    assert said in str(caught.value)


@pytest.mark.parametrize("name", VARIABLES)
def test_every_variable_reads_what_it_shows(name: str) -> None:
    """The bounds as shown on a screen are allowed values."""
    variable = VARIABLES[name]
    for bound in (variable.lower, variable.upper):
        assert parse_variable(name, variable.show(bound)) == pytest.approx(bound, rel=1e-5)


_PREFIX = {"m": 1e-3, "": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}


@given(
    st.floats(-1e12, 1e12, allow_nan=False),
    st.sampled_from(sorted(_PREFIX)),
    st.sampled_from([("Pa", "Pa"), ("m", "m"), ("J", "J"), ("s", "s")]),
    st.sampled_from(["", " ", "  "]),
)
def test_number_times_prefix(number: float, prefix: str, units: tuple[str, str], gap: str) -> None:
    written, unit = units
    found = parse_quantity(f"{number!r}{gap}{prefix}{written}", unit)
    assert found == pytest.approx(number * _PREFIX[prefix], rel=1e-14, abs=1e-300)


@pytest.mark.parametrize(
    ("quantity", "written", "said"),
    [
        (QuantityIn("m", above=0.0), "0 m", "must be larger than 0 m"),
        (QuantityIn("m", 0.0, 5.0), "7000 mm", "implausible (7 m); allowed: 0 to 5 m"),
        (QuantityIn("rad", -1.0, math.pi / 3.0), "61 deg", "(61 deg); allowed: -57.2958 to 60 deg"),
        (QuantityIn("1", 0.0, 0.2, hint="a share"), 0.5, "allowed: 0 to 0.2; a share"),
    ],
)
def test_a_range_is_said_in_the_unit_of_people(
    quantity: QuantityIn, written: object, said: str
) -> None:
    """Bounds are allowed themselves, in spite of rounding; an open end allows anything."""
    with pytest.raises(QuantityError, match=re.escape(said)):
        quantity.parse(written)
    assert QuantityIn("rad", 0.0, math.pi / 3.0).parse("60 deg") == pytest.approx(math.pi / 3.0)
    assert QuantityIn("m", 0.0).parse("1e9 m") == 1e9
    with pytest.raises(QuantityError):
        QuantityIn("m", 0.0).parse("-1 mm")


@pytest.mark.parametrize(
    "text",
    ["3 m^9^9^9", "3 m**9**9", "3 9**9**9", "3 m/(2**9**9**9)", "3 m^999999999", "3 1e400 m",
     "3 m/0", "3 " + "(" * 80, "3 " + "m*" * 5000 + "m", "1" * 5000 + " m", "1e999 m",
     "3 min^400", 10**400, 10**5000],
    ids=lambda value: type(value).__name__,
)  # fmt: skip
def test_bombs_are_refused_at_once(text: object) -> None:
    """Python would compute 9^9^9 if it were asked to."""
    start = time.process_time()
    with pytest.raises(SpecError) as fault:
        parse_quantity(text, "m", "case.yaml: burden")
    assert time.process_time() - start < 1.0
    assert len(str(fault.value)) < 250
    assert str(fault.value).isprintable()


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [("3 (m/s)^2", "m2 s-2", 9.0 / 3.0), ("2 1/s", "s-1", 2.0), ("4 kg/(m s2)", "Pa", 4.0),
     ("5 kg m-1 s-2", "Pa", 5.0), ("1 MJ/kg", "J kg-1", 1e6), ("2 m**3", "m3", 2.0)],
)  # fmt: skip
def test_products_and_powers_of_units_are_read(text: str, unit: str, value: float) -> None:
    assert parse_quantity(text, unit) == pytest.approx(value, rel=1e-14)


def test_units_do_not_load_the_heavy_libraries() -> None:
    """`castblast predict` reads units and has to start in a second."""
    code = (
        "import sys; from castblast.specs.quantity import parse_quantity as p; p('3 m', 'm');"
        "print(*sorted({'dask', 'scipy', 'pydantic', 'xarray', 'sklearn'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
