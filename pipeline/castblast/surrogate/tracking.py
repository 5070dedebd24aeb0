"""A lab book of training runs in MLflow: the only module that imports it.

An observer: it receives finished fits and their comparison and returns nothing that anyone reads,
so results are the same with tracking off. Runs live in a SQLite file with the artifacts beside it
(plain file stores are no longer opened by MLflow). MLflow keeps absolute paths: move the exports,
not this folder.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from castblast import __version__
from castblast.surrogate.features import SPLITS
from castblast.surrogate.training import Fit

#: Types of our stock pipelines that skops does not trust by itself.
_TRUSTED_TYPES = ["numpy.log", "numpy.exp"]


class Tracker(Protocol):
    """What training tells about finished work."""

    def record(
        self, fits: Sequence[Fit], comparison: Mapping[str, Any], files: Sequence[Path]
    ) -> None:
        """Keep fits of one dataset, their comparison and its files."""


class NullTracker:
    """Keeps nothing."""

    def record(
        self, fits: Sequence[Fit], comparison: Mapping[str, Any], files: Sequence[Path]
    ) -> None:
        """Do nothing."""


class MlflowTracker:
    """Writes runs to ``<folder>/mlflow.db`` and ``<folder>/artifacts``.

    One parent run per comparison with one child run per fit; the chosen model is registered under
    the name of the dataset with the alias ``champion``. No automatic logging.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()

    def record(
        self, fits: Sequence[Fit], comparison: Mapping[str, Any], files: Sequence[Path]
    ) -> None:
        """Write the runs; see the class."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with _quiet_mlflow(f"sqlite:///{self.folder / 'mlflow.db'}") as mlflow:
            source = dict(comparison["dataset"])
            name = source.get("name", "dataset")
            major = source.get("dataset_version", "0").split(".")[0]
            experiment = f"{name}/{major}"
            if mlflow.get_experiment_by_name(experiment) is None:
                artifacts = (self.folder / "artifacts").as_uri()
                mlflow.create_experiment(experiment, artifact_location=artifacts)
            mlflow.set_experiment(experiment)
            with mlflow.start_run(run_name="compare", tags=_tags(source, "compare")):
                mlflow.log_dict(dict(comparison), "comparison.json")
                mlflow.set_tag("chosen", comparison["chosen"])
                for path in files:
                    mlflow.log_artifact(str(path))
                for fit in fits:
                    is_chosen = fit.spec.name == comparison["chosen"]
                    _record_fit(mlflow, fit, source, f"castblast_{name}" if is_chosen else None)


@contextmanager
def _quiet_mlflow(uri: str) -> Iterator[Any]:
    """MLflow on our store, without telemetry or chatter; the earlier store is put back."""
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    os.environ.setdefault("MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR", "false")
    import logging

    import mlflow

    loggers = [logging.getLogger(name) for name in ("mlflow", "alembic")]
    levels = [logger.level for logger in loggers]
    earlier = mlflow.get_tracking_uri()
    try:
        for logger in loggers:
            logger.setLevel(logging.ERROR)
        mlflow.set_tracking_uri(uri)
        yield mlflow
    finally:
        mlflow.set_tracking_uri(earlier)
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def _tags(source: Mapping[str, str], stage: str) -> dict[str, str]:
    tags = {
        "stage": stage,
        "castblast.version": __version__,
        "dataset.version": source.get("dataset_version", ""),
        "dataset.sha256": source.get("content_sha256", ""),
    }
    return {key: value for key, value in tags.items() if value}


def _record_fit(mlflow: Any, fit: Fit, source: Mapping[str, str], register: str | None) -> None:
    """One child run: parameters, metrics, dataset, model with its signature."""
    from mlflow.models import infer_signature

    spec = fit.spec
    tags = {**_tags(source, "train"), "spec.sha256": spec.sha256()}
    run_name = f"{spec.kind}/{spec.name}/{fit.restart.seed}"
    with mlflow.start_run(run_name=run_name, nested=True, tags=tags):
        mlflow.log_params({key: str(v) for key, v in spec.model_dump(mode="json").items()})
        mlflow.log_params({f"rows_{split}": len(fit.table.rows(split)) for split in SPLITS})
        mlflow.log_metrics(_metrics(fit))
        train = fit.table.rows("train")
        inputs = fit.table.frame.iloc[train]
        outputs = fit.estimator.predict(inputs.head(2))
        names = list(fit.table.target_names)
        mlflow.log_input(
            mlflow.data.from_pandas(
                inputs.assign(**dict(zip(names, fit.table.targets[train].T, strict=True))),
                name=source.get("name", "dataset"),
                digest=source.get("content_sha256", "")[:36] or None,
            ),
            context="training",
        )
        info = mlflow.sklearn.log_model(
            fit.estimator,
            name="model",
            signature=infer_signature(inputs.head(2), _frame(outputs, names)),
            pip_requirements=_requirements(),
            skops_trusted_types=_TRUSTED_TYPES,
        )
        if register:
            _register(mlflow.MlflowClient(), register, info)


def _register(client: Any, name: str, info: Any) -> None:
    """Make the logged model the champion of its name; the client does it without chatter."""
    if not client.search_registered_models(filter_string=f"name = '{name}'"):
        client.create_registered_model(name)
    made = client.create_model_version(name, source=info.model_uri, run_id=info.run_id)
    client.set_registered_model_alias(name, "champion", made.version)


def _frame(values: Any, names: list[str]) -> Any:
    import pandas as pd

    return pd.DataFrame(values.reshape(-1, len(names)), columns=names)


def _requirements() -> list[str]:
    from importlib.metadata import version

    return [f"{name}=={version(name)}" for name in ("scikit-learn", "numpy", "pandas")]


def _metrics(fit: Fit) -> dict[str, float]:
    metrics = {
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
    return metrics
