"""Departures of a dataset from its format, all of them at once.

A checker that stops at the first fault makes people run it many times; this one returns a list. It
looks at one block of rows at a time, so the length of the dataset does not matter.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
import xarray as xr

from castblast.dataset.check_rows import INPUT_ROLES, OUTPUT_ROLES, RowCheck
from castblast.dataset.content import ContentHash
from castblast.dataset.schema import (
    DESCRIPTORS,
    HISTORIES,
    LABELS,
    REQUIRED_ATTRIBUTES,
    SCHEMA,
    label_attributes,
)
from castblast.dataset.store import row_blocks
from castblast.errors import nearest_name
from castblast.progress import ProgressCallback, silent
from castblast.variables import INPUT_NAMES, OUTPUT_NAMES, VARIABLES


@dataclass(frozen=True)
class Fault:
    """One departure from the format: where, and what is wrong there."""

    where: str
    message: str

    def __str__(self) -> str:
        """Give one line for people."""
        return f"{self.where}: {self.message}"


def check(dataset: xr.Dataset, progress: ProgressCallback = silent) -> list[Fault]:
    """Compare a dataset with the format and report every fault, not the first only.

    Parameters
    ----------
    dataset : xr.Dataset
        In memory, or open and not read yet (`store.reading`).
    """
    rows, content = RowCheck(), ContentHash()
    size, done = dataset.sizes.get("sample", 0), 0
    for block in row_blocks(dataset):
        rows.add(block)
        content.add(block)
        done += block.sizes.get("sample", 0)
        progress(done / max(size, 1), f"checked {done} of {size} samples")
    faults = _attribute_faults(dataset, rows.failed)
    faults += _label_faults(dataset, rows)
    for name in (*INPUT_NAMES, *OUTPUT_NAMES):
        faults += _variable_faults(dataset, name)
    faults += _table_faults(dataset, HISTORIES, ("sample", "history_point"), "float32")
    faults += _table_faults(dataset, DESCRIPTORS, ("explosive_type",), "float64")
    faults += [Fault(*fault) for fault in rows.faults()]
    faults += _unknown_names(dataset)
    stored = dataset.attrs.get("content_sha256")
    if stored is not None and stored != content.hexdigest():
        faults.append(
            Fault("content_sha256", "the values are not those that were written (hash differs)")
        )
    return faults


def _attribute_faults(dataset: xr.Dataset, failed: int) -> list[Fault]:
    attributes = dataset.attrs
    faults = [
        Fault(f"attribute {name}", "is missing")
        for name in REQUIRED_ATTRIBUTES
        if name not in attributes
    ]
    if attributes.get("schema", SCHEMA) != SCHEMA:
        faults.append(Fault("attribute schema", f"is '{attributes['schema']}', not '{SCHEMA}'"))
    for name in ("dependency_versions", "explosive_specs", "made_from", "extends"):
        try:
            json.loads(str(attributes.get(name, "{}")))
        except ValueError:
            faults.append(Fault(f"attribute {name}", "is not JSON"))
    if "status" in dataset.variables:
        for name, count in (("n_ok", dataset["status"].size - failed), ("n_failed", failed)):
            if name in attributes and int(attributes[name]) != count:
                faults.append(Fault(f"attribute {name}", f"is {attributes[name]}, not {count}"))
    return faults


def _label_faults(dataset: xr.Dataset, rows: RowCheck) -> list[Fault]:
    faults = []
    for name, (dtype, dims, _, _) in LABELS.items():
        if name not in dataset.variables:
            faults.append(Fault(name, "is missing"))
            continue
        variable = dataset[name]
        faults += _form_faults(name, variable, dtype, dims)
        if name in rows.codes:
            faults += _flag_faults(name, variable, rows.codes[name])
    return faults


def _flag_faults(name: str, variable: xr.DataArray, codes: set[int]) -> list[Fault]:
    meanings = str(variable.attrs.get("flag_meanings", "")).split()
    flags = np.atleast_1d(variable.attrs.get("flag_values", [])).tolist()
    if not meanings or len(meanings) != len(flags):
        return [Fault(name, "needs as many flag_values as flag_meanings")]
    faults = []
    known = label_attributes(name, tuple(meanings))["flag_meanings"].split()
    if meanings != known:
        faults.append(Fault(name, f"flag_meanings are '{' '.join(meanings)}', not {known}"))
    strange = sorted(codes - set(flags))
    if strange:
        allowed = ", ".join(f"{f} {m}" for f, m in zip(flags, meanings, strict=True))
        faults.append(Fault(name, f"unknown codes {strange[:5]}; allowed: {allowed}"))
    return faults


def _variable_faults(dataset: xr.Dataset, name: str) -> list[Fault]:
    if name not in dataset.variables:
        return [Fault(name, "is missing")]
    variable = dataset[name]
    role = variable.attrs.get("role")
    roles = OUTPUT_ROLES if name in OUTPUT_NAMES else INPUT_ROLES
    dims = () if role == "fixed" else ("sample",)
    faults = _form_faults(name, variable, "float64", dims, VARIABLES[name].unit)
    if role not in roles:
        faults.append(Fault(name, f"role is '{role}', not one of {', '.join(roles)}"))
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
