"""Spec to scikit-learn estimator, and fitted estimator to `Network`.

The estimator is stock scikit-learn from end to end, scaling of targets included, so that it can
be stored, tracked and compared by the usual tools. It takes a data frame with the numeric features
in SI and the column ``explosive``, and gives the targets in SI.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from castblast.network import (
    Activation,
    Column,
    Floats,
    GoldenRows,
    InputColumn,
    Layer,
    Network,
    OutputColumn,
    Transform,
)
from castblast.specs.model import MlpSpec, ModelSpec
from castblast.surrogate.features import Table, domain_constraints, input_columns
from castblast.variables import VARIABLES

_GOLDEN_ROWS = 200
_GOLDEN_CORNERS = 64


def make_estimator(spec: ModelSpec, explosives: Sequence[str], seed: int) -> Any:
    """Make the unfitted estimator of a spec.

    Parameters
    ----------
    spec : ModelSpec
    explosives : sequence of str
        Categories of the one-hot column, in order.
    seed : int
        Of the random starting weights; families without any ignore it.

    Returns
    -------
    sklearn.compose.TransformedTargetRegressor
    """
    from sklearn.compose import ColumnTransformer, TransformedTargetRegressor
    from sklearn.pipeline import Pipeline
    from sklearn.preprocessing import OneHotEncoder, PolynomialFeatures

    one_hot = OneHotEncoder(categories=[list(explosives)], sparse_output=False)
    columns = ColumnTransformer(
        [
            ("numeric", _scaler(spec.input_transform), list(spec.features)),
            ("explosive", one_hot, ["explosive"]),
        ]
    )
    steps: list[tuple[str, Any]] = [("columns", columns)]
    if not isinstance(spec, MlpSpec) and spec.degree > 1:
        steps.append(("polynomial", PolynomialFeatures(degree=spec.degree, include_bias=False)))
    steps.append(("model", _model(spec, seed)))
    return TransformedTargetRegressor(
        regressor=Pipeline(steps), transformer=_scaler(spec.target_transform), check_inverse=False
    )


def _scaler(transform: Transform) -> Any:
    """Standard scaling, of logarithms if so asked; always a pipeline that ends in the scaler."""
    from sklearn.pipeline import Pipeline
    from sklearn.preprocessing import FunctionTransformer, StandardScaler

    log = FunctionTransformer(
        func=np.log, inverse_func=np.exp, check_inverse=False, feature_names_out="one-to-one"
    )
    steps = [("log", log)] if transform == "log" else []
    return Pipeline([*steps, ("scale", StandardScaler())])


def _model(spec: ModelSpec, seed: int) -> Any:
    if isinstance(spec, MlpSpec):
        from sklearn.neural_network import MLPRegressor

        return MLPRegressor(
            hidden_layer_sizes=spec.hidden_layers,
            activation=spec.activation,
            solver="lbfgs",
            alpha=spec.penalty,
            max_iter=spec.max_iterations,
            max_fun=10**6,
            tol=spec.tolerance,
            random_state=seed,
        )
    from sklearn.linear_model import Ridge

    return Ridge(alpha=spec.penalty)


def fit_estimator(estimator: Any, spec: ModelSpec, frame: Any, targets: Floats) -> tuple[int, bool]:
    """Fit in place on one BLAS thread: with such small matrices a second one slows the fit down.

    Parameters
    ----------
    estimator
        From `make_estimator`.
    spec : ModelSpec
    frame : pandas.DataFrame
        Numeric features [SI] and ``explosive``.
    targets : (n, m) [SI]

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
        estimator.fit(frame, targets)
        model = estimator.regressor_["model"]
        total = int(getattr(model, "n_iter_", 0) or 0)
        if isinstance(spec, MlpSpec) and spec.refinements:
            features = estimator.regressor_["columns"].transform(frame)
            scaled = estimator.transformer_.transform(targets)
            for round_ in range(1, spec.refinements + 1):
                caught.clear()
                total += _refine(model, features, scaled, 10.0**round_)
    return total, not any(issubclass(entry.category, ConvergenceWarning) for entry in caught)


