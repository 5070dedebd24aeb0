"""Runs of the lab book as a table, read from its SQLite file.

A listing asks for four plain tables. Loading MLflow for that takes seconds, this some
milliseconds; the tables are checked first, so that another layout is a message, not a wrong list.
"""

from __future__ import annotations

import sqlite3
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from castblast.errors import SpecError, nearest_name

_NEEDED = {
    "experiments": {"experiment_id", "name"},
    "runs": {"run_uuid", "name", "status", "start_time", "end_time", "lifecycle_stage"},
    "latest_metrics": {"run_uuid", "key", "value", "is_nan"},
    "tags": {"run_uuid", "key", "value"},
}
_QUERY = """
SELECT runs.run_uuid, runs.name, runs.status, runs.start_time, runs.end_time, experiments.name
FROM runs JOIN experiments ON runs.experiment_id = experiments.experiment_id
WHERE runs.lifecycle_stage = 'active' ORDER BY runs.start_time DESC, runs.run_uuid
"""


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
        message = f"{store}: there is no lab book; castblast train, tune and compare write one"
        raise SpecError(message)
    try:
        with closing(sqlite3.connect(f"{store.resolve().as_uri()}?mode=ro", uri=True)) as base:
            _check_tables(base, store)
            entries = _read(base)
            known = sorted(name for (name,) in base.execute("SELECT name FROM experiments"))
    except sqlite3.Error as fault:
        message = f"{store}: cannot be read as the store of MLflow: {fault}"
        raise SpecError(message) from None
    if experiment is None:
        return entries
    if experiment not in known:
        message = (
            f"experiment '{experiment}': not in {store}{nearest_name(experiment, known)} "
            f"(there are {', '.join(known)})"
        )
        raise SpecError(message)
    return [entry for entry in entries if entry.experiment == experiment]


def _check_tables(base: sqlite3.Connection, store: Path) -> None:
    for table, needed in _NEEDED.items():
        found = {row[1] for row in base.execute(f"PRAGMA table_info({table})")}
        if needed - found:
            message = f"{store}: table '{table}' is not as MLflow 3 writes it; use `mlflow ui`"
            raise SpecError(message)


def _read(base: sqlite3.Connection) -> list[RunEntry]:
    metrics: dict[str, dict[str, float]] = {}
    for run, key, value, is_nan in base.execute(
        "SELECT run_uuid, key, value, is_nan FROM latest_metrics ORDER BY key"
    ):
        if not is_nan:
            metrics.setdefault(run, {})[key] = float(value)
    tags: dict[str, dict[str, str]] = {}
    for run, key, text in base.execute("SELECT run_uuid, key, value FROM tags ORDER BY key"):
        tags.setdefault(run, {})[key] = str(text)
    return [_entry(row, metrics, tags) for row in base.execute(_QUERY)]


def _entry(
    row: tuple[Any, ...], metrics: dict[str, dict[str, float]], tags: dict[str, dict[str, str]]
) -> RunEntry:
    run, name, status, start, end, experiment = row
    own = tags.get(run, {})
    return RunEntry(
        run_id=run,
        parent_id=own.get("mlflow.parentRunId", ""),
        experiment=experiment,
        name=name or "",
        status=str(status).lower(),
        started=datetime.fromtimestamp(start / 1000.0, UTC).isoformat(timespec="seconds"),
        seconds=(end - start) / 1000.0 if end else None,
        metrics=metrics.get(run, {}),
        tags={key: value for key, value in own.items() if not key.startswith("mlflow.")},
    )
