"""Work on a written dataset: check it, describe it, recompute one of its samples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from castblast.dataset.file.card import training_statistics
from castblast.dataset.file.check import check
from castblast.dataset.file.compare import relative_difference
from castblast.dataset.file.failures import summary
from castblast.dataset.file.form import require_form
from castblast.dataset.file.provenance import SOURCES, stored_explosives
from castblast.dataset.file.schema import flag_counts, flag_names, names_with_role
from castblast.dataset.file.store import reading_dataset
from castblast.dataset.rows.simulation import blast_simulator
from castblast.design.variables import INPUT_NAMES, OUTPUT_NAMES, VARIABLES
from castblast.errors import DatasetError, SpecError, Status
from castblast.identity import source_hash
from castblast.names import printable
from castblast.progress import ProgressCallback, silent
from castblast.specs.recipe import recipe_from_text
from castblast.stages.outcome import Outcome

#: Deviation up to which a recomputed number is the same: last digits differ between processors.
SAME = 1e-10


def check_dataset(path: str | Path, progress: ProgressCallback = silent) -> list[str]:
    """Report every departure of a file from the format; empty if there is none.

    Raises
    ------
    DatasetError
        The file cannot be read as a dataset at all.
    """
    path = Path(path)
    with reading_dataset(path) as dataset:
        return [str(fault) for fault in check(dataset, progress)]


def describe_dataset(path: str | Path) -> Outcome:
    """Say what a dataset holds: rows, splits, failures, ranges, where it comes from.

    Raises
    ------
    DatasetError
        The file cannot be read as a dataset.
    """
    path = Path(path)
    with reading_dataset(path) as dataset:
        require_form(dataset, path)
        return _describe(dataset, path)


def _describe(dataset: xr.Dataset, path: Path) -> Outcome:
    attributes = dataset.attrs
    counts = {name: flag_counts(dataset[name]) for name in ("explosive", "split", "status")}
    variables = {
        name: {"role": role, "units": VARIABLES[name].unit, **training_statistics(dataset, name)}
        for role in ("input", "derived", "fixed", "target", "diagnostic")
        for name in names_with_role(dataset, role)
    }
    lines = [
        f"{attributes['id']}: {attributes['title']}",
        summary(dataset["status"].to_numpy()),
        *(
            f"{name}: {', '.join(f'{key} {count}' for key, count in counts[name].items())}"
            for name in ("explosive", "split")
        ),
        f"made by castblast {attributes['castblast_version']}, content "
        f"{attributes['content_sha256']}",
    ]
    rows = [
        (
            name,
            str(entry["role"]),
            VARIABLES[name].shown_unit,
            *(
                f"{float(entry[key]) * VARIABLES[name].display_factor:.5g}"
                for key in ("mean", "std", "min", "max")
            ),
        )
        for name, entry in variables.items()
        if entry["role"] != "fixed"
    ]
    header = ("variable", "role", "unit", "mean", "std", "min", "max")
    document = {
        "dataset": str(path),
        "id": attributes["id"],
        "size": dataset.sizes["sample"],
        **counts,
        "variables": variables,
        "content_sha256": attributes["content_sha256"],
        "recipe_sha256": attributes["recipe_sha256"],
    }
    return Outcome(document=document, header=header, rows=rows, lines=lines)


def reproduce_sample(path: str | Path, sample: int) -> Outcome:
    """Compute one sample again from the file alone and compare every output.

    Parameters
    ----------
    sample : int
        Stable id.

    Raises
    ------
    DatasetError
        The file cannot be read as a dataset.
    SpecError
        No such sample, or a recipe that this version cannot read.
    """
    path = Path(path)
    with reading_dataset(path) as dataset:
        require_form(dataset, path)
        position = _position(dataset, sample, path)
        wanted = ["explosive", "status", *INPUT_NAMES, *OUTPUT_NAMES]
        stored = dataset[wanted].isel(sample=position).load()
    recipe = recipe_from_text(stored.attrs["recipe"], f"{path}: recipe")
    name = str(flag_names(stored["explosive"]))
    carried = stored_explosives(stored.attrs, str(path))
    if name not in carried:
        message = f"{path}: carries no file of the explosive '{printable(name)}'"
        raise DatasetError(message)
    explosive = carried[name].spec.to_explosive()
    inputs = {key: np.array([float(stored[key])]) for key in INPUT_NAMES}
    result = blast_simulator(recipe, (explosive,)).run(inputs, np.zeros(1, dtype=np.int8))
    values = {key: (float(stored[key]), float(result.outputs[key][0])) for key in OUTPUT_NAMES}
    deviations = {
        key: float(relative_difference(key, *np.array(pair).reshape(2, 1))[0])
        for key, pair in values.items()
    }
    worst = max(deviations, key=lambda key: deviations[key])
    flag_names(stored["status"])  # a code that is none is refused
    statuses = (Status(int(stored["status"])), Status(int(result.status[0])))
    same = statuses[0] == statuses[1] and deviations[worst] <= SAME
    verdict = f"sample {sample}: " + _verdict(same, statuses, worst, deviations[worst])
    if not same and stored.attrs["source_sha256"] != source_hash(SOURCES):
        verdict += "; the code of the physics is not the one that made the file"
    rows = [
        (key, *(VARIABLES[key].show(value) for value in values[key]), f"{deviations[key]:.1e}")
        for key in OUTPUT_NAMES
    ]
    header = ("quantity", "stored", "recomputed", "relative difference")
    document = {
        "dataset": str(path),
        "sample": sample,
        "same": same,
        "status": [status.name.lower() for status in statuses],
        "stored": {key: pair[0] for key, pair in values.items()},
        "recomputed": {key: pair[1] for key, pair in values.items()},
        "relative_difference": deviations,
    }
    return Outcome(document=document, header=header, rows=rows, lines=[verdict], ok=same)


def _position(dataset: xr.Dataset, sample: int, path: Path) -> int:
    ids = dataset["sample"].to_numpy()
    found = np.flatnonzero(ids == sample)
    if not len(found):
        known = f"ids are {ids.min()} to {ids.max()}" if len(ids) else "it has none"
        message = f"{path}: no sample {sample}; {known}"
        raise SpecError(message)
    return int(found[0])


def _verdict(same: bool, statuses: tuple[Status, Status], worst: str, deviation: float) -> str:
    if statuses[0] != statuses[1]:
        stored, computed = (status.name.lower() for status in statuses)
        return f"status was {stored}, is {computed} now"
    if same:
        exactly = "bit for bit" if deviation == 0.0 else f"to {deviation:.1e} relative"
        return f"reproduced {exactly}"
    return f"differs, most in {worst} ({deviation:.1e} relative)"
