"""The finished dataset from its design and the results of all its rows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from castblast.dataset.design import Design
from castblast.dataset.provenance import ExplosiveSource, global_attributes
from castblast.dataset.schema import (
    DESCRIPTORS,
    HISTORIES,
    LABELS,
    content_hash,
    label_attributes,
    output_role,
    variable_attributes,
)
from castblast.dataset.simulation import BatchResult, FloatArray
from castblast.errors import Status
from castblast.explosive.isentrope import energy, pressure
from castblast.specs.recipe import Recipe, RecipeSource


def assemble(
    source: RecipeSource,
    explosives: tuple[ExplosiveSource, ...],
    design: Design,
    results: BatchResult,
) -> xr.Dataset:
    """Put design and results of all rows into one dataset, with its content hash.

    Parameters
    ----------
    results : BatchResult
        Rows in the order of the design.
    """
    columns = _labels(explosives, design, results)
    columns |= _inputs(source.recipe, design)
    for name, values in results.outputs.items():
        columns[name] = ("sample", values, variable_attributes(name, output_role(name)))
    columns |= history_columns(results.histories)
    columns |= _descriptors(explosives)
    failed = int(np.count_nonzero(results.status != Status.OK))
    dataset = xr.Dataset(
        data_vars=columns,
        coords={"sample": ("sample", design.sample, label_attributes("sample"))},
        attrs=global_attributes(
            source,
            explosives,
            drawn=design.drawn,
            n_ok=len(design.sample) - failed,
            n_failed=failed,
        ),
    )
    dataset.attrs["content_sha256"] = content_hash(dataset)
    return dataset


def history_columns(histories: Mapping[str, FloatArray]) -> dict[str, Any]:
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
    explosives: tuple[ExplosiveSource, ...], design: Design, results: BatchResult
) -> dict[str, Any]:
    names = tuple(entry.name for entry in explosives)
    values: dict[str, NDArray[Any]] = {
        "explosive": design.explosive,
        "split": design.split,
        "status": results.status,
        "design_batch": design.batch,
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
            columns[name] = ("sample", values, attributes)
        elif (values == values[0]).all():
            columns[name] = ((), values[0], variable_attributes(name, "fixed"))
        else:
            columns[name] = ("sample", values, variable_attributes(name, "derived"))
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
