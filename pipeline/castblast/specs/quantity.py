"""Quantities written by people, such as ``165 mm`` or ``45 deg``, as spec fields and options.

A value is a number and a unit; a bare number is refused unless the field is dimensionless, so that
100 meant as MPa cannot enter as pascals. Named variables are held against their plausible ranges.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from castblast.design.variables import VARIABLES, Variable
from castblast.errors import SpecError, nearest_name
from castblast.names import people_unit, shortened
from castblast.specs.units import QuantityError, convert
from castblast.types import BoolArray, FloatArray

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import CoreSchema

__all__ = [
    "QuantityError",
    "QuantityIn",
    "VariableIn",
    "allowed",
    "check_variable",
    "convert",
    "convert_variable",
    "parse_quantity",
    "parse_variable",
]


def convert_variable(name: str, value: object) -> float:
    """Turn a written value of a named variable into SI and hold it against its bounds.

    Raises
    ------
    QuantityError
        What is wrong and what is allowed.
    """
    return VariableIn(name).check(convert(value, VARIABLES[name].unit))


def _within(numbers: ArrayLike, lower: float, upper: float) -> BoolArray:
    """Compare with a rounding margin: 60 deg must pass a bound of 60 deg; NaN does not pass."""
    values = np.asarray(numbers, dtype=np.float64)
    return (lower - 1e-12 * abs(lower) <= values) & (values <= upper + 1e-12 * abs(upper))


def allowed(variable: Variable) -> str:
    """Plausible range of a variable in its display unit: ``'1 to 600 MPa'``."""
    low = variable.lower * variable.display_factor
    return f"{low:.6g} to {variable.show(variable.upper)}"


def _placed(fault: QuantityError, value: object, where: str, name: str = "") -> SpecError:
    prefix = f"{where}: " if where else ""
    return SpecError(
        f"{prefix}{shortened(value)}: {fault}",
        field=name or None,
        value=value,
        allowed=allowed(VARIABLES[name]) if name else None,
    )


def parse_quantity(value: object, unit: str, where: str = "") -> float:
    """Turn a written value into the SI `unit`; `where` names its file and field.

    Raises
    ------
    SpecError
        One line: where, value, what is wrong and what is needed.
    """
    try:
        return convert(value, unit)
    except QuantityError as fault:
        raise _placed(fault, value, where) from None


def parse_variable(name: str, value: object, where: str = "") -> float:
    """Turn a written value of the variable `name` into SI, within its plausibility bounds.

    Raises
    ------
    SpecError
        One line: where, value, what is wrong and what is allowed; or `name` is not a variable.
    """
    if name not in VARIABLES:
        message = f"{where or name}: unknown variable '{name}'{nearest_name(name, VARIABLES)}"
        raise SpecError(message, field=name, allowed=tuple(VARIABLES))
    try:
        return convert_variable(name, value)
    except QuantityError as fault:
        raise _placed(fault, value, where or name, name) from None


def check_variable(name: str, number: float, where: str = "") -> float:
    """Hold a number in SI against the bounds of the variable `name`; give it back.

    Raises
    ------
    SpecError
        One line: where, value, what is allowed.
    """
    try:
        return VariableIn(name).check(number)
    except QuantityError as fault:
        raise _placed(fault, number, where or name, name) from None


@dataclass(frozen=True)
class QuantityIn:
    """Pydantic annotation of a field with a unit: ``Annotated[float, QuantityIn("m")]``.

    Attributes
    ----------
    unit : str
        SI unit of the float that the field holds after reading.
    lower, upper : float [unit]
        Allowed range, both ends included.
    above : float [unit]
        The value must be larger than this.
    hint : str
        What a value outside the range most likely is, for the message.
    """

    unit: str
    lower: float = -math.inf
    upper: float = math.inf
    above: float = -math.inf
    hint: str = ""

    def parse(self, value: object) -> float:
        """Read one value; a ValueError says what is wrong."""
        return self.check(convert(value, self.unit))

    def check(self, number: float) -> float:
        """Hold a value in `unit` against the range; a ValueError says what is allowed.

        For columns of tables, whose numbers are converted all at once.
        """
        if not number > self.above:
            message = f"must be larger than {self._show(self.above)}"
        elif not _within(number, self.lower, self.upper):
            low = self._show(self.lower).split()[0]
            found = "" if self.unit == "1" else f" ({self._show(number)})"
            message = f"implausible{found}; allowed: {low} to {self._show(self.upper)}"
        else:
            return number
        raise QuantityError(message + (f"; {self.hint}" if self.hint else ""))

    def within(self, numbers: FloatArray) -> BoolArray:
        """Which of many numbers in `unit` are allowed; NaN is not."""
        return (numbers > self.above) & _within(numbers, self.lower, self.upper)

    def _show(self, number: float) -> str:
        """Write a value with its unit; angles in degrees."""
        if self.unit == "rad":
            return f"{math.degrees(number):.6g} deg"
        return f"{number:.6g}" if self.unit == "1" else f"{number:.6g} {people_unit(self.unit)}"

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        from pydantic_core import core_schema

        return core_schema.no_info_before_validator_function(self.parse, handler(source))


@dataclass(frozen=True)
class VariableIn:
    """Pydantic annotation of a field that is a variable: ``Annotated[float, VariableIn("ucs")]``.

    Attributes
    ----------
    name : str
        A name of `castblast.design.variables`; gives unit and plausibility bounds.
    """

    name: str

    @property
    def unit(self) -> str:
        """SI unit of the variable."""
        return VARIABLES[self.name].unit

    def parse(self, value: object) -> float:
        """Read one value; a ValueError says what is wrong."""
        return convert_variable(self.name, value)

    def check(self, number: float) -> float:
        """Hold a value [SI] against the bounds; a ValueError says what is allowed."""
        variable = VARIABLES[self.name]
        if _within(number, variable.lower, variable.upper):
            return number
        message = f"implausible ({variable.show(number)}); allowed: {allowed(variable)}"
        raise QuantityError(message)

    def within(self, numbers: FloatArray) -> BoolArray:
        """Which of many numbers [SI] are plausible; NaN is not."""
        variable = VARIABLES[self.name]
        return _within(numbers, variable.lower, variable.upper)

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        from pydantic_core import core_schema

        return core_schema.no_info_before_validator_function(self.parse, handler(source))
