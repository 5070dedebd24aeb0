"""Values as people give them, turned into SI: text with a unit, numbers in SI, quantities.

A text carries its unit, a plain number is in SI. Whatever has a magnitude and units (pint) or
units among its attributes (xarray) says its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from numbers import Real
from typing import Any, SupportsFloat

import numpy as np

from castblast.bands import BAND_TITLE, Ends, prediction_band, show_band, show_value
from castblast.design.rule import OPTIONAL
from castblast.design.variables import VARIABLES
from castblast.specs.case import parse_values
from castblast.specs.quantity import check_variable, parse_variable


class Quantity(float):
    """A number in SI that knows its name, unit and prediction band.

    It is a float: arithmetic is that of the SI value and gives plain floats.

    Parameters
    ----------
    name : str
        Of `castblast.design.variables`.
    value : float [SI]
    network_band : float
        Relative half-width of the 95 % band of the network that gave the value; 0 for physics.

    Examples
    --------
    >>> Quantity("burden_velocity", 12.0)
    12 m/s (prediction band 6.7 to 21)
    >>> Quantity("burden_velocity", 12.0) / 2
    6.0
    """

    __slots__ = ("name", "network_band")

    name: str
    network_band: float

    def __new__(cls, name: str, value: float, network_band: float = 0.0) -> Quantity:
        """Make one from a name and an SI value."""
        made = super().__new__(cls, value)
        made.name, made.network_band = name, network_band
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        return Quantity, (self.name, float(self), self.network_band)

    @property
    def value(self) -> float:
        """The number in SI, as a plain float."""
        return float(self)

    @property
    def unit(self) -> str:
        """SI unit."""
        return VARIABLES[self.name].unit

    @property
    def band(self) -> Ends | None:
        """Ends of the prediction band [SI]; None where no band is stated."""
        ends = prediction_band(self.name, float(self), self.network_band)
        return None if math.isnan(ends.lower) else ends

    def __repr__(self) -> str:
        unit = VARIABLES[self.name].shown_unit
        text = show_value(self.name, float(self)) + ("" if unit == "1" else f" {unit}")
        if self.band is None:
            return text
        return f"{text} ({BAND_TITLE} {show_band(self.name, float(self), self.network_band)})"

    __str__ = __repr__


def si_values(values: Mapping[str, object], where: str) -> dict[str, float]:
    """Turn given inputs into SI floats; all faults at once.

    Parameters
    ----------
    values : mapping of input name to value
        Text with unit, SI number, pint quantity or 0-d xarray.
    where : str
        Begins every line of a fault.

    Raises
    ------
    SpecError
        Unknown names, units, values out of range; a line each.
    """
    return parse_values(values, where, parse=si_value)


def si_value(name: str, value: object, where: str) -> float:
    """Turn one value of the variable `name` into SI, within its plausible range.

    Raises
    ------
    SpecError
        One line: where, value, what is wrong and what is allowed.
    """
    written = as_written(value)
    if isinstance(written, str) or not _is_number(written):
        return parse_variable(name, written, where)
    number = float(written)
    if name in OPTIONAL and number == 0.0:
        return number
    return check_variable(name, number, where)


def as_written(value: object) -> Any:
    """What a value says in words: text for whatever has a unit of its own, else the value.

    A pint quantity or an xarray scalar with units becomes a text with its unit; NumPy scalars and
    arrays of one number become floats.
    """
    unit = getattr(value, "units", None)
    number: Any = getattr(value, "magnitude", None)
    if number is None:
        unit = getattr(value, "attrs", {}).get("units")
        number = value
    size = getattr(number, "ndim", 0)
    if isinstance(number, np.generic) or (size == 0 and hasattr(number, "dtype")):
        number = getattr(number, "item", lambda: number)()
    if unit is None or not _is_number(number):
        return number
    return f"{float(number)!r} {unit_words(unit)}".rstrip()


def unit_words(unit: object) -> str:
    """Unit of another library in our spelling; nothing for a number without a unit."""
    text = str(unit).replace(" ** ", "**").strip()
    return "" if text in ("1", "dimensionless") else text


def _is_number(value: object) -> bool:
    """Whether a value is a number, and no truth value or text."""
    return isinstance(value, Real | SupportsFloat) and not isinstance(value, bool | str | np.bool_)
