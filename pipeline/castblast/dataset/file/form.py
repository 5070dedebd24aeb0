"""The form of a dataset: its attributes and the kind of its columns, without any of its rows.

What is looked at here costs nothing, so that every use of a file begins with it: a file from
elsewhere may hold anything under the names of this format.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from castblast.dataset.file.check_rows import INPUT_ROLES, OUTPUT_ROLES
from castblast.dataset.file.schema import (
    DESCRIPTORS,
    HISTORIES,
    LABELS,
    REQUIRED_ATTRIBUTES,
    SCHEMA,
    label_attributes,
    role_of,
    text_attribute,
)
from castblast.design.variables import INPUT_NAMES, OUTPUT_NAMES, VARIABLES
from castblast.disk.reading import parse_json
from castblast.errors import DatasetError, SpecError, nearest_name
from castblast.names import shortened

_COUNTS = ("designs_drawn", "n_ok", "n_failed")
#: JSON attributes: whether they hold a group (or a list), and whether of texts only.
_JSON = {
    "dependency_versions": (dict, False),
    "explosive_specs": (dict, True),
    "made_from": (dict, False),
    "extends": (list, False),
}
_SHOWN = 3


@dataclass(frozen=True)
class Fault:
    """One departure from the format: where, and what is wrong there."""

    where: str
    message: str

    def __str__(self) -> str:
        """Give one line for people."""
        return f"{self.where}: {self.message}"


def form_faults(dataset: xr.Dataset) -> list[Fault]:
    """Departures of a dataset from the format that show without reading a row."""
    faults = _attribute_faults(dataset)
    faults += _label_faults(dataset)
    for name in (*INPUT_NAMES, *OUTPUT_NAMES):
        faults += _variable_faults(dataset, name)
    faults += _table_faults(dataset, HISTORIES, ("sample", "history_point"), "float32")
    faults += _table_faults(dataset, DESCRIPTORS, ("explosive_type",), "float64")
    return faults + _unknown_names(dataset)


def require_form(dataset: xr.Dataset, path: Path) -> None:
    """Refuse a dataset whose attributes or columns are not those of the format.

    Raises
    ------
    DatasetError
        The first faults, and how to see the others.
    """
    faults = form_faults(dataset)
    if faults:
        more = len(faults) - _SHOWN
        lines = [f"{path}: {fault}" for fault in faults[:_SHOWN]]
        if more > 0:
            lines.append(f"{path}: {more} more; 'castblast dataset check {path}' lists them")
        raise DatasetError("\n".join(lines))


def _attribute_faults(dataset: xr.Dataset) -> list[Fault]:
    attributes = dataset.attrs
    faults = []
    for name in REQUIRED_ATTRIBUTES:
        value = attributes.get(name)
        if value is None:
            faults.append(Fault(f"attribute {name}", "is missing"))
        elif name in _COUNTS:
            if not isinstance(value, int | np.integer):
                faults.append(Fault(f"attribute {name}", f"is {shortened(value)}, not a number"))
        elif not isinstance(value, str) and name != "design_seed":
            faults.append(Fault(f"attribute {name}", f"is {shortened(value)}, not a text"))
    if "schema" in attributes and text_attribute(dataset, "schema") != SCHEMA:
        shown = shortened(attributes["schema"])
        faults.append(Fault("attribute schema", f"is '{shown}', not '{SCHEMA}'"))
    for name, (kind, of_texts) in _JSON.items():
        if name not in attributes:
            continue
        try:
            value = parse_json(str(attributes[name]))
        except SpecError:
            faults.append(Fault(f"attribute {name}", "is not JSON"))
            continue
        parts = value.values() if isinstance(value, dict) else ()
        if not isinstance(value, kind) or (of_texts and not all(isinstance(p, str) for p in parts)):
            faults.append(Fault(f"attribute {name}", "holds another kind of JSON"))
    return faults


def _label_faults(dataset: xr.Dataset) -> list[Fault]:
    faults = []
    for name, (dtype, dims, _, _) in LABELS.items():
        if name not in dataset.variables:
            faults.append(Fault(name, "is missing"))
            continue
        variable = dataset[name]
        faults += _form_faults(name, variable, dtype, dims)
        if name in ("explosive", "split", "status"):
            faults += _flag_faults(name, variable)
    return faults


def _flag_faults(name: str, variable: xr.DataArray) -> list[Fault]:
    meanings = str(variable.attrs.get("flag_meanings", "")).split()
    flags = np.atleast_1d(variable.attrs.get("flag_values", [])).tolist()
    if not meanings or len(meanings) != len(flags):
        return [Fault(name, "needs as many flag_values as flag_meanings")]
    if flags != list(range(len(flags))):
        return [Fault(name, f"flag_values are {shortened(flags)}, not 0, 1, 2, ...")]
    faults = []
    known = label_attributes(name, tuple(meanings))["flag_meanings"].split()
    if meanings != known:
        faults.append(
            Fault(name, f"flag_meanings are '{shortened(' '.join(meanings))}', not {known}")
        )
    return faults


def _variable_faults(dataset: xr.Dataset, name: str) -> list[Fault]:
    if name not in dataset.variables:
        return [Fault(name, "is missing")]
    variable = dataset[name]
    role = role_of(variable)
    roles = OUTPUT_ROLES if name in OUTPUT_NAMES else INPUT_ROLES
    dims = () if role == "fixed" else ("sample",)
    faults = _form_faults(name, variable, "float64", dims, VARIABLES[name].unit)
    if role not in roles:
        faults.append(Fault(name, f"role is '{shortened(role)}', not one of {', '.join(roles)}"))
    return faults


def _table_faults(
    dataset: xr.Dataset, table: dict[str, tuple[str, str]], dims: tuple[str, ...], dtype: str
) -> list[Fault]:
    faults = []
    for name, (units, _) in table.items():
        if name not in dataset.variables:
            faults.append(Fault(name, "is missing"))
        else:
            faults += _form_faults(name, dataset[name], dtype, dims, units)
    return faults


def _form_faults(
    name: str, variable: xr.DataArray, dtype: str, dims: tuple[str, ...], units: str | None = None
) -> list[Fault]:
    """Type, dimensions, unit and meaning of one column."""
    faults = []
    if variable.dtype != np.dtype(dtype):
        faults.append(Fault(name, f"type is {variable.dtype}, not {dtype}"))
    if variable.dims != dims:
        faults.append(Fault(name, f"dimensions are {variable.dims}, not {dims}"))
    if units is not None and text_attribute(variable, "units") != units:
        faults.append(
            Fault(name, f"units are '{shortened(variable.attrs.get('units', ''))}', not '{units}'")
        )
    if not text_attribute(variable, "long_name"):
        faults.append(Fault(name, "has no long_name"))
    return faults


def _unknown_names(dataset: xr.Dataset) -> list[Fault]:
    known = {*LABELS, *HISTORIES, *DESCRIPTORS, *INPUT_NAMES, *OUTPUT_NAMES, "explosive_name"}
    return [
        Fault(str(name), f"is not part of the format{nearest_name(str(name), known)}")
        for name in dataset.variables
        if name not in known
    ]
