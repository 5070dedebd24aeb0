"""Fit one spec on the training rows; choose between its restarts on the validation rows."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from castblast.errors import SpecError
from castblast.network import Network, Shell
from castblast.progress import ProgressCallback, silent
from castblast.specs.models.model import ModelSpec
from castblast.surrogate.fitting import estimators
from castblast.surrogate.fitting.column_checks import check_positive, constant_faults
from castblast.surrogate.fitting.conformal import band_coverage, conformal_band
from castblast.surrogate.fitting.density import with_density
from castblast.surrogate.fitting.features import SPLITS, Split, Table
from castblast.surrogate.fitting.metrics import (
    Score,
    score_by_explosive,
    score_targets,
    summary_error,
)
from castblast.types import FloatArray
from castblast.version import __version__


class Restart(NamedTuple):
    """One fit from random weights.

    Attributes
    ----------
    seed : int
    valid_error : float
        Geometric mean over the targets of the 95 % relative error on validation rows.
    iterations : int
    converged : bool
        The solver stopped by its own rule, not at a limit.
    """

    seed: int
    valid_error: float
    iterations: int
    converged: bool


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted spec and its predictions for every row of the table.

    Attributes
    ----------
    spec : ModelSpec
    estimator
        Fitted scikit-learn estimator of the chosen restart.
    network : Network or None
        The exportable record; None for a family that is no chain of dense layers.
    table : Table
        Rows with the features and targets of `spec`.
    predicted : (n, m) [SI]
    band : (m,)
        Relative 95 % band from the calibration rows.
    restarts : tuple of Restart
    chosen : int
        Position of the restart kept.
    seconds : float
        Wall time of all restarts; never written to a reproducible file.
    """

    spec: ModelSpec
    estimator: Any
    network: Network | None
    table: Table
    predicted: FloatArray
    band: FloatArray
    restarts: tuple[Restart, ...]
    chosen: int
    seconds: float

    @property
    def restart(self) -> Restart:
        """The restart kept."""
        return self.restarts[self.chosen]

    def scores(self, split: Split) -> dict[str, Score]:
        """Scores per target on the rows of a split."""
        rows = self.table.rows(split)
        return score_targets(
            self.table.targets[rows], self.predicted[rows], self.table.target_names
        )

    def shell(self) -> Shell:
        """Everything of the exportable record but the layers, for a model of any shape."""
        provenance = _provenance(self.spec, self.table, self.predicted, self.band, self.restart)
        shell = estimators.to_shell(self.estimator, self.spec, self.table, self.band, provenance)
        return with_density(shell, self.table)

    def to_document(self) -> dict[str, Any]:
        """Give everything that is worth keeping of the fit as plain JSON values."""
        return {
            **_provenance(self.spec, self.table, self.predicted, self.band, self.restart),
            "exportable": self.network is not None,
            "parameters": self.network.parameter_count if self.network else None,
            "restarts": [restart._asdict() for restart in self.restarts],
            "test_by_explosive": _nested(self._by_explosive()),
        }

    def _by_explosive(self) -> dict[str, dict[str, Score]]:
        rows, table = self.table.rows("test"), self.table
        return score_by_explosive(
            table.targets[rows],
            self.predicted[rows],
            table.target_names,
            table.frame["explosive"].to_numpy(dtype=str)[rows],
        )


def fit_spec(
    spec: ModelSpec,
    table: Table,
    progress: ProgressCallback = silent,
    report: Callable[[float], None] | None = None,
) -> Fit:
    """Fit a spec.

    Parameters
    ----------
    spec : ModelSpec
        ``features: all`` is replaced by the names of what the dataset varies.
    table : Table
        Holds at least the features and targets of the spec.
    progress : callable
        Told after every restart.
    report : callable, optional
        Given the summary error on the validation rows now and then while a family with epochs is
        fitted; what it raises ends the fit.

    Raises
    ------
    DatasetError
        A column to be logged is not positive, the dataset has no descriptors of the explosives
        and the spec needs them, or the error band is not finite.
    SpecError
        A feature or target with one value in every row, or a user's own model that cannot be made
        or used.
    """
    started = time.perf_counter()
    spec = spec.resolved(table.varying or table.feature_names)
    table = table.select(spec.features, spec.targets)
    faults = constant_faults(spec, table)
    if faults:
        raise SpecError("\n".join(faults))
    logged = [name for name in table.feature_names if spec.transform_of(name) == "log"]
    logged += table.target_names if spec.target_transform == "log" else ()
    sums = {k: dict(e.coefficients) for k, e in spec.derived.items() if e.transform == "log"}
    check_positive(table, logged, sums)
    seeds = spec.seeds
    runs = []
    for number, seed in enumerate(seeds):
        progress(number / len(seeds), f"{spec.name}: start {number + 1} of {len(seeds)}")
        runs.append(_run(spec, table, seed, report))
    chosen = int(np.argmin([run[1].valid_error for run in runs]))
    estimator, restart, predicted = runs[chosen]
    calibration = table.rows("calibration")
    band = conformal_band(table.targets[calibration], predicted[calibration])
    provenance = _provenance(spec, table, predicted, band, restart)
    network = estimators.to_network(estimator, spec, table, band, provenance)
    if network is not None:
        network = with_density(network, table)
        if getattr(spec, "keep_members", False):
            others = [run[0] for run in runs if run[0] is not estimator]
            network = replace(network, members=estimators.chains_of(others))
    progress(1.0, f"{spec.name}: 95 % within {restart.valid_error:.2%} on validation rows")
    restarts = tuple(run[1] for run in runs)
    seconds = time.perf_counter() - started
    return Fit(
        spec=spec,
        estimator=estimator,
        network=network,
        table=table,
        predicted=predicted,
        band=band,
        restarts=restarts,
        chosen=chosen,
        seconds=seconds,
    )


