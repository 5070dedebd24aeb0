"""A lab book of fits, comparisons and studies in MLflow.

An observer: it receives finished work and returns nothing that anyone reads, so results are the
same with tracking off. Runs live in a SQLite file with the artifacts beside it (plain file stores
are no longer opened by MLflow). MLflow keeps absolute paths: move the exports, not this folder.
"""

from __future__ import annotations

import math
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castblast.disk.plain import finite
from castblast.surrogate.fitting.features import SPLITS, Table
from castblast.surrogate.fitting.training import Fit, LearningPoint
from castblast.surrogate.judging.champion import champion_figures, percent
from castblast.surrogate.keeping.lab_book import open_store
from castblast.surrogate.keeping.logged_model import log_model
from castblast.surrogate.keeping.notes import comparison_note, study_note
from castblast.version import __version__

if TYPE_CHECKING:
    from castblast.surrogate.judging.comparison import League
    from castblast.surrogate.searching.tuning import StudyResult

Files = Mapping[str, Sequence[Path]]
#: Tag under which MLflow keeps the description of a run, in Markdown.
_NOTE = "mlflow.note.content"


class MlflowTracker:
    """Writes runs to ``<folder>/mlflow.db`` and ``<folder>/artifacts``.

    One parent run per call with one child run per fit or trial, in the experiment
    ``<dataset>/<major version>``. No automatic logging.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()

    def record_fits(self, fits: Sequence[Fit], files: Files) -> None:
        """Keep fits that were made without a comparison.

        Parameters
        ----------
        fits : sequence of Fit
            Of one dataset.
        files : mapping of spec name to sequence of path
            Files of each fit.
        """
        with self._parent(fits[0].table.source, "train") as mlflow:
            for fit in fits:
                _record_fit(mlflow, fit, files.get(fit.spec.name, ()))

    def record_comparison(
        self,
        fits: Sequence[Fit],
        league: League,
        files: Files,
        curves: Mapping[str, Sequence[LearningPoint]],
    ) -> None:
        """Keep a comparison: its files, one child run per fit, and the chosen model registered.

        The parent run carries name and errors of the champion and says them in its description.
        The chosen model is a new version of ``castblast_<dataset>`` with the alias ``champion``.

        Parameters
        ----------
        fits : sequence of Fit
        league : League
        files : mapping of spec name to sequence of path
            Files of each fit; those of the comparison under the empty name.
        curves : mapping of spec name to learning curve
        """
        source = dict(fits[0].table.source)
        with self._parent(source, "compare") as mlflow:
            figures = champion_figures(fits, league)
            mlflow.log_metrics(_finite(figures))
            note = comparison_note(league, figures)
            mlflow.set_tags({"champion": league["chosen"] or "none", _NOTE: note})
            _log_files(mlflow, files.get("", ()))
            for fit in fits:
                name, register = fit.spec.name, None
                if name == league["chosen"]:
                    register = f"castblast_{source.get('name', 'dataset')}"
                _record_fit(mlflow, fit, files.get(name, ()), curves.get(name, ()), register)

    def record_study(self, study: StudyResult, table: Table, files: Sequence[Path]) -> None:
        """Keep a study: its files, its best trial and one child run without a model per trial."""
        source = table.source
        with self._parent(source, "tune") as mlflow:
            tags = {"spec.sha256": study.spec.sha256(), "spec": study.identity["spec"]}
            note = study_note(study, table)
            mlflow.set_tags({**tags, "champion": study.spec.name, _NOTE: note})
            mlflow.log_params({key: str(v) for key, v in study.best.settings.items()})
            error = study.best.error
            figures = {
                "best_valid_error": error,
                "valid_error_percent": percent(error),
                "best_trial": study.best.number,
                "parameters": study.best.parameters,
            }
            mlflow.log_metrics(_finite(figures))
            _log_files(mlflow, files)
            for trial in study.trials:
                name = f"{study.identity['spec']}/trial {trial.number}"
                tags = {**_tags(source, "trial"), "trial.state": trial.state}
                with mlflow.start_run(run_name=name, nested=True, tags=tags):
                    mlflow.log_params({key: str(v) for key, v in trial.settings.items()})
                    mlflow.log_metrics(
                        _finite({"valid_error": trial.error, "parameters": trial.parameters})
                    )

    @contextmanager
    def _parent(self, source: Mapping[str, str], stage: str) -> Iterator[Any]:
        """Open the store and a parent run in the experiment of a dataset."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with open_store(self.folder / "mlflow.db") as mlflow:
            major = source.get("dataset_version", "0").split(".")[0]
            experiment = f"{source.get('name', 'dataset')}/{major}"
            if mlflow.get_experiment_by_name(experiment) is None:
                artifacts = (self.folder / "artifacts").as_uri()
                mlflow.create_experiment(experiment, artifact_location=artifacts)
            mlflow.set_experiment(experiment)
            with mlflow.start_run(run_name=stage, tags=_tags(source, stage)):
                yield mlflow


