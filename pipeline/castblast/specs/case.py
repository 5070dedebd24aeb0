"""One blast to simulate: explosive, end mode and the values that differ from the defaults."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from castblast.design.variables import INPUT_NAMES
from castblast.disk.resources import find_spec
from castblast.errors import SpecError, nearest_name
from castblast.names import shortened
from castblast.specs.loading import Spec, load_spec
from castblast.specs.quantity import parse_variable

ModeName = Literal["equilibrium", "paper"]
TensionName = Literal["ductile", "brittle", "none"]


class CaseSpec(Spec):
    """Contents of a case file.

    Attributes
    ----------
    explosive : str
        Name in the catalogue or path of an explosive file.
    mode : {"equilibrium", "paper"}
        End of the near-field run.
    tension : {"ductile", "brittle", "none"}
        Behaviour of rock that yields in tension.
    parameter_set : {"authors", "field"}
        Calibrated parameters of the burden model.
    values : mapping of str to str
        Input variables with their units; in the file under the key ``set``.
    """

    explosive: str = "anfo"
    mode: ModeName = "equilibrium"
    tension: TensionName = "ductile"
    parameter_set: Literal["authors", "field"] = "authors"
    values: dict[str, Any] = Field(default_factory=dict, alias="set")


def read_case(path: Path | None) -> CaseSpec:
    """Read a case, from a file or one that came with castblast, by name; the defaults without."""
    return CaseSpec() if path is None else load_spec(find_spec(path, "case"), CaseSpec)


def split_assignments(assignments: Iterable[str]) -> dict[str, str]:
    """Split ``NAME=VALUE UNIT`` texts of the command line.

    Raises
    ------
    SpecError
        A text without ``=`` or a name given twice.
    """
    values: dict[str, str] = {}
    faults = []
    for text in assignments:
        name, sign, value = text.partition("=")
        name = name.strip().replace("-", "_")
        if not sign or not value.strip():
            faults.append(
                f'--set {shortened(text)}: write NAME="VALUE UNIT", e.g. --set burden="3 m"'
            )
        elif name in values:
            faults.append(f"--set {name}: given twice")
        else:
            values[name] = value.strip()
    if faults:
        raise SpecError("\n".join(faults))
    return values


def parse_values(
    values: Mapping[str, Any],
    where: str,
    names: Iterable[str] = INPUT_NAMES,
    parse: Callable[[str, Any, str], float] = parse_variable,
) -> dict[str, float]:
    """Turn quantities with units into SI floats, reporting all faults at once.

    `parse` turns one value of a variable into SI; its last argument begins the line of a fault.

    Raises
    ------
    SpecError
        One line per unknown name (with the nearest one), unit or value out of range.
    """
    allowed = tuple(names)
    parsed: dict[str, float] = {}
    faults = []
    for name, value in values.items():
        if name not in allowed:
            faults.append(unknown_input(name, value, where, allowed))
            continue
        try:
            parsed[name] = parse(name, value, f"{where}: {name}")
        except SpecError as error:
            faults.append(error)
    require_none(faults)
    return parsed


def unknown_input(
    name: object, value: object, where: str, allowed: tuple[str, ...] = INPUT_NAMES
) -> SpecError:
    """Fault of a name that is no input, with the nearest one."""
    hint = nearest_name(str(name), allowed)
    message = f"{where}: {shortened(name)}: no such input{hint}"
    return SpecError(message, field=str(name), value=value, allowed=allowed)


def require_none(faults: Sequence[SpecError]) -> None:
    """Raise faults together, one a line, if there are any.

    Raises
    ------
    SpecError
        Field, value and what is allowed are those of the first.
    """
    if faults:
        first = faults[0]
        raise SpecError(
            "\n".join(map(str, faults)),
            field=first.field,
            value=first.value,
            allowed=first.allowed,
        )
