"""Estimators that are chains of dense layers by construction, in the manner of scikit-learn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin

from castblast.network import Activation, Layer, run_layers
from castblast.surrogate.fitting.families.chains import Chain, embed, one_for_each, side_by_side
from castblast.surrogate.fitting.families.levenberg import LevenbergResult, fit_dense
from castblast.types import FloatArray


def layers_of(model: Any) -> Chain | None:
    """Give a fitted model as a chain of dense layers; None where it is none."""
    if hasattr(model, "layers_"):
        chain: Chain | None = model.layers_
        return chain
    if hasattr(model, "coefs_") and hasattr(model, "activation"):  # MLPRegressor
        last = len(model.coefs_) - 1
        return tuple(
            Layer(weights, biases, "identity" if number == last else model.activation)
            for number, (weights, biases) in enumerate(
                zip(model.coefs_, model.intercepts_, strict=True)
            )
        )
    if hasattr(model, "coef_") and hasattr(model, "intercept_"):  # linear models
        weights = np.ascontiguousarray(np.atleast_2d(model.coef_).T)
        intercept = np.broadcast_to(np.atleast_1d(model.intercept_), weights.shape[1:])
        return (Layer(weights, intercept.copy(), "identity"),)
    return None


def as_matrix(targets: Any) -> FloatArray:
    """Targets (n,) or (n, m) as (n, m) float64."""
    values = np.asarray(targets, dtype=np.float64)
    return values.reshape(len(values), -1)


class ChainRegressor(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """What can be predicted from the attribute ``layers_`` alone."""

    layers_: Chain

    def predict(self, x: Any) -> FloatArray:
        """Evaluate rows (n, k): (n, m), or (n,) where a single target was fitted as a vector."""
        values = run_layers(self.layers_, np.asarray(x, dtype=np.float64))
        return values[:, 0] if self.as_vector_ else values

    def _note_shape(self, targets: Any) -> FloatArray:
        self.as_vector_ = np.ndim(targets) == 1
        return as_matrix(targets)


class LevenbergMlp(ChainRegressor):
    """One small network for each target, fitted by Levenberg-Marquardt.

    Parameters
    ----------
    hidden_layers : sequence of int
    activation : {"tanh", "logistic", "silu"}
    penalty : float
    start_rows, start_iterations : int
        A fit starts with so many steps on so many random rows, where they cost less.
    starts : int
        Random weights to start from; the lowest objective after the first steps goes on.
    max_iterations : int
        Then so many steps on all rows.
    tolerance : float
    columns : sequence of sequences of int, optional
        Columns of the inputs that each target looks at; None: all.
    categories : int
        Above 0: the last so many columns are a one-hot code, and each category has a network.
    random_state : int
        Of the random weights, with the numbers of target and start.

    Attributes
    ----------
    layers_ : tuple of Layer
    n_iter_ : int
        Steps of all fits together.
    converged_ : bool
        All fits ended by their own rule.
    """

    def __init__(
        self,
        hidden_layers: Sequence[int] = (32, 16),
        activation: Activation = "tanh",
        penalty: float = 0.0,
        start_rows: int = 2500,
        start_iterations: int = 100,
        starts: int = 1,
        max_iterations: int = 40,
        tolerance: float = 1e-3,
        columns: Sequence[Sequence[int]] | None = None,
        categories: int = 0,
        random_state: int = 0,
    ) -> None:
        self.hidden_layers = hidden_layers
        self.activation = activation
        self.penalty = penalty
        self.start_rows = start_rows
        self.start_iterations = start_iterations
        self.starts = starts
        self.max_iterations = max_iterations
        self.tolerance = tolerance
        self.columns = columns
        self.categories = categories
        self.random_state = random_state

    def fit(self, x: Any, y: Any) -> Self:
        """Fit scaled rows x (n, k) to scaled targets y (n, m) or (n,)."""
        inputs, targets = np.asarray(x, dtype=np.float64), self._note_shape(y)
        self.n_iter_, self.converged_ = 0, True
        self.layers_ = side_by_side(
            [self._fit_target(inputs, targets[:, j], j) for j in range(targets.shape[1])]
        )
        return self

    def _fit_target(self, x: FloatArray, y: FloatArray, number: int) -> Chain:
        seen = range(x.shape[1]) if self.columns is None else self.columns[number]
        if not self.categories:
            return embed(self._fit_rows(x[:, list(seen)], y, number), seen, x.shape[1])
        numbers = x.shape[1] - self.categories
        seen = [column for column in seen if column < numbers]
        chains = []
        for k in range(self.categories):
            rows = x[:, numbers + k] > 0.5
            chains.append(embed(self._fit_rows(x[rows][:, seen], y[rows], number), seen, numbers))
        return one_for_each(chains)

    def _fit_rows(self, x: FloatArray, y: FloatArray, number: int) -> Chain:
        """Fit one network: first steps, on some of the rows if there are many more, then all."""
        rows: Any = slice(None)
        if len(y) > 1.5 * self.start_rows:
            order = np.random.default_rng([self.random_state, number]).permutation(len(y))
            rows = order[: self.start_rows]
        firsts = [
            self._levenberg(
                x[rows], y[rows], self.start_iterations, [self.random_state, number, start], None
            )
            for start in range(self.starts)
        ]
        best = min(firsts, key=lambda first: first.objective)
        result = self._levenberg(x, y, self.max_iterations, 0, best.weights)
        self.n_iter_ += sum(first.steps for first in firsts) + result.steps
        self.converged_ &= result.converged
        return result.layers

    def _levenberg(
        self,
        x: FloatArray,
        y: FloatArray,
        steps: int,
        seed: int | Sequence[int],
        start: FloatArray | None,
    ) -> LevenbergResult:
        return fit_dense(
            np.ascontiguousarray(x),
            np.ascontiguousarray(y),
            tuple(self.hidden_layers),
            self.activation,
            penalty=self.penalty,
            max_steps=steps,
            tolerance=self.tolerance,
            seed=seed,
            start=start,
        )
