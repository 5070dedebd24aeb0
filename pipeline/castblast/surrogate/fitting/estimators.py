"""Spec to scikit-learn estimator, and fitted estimator to `Network`.

The estimator is made of scikit-learn steps from end to end, scaling of targets included, so that
it can be stored, tracked and compared by the usual tools. It takes a data frame with the numeric
features in SI and the column ``explosive``, and gives the targets in SI.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from castblast.design.variables import VARIABLES
from castblast.network import (
    Column,
    DerivedColumn,
    GoldenRows,
    InputColumn,
    Layer,
    Network,
    OutputColumn,
    Shell,
)
from castblast.specs.models.model import MlpSpec, ModelSpec
from castblast.surrogate.fitting.families.build import make_model
from castblast.surrogate.fitting.features import Table, domain_constraints, input_columns
from castblast.types import FloatArray

_GOLDEN_ROWS = 200
_GOLDEN_CORNERS = 64


def make_estimator(spec: ModelSpec, table: Table, seed: int) -> Any:
    """Make the unfitted estimator of a spec.

    Parameters
    ----------
    spec : ModelSpec
        With named features.
    table : Table
        Gives the explosives, in order, and their descriptors.
    seed : int
        Of the random starting weights; families without any ignore it.

    Returns
    -------
    sklearn.compose.TransformedTargetRegressor
        Of a pipeline with the steps ``columns`` and ``model``.
    """
    from sklearn.compose import TransformedTargetRegressor
    from sklearn.pipeline import Pipeline

    from castblast.surrogate.fitting.columns import make_columns, make_scaler

    steps = [("columns", make_columns(spec, table)), ("model", make_model(spec, table, seed))]
    scaler = make_scaler([spec.target_transform] * len(spec.targets))
    return TransformedTargetRegressor(
        regressor=Pipeline(steps), transformer=scaler, check_inverse=False
    )


def fit_estimator(
    estimator: Any,
    spec: ModelSpec,
    frame: Any,
    targets: FloatArray,
    watch: Callable[[Any], None] | None = None,
) -> tuple[int, bool]:
    """Fit in place on one BLAS thread: with such small matrices a second one slows the fit down.

    Parameters
    ----------
    estimator
        From `make_estimator`.
    spec : ModelSpec
    frame : pandas.DataFrame
        Numeric features [SI] and ``explosive``.
    targets : (n, m) [SI]
    watch : callable, optional
        Called now and then by families that can, with an estimator as far as it is fitted. What
        it raises ends the fit.

    Returns
    -------
    iterations : int
        Of all rounds; 0 for a solver without any.
    converged : bool
        The last round ended by a rule of the solver, not at a limit.
    """
    from sklearn.exceptions import ConvergenceWarning
    from threadpoolctl import threadpool_limits

    with warnings.catch_warnings(record=True) as caught, threadpool_limits(1):
        warnings.simplefilter("always")
        if watch is not None and "watch" in estimator.regressor["model"].get_params():
            watcher = _model_watch(estimator, frame, targets, watch)
            estimator.regressor.set_params(model__watch=watcher)
        try:
            estimator.fit(frame, targets)
        finally:
            _unwatch(estimator)
        model = estimator.regressor_["model"]
        total = int(np.max(getattr(model, "n_iter_", 0) or 0))
        if isinstance(spec, MlpSpec) and spec.refinements:
            features = estimator.regressor_["columns"].transform(frame)
            scaled = estimator.transformer_.transform(targets)
            for round_ in range(1, spec.refinements + 1):
                caught.clear()
                total += _refine(model, features, scaled, 10.0**round_)
    warned = any(issubclass(entry.category, ConvergenceWarning) for entry in caught)
    return total, bool(getattr(model, "converged_", not warned))


def _model_watch(
    estimator: Any, frame: Any, targets: FloatArray, watch: Callable[[Any], None]
) -> Callable[[Callable[[FloatArray], FloatArray]], None]:
    """Turn a watch of whole estimators into one of what stands inside the scalings."""
    from sklearn.base import clone

    columns = clone(estimator.regressor["columns"]).fit(frame)
    scaler = clone(estimator.transformer).fit(targets)

    class Partial:
        """The estimator as far as its model is fitted."""

        def __init__(self, inner: Callable[[FloatArray], FloatArray]) -> None:
            self.inner = inner

        def predict(self, rows: Any) -> FloatArray:
            values: FloatArray = scaler.inverse_transform(self.inner(columns.transform(rows)))
            return values

    return lambda inner: watch(Partial(inner))


def _unwatch(estimator: Any) -> None:
    """Forget the watch: a fitted estimator holds nothing that cannot be stored."""
    for pipeline in (estimator.regressor, getattr(estimator, "regressor_", None)):
        if pipeline is not None and "watch" in pipeline["model"].get_params():
            pipeline.set_params(model__watch=None)


def _refine(model: Any, features: FloatArray, scaled: FloatArray, spread: float) -> int:
    """Go on from the weights of `model` with targets `spread` times as large; iterations taken.

    The last layer is linear, so scaling it scales the outputs; it is scaled back at the end.
    """
    model.set_params(warm_start=True)
    model.coefs_[-1] *= spread
    model.intercepts_[-1] *= spread
    model.fit(features, spread * scaled)
    model.coefs_[-1] /= spread
    model.intercepts_[-1] /= spread
    model.set_params(warm_start=False)
    return int(model.n_iter_)


def predict(estimator: Any, frame: Any) -> FloatArray:
    """Evaluate a fitted estimator: (n, m) in SI, on one BLAS thread."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        values = np.asarray(estimator.predict(frame), dtype=np.float64)
    return values.reshape(len(frame), -1)


