"""Rows of a dataset for several specs at once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from castblast.errors import DatasetError, SpecError
from castblast.specs.models.model import ModelSpec
from castblast.surrogate.fitting.column_checks import constant_faults
from castblast.surrogate.fitting.features import Table, read_table


def read_rows(dataset: Any, specs: Sequence[ModelSpec], path: Path | str) -> Table:
    """Read every column that one of the specs asks for.

    Parameters
    ----------
    dataset : Dataset
        With codes and flags, as in the file.
    specs : sequence of ModelSpec
    path : path
        Begins every line of a fault.

    Raises
    ------
    DatasetError
        As `read_table`, with the path in front of every line.
    SpecError
        Features or targets that have one value in every row; all specs at once.
    """
    features = dict.fromkeys(name for spec in specs for name in spec.features)
    targets = dict.fromkeys(name for spec in specs for name in spec.targets)
    try:
        table = read_table(dataset, tuple(features), tuple(targets))
    except DatasetError as fault:
        lines = "\n".join(f"{path}: {line}" for line in str(fault).splitlines())
        raise DatasetError(lines) from None
    named = [spec.resolved(table.varying or table.feature_names) for spec in specs]
    faults = [line for spec in named for line in constant_faults(spec, table)]
    if faults:
        raise SpecError("\n".join(faults))
    return table
