"""The finished dataset from its design and the results of its rows, block by block.

Whole columns exist of the design only; results come shard by shard and leave in blocks whose size
has nothing to do with that of the shards.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from castblast.dataset.file.provenance import ExplosiveSource
from castblast.dataset.file.schema import (
    DESCRIPTORS,
    HISTORIES,
    LABELS,
    label_attributes,
    output_role,
    variable_attributes,
)
from castblast.dataset.file.store import BLOCK_ROWS
from castblast.dataset.rows.design import Design
from castblast.dataset.rows.simulation import BatchResult
from castblast.explosive.isentrope import energy, pressure
from castblast.specs.recipe import Recipe
from castblast.types import FloatArray


def assemble(
    recipe: Recipe,
    explosives: tuple[ExplosiveSource, ...],
    design: Design,
    results: Iterable[BatchResult],
) -> Iterator[xr.Dataset]:
    """Put design and results together, `BLOCK_ROWS` rows at a time, without global attributes.

    Parameters
    ----------
    results : iterable of BatchResult
        Of all rows in the order of the design, in parts of any length.
    """
    inputs = _inputs(recipe, design)
    descriptors = _descriptors(explosives)
    begin = 0
    for part in regroup(results, BLOCK_ROWS):
        rows = slice(begin, begin + len(part.status))
        columns = _labels(explosives, design, part.status, rows)
        columns |= {
            name: (dims, values[rows] if dims else values, attributes)
            for name, (dims, values, attributes) in inputs.items()
        }
        for name, values in part.outputs.items():
            columns[name] = ("sample", values, variable_attributes(name, output_role(name)))
        columns |= _histories(part.histories)
        columns |= descriptors
        sample = ("sample", design.sample[rows], label_attributes("sample"))
        yield xr.Dataset(data_vars=columns, coords={"sample": sample})
        begin = rows.stop


def regroup(parts: Iterable[BatchResult], rows: int) -> Iterator[BatchResult]:
    """Join parts of any length to parts of `rows` rows; the last one holds what is left."""
    held: list[BatchResult] = []
    count = 0
    for part in parts:
        held.append(part)
        count += len(part.status)
        if count < rows:
            continue
        joined = _joined(held)
        whole = count - count % rows
        for begin in range(0, whole, rows):
            yield _rows_of(joined, slice(begin, begin + rows))
        held, count = [_rows_of(joined, slice(whole, count))], count - whole
    if count:
        yield _joined(held)


def _joined(parts: list[BatchResult]) -> BatchResult:
    first = parts[0]
    return BatchResult(
        status=np.concatenate([part.status for part in parts]),
        outputs={
            name: np.concatenate([part.outputs[name] for part in parts]) for name in first.outputs
        },
        histories={
            name: np.concatenate([part.histories[name] for part in parts])
            for name in first.histories
        },
    )


def _rows_of(part: BatchResult, rows: slice) -> BatchResult:
    return BatchResult(
        status=part.status[rows],
        outputs={name: values[rows] for name, values in part.outputs.items()},
        histories={name: values[rows] for name, values in part.histories.items()},
    )


def _histories(histories: Mapping[str, FloatArray]) -> dict[str, Any]:
    """Histories as columns of shape (sample, history_point), in single precision."""
    return {
        name: (
            ("sample", "history_point"),
            histories[name].astype(np.float32),
            {"units": units, "long_name": long_name, "role": "history"},
        )
        for name, (units, long_name) in HISTORIES.items()
    }


def _labels(
    explosives: tuple[ExplosiveSource, ...],
    design: Design,
    status: NDArray[np.int8],
    rows: slice,
) -> dict[str, Any]:
    names = tuple(entry.name for entry in explosives)
    values: dict[str, NDArray[Any]] = {
        "explosive": design.explosive[rows],
        "split": design.split[rows],
        "status": status,
        "design_batch": design.batch[rows],
    }
    return {
        name: (LABELS[name][1], array.astype(LABELS[name][0]), label_attributes(name, names))
        for name, array in values.items()
    }


def _inputs(recipe: Recipe, design: Design) -> dict[str, Any]:
    """Every input: a column where it varies, a single value where it does not."""
    columns: dict[str, Any] = {}
    sampled = {spec.name: spec for spec in recipe.sampled}
    for name, values in design.inputs.items():
        if name in sampled:
            spec = sampled[name]
            attributes = variable_attributes(name, "input") | {
                "sampled_lower": spec.at(0.0),
                "sampled_upper": spec.at(1.0),
                "sampled_distribution": spec.distribution,
            }
            if spec.ratio_of is not None:
                attributes["sampled_as_ratio_of"] = spec.ratio_of
            columns[name] = (("sample",), values, attributes)
        elif (values == values[0]).all():
            columns[name] = ((), values[0], variable_attributes(name, "fixed"))
        else:
            columns[name] = (("sample",), values, variable_attributes(name, "derived"))
    return columns


def _descriptors(explosives: tuple[ExplosiveSource, ...]) -> dict[str, Any]:
    """Physical description of the explosives, for models that learn across them."""
    rows = []
    for entry in explosives:
        explosive = entry.spec.to_explosive()
        start = energy(explosive.isentrope, 1.0)
        rows.append(
            (
                explosive.density,
                explosive.detonation_velocity,
                explosive.heat_of_explosion,
                explosive.total_energy,
                pressure(explosive.isentrope, 1.0),
                start - energy(explosive.isentrope, 5.0),
            )
        )
    table = np.array(rows, dtype=np.float64)
    columns: dict[str, Any] = {
        name: (
            "explosive_type",
            table[:, j],
            {"units": units, "long_name": long_name, "role": "descriptor"},
        )
        for j, (name, (units, long_name)) in enumerate(DESCRIPTORS.items())
    }
    names = np.array([entry.name for entry in explosives], dtype=object)
    about = {"long_name": "name of the explosive", "role": "label"}
    return {"explosive_name": ("explosive_type", names, about), **columns}
