"""List the runs of the lab book without its web page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from castblast.errors import SpecError, nearest_name
from castblast.stages.outcome import Outcome
from castblast.stages.training.train import RUNS_FOLDER
from castblast.surrogate.keeping.run_list import read_runs

if TYPE_CHECKING:
    from castblast.surrogate.keeping.run_list import RunEntry

#: Shown unless another metric is asked for; a lower value is better.
DEFAULT_METRIC = "valid_error"


def list_runs(
    runs: str | Path = RUNS_FOLDER,
    *,
    experiment: str | None = None,
    stage: str | None = None,
    sort: str | None = None,
    limit: int | None = None,
) -> Outcome:
    """List runs, newest first or by a metric.

    Parameters
    ----------
    runs : path
        Folder of the lab book.
    experiment : str, optional
        Name such as ``paper/1``.
    stage : str, optional
        ``train``, ``compare``, ``tune``, ``fit`` or ``trial``.
    sort : str, optional
        Metric to sort by: lowest first, R² highest first; runs without it are left out.
    limit : int, optional
        At most so many.

    Raises
    ------
    SpecError
        No lab book, no such experiment, stage or metric.
    """
    runs = Path(runs)
    entries = read_runs(runs / "mlflow.db", experiment)
    if stage is not None:
        stages = sorted({entry.tags.get("stage", "") for entry in entries} - {""})
        if stage not in stages:
            known = f" (there are {', '.join(stages)})" if stages else ""
            message = f"stage '{stage}': no such runs{nearest_name(stage, stages)}{known}"
            raise SpecError(message)
        entries = [entry for entry in entries if entry.tags.get("stage") == stage]
    entries = _grouped(entries) if sort is None else _sorted(entries, sort)
    shown = entries[:limit] if limit else entries
    metric = sort or DEFAULT_METRIC
    header = ["run", "stage", "experiment", "started (UTC)", "status", "seconds", metric]
    title = f"{len(shown)} of {len(entries)} runs in {runs}"
    document = {"runs": [entry._asdict() for entry in shown]}
    rows = [_row(entry, metric) for entry in shown]
    return Outcome(document=document, title=title, header=header, rows=rows)


def _grouped(entries: Sequence[RunEntry]) -> list[RunEntry]:
    """Newest first, what belongs to a run right below it in its own order."""
    known = {entry.run_id for entry in entries}
    children: dict[str, list[RunEntry]] = {}
    for entry in reversed(entries):
        if entry.parent_id in known:
            children.setdefault(entry.parent_id, []).append(entry)
    return [
        one
        for entry in entries
        if entry.parent_id not in known
        for one in (entry, *children.get(entry.run_id, ()))
    ]


def _sorted(entries: Sequence[RunEntry], metric: str) -> list[RunEntry]:
    known = sorted({name for entry in entries for name in entry.metrics})
    if metric not in known:
        message = f"metric '{metric}': no run has it{nearest_name(metric, known)}"
        raise SpecError(message)
    having = [entry for entry in entries if metric in entry.metrics]
    higher_is_better = "r2" in metric.split("_") or metric.startswith(("coverage", "test_share"))
    return sorted(
        having,
        key=lambda entry: -entry.metrics[metric] if higher_is_better else entry.metrics[metric],
    )


def _row(entry: RunEntry, metric: str) -> list[str]:
    value = entry.metrics.get(metric)
    return [
        f"  {entry.name}" if entry.parent_id else entry.name,
        entry.tags.get("stage", ""),
        entry.experiment,
        entry.started.removesuffix("+00:00").replace("T", " "),
        entry.status,
        "" if entry.seconds is None else f"{entry.seconds:.1f}",
        "" if value is None else f"{value:.6g}",
    ]
