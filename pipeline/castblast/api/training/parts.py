"""Long parts of a comparison: each is run once, kept, and taken from there the next time.

A part is valid for the very fit, dataset and sources of the package it was made from. Parts that
are missing run some at a time, each in a process of its own.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castblast.identity import document_hash, package_hash
from castblast.jobs import Job, run_jobs
from castblast.progress import ProgressCallback, silent

if TYPE_CHECKING:
    from castblast.specs.models.model import ModelSpec
    from castblast.surrogate.fitting.features import Table
    from castblast.surrogate.fitting.training import Fit


#: Folders of the package that no part of a comparison uses.
_NO_PART = ("muckpile", "scene", "prediction", "report", "export", "api", "stages", "cli")


@dataclass(frozen=True)
class Part:
    """One part of a comparison.

    Attributes
    ----------
    name : str
        Unique; also the name of its file.
    function : callable
        Importable by its name.
    arguments : tuple
    inputs : mapping
        What the result depends on, as plain values.
    """

    name: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    inputs: Mapping[str, Any]

    @property
    def key(self) -> dict[str, str]:
        """What the result was made from, hashed."""
        inputs = document_hash(self.inputs, default=str)
        return {"inputs": inputs, "package": package_hash(_NO_PART)}


@dataclass(frozen=True)
class Done:
    """Result of a part and how long it took when it was made: by the clock, of the processor."""

    value: Any
    seconds: float
    cpu_seconds: float


def run_parts(
    parts: Sequence[Part],
    folder: Path,
    *,
    workers: int | None = None,
    progress: ProgressCallback = silent,
) -> dict[str, Done]:
    """Give the result of every part by its name; those kept in `folder` are not made again."""
    from castblast.surrogate.fitting.fit_store import load_kept, save_kept

    found: dict[str, Done] = {}
    for part in parts:
        kept = load_kept(_place(folder, part), part.key)
        if isinstance(kept, Done):
            found[part.name] = kept
    missing = [part for part in parts if part.name not in found]
    jobs = [
        Job(
            part.name,
            _timed,
            (part.function, part.arguments),
            partial(_keep, save_kept, _place(folder, part), part.key),
        )
        for part in missing
    ]
    results = run_jobs(jobs, workers, progress)
    found |= {part.name: done for part, done in zip(missing, results, strict=True)}
    return found


def _place(folder: Path, part: Part) -> Path:
    """What a part is kept under: no name of a fit has a dot."""
    return folder / f"{part.name}.part"


def _keep(save: Callable[..., object], path: Path, key: dict[str, str], done: Done) -> None:
    save(path, done, key)


def _timed(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Done:
    started, worked = time.perf_counter(), time.process_time()
    value = function(*arguments)
    return Done(value, time.perf_counter() - started, time.process_time() - worked)


def probe_part(dataset: Path, points: int, dense: int) -> Any:
    """Physics of the domain that the gate asks about."""
    from castblast.surrogate.judging.probe import physics_probe

    return physics_probe(open_domain(dataset), points, dense)


def curve_part(fit: Fit, table: Table, sizes: tuple[int, ...]) -> Any:
    """Learning curve of one fit."""
    from castblast.surrogate.fitting.training import learning_curve

    return learning_curve(fit, table, sizes)


def shift_part(spec: ModelSpec, table: Table, dataset: Path | None) -> dict[str, Any]:
    """Tests beyond random splits of one spec, in its quick form: it is fitted a dozen times."""
    from castblast.surrogate.fitting.training import fit_spec
    from castblast.surrogate.judging.shifts import shift_tests

    fit = fit_spec(spec.quick(), table)
    return shift_tests(fit, table, None if dataset is None else open_domain(dataset))


def sobol_part(fit: Fit, dataset: Path, rows: int, checked_rows: int) -> dict[str, Any]:
    """Sobol indices of one fit."""
    from castblast.surrogate.judging.sensitivity import sobol_report

    return sobol_report(fit, open_domain(dataset), rows=rows, checked_rows=checked_rows)


def open_domain(dataset: Path) -> Any:
    """Joint domain of a dataset file.

    Raises
    ------
    DatasetError
        The dataset does not carry its recipe.
    """
    from castblast.dataset.file.store import open_dataset
    from castblast.surrogate.judging.domain import dataset_domain

    return dataset_domain(open_dataset(dataset), dataset.name)