def _refine(model: Any, features: Floats, scaled: Floats, spread: float) -> int:
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


def predict(estimator: Any, frame: Any) -> Floats:
    """Evaluate a fitted estimator: (n, m) in SI, on one BLAS thread."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        values = np.asarray(estimator.predict(frame), dtype=np.float64)
    return values.reshape(len(frame), -1)


def is_exportable(spec: ModelSpec) -> bool:
    """Whether the family of this spec is a chain of dense layers."""
    return isinstance(spec, MlpSpec) or spec.degree == 1


def to_network(
    estimator: Any, spec: ModelSpec, table: Table, band: Floats, provenance: Mapping[str, Any]
) -> Network:
    """Turn a fitted estimator into the neutral record.

    Parameters
    ----------
    estimator
        Fitted on the training rows of `table`.
    spec : ModelSpec
        Exportable.
    table : Table
        With the features and targets of `spec`.
    band : (m,)
        Relative 95 % band of each target.
    provenance : mapping
        Plain JSON values.
    """
    numeric = estimator.regressor_["columns"].named_transformers_["numeric"]["scale"]
    inputs = input_columns(table, spec.input_transform, numeric.mean_, numeric.scale_)
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
    return Network(
        inputs=inputs,
        explosives=table.explosives,
        codes=np.eye(len(table.explosives)),
        layers=_layers(estimator.regressor_["model"]),
        outputs=outputs,
        constraints=domain_constraints(table),
        golden=golden_rows(estimator, inputs, table.explosives),
        provenance=provenance,
    )


def _layers(model: Any) -> tuple[Layer, ...]:
    if hasattr(model, "coefs_"):
        last = len(model.coefs_) - 1
        activation: Activation = model.activation
        return tuple(
            Layer(weights, biases, "identity" if number == last else activation)
            for number, (weights, biases) in enumerate(
                zip(model.coefs_, model.intercepts_, strict=True)
            )
        )
    weights = np.ascontiguousarray(np.atleast_2d(model.coef_).T)
    return (Layer(weights, np.atleast_1d(model.intercept_), "identity"),)


def golden_rows(
    estimator: Any, inputs: Sequence[InputColumn], explosives: Sequence[str], seed: int = 0
) -> GoldenRows:
    """Answers of the estimator on corners of the training box and on rows inside it."""
    import pandas as pd

    rng = np.random.default_rng(seed)
    lower = np.array([column.lower for column in inputs])
    upper = np.array([column.upper for column in inputs])
    corners = _corners(len(inputs), rng)
    inside = rng.random((_GOLDEN_ROWS - len(corners), len(inputs)))
    # lower + (upper - lower) may miss `upper` by a bit; the corner itself must be in the box.
    shares = np.concatenate([corners, inside])
    rows = np.where(shares == 1.0, upper, lower + (upper - lower) * shares)
    kinds = [explosives[k] for k in rng.integers(0, len(explosives), len(rows))]
    frame = pd.DataFrame(rows, columns=_names(inputs)).assign(explosive=kinds)
    return GoldenRows(rows, tuple(kinds), predict(estimator, frame))


def _names(columns: Sequence[Column]) -> list[str]:
    return [column.name for column in columns]


def _corners(dimensions: int, rng: np.random.Generator) -> Floats:
    """Corners of the unit box, (c, dimensions): all of them, or a random choice where too many."""
    if 2**dimensions <= _GOLDEN_CORNERS:
        return np.array(list(product((0.0, 1.0), repeat=dimensions)))
    ends = np.array([[0.0] * dimensions, [1.0] * dimensions])
    drawn = rng.integers(0, 2, (_GOLDEN_CORNERS - 2, dimensions)).astype(np.float64)
    return np.concatenate([ends, drawn])