def _tags(source: Mapping[str, str], stage: str) -> dict[str, str]:
    tags = {
        "stage": stage,
        "castblast.version": __version__,
        "dataset.version": source.get("dataset_version", ""),
        "dataset.sha256": source.get("content_sha256", ""),
        "git.commit": _git_commit(),
    }
    return {key: value for key, value in tags.items() if value}


def _git_commit() -> str:
    """Commit of the working folder, marked where files differ from it; empty outside of Git."""
    try:
        commit = _git("rev-parse", "HEAD")
        return f"{commit}-dirty" if _git("status", "--porcelain", "-uno") else commit
    except (OSError, subprocess.SubprocessError):
        return ""


def _git(*arguments: str) -> str:
    done = subprocess.run(
        ["git", *arguments], capture_output=True, text=True, timeout=10, check=True
    )
    return done.stdout.strip()


def _log_files(mlflow: Any, files: Sequence[Path]) -> None:
    for path in files:
        mlflow.log_artifact(str(path))


def _record_fit(
    mlflow: Any,
    fit: Fit,
    files: Sequence[Path],
    curve: Sequence[LearningPoint] = (),
    register: str | None = None,
) -> None:
    """One child run: settings, metrics, learning curve, files, dataset, model with signature."""
    spec, source = fit.spec, fit.table.source
    tags = {**_tags(source, "fit"), "spec.sha256": spec.sha256(), "spec": spec.name}
    run_name = f"{spec.kind}/{spec.name}/{fit.restart.seed}"
    with mlflow.start_run(run_name=run_name, nested=True, tags=tags) as run:
        mlflow.log_params({key: str(v) for key, v in spec.model_dump(mode="json").items()})
        mlflow.log_params({f"rows_{split}": len(fit.table.rows(split)) for split in SPLITS})
        mlflow.log_metrics(_metrics(fit))
        _log_curve(mlflow, run.info.run_id, curve)
        _log_files(mlflow, files)
        mlflow.log_input(_dataset(mlflow, fit), context="training")
        model_uri, flavour = log_model(mlflow, fit)
        mlflow.set_tag("model.flavour", flavour)
        if register and model_uri:
            _register(mlflow.MlflowClient(), register, model_uri, run.info.run_id)


def _dataset(mlflow: Any, fit: Fit) -> Any:
    """Training rows with their hash, as MLflow notes them."""
    table, train = fit.table, fit.table.rows("train")
    targets = dict(zip(table.target_names, table.targets[train].T, strict=True))
    return mlflow.data.from_pandas(
        table.frame.iloc[train].assign(**targets),
        name=table.source.get("name", "dataset"),
        digest=table.source.get("content_sha256", "")[:36] or None,
    )


def _log_curve(mlflow: Any, run_id: str, curve: Sequence[LearningPoint]) -> None:
    """Learning curve as metrics whose step is the number of training rows, in one call."""
    metrics = [
        mlflow.entities.Metric(
            f"curve_{part}_p95_rel_err_{target}", entry.relative_error_95, 0, point.rows
        )
        for point in curve
        for part, scores in (("train", point.train), ("test", point.test))
        for target, entry in scores.items()
        if math.isfinite(entry.relative_error_95)
    ]
    if metrics:
        mlflow.MlflowClient().log_batch(run_id, metrics=metrics)


def _register(client: Any, name: str, model_uri: str, run_id: str) -> None:
    """Make the logged model the champion of its name; the client does it without chatter."""
    if not client.search_registered_models(filter_string=f"name = '{name}'"):
        client.create_registered_model(name)
    made = client.create_model_version(name, source=model_uri, run_id=run_id)
    client.set_registered_model_alias(name, "champion", made.version)


def _metrics(fit: Fit) -> dict[str, float]:
    metrics: dict[str, float | None] = {
        "fit_seconds": fit.seconds,
        "valid_error": fit.restart.valid_error,
        "iterations": float(fit.restart.iterations),
        "converged": float(fit.restart.converged),
    }
    for target, entry in fit.scores("test").items():
        metrics[f"test_r2_{target}"] = entry.r2
        metrics[f"test_p95_rel_err_{target}"] = entry.relative_error_95
        metrics[f"test_share_within_{target}"] = entry.share_within
    document = fit.to_document()
    for target, covered in document["band_coverage_on_test"].items():
        metrics[f"band_coverage_{target}"] = covered
    return _finite(metrics)


def _finite(metrics: Mapping[str, float | int | None]) -> dict[str, float]:
    """Leave out what the store of MLflow cannot hold."""
    return {name: float(value) for name, value in finite(metrics).items() if value is not None}
