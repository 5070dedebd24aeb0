"""A number and a unit as people write them, turned into an SI float.

Pint does the unit algebra over a small unit set of our own: it loads in a hundredth of a second,
and the angle is a dimension of its own in it, so that ``0.3 rad`` is no Poisson's ratio.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, TypeVar

from castblast.errors import nearest_name
from castblast.names import shortened
from castblast.types import FloatArray

_PREFIXES = (
    "nano- = 1e-9 = n-",
    "micro- = 1e-6 = u- = µ- = μ-",
    "milli- = 1e-3 = m-",
    "centi- = 1e-2 = c-",
    "kilo- = 1e3 = k-",
    "mega- = 1e6 = M-",
    "giga- = 1e9 = G-",
)
_UNITS = (
    "meter = [length] = m = metre",
    "second = [time] = s",
    "gram = [mass] = g",
    "radian = [angle] = rad",
    "degree = 0.017453292519943295 * radian = deg = °",
    "percent = 0.01 = percent",
    "minute = 60 * second = min",
    "hour = 3600 * second = h",
    "liter = 1e-3 * meter ** 3 = L = l = litre",
    "cubic_centimeter = 1e-6 * meter ** 3 = cc",
    "tonne = 1e6 * gram = t",
    "newton = 1000 * gram * meter / second ** 2 = N",
    "pascal = newton / meter ** 2 = Pa",
    "bar = 1e5 * pascal = bar",
    "joule = newton * meter = J",
    "watt = joule / second = W",
    "calorie = 4.184 * joule = cal",
    "inch = 0.0254 * meter = in",
    "foot = 0.3048 * meter = ft",
    "pound = 453.59237 * gram = lb",
    "psi = 6894.757293168361 * pascal = psi",
    "ksi = 6894757.293168361 * pascal = ksi",
    "atmosphere = 101325 * pascal = atm",
    "yard = 0.9144 * meter = yd",
    "ounce = 28.349523125 * gram = oz",
    "gallon = 3.785411784e-3 * meter ** 3 = gal",
    "pound_force = 4.4482216152605 * newton = lbf",
    "kilogram_force = 9.80665 * newton = kgf",
    "erg = 1e-7 * joule = erg",
    "btu = 1055.05585262 * joule = Btu = BTU",
)
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
_POWER = re.compile(r"([A-Za-zµμ°]+)(?:\^|\*\*)?([+-]?\d+)")
_SYMBOL = re.compile(r"[A-Za-zµμ°]+")
#: A unit as a product of powers. What is left of it without its powers is one of a few signs:
#: no power of a power, and no number, so that nobody can ask for 9^9^9.
_FACTOR = re.compile(
    r"(?:[A-Za-zµμ°]+(?:(?:\^|\*\*)?[+-]?[0-9]{1,2}(?![0-9]))?|\)(?:\^|\*\*)[+-]?[0-9](?![0-9])"
    r"|(?<![0-9])1\s*/)"
)
_SIGNS = re.compile(r"(?:[()/\s]|\*(?!\*))*")
#: Longest text of a value, and of its unit.
_LONGEST, _LONGEST_UNIT = 200, 60


class QuantityError(ValueError):
    """What is wrong with one value; a plain ValueError, so that pydantic collects it."""


@contextmanager
def _hidden(*names: str) -> Iterator[None]:
    """Make optional packages that are not loaded yet look absent to what is imported inside."""
    absent = [name for name in names if name not in sys.modules]
    sys.modules.update(dict.fromkeys(absent))  # type: ignore[arg-type]  # None: import refused
    try:
        yield
    finally:
        for name in absent:
            del sys.modules[name]


@cache
def _registry() -> Any:
    """Unit registry over the units above, made at the first use."""
    # Pint imports dask and scipy where it finds them, for quantities in arrays, which are not used
    # here: two thirds of the start-up time of `castblast predict` would go into that.
    with _hidden("dask", "scipy"):
        import pint

    registry = pint.UnitRegistry(None, on_redefinition="ignore")
    for line in (*_PREFIXES, *_UNITS):
        registry.define(line)
    return registry


@cache
def _factor(written: str, unit: str) -> float:
    """Factor from the `written` unit to the SI `unit`."""
    registry = _registry()  # before pint is imported anywhere else, see there
    import pint

    try:
        source = registry.parse_units(_to_expression(written))
    except pint.UndefinedUnitError as fault:
        names = fault.args[0] if fault.args else written
        name = names if isinstance(names, str) else next(iter(names), written)
        hint = nearest_name(name, UNIT_SYMBOLS) or f"; {needs(unit)}"
        message = f"unknown unit '{name}'{hint}"
        raise QuantityError(message) from None
    except Exception:  # pint leaks tokenizer, syntax and attribute errors on odd text
        message = f"'{shortened(written)}' is not a unit; {needs(unit)}"
        raise QuantityError(message) from None
    target = registry.parse_units(_to_expression(unit))
    if source.dimensionality != target.dimensionality:
        message = f"'{shortened(written)}' is {_dimension_name(source)}; {needs(unit)}"
        raise QuantityError(message)
    try:
        factor = float(registry.convert(1.0, source, target))
    except (ArithmeticError, ValueError):
        factor = math.nan
    if not 0.0 < factor < math.inf:
        message = f"'{shortened(written)}' is not a unit; {needs(unit)}"
        raise QuantityError(message)
    return factor


def _to_expression(unit: str) -> str:
    """Rewrite UDUNITS and everyday spelling (``kg m-3``, ``kg/m3``, ``m^2``) for pint."""
    text = unit.strip().replace("%", "percent").replace("·", " ").replace("³", "3")
    text = text.replace("²", "2").replace("^", "**")
    if text in ("", "1"):
        return "dimensionless"
    if len(text) > _LONGEST_UNIT or not _SIGNS.fullmatch(_FACTOR.sub(" ", text)):
        message = f"'{shortened(unit)}' is not a unit"
        raise QuantityError(message)
    text = _POWER.sub(r"\1**(\2)", text)
    return re.sub(r"(?<=[\w)°])\s+(?=[A-Za-zµμ°(])", " * ", text)


def _dimension_name(unit: Any) -> str:
    registry = _registry()
    for known, name in _DIMENSIONS.items():
        if registry.parse_units(_to_expression(known)).dimensionality == unit.dimensionality:
            return name
    return "another kind of quantity"


def needs(unit: str) -> str:
    """Say in words what a field of this SI unit takes, with an example."""
    name = _DIMENSIONS.get(unit, f"a quantity in {unit}")
    example = _EXAMPLES.get(unit)
    return f"{name} is needed" + (f", such as '{example}'" if example else "")


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
