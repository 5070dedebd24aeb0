"""Runs of the lab book as a table."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from datetime import UTC, datetime
from math import isnan
from pathlib import Path
from typing import Any, NamedTuple

from castblast.errors import SpecError, nearest_name
from castblast.surrogate.keeping.lab_book import open_store


class RunEntry(NamedTuple):
    """One run of the lab book.

    Attributes
    ----------
    run_id, parent_id : str
        `parent_id` is empty for a comparison, study or training as a whole.
    experiment, name, status : str
    started : str
        ISO 8601, UTC.
    seconds : float or None
        None while it runs.
    metrics : dict of str to float
    tags : dict of str to str
        Without those of MLflow itself.
    """

    run_id: str
    parent_id: str
    experiment: str
    name: str
    status: str
    started: str
    seconds: float | None
    metrics: dict[str, float]
    tags: dict[str, str]


def read_runs(store: Path, experiment: str | None = None) -> list[RunEntry]:
    """List the runs of ``mlflow.db``, newest first.

    Parameters
    ----------
    store : path
        The SQLite file.
    experiment : str, optional
        Only runs of this experiment, such as ``paper/1``.

    Raises
    ------
    SpecError
        No such file, none of MLflow, or no such experiment.
    """
    if not store.is_file():
        message = f"{store}: no record of runs; castblast train, tune and compare write one"
        raise SpecError(message)
    _require_store(store)
    with open_store(store.resolve()) as mlflow:
        try:
            names = {one.experiment_id: one.name for one in mlflow.search_experiments()}
            runs = mlflow.search_runs(list(names), output_format="list")
        except mlflow.MlflowException as fault:
            raise SpecError(f"{store}: {fault}") from None
    if experiment is not None and experiment not in names.values():
        known = sorted(names.values())
        message = (
            f"experiment '{experiment}': not in {store}{nearest_name(experiment, known)} "
            f"(there are {', '.join(known)})"
        )
        raise SpecError(message)
    entries = [_entry(run, names[run.info.experiment_id]) for run in runs]
    return [entry for entry in entries if experiment in (None, entry.experiment)]


def _require_store(store: Path) -> None:
    """Refuse a file that is not MLflow's: opening it with MLflow would write tables into it."""
    try:
        with closing(sqlite3.connect(f"{store.resolve().as_uri()}?mode=ro", uri=True)) as base:
            tables = {name for (name,) in base.execute("SELECT name FROM sqlite_master")}
    except sqlite3.Error as fault:
        message = f"{store}: cannot be read as the store of MLflow: {fault}"
        raise SpecError(message) from None
    if not {"alembic_version", "experiments", "runs"} <= tables:
        raise SpecError(f"{store}: not a store of MLflow")


def _entry(run: Any, experiment: str) -> RunEntry:
    info, tags = run.info, dict(sorted(run.data.tags.items()))
    return RunEntry(
        run_id=info.run_id,
        parent_id=tags.get("mlflow.parentRunId", ""),
        experiment=experiment,
        name=info.run_name or "",
        status=info.status.lower(),
        started=datetime.fromtimestamp(info.start_time / 1000.0, UTC).isoformat(timespec="seconds"),
        seconds=(info.end_time - info.start_time) / 1000.0 if info.end_time else None,
        metrics={key: x for key, x in sorted(run.data.metrics.items()) if not isnan(x)},
        tags={key: text for key, text in tags.items() if not key.startswith("mlflow.")},
    )