def bare_model(estimator: Any) -> Any:
    """What a fitted estimator holds inside its scalings; a user's own model as they made it."""
    model = estimator.regressor_["model"]
    return getattr(model, "model_", model)


def is_torch_model(model: Any) -> bool:
    """Whether a bare model is one of `torch_mlp`, told without importing torch."""
    return type(model).__module__ == "castblast.surrogate.fitting.families.torch_mlp"


def to_network(
    estimator: Any, spec: ModelSpec, table: Table, band: FloatArray, provenance: Mapping[str, Any]
) -> Network | None:
    """Turn a fitted estimator into the neutral record; parameters as `to_shell`.

    Returns
    -------
    Network or None
        None for a model that is no chain of dense layers.
    """
    from castblast.surrogate.fitting.families.dense_models import layers_of

    layers = layers_of(estimator.regressor_["model"])
    if layers is None:
        return None
    return Network.of(to_shell(estimator, spec, table, band, provenance), layers)


def to_shell(
    estimator: Any, spec: ModelSpec, table: Table, band: FloatArray, provenance: Mapping[str, Any]
) -> Shell:
    """Everything of the neutral record but the layers, for a model of any shape.

    Parameters
    ----------
    estimator
        Fitted on the training rows of `table`.
    spec : ModelSpec
    table : Table
        With the features and targets of `spec`.
    band : (m,)
        Relative 95 % band of each target.
    provenance : mapping
        Plain JSON values.
    """
    from castblast.surrogate.fitting.columns import derived_columns, explosive_codes

    columns = estimator.regressor_["columns"]
    numeric = columns.named_transformers_["numeric"]["scale"]
    transforms = [spec.transform_of(name) for name in spec.features]
    inputs = input_columns(table, transforms, numeric.mean_, numeric.scale_)
    derived = derived_columns(spec, columns)
    targets = estimator.transformer_["scale"]
    outputs = tuple(
        OutputColumn(
            name=name,
            unit=VARIABLES[name].unit,
            transform=spec.target_transform,
            mean=float(targets.mean_[j]),
            scale=float(targets.scale_[j]),
            relative_band=float(band[j]),
        )
        for j, name in enumerate(table.target_names)
    )
    return Shell(
        inputs=inputs,
        explosives=table.explosives,
        codes=explosive_codes(columns, table.explosives),
        outputs=outputs,
        constraints=domain_constraints(table),
        golden=golden_rows(estimator, inputs, table.explosives, derived),
        provenance=provenance,
        derived=derived,
    )


def chains_of(fitted: Sequence[Any]) -> tuple[tuple[Layer, ...], ...]:
    """Layers of several fitted estimators of one spec, which share all scalings."""
    from castblast.surrogate.fitting.families.dense_models import layers_of

    chains = (layers_of(estimator.regressor_["model"]) for estimator in fitted)
    return tuple(chain for chain in chains if chain is not None)


def golden_rows(
    estimator: Any,
    inputs: Sequence[InputColumn],
    explosives: Sequence[str],
    derived: Sequence[DerivedColumn] = (),
    seed: int = 0,
) -> GoldenRows:
    """Answers of the estimator on corners of the training box and on rows inside it.

    Rows for which a derived column cannot be logged, such as a charge of less than no length, are
    left out.
    """
    import pandas as pd

    rng = np.random.default_rng(seed)
    lower = np.array([column.lower for column in inputs])
    upper = np.array([column.upper for column in inputs])
    shares = _corners(len(inputs), rng)
    rows = np.empty((0, len(inputs)))
    while len(rows) < _GOLDEN_ROWS:
        # lower + (upper - lower) may miss `upper` by a bit; the corner itself must be in the box.
        drawn = np.where(shares == 1.0, upper, lower + (upper - lower) * shares)
        rows = np.concatenate([rows, drawn[_can_be_logged(drawn, inputs, derived)]])
        shares = rng.random((_GOLDEN_ROWS - len(rows), len(inputs)))
    kinds = [explosives[k] for k in rng.integers(0, len(explosives), len(rows))]
    frame = pd.DataFrame(rows, columns=_names(inputs)).assign(explosive=kinds)
    return GoldenRows(rows, tuple(kinds), predict(estimator, frame))


def _can_be_logged(
    rows: FloatArray, inputs: Sequence[InputColumn], derived: Sequence[DerivedColumn]
) -> Any:
    good = np.ones(len(rows), dtype=bool)
    for column in derived:
        if column.transform == "log":
            names = _names(inputs)
            value = sum(c * rows[:, names.index(n)] for n, c in column.coefficients.items())
            # Not by a hair either: there rounding is all that is left of a difference.
            good &= value > 1e-6 * np.max(
                np.abs(rows[:, [names.index(n) for n in column.coefficients]]), axis=1
            )
    return good


def _names(columns: Sequence[Column]) -> list[str]:
    return [column.name for column in columns]


def _corners(dimensions: int, rng: np.random.Generator) -> FloatArray:
    """Corners of the unit box, (c, dimensions): all of them, or a random choice where too many."""
    if 2**dimensions <= _GOLDEN_CORNERS:
        return np.array(list(product((0.0, 1.0), repeat=dimensions)))
    ends = np.array([[0.0] * dimensions, [1.0] * dimensions])
    drawn = rng.integers(0, 2, (_GOLDEN_CORNERS - 2, dimensions)).astype(np.float64)
    return np.concatenate([ends, drawn])
