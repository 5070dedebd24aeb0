"""Whether the columns of a table are ones that a spec can learn from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from castblast.design.variables import VARIABLES
from castblast.errors import DatasetError
from castblast.specs.models.model import ModelSpec
from castblast.surrogate.fitting.features import Table
from castblast.types import FloatArray

#: A sum of inputs that moves by no more than this share of its terms is held: the rest is rounding.
_ROUNDING = 1e-12


def constant_faults(spec: ModelSpec, table: Table) -> list[str]:
    """Columns of a spec that have one value in every row of a table, a line for each.

    Nothing is learned from such an input, and its scaling divides by nothing; a target of the kind
    has no spread that could be explained.

    Parameters
    ----------
    spec : ModelSpec
        With named features.
    table : Table
        Holds at least the features and targets of the spec.
    """
    faults = []
    for name in spec.features:
        values = table.frame[name].to_numpy()
        if np.ptp(values) == 0.0:
            shown = VARIABLES[name].show(float(values[0]))
            faults.append(
                f"{spec.name}: features: {name}: the dataset holds it at {shown}, so nothing can "
                "be learned from it; leave it out, or write 'features: all'"
            )
    for column, entry in spec.derived.items():
        terms = _terms(table, entry.coefficients)
        size = float(np.max(np.abs(terms)))
        if np.ptp(terms.sum(axis=0)) <= _ROUNDING * size:
            names = ", ".join(entry.coefficients)
            faults.append(
                f"{spec.name}: derived: {column}: the sum of {names} is the same in every row; "
                "leave it out"
            )
    for name in spec.targets:
        values = table.targets[:, table.target_names.index(name)]
        if np.ptp(values) == 0.0:
            shown = VARIABLES[name].show(float(values[0]))
            faults.append(
                f"{spec.name}: targets: {name}: is {shown} in every row of the dataset; "
                "there is nothing to learn"
            )
    return faults


def check_positive(
    table: Table, names: Sequence[str], derived: Mapping[str, Mapping[str, float]] | None = None
) -> None:
    """Refuse columns that are to be logged but hold values of 0 or below.

    Parameters
    ----------
    table : Table
    names : sequence of str
        Features and targets.
    derived : mapping of name to coefficients of inputs, optional
        Sums of features.

    Raises
    ------
    DatasetError
        One line per column.
    """
    columns = {
        name: table.targets[:, table.target_names.index(name)]
        if name in table.target_names
        else table.frame[name].to_numpy()
        for name in names
    }
    for name, coefficients in (derived or {}).items():
        columns[name] = _terms(table, coefficients).sum(axis=0)
    faults = []
    for name, values in columns.items():
        bad = np.flatnonzero(values <= 0.0)
        if len(bad):
            value = float(values[bad[0]])
            shown = VARIABLES[name].show(value) if name in VARIABLES else f"{value:.6g}"
            faults.append(
                f"{name}: {len(bad)} rows are not above 0 (sample {table.sample[bad[0]]}: "
                f"{shown}); a model with transform 'log' cannot use it"
            )
    if faults:
        raise DatasetError("\n".join(faults))


def _terms(table: Table, coefficients: Mapping[str, float]) -> FloatArray:
    """Terms of a sum of features, (k, n)."""
    return np.stack([c * table.frame[name].to_numpy() for name, c in coefficients.items()])
