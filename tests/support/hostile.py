"""Values, texts and bytes that nobody would write on purpose, for the tests of all readers."""

import copy
import os
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from castblast.errors import CastblastError

#: Values that have broken a reader of something.
VALUES = st.one_of(
    st.sampled_from(
        [
            None, True, False, 0, -1, 1, 10**25, 10**390, -(10**390), 0.0, -0.0, 1e-320, 1e308,
            float("nan"), float("inf"), -float("inf"), "", " ", "nan", "inf", "1e999 m", "3",
            "3 m", "-3 m", "0 m", "1e300 m", "100 MPa", "45 deg", "30 ms", "3 m^9^9^9", "m",
            "2001-01-01", "../../x", "/dev/null", "a\nb", "x[/b]", "$\\frac$", "=1+1", "é",
            "x" * 5000, "\u202e",
            [], {}, [[]], [None], [{}], {"a": 1}, {1: 2}, [1, "2", None], [[0, 0], [1, 0]],
        ]
    ),
    st.floats(),
    st.integers(),
    st.text(max_size=12),
)  # fmt: skip
#: What lines of tables and grids are made of.
PIECES = (
    "x", "y", "z", "radius", "delay", "name", "explosive", "burden", "[m]", "(mm)", "[m/s]",
    "[9^9]", ",", ";", "\t", " ", "\n", "\r\n", "\r", '"', "'", "#", "1", "-2.5", "1,5", "1e400",
    "nan", "inf", "NODATA", "-9999", "ncols 3\n", "nrows 2\n", "cellsize 1\n", "x,y,z\n",
    "0,0,1\n1,0,1\n0,1,1\n",
    "x [m],y [m],delay [ms]\n", "1,2,3\n", "name,x,y\n", "solid a\n", "facet normal 0 0 1\n",
    "vertex 0 0 0\n", "endsolid\n", "\ufeff", "é", "\x00", "\x1b", "٣", "1_0", "0x1", "=A1", ",,,,",
    "ITEM: ATOMS id x y z radius\n", "3 atoms\n", "Properties=species:S:1:pos:R:3\n", "\u00a0",
)  # fmt: skip
LINES = st.lists(st.sampled_from(PIECES), max_size=25).map("".join)
#: Few examples, so that every reader is asked in every run of the suite and none takes long; seeds
#: differ between runs. CASTBLAST_FUZZ=20 asks for twenty times as many.
TIMES = int(os.environ.get("CASTBLAST_FUZZ", "1"))
BRIEF = settings(
    max_examples=40 * TIMES,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)


def outcome(read: Callable[[], Any]) -> Any:
    """Result, or the words of a fault; every other exception is a bug of the reader."""
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return read()
    except CastblastError as fault:
        said = str(fault)
        assert said
        assert "pickle" not in said.lower()
        assert max(map(len, said.splitlines())) < 3000
        return fault


def _places(value: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths to all parts of a nested value, itself included."""
    items = value.items() if isinstance(value, dict) else ()
    if isinstance(value, list):
        items = list(enumerate(value))[:6]
    return [at] + [place for key, inner in items for place in _places(inner, (*at, key))]


@st.composite
def broken(draw: st.DrawFn, content: Any) -> Any:
    """Nested lists and mappings with one to three parts replaced, left out or added."""
    content = copy.deepcopy(content)
    for _ in range(draw(st.integers(1, 3))):
        places = _places(content)[1:]
        if not places:
            break
        *way, last = draw(st.sampled_from(places))
        inner = content
        for key in way:
            inner = inner[key]
        action = draw(st.sampled_from(["replace", "replace", "drop", "add"]))
        if action == "drop":
            del inner[last]
        elif action == "add" and isinstance(inner, dict):
            inner[draw(st.one_of(st.text(max_size=8), st.just("name")))] = copy.deepcopy(
                draw(VALUES)
            )
        else:
            inner[last] = copy.deepcopy(draw(VALUES))
    return content


@st.composite
def mangled(draw: st.DrawFn, content: bytes) -> bytes:
    """Bytes of a file with some cut off, turned, doubled or put in."""
    edited = bytearray(content)
    for _ in range(draw(st.integers(1, 4))):
        place = draw(st.integers(0, max(len(edited) - 1, 0)))
        action = draw(st.sampled_from(["cut", "turn", "insert", "double"]))
        if action == "cut":
            del edited[place:]
        elif action == "turn" and edited:
            edited[place] ^= draw(st.integers(1, 255))
        elif action == "insert":
            edited[place:place] = draw(st.binary(min_size=1, max_size=8))
        else:
            edited[place:place] = edited[max(place - 40, 0) : place]
    return bytes(edited)
