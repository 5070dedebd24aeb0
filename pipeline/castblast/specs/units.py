"""A number and a unit as people write them, turned into an SI float.

A unit is a product of powers of the symbols below, worked out in exact fractions, so that a factor
is the nearest float. The angle is a dimension of its own: ``0.3 rad`` is no Poisson's ratio.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from fractions import Fraction
from functools import cache
from typing import NamedTuple, NoReturn, TypeVar

from castblast.errors import nearest_name
from castblast.names import people_unit, shortened
from castblast.types import FloatArray

_BASE = ("m", "s", "kg", "rad")
_PREFIXES = {
    "nano n": "1e-9",
    "micro u µ μ": "1e-6",
    "milli m": "1e-3",
    "centi c": "1e-2",
    "kilo k": "1e3",
    "mega M": "1e6",
    "giga G": "1e9",
}
#: Names of a unit: how much it is of a unit that was defined before.
_UNITS = {
    "meter metre": ("1", "m"),
    "second": ("1", "s"),
    "gram g": ("1e-3", "kg"),
    "radian": ("1", "rad"),
    "degree deg °": ("0.017453292519943295", "rad"),
    "percent": ("0.01", "1"),
    "minute min": ("60", "s"),
    "hour h": ("3600", "s"),
    "liter litre L l": ("1e-3", "m3"),
    "cc": ("1e-6", "m3"),
    "tonne t": ("1e3", "kg"),
    "newton N": ("1", "kg m s-2"),
    "pascal Pa": ("1", "N m-2"),
    "bar": ("1e5", "Pa"),
    "joule J": ("1", "N m"),
    "watt W": ("1", "J s-1"),
    "calorie cal": ("4.184", "J"),
    "inch in": ("0.0254", "m"),
    "foot ft": ("0.3048", "m"),
    "pound lb": ("0.45359237", "kg"),
    "psi": ("6894.757293168361", "Pa"),
    "ksi": ("6894757.293168361", "Pa"),
    "atmosphere atm": ("101325", "Pa"),
    "yard yd": ("0.9144", "m"),
    "ounce oz": ("0.028349523125", "kg"),
    "gallon gal": ("3.785411784e-3", "m3"),
    "lbf": ("4.4482216152605", "N"),
    "kgf": ("9.80665", "N"),
    "erg": ("1e-7", "J"),
    "btu Btu BTU": ("1055.05585262", "J"),
}
#: Unit symbols offered when a unit is not known.
UNIT_SYMBOLS = (
    "m", "mm", "cm", "km", "um", "in", "ft", "s", "ms", "us", "min", "h", "kg", "g", "t", "lb",
    "rad", "deg", "Pa", "kPa", "MPa", "GPa", "bar", "kbar", "psi", "N", "kN", "J", "kJ", "MJ",
    "GJ", "cal", "kcal", "W", "kW", "L", "percent", "cc", "Mbar", "ksi", "yd", "oz", "gal", "lbf",
    "kgf", "atm", "erg", "Btu",
)  # fmt: skip
_DIMENSIONS = {
    "1": "a number without a unit",
    "m": "a length",
    "s": "a time",
    "kg": "a mass",
    "rad": "an angle",
    "Pa": "a pressure",
    "J": "an energy",
    "m s-1": "a velocity",
    "m s-2": "an acceleration",
    "kg m-3": "a density",
    "J kg-1": "an energy per mass",
    "J m-1": "an energy per length",
    "Pa s": "a viscosity",
    "m2": "an area",
    "m3": "a volume",
}
_EXAMPLES = {
    "m": "3 m",
    "s": "30 ms",
    "rad": "45 deg",
    "Pa": "100 MPa",
    "J": "5 MJ",
    "m s-1": "12.7 m/s",
    "kg m-3": "2600 kg/m3",
    "J kg-1": "3.75 MJ/kg",
    "kg": "50 kg",
}
_NUMBER = re.compile(
    r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?![\d.,])\s*(.*?)\s*", re.DOTALL
)
#: One part of a unit: a symbol or a closing bracket with its power, or a sign.
_PART = re.compile(
    r"\s*(?:(?P<symbol>[A-Za-zµμ°]+)(?:(?:\^|\*\*)?(?P<power>[+-]?[0-9]{1,2}(?![0-9])))?"
    r"|\)(?:(?:\^|\*\*)(?P<outer>[+-]?[0-9](?![0-9])))?|(?P<sign>[(/]|\*(?!\*)|1(?=\s*/)))\s*"
)
#: Longest text of a value, and of its unit.
_LONGEST, _LONGEST_UNIT = 200, 60


class QuantityError(ValueError):
    """What is wrong with one value; a plain ValueError, so that pydantic collects it."""


class _Unit(NamedTuple):
    """A unit in SI: its size, and its powers of `_BASE`."""

    size: Fraction
    powers: tuple[int, ...] = (0, 0, 0, 0)

    def times(self, other: _Unit, power: int = 1) -> _Unit:
        """Product with a power of another unit."""
        powers = (a + power * b for a, b in zip(self.powers, other.powers, strict=True))
        return _Unit(self.size * other.size**power, tuple(powers))


_ONE = _Unit(Fraction(1))


class _UnknownSymbolError(Exception):
    """A symbol that no unit has."""


@cache
def _symbols() -> dict[str, _Unit]:
    """Every symbol that is a unit without a prefix."""
    found = {
        name: _Unit(Fraction(1), tuple(int(k == i) for k in range(len(_BASE))))
        for i, name in enumerate(_BASE)
    }
    for names, (size, unit) in _UNITS.items():
        defined = _ONE if unit == "1" else _parse(unit, found)
        found |= {n: defined._replace(size=defined.size * Fraction(size)) for n in names.split()}
    return found


@cache
def _prefixes() -> dict[str, Fraction]:
    """Size of every prefix; none comes first."""
    written = {name: size for names, size in _PREFIXES.items() for name in names.split()}
    return {"": Fraction(1)} | {name: Fraction(size) for name, size in written.items()}


def _unit_of(symbol: str, known: dict[str, _Unit]) -> _Unit:
    """Unit of a symbol: with a prefix, and in the plural (``lbs``) where it has two letters."""
    for name in (symbol, symbol.removesuffix("s")):
        shortest = 1 if name == symbol else 2
        for prefix, size in _prefixes().items():
            base = name.removeprefix(prefix) if name.startswith(prefix) else ""
            if len(base) >= shortest and base in known and not (prefix and base == "kg"):
                return _Unit(size).times(known[base])
    raise _UnknownSymbolError(symbol)


def _parse(text: str, known: dict[str, _Unit]) -> _Unit:
    """Work out a product of powers, such as ``kg m-3``, ``kg/m3``, ``J/(kg*m^2)`` or ``1/s``.

    Raises
    ------
    ValueError
        Not of that form.
    _UnknownSymbolError
        With the first symbol that is no unit.
    """
    outer: list[tuple[_Unit, int]] = []
    product, power, needed = _ONE, 1, True
    place = 0
    while place < len(text):
        part = _PART.match(text, place)
        if part is None:
            raise ValueError
        place, sign = part.end(), part["sign"]
        if part["symbol"] or sign == "1":
            unit = _unit_of(part["symbol"], known) if part["symbol"] else _ONE
            product = product.times(unit, power * int(part["power"] or 1))
            power, needed = 1, False
        elif sign == "(":
            outer.append((product, power))
            product, power, needed = _ONE, 1, True
        elif needed or (sign is None and not outer):
            raise ValueError
        elif sign is None:
            before, outside = outer.pop()
            product = before.times(product, outside * int(part["outer"] or 1))
        else:
            power, needed = (-1 if sign == "/" else 1), True
    if needed or outer:
        raise ValueError
    return product


def _to_unit(text: str) -> _Unit:
    """Unit of a text in UDUNITS or everyday spelling: ``kg m-3``, ``kg/m³``."""
    for written, plain in (("%", "percent"), ("·", " "), ("³", "3"), ("²", "2")):
        text = text.replace(written, plain)
    if text.strip() in ("", "1"):
        return _ONE
    if len(text) > _LONGEST_UNIT:
        raise ValueError
    return _parse(text, _symbols())


@cache
def _factor(written: str, unit: str) -> float:
    """Factor from the `written` unit to the SI `unit`."""
    try:
        source = _to_unit(written)
    except _UnknownSymbolError as fault:
        hint = nearest_name(str(fault), UNIT_SYMBOLS) or f"; {needs(unit)}"
        message = f"unknown unit '{fault}'{hint}"
        raise QuantityError(message) from None
    except ValueError:
        _refuse(written, unit)
    target = _to_unit(unit)
    if source.powers != target.powers:
        message = f"'{shortened(written)}' is {_dimension_name(source)}; {needs(unit)}"
        raise QuantityError(message)
    try:
        factor = float(source.size / target.size)
    except OverflowError:
        factor = math.inf
    if not 0.0 < factor < math.inf:
        _refuse(written, unit)
    return factor


def _refuse(written: str, unit: str) -> NoReturn:
    message = f"'{shortened(written)}' is not a unit; {needs(unit)}"
    raise QuantityError(message)


def _dimension_name(unit: _Unit) -> str:
    kinds = {_to_unit(known).powers: name for known, name in _DIMENSIONS.items()}
    return kinds.get(unit.powers, "another kind of quantity")


def needs(unit: str) -> str:
    """Say in words what a field of this SI unit takes, with an example."""
    name = _DIMENSIONS.get(unit, f"a quantity in {people_unit(unit)}")
    example = _EXAMPLES.get(unit)
    return f"{name} is needed" + (f", such as '{example}'" if example else "")


#: Whether a number without a unit is in SI: in Python it is, in a file it is refused.
_BARE_IS_SI: ContextVar[bool] = ContextVar("bare_is_si", default=False)


@contextmanager
def numbers_in_si() -> Iterator[None]:
    """Take numbers without a unit as SI while specs are made from Python values."""
    token = _BARE_IS_SI.set(True)
    try:
        yield
    finally:
        _BARE_IS_SI.reset(token)


def convert(value: object, unit: str) -> float:
    """Turn a written value into the SI `unit`.

    Parameters
    ----------
    value : str, int or float
        ``"165 mm"``; a bare number only when `unit` is ``"1"``.
    unit : str
        SI unit in UDUNITS spelling, as in `castblast.design.variables`.

    Returns
    -------
    float [unit]
        Finite.

    Raises
    ------
    QuantityError
        What is wrong and what is needed, without the value and its place.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        message = f"not a quantity; {needs(unit)}"
        raise QuantityError(message)
    if isinstance(value, str) and len(value) > _LONGEST:
        message = f"is too long; {needs(unit)}"
        raise QuantityError(message)
    number, written = _split(value, unit)
    if not math.isfinite(number):
        message = f"not a finite number; {needs(unit)}"
        raise QuantityError(message)
    if not isinstance(value, str) and _BARE_IS_SI.get():
        return number
    result = scaled(number, unit_factor(written, unit))
    if not math.isfinite(result):
        message = f"not a finite number; {needs(unit)}"
        raise QuantityError(message)
    return result


