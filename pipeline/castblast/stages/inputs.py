"""The inputs of a blast as a table: name, unit, default, plausible range, meaning."""

from __future__ import annotations

from typing import Any

from castblast.design.variables import BURDEN_PARAMETER_SETS, INPUTS, Variable

HEADER = ("input", "default", "lowest", "highest", "unit", "meaning")


def list_inputs(role: str | None = None) -> list[dict[str, Any]]:
    """Describe the inputs, all or those of one role.

    Parameters
    ----------
    role : str, optional
        ``rock``, ``hole``, ``bench``, ``burden_model`` or ``solver``.

    Returns
    -------
    list of dict
        ``name``, ``role``, ``meaning``; SI ``unit`` with ``default``, ``lower`` and ``upper``
        in it (``default`` is None where it follows from other inputs); ``shown_unit`` with
        ``display_factor`` from SI.
    """
    return [
        {
            "name": variable.name,
            "role": variable.role,
            "meaning": variable.long_name,
            "unit": variable.unit,
            "default": variable.default,
            "lower": variable.lower,
            "upper": variable.upper,
            "shown_unit": variable.shown_unit,
            "display_factor": variable.display_factor,
            "parameter_sets": {
                name: values[variable.name]
                for name, values in BURDEN_PARAMETER_SETS.items()
                if variable.name in values
            },
        }
        for variable in INPUTS
        if role in (None, variable.role)
    ]


def input_rows(role: str | None = None) -> list[tuple[str, ...]]:
    """Lay the inputs out for people: the columns of `HEADER`, values in the shown unit."""
    return [
        (
            variable.name,
            _number(variable, variable.default),
            _number(variable, variable.lower),
            _number(variable, variable.upper),
            "" if variable.shown_unit == "1" else variable.shown_unit,
            variable.long_name,
        )
        for variable in INPUTS
        if role in (None, variable.role)
    ]


def _number(variable: Variable, value: float | None) -> str:
    return "" if value is None else f"{value * variable.display_factor:.6g}"
