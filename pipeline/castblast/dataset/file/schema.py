"""The format of a near-field dataset: its columns and their attributes.

`data_specs/FORMAT.md` states the same in words, `castblast.dataset.file.check` reports departures.
Names, units and bounds come from `castblast.design.variables`; the few columns that only a dataset
has are defined here. Conventions: CF-1.11 (Eaton et al.) and ACDD-1.3.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from castblast.design.variables import INPUT_NAMES, VARIABLES
from castblast.errors import DatasetError, Status
from castblast.specs.recipe import SPLIT_NAMES
from castblast.types import BoolArray

#: Kind and version of the format, an attribute of every file.
SCHEMA = "castblast near-field dataset"
SCHEMA_VERSION = "1.0"

#: Name to (dtype, dimensions, units, long_name) of the columns that are no physical variable.
LABELS: dict[str, tuple[str, tuple[str, ...], str, str]] = {
    "sample": ("int32", ("sample",), "1", "stable id of the sample, never used again"),
    "explosive": ("int8", ("sample",), "1", "explosive of the sample"),
    "split": ("int8", ("sample",), "1", "what the sample may be used for"),
    "status": ("int8", ("sample",), "1", "outcome of the simulation"),
    "design_batch": ("int16", ("sample",), "1", "Latin-hypercube batch of the sample"),
}
#: Name to (units, long_name) of the columns of shape (sample, history_point), float32.
HISTORIES: dict[str, tuple[str, str]] = {
    "history_time": ("s", "time since detonation"),
    "history_pressure": ("Pa", "gas pressure in the hole"),
    "history_radius": ("m", "radius of the hole wall"),
}
#: Name to (units, long_name) of the columns of shape (explosive_type,), float64.
DESCRIPTORS: dict[str, tuple[str, str]] = {
    "explosive_density": ("kg m-3", "density of the explosive"),
    "explosive_detonation_velocity": ("m s-1", "ideal velocity of detonation"),
    "explosive_heat_of_explosion": ("J kg-1", "heat of explosion"),
    "explosive_total_energy": ("J m-3", "energy of detonation per volume of explosive"),
    "explosive_initial_pressure": ("Pa", "pressure on the isentrope at the initial volume"),
    "explosive_expansion_work": (
        "J m-3",
        "work of the products from the initial to five times the initial volume, per volume",
    ),
}
#: Global attributes every file carries.
REQUIRED_ATTRIBUTES = (
    "Conventions", "title", "summary", "keywords", "id", "naming_authority", "history", "source",
    "processing_level", "comment", "license", "creator_name", "product_version", "references",
    "schema", "schema_version", "name", "dataset_version", "recipe", "recipe_sha256",
    "rows_sha256", "source_sha256", "castblast_version", "dependency_versions", "explosive_specs",
    "made_from", "design_method", "design_seed", "designs_drawn", "n_ok", "n_failed",
    "content_sha256",
)  # fmt: skip


def flag_attributes(meanings: tuple[str, ...]) -> dict[str, Any]:
    """CF attributes of a column of codes that count from 0."""
    return {
        "flag_values": np.arange(len(meanings), dtype=np.int8),
        "flag_meanings": " ".join(meanings),
    }


def label_attributes(name: str, explosives: tuple[str, ...] = ()) -> dict[str, Any]:
    """Attributes of one of `LABELS`."""
    _, _, units, long_name = LABELS[name]
    attributes: dict[str, Any] = {"long_name": long_name, "role": "label"}
    meanings = {
        "explosive": explosives,
        "split": SPLIT_NAMES,
        "status": tuple(status.name.lower() for status in Status),
    }.get(name)
    if meanings:
        attributes |= flag_attributes(meanings)
    else:
        attributes["units"] = units
    if name == "explosive":
        attributes["role"] = "input"
    return attributes


def variable_attributes(name: str, role: str) -> dict[str, Any]:
    """Attributes of a physical variable; `role` is input, derived, fixed, target or diagnostic."""
    variable = VARIABLES[name]
    attributes: dict[str, Any] = {
        "units": variable.unit,
        "long_name": variable.long_name,
        "role": role,
    }
    if variable.symbol:
        attributes["symbol"] = variable.symbol
    # An input of 0 may stand for "the default of the solver", which its bounds do not cover.
    low, high = plausible_range(name)
    return {**attributes, "valid_min": low, "valid_max": high}


def plausible_range(name: str) -> tuple[float, float]:
    """Bounds of a stored value."""
    variable = VARIABLES[name]
    lower = 0.0 if variable.role == "solver" else variable.lower
    return lower, variable.upper


def output_role(name: str) -> str:
    """Role of an output: target or diagnostic."""
    return "target" if VARIABLES[name].role == "target" else "diagnostic"


def flag_names(variable: xr.DataArray) -> NDArray[np.str_]:
    """Names of a column of codes, by its `flag_meanings`."""
    meanings, codes = _meanings(variable), variable.to_numpy()
    _require_known(variable, codes, meanings)
    return np.asarray(np.array(meanings)[codes])


def flag_counts(variable: xr.DataArray) -> dict[str, int]:
    """How often each code of a column was met, by name in alphabetical order."""
    meanings = _meanings(variable)
    codes, counts = np.unique(variable.to_numpy(), return_counts=True)
    _require_known(variable, codes, meanings)
    return dict(
        sorted((meanings[code], int(count)) for code, count in zip(codes, counts, strict=True))
    )


def flag_rows(variable: xr.DataArray, name: str) -> BoolArray:
    """Rows with the code of one name."""
    meanings = _meanings(variable)
    code = meanings.index(name) if name in meanings else len(meanings)
    return np.asarray(variable.to_numpy() == code)


def _meanings(variable: xr.DataArray) -> list[str]:
    return str(variable.attrs.get("flag_meanings", "")).split()


def _require_known(variable: xr.DataArray, codes: NDArray[Any], meanings: list[str]) -> None:
    """Refuse codes that no flag stands for.

    Raises
    ------
    DatasetError
        One line.
    """
    if codes.dtype.kind not in "iu" or np.any(codes < 0) or np.any(codes >= len(meanings)):
        message = f"{variable.name}: holds codes that none of its {len(meanings)} flags stands for"
        raise DatasetError(message)


def names_with_role(dataset: xr.Dataset, role: str) -> tuple[str, ...]:
    """Physical variables of one role, in the order of the file."""
    return tuple(
        str(name)
        for name, variable in dataset.variables.items()
        if role_of(variable) == role and name in VARIABLES
    )


def varying_inputs(dataset: xr.Dataset) -> tuple[str, ...]:
    """Inputs that the design of a dataset varies, those derived from others left out.

    A column that says nothing of its role is an input.
    """
    return tuple(
        name
        for name in INPUT_NAMES
        if name in dataset.data_vars
        and is_column(dataset[name])
        and ("role" not in dataset[name].attrs or role_of(dataset[name]) == "input")
        and float(np.ptp(dataset[name].to_numpy())) > 0.0
    )


def is_column(variable: xr.DataArray) -> bool:
    """Whether a variable holds a number for each sample."""
    return variable.dims == ("sample",) and variable.dtype.kind in "fiub"


def role_of(variable: xr.Variable | xr.DataArray) -> str:
    """Role of a column; an attribute of another kind is none."""
    return text_attribute(variable, "role")


def text_attribute(of: xr.Variable | xr.DataArray | xr.Dataset, name: str) -> str:
    """Text of an attribute; empty if it is missing or of another kind, an array for one."""
    value = of.attrs.get(name)
    return value if isinstance(value, str) else ""