def _run(
    spec: ModelSpec, table: Table, seed: int, report: Callable[[float], None] | None
) -> tuple[Any, Restart, FloatArray]:
    """One fit from one seed, with its predictions for every row."""
    train, valid = table.rows("train"), table.rows("valid")
    estimator = estimators.make_estimator(spec, table, seed)

    def valid_error(values: FloatArray) -> float:
        scores = score_targets(table.targets[valid], values, table.target_names)
        return summary_error(scores)

    def watch(partial: Any) -> None:
        if report is not None:
            report(valid_error(estimators.predict(partial, table.frame.iloc[valid])))

    iterations, converged = estimators.fit_estimator(
        estimator,
        spec,
        table.frame.iloc[train],
        table.targets[train],
        None if report is None else watch,
    )
    predicted = estimators.predict(estimator, table.frame)
    error = valid_error(predicted[valid])
    # A fit that blew up must never win.
    restart = Restart(seed, error if np.isfinite(error) else np.inf, iterations, converged)
    return estimator, restart, predicted


def _provenance(
    spec: ModelSpec, table: Table, predicted: FloatArray, band: FloatArray, restart: Restart
) -> dict[str, Any]:
    """What made this model and how good it is; no times, no paths."""
    names = table.target_names
    scores = {}
    for split in ("valid", "test"):
        rows = table.rows(split)
        scores[split] = score_targets(table.targets[rows], predicted[rows], names)
    test = table.rows("test")
    covered = band_coverage(table.targets[test], predicted[test], band)
    return {
        "castblast_version": __version__,
        "dataset": dict(table.source),
        "held_inputs": dict(table.held),
        "spec": spec.model_dump(mode="json"),
        "spec_sha256": spec.sha256(),
        "rows": {split: len(table.rows(split)) for split in SPLITS},
        "seed": restart.seed,
        "iterations": restart.iterations,
        "converged": restart.converged,
        "valid_error": restart.valid_error,
        "scores": _nested(scores),
        "band": dict(zip(names, band.tolist(), strict=True)),
        "band_coverage_on_test": {n: found.share for n, found in zip(names, covered, strict=True)},
        "band_coverage_interval": {
            n: [found.lower, found.upper] for n, found in zip(names, covered, strict=True)
        },
    }


def _nested(scores: dict[str, dict[str, Score]]) -> dict[str, Any]:
    return {
        outer: {name: entry.to_document() for name, entry in inner.items()}
        for outer, inner in scores.items()
    }


class LearningPoint(NamedTuple):
    """Scores of a spec fitted on the first `rows` of the shuffled training rows."""

    rows: int
    train: dict[str, Score]
    test: dict[str, Score]


def learning_curve(
    fit: Fit,
    table: Table,
    sizes: Sequence[int] = (250, 500, 1000, 2000, 4000),
    progress: ProgressCallback = silent,
) -> list[LearningPoint]:
    """Refit a spec on growing, nested parts of the training rows; all other rows stay.

    Parameters
    ----------
    fit : Fit
        The spec fitted on all training rows: the last point.
    table : Table
    sizes : sequence of int
        Training rows; those not below the number there are fall away.
    """
    total = len(table.rows("train"))
    smaller = [size for size in sorted(sizes) if size < total]
    points = []
    for number, size in enumerate(smaller):
        progress(number / max(len(smaller), 1), f"learning curve: {size} rows")
        part = fit_spec(fit.spec, table.with_train_rows(size))
        points.append(LearningPoint(size, part.scores("train"), part.scores("test")))
    points.append(LearningPoint(total, fit.scores("train"), fit.scores("test")))
    return points
