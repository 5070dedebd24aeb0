"""Departures of a dataset from its format, all of them at once.

A checker that stops at the first fault makes people run it many times; this one returns a list.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from castblast.dataset.schema import (
    DESCRIPTORS,
    HISTORIES,
    LABELS,
    REQUIRED_ATTRIBUTES,
    SCHEMA,
    content_hash,
    label_attributes,
    plausible_range,
)
from castblast.errors import Status, nearest_name
from castblast.variables import INPUT_NAMES, OUTPUT_NAMES, VARIABLES


@dataclass(frozen=True)
class Fault:
    """One departure from the format: where, and what is wrong there."""

    where: str
    message: str

    def __str__(self) -> str:
        """Give one line for people."""
        return f"{self.where}: {self.message}"


def check(dataset: xr.Dataset) -> list[Fault]:
    """Compare a dataset with the format and report every fault, not the first only."""
    faults = _attribute_faults(dataset)
    faults += _label_faults(dataset)
    for name in (*INPUT_NAMES, *OUTPUT_NAMES):
        faults += _variable_faults(dataset, name)
    faults += _table_faults(dataset, HISTORIES, ("sample", "history_point"), "float32")
    faults += _table_faults(dataset, DESCRIPTORS, ("explosive_type",), "float64")
    faults += _history_faults(dataset)
    faults += _unknown_names(dataset)
    stored = dataset.attrs.get("content_sha256")
    if stored is not None and stored != content_hash(dataset):
        faults.append(
            Fault("content_sha256", "the values are not those that were written (hash differs)")
        )
    return faults


def _attribute_faults(dataset: xr.Dataset) -> list[Fault]:
    attributes = dataset.attrs
    faults = [
        Fault(f"attribute {name}", "is missing")
        for name in REQUIRED_ATTRIBUTES
        if name not in attributes
    ]
    if attributes.get("schema", SCHEMA) != SCHEMA:
        faults.append(Fault("attribute schema", f"is '{attributes['schema']}', not '{SCHEMA}'"))
    for name in ("dependency_versions", "explosive_specs", "made_from"):
        try:
            json.loads(str(attributes.get(name, "{}")))
        except ValueError:
            faults.append(Fault(f"attribute {name}", "is not JSON"))
    if "status" in dataset.variables:
        failed = int(np.count_nonzero(dataset["status"].to_numpy()))
        for name, count in (("n_ok", dataset["status"].size - failed), ("n_failed", failed)):
            if name in attributes and int(attributes[name]) != count:
                faults.append(Fault(f"attribute {name}", f"is {attributes[name]}, not {count}"))
    return faults


def _label_faults(dataset: xr.Dataset) -> list[Fault]:
    faults = []
    for name, (dtype, dims, _, _) in LABELS.items():
        if name not in dataset.variables:
            faults.append(Fault(name, "is missing"))
            continue
        variable = dataset[name]
        faults += _form_faults(name, variable, dtype, dims)
        if "flag_meanings" in label_attributes(name, ("any",)):
            faults += _flag_faults(name, variable)
    if "sample" in dataset.variables:
        ids, counts = np.unique(dataset["sample"].to_numpy(), return_counts=True)
        if (counts > 1).any():
            shown = ", ".join(map(str, ids[counts > 1][:5]))
            faults.append(Fault("sample", f"{int((counts > 1).sum())} ids twice: {shown}"))
        if (ids < 0).any():
            faults.append(Fault("sample", "negative ids"))
    return faults


def _flag_faults(name: str, variable: xr.DataArray) -> list[Fault]:
    meanings = str(variable.attrs.get("flag_meanings", "")).split()
    flags = np.atleast_1d(variable.attrs.get("flag_values", [])).tolist()
    if not meanings or len(meanings) != len(flags):
        return [Fault(name, "needs as many flag_values as flag_meanings")]
    faults = []
    known = label_attributes(name, tuple(meanings))["flag_meanings"].split()
    if meanings != known:
        faults.append(Fault(name, f"flag_meanings are '{' '.join(meanings)}', not {known}"))
    strange = sorted(set(np.unique(variable.to_numpy()).tolist()) - set(flags))
    if strange:
        allowed = ", ".join(f"{f} {m}" for f, m in zip(flags, meanings, strict=True))
        faults.append(Fault(name, f"unknown codes {strange[:5]}; allowed: {allowed}"))
    return faults


def _variable_faults(dataset: xr.Dataset, name: str) -> list[Fault]:
    if name not in dataset.variables:
        return [Fault(name, "is missing")]
    variable = dataset[name]
    role = variable.attrs.get("role")
    roles = ("target", "diagnostic") if name in OUTPUT_NAMES else ("input", "derived", "fixed")
    dims = () if role == "fixed" else ("sample",)
    faults = _form_faults(name, variable, "float64", dims, VARIABLES[name].unit)
    if role not in roles:
        faults.append(Fault(name, f"role is '{role}', not one of {', '.join(roles)}"))
    if variable.dims != dims or variable.dtype.kind != "f":
        return faults
    values = np.atleast_1d(variable.to_numpy())
    ok = np.ones(values.size, dtype=bool)
    if name in OUTPUT_NAMES:
        ok = _finished(dataset, values.size)
    faults += _value_faults(dataset, name, values, ok)
    low, high = variable.attrs.get("sampled_lower"), variable.attrs.get("sampled_upper")
    if low is not None and high is not None and "sampled_as_ratio_of" not in variable.attrs:
        outside = np.flatnonzero((values < low) | (values > high))
        if len(outside):
            faults.append(_at(dataset, name, outside, values, "outside the sampled range"))
    return faults


def _value_faults(
    dataset: xr.Dataset, name: str, values: NDArray[Any], ok: NDArray[np.bool_]
) -> list[Fault]:
    """Finite and plausible where the row is finished, NaN where it failed."""
    faults = []
    finite = np.isfinite(values)
    if (ok & ~finite).any():
        where = np.flatnonzero(ok & ~finite)
        faults.append(_at(dataset, name, where, values, "not finite in finished samples"))
    if (~ok & ~np.isnan(values)).any():
        where = np.flatnonzero(~ok & ~np.isnan(values))
        faults.append(_at(dataset, name, where, values, "not NaN in failed samples"))
    low, high = plausible_range(name)
    beyond = (values < low - 1e-9 * abs(low)) | (values > high + 1e-9 * abs(high))
    outside = np.flatnonzero(ok & finite & beyond)
    if len(outside):
        allowed = f"implausible; allowed: {low:g} to {high:g} {VARIABLES[name].unit}"
        faults.append(_at(dataset, name, outside, values, allowed))
    return faults


def _history_faults(dataset: xr.Dataset) -> list[Fault]:
    faults = []
    for name in HISTORIES:
        if name in dataset.variables and dataset[name].ndim == 2:
            finite = np.isfinite(dataset[name].to_numpy())
            ok = _finished(dataset, len(finite))
            bad = np.flatnonzero(ok & ~finite.all(axis=1))
            if len(bad):
                faults.append(Fault(name, f"not finite in finished samples: {_ids(dataset, bad)}"))
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
    if units is not None and variable.attrs.get("units") != units:
        faults.append(Fault(name, f"units are '{variable.attrs.get('units', '')}', not '{units}'"))
    if not variable.attrs.get("long_name"):
        faults.append(Fault(name, "has no long_name"))
    return faults


def _unknown_names(dataset: xr.Dataset) -> list[Fault]:
    known = {*LABELS, *HISTORIES, *DESCRIPTORS, *INPUT_NAMES, *OUTPUT_NAMES, "explosive_name"}
    return [
        Fault(str(name), f"is not part of the format{nearest_name(str(name), known)}")
        for name in dataset.variables
        if name not in known
    ]


def _finished(dataset: xr.Dataset, count: int) -> NDArray[np.bool_]:
    if "status" in dataset.variables and dataset["status"].shape == (count,):
        return np.asarray(dataset["status"].to_numpy() == Status.OK)
    return np.ones(count, dtype=bool)


def _at(
    dataset: xr.Dataset, name: str, where: NDArray[np.intp], values: NDArray[Any], what: str
) -> Fault:
    shown = VARIABLES[name].show(float(values[where[0]]))
    return Fault(name, f"{what}: {_ids(dataset, where)} ({shown} first)")


def _ids(dataset: xr.Dataset, where: NDArray[np.intp]) -> str:
    """Name the samples at some positions, the first five by id."""
    if "sample" not in dataset.variables:
        return f"{len(where)} rows"
    ids = dataset["sample"].to_numpy()
    shown = ", ".join(str(ids[i]) for i in where[:5] if i < len(ids))
    return f"{len(where)} sample{'s' if len(where) > 1 else ''}, id {shown}"