def unit_factor(written: str, unit: str) -> float:
    """Factor from the `written` unit to the SI `unit`; apply it with `scaled`.

    Raises
    ------
    QuantityError
        No unit where one is needed, an unknown one, or one of another kind.
    """
    if unit == "1" and not written:
        return 1.0
    if not written:
        message = f"no unit given; {needs(unit)}"
        raise QuantityError(message)
    return _factor(written, unit)


def _split(value: float | str, unit: str) -> tuple[float, str]:
    """Number and unit text of a written value."""
    if not isinstance(value, str):
        try:
            return float(value), ""
        except OverflowError:  # an integer beyond the largest float
            return math.inf, ""
    match = _NUMBER.fullmatch(value)
    if match is None:
        comma = re.match(r"\s*[+-]?\d+,\d", value)
        hint = "write a decimal point, not a comma" if comma else needs(unit)
        message = f"does not start with a number; {hint}" if not comma else hint
        raise QuantityError(message)
    return float(match[1]), match[2]


_Numbers = TypeVar("_Numbers", float, FloatArray)


def scaled(number: _Numbers, factor: float) -> _Numbers:
    """Multiply, or divide by the reciprocal where that is the whole number: 165 mm is 0.165 m."""
    if 0.0 < factor < 1.0:
        reciprocal = round(1.0 / factor)
        if math.isclose(reciprocal * factor, 1.0, rel_tol=1e-14):
            return number / reciprocal
    return number * factor
