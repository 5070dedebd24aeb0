"""Least squares for a small dense network with one output: Levenberg-Marquardt.

A network of 500 to 2,000 weights has a Gauss-Newton matrix that one core forms and factorises in
a fraction of a second. With it a fit needs a hundred steps where first-order and quasi-Newton
methods need tens of thousands, and ends at a far smaller residual. The weights are found as

    (J'J + (penalty + damping) I) step = -(J'r + penalty w),

with the damping led by the gain ratio (Nielsen 1999, as in Madsen, Nielsen & Tingleff 2004,
Methods for non-linear least squares problems, algorithm 3.16). The penalty keeps the weights
small where the rows do not say what they should be. For networks: Hagan & Menhaj (1994), IEEE
Trans. Neural Networks 5, 989-993. Memory is bounded, for J is formed in blocks of rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from castblast.network import Activation, Layer
from castblast.types import FloatArray

_BLOCK_ROWS = 2000
_FIRST_DAMPING = 1e-2
_LEAST_DAMPING = 1e-14
#: Beyond it a step is smaller than rounding.
_MOST_DAMPING = 1e15
#: Accepted steps over which the fall of the objective is judged.
_WINDOW = 10


class LevenbergResult(NamedTuple):
    """Outcome of a fit.

    Attributes
    ----------
    layers : tuple of Layer
    weights : (P,)
        All weights and biases, where a further fit may start.
    steps : int
        Accepted ones.
    converged : bool
        Ended by its own rule, not at the limit of steps.
    objective : float
        Sum of squared residuals with the penalty.
    """

    layers: tuple[Layer, ...]
    weights: FloatArray
    steps: int
    converged: bool
    objective: float


def fit_dense(
    x: FloatArray,
    y: FloatArray,
    hidden: Sequence[int],
    activation: Activation,
    *,
    penalty: float,
    max_steps: int,
    tolerance: float,
    seed: int | Sequence[int],
    start: FloatArray | None = None,
) -> LevenbergResult:
    """Fit a dense network to rows.

    Parameters
    ----------
    x : (n, k)
        Inputs of order 1.
    y : (n,)
        Target of order 1.
    hidden : sequence of int
        Nodes of each hidden layer; none: a linear map.
    activation : {"tanh", "logistic", "silu"}
    penalty : float
        Weight of the sum of squared weights beside the sum of squared residuals.
    max_steps : int
    tolerance : float
        Relative fall of the objective over ten steps at which the fit ends.
    seed : int or sequence of int
        Of the random weights at the start.
    start : (P,), optional
        Weights of an earlier fit of the same network, taken in place of random ones.
    """
    net = _Net((x.shape[1], *hidden, 1), activation, x, y)
    weights = net.start(np.random.default_rng(seed)) if start is None else start
    matrix, gradient, square = net.normal_equations(weights)
    objective = square + penalty * float(weights @ weights)
    history = [objective]
    damping, growth = _FIRST_DAMPING, 2.0
    converged = False
    while not converged and len(history) <= max_steps:
        slope = gradient + penalty * weights
        step = _solve(matrix, slope, penalty + damping)
        if step is not None:
            trial = weights + step
            tried = net.square(trial) + penalty * float(trial @ trial)
            expected = float(step @ (damping * step - slope))
            gain = (objective - tried) / expected if expected > 0.0 else -1.0
        if step is None or not (gain > 0.0 and tried < objective):
            damping, growth = damping * growth, 2.0 * growth
            converged = damping > _MOST_DAMPING
            continue
        damping = max(damping * max(1.0 / 3.0, 1.0 - (2.0 * gain - 1.0) ** 3), _LEAST_DAMPING)
        growth = 2.0
        weights, objective = trial, tried
        history.append(objective)
        converged = (
            len(history) > _WINDOW
            and history[-1 - _WINDOW] - objective <= tolerance * history[-1 - _WINDOW]
        )
        if not converged and len(history) <= max_steps:
            matrix, gradient, square = net.normal_equations(weights)
    return LevenbergResult(
        layers=net.layers(weights),
        weights=weights,
        steps=len(history) - 1,
        converged=converged,
        objective=objective,
    )


def _solve(matrix: FloatArray, slope: FloatArray, shift: float) -> FloatArray | None:
    """Solve (matrix + shift I) step = -slope; None where rounding made it not positive."""
    from scipy.linalg import LinAlgError, cho_factor, cho_solve

    shifted = matrix.copy()
    shifted[np.diag_indices_from(shifted)] += shift
    try:
        factor = cho_factor(shifted, lower=True, overwrite_a=True, check_finite=False)
    except LinAlgError:
        return None
    step: FloatArray = cho_solve(factor, -slope, check_finite=False)
    return step if np.isfinite(step).all() else None


class _Net:
    """A dense network with one output as a function of one vector of weights."""

    def __init__(
        self, sizes: tuple[int, ...], activation: Activation, x: FloatArray, y: FloatArray
    ) -> None:
        self.sizes, self.activation, self.x, self.y = sizes, activation, x, y
        self.count = sum((a + 1) * b for a, b in pairwise(sizes))

    def start(self, rng: np.random.Generator) -> FloatArray:
        """Random weights that keep the spread of the inputs; biases spread over it."""
        parts = []
        for depth, (a, b) in enumerate(pairwise(self.sizes)):
            last = depth == len(self.sizes) - 2
            parts += [
                rng.standard_normal(a * b) / np.sqrt(a),
                np.zeros(b) if last else rng.uniform(-0.8, 0.8, b),
            ]
        return np.concatenate(parts)

    def _split(self, weights: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        split, at = [], 0
        for a, b in pairwise(self.sizes):
            middle, end = at + a * b, at + (a + 1) * b
            split.append((weights[at:middle].reshape(a, b), weights[middle:end]))
            at = end
        return split

    def layers(self, weights: FloatArray) -> tuple[Layer, ...]:
        """The network as layers of their own memory."""
        split = self._split(weights)
        last = len(split) - 1
        return tuple(
            Layer(w.copy(), b.copy(), "identity" if depth == last else self.activation)
            for depth, (w, b) in enumerate(split)
        )

    def _forward(
        self, split: list[tuple[FloatArray, FloatArray]], x: FloatArray
    ) -> tuple[list[FloatArray], list[FloatArray]]:
        """Values of every layer, inputs first, and slopes of every hidden one."""
        values, slopes = [x], []
        for w, b in split[:-1]:
            value, slope = _activate(self.activation, values[-1] @ w + b)
            values.append(value)
            slopes.append(slope)
        w, b = split[-1]
        values.append(values[-1] @ w + b)
        return values, slopes

    def square(self, weights: FloatArray) -> float:
        """Sum of squared residuals."""
        split, total = self._split(weights), 0.0
        for rows in self._blocks():
            values, _ = self._forward(split, self.x[rows])
            residual = values[-1][:, 0] - self.y[rows]
            total += float(residual @ residual)
        return total

    def normal_equations(self, weights: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """J'J, J'r and r'r of the residuals."""
        split = self._split(weights)
        matrix = np.zeros((self.count, self.count))
        gradient, total = np.zeros(self.count), 0.0
        for rows in self._blocks():
            values, slopes = self._forward(split, self.x[rows])
            residual = values[-1][:, 0] - self.y[rows]
            jacobian = self._jacobian(split, values, slopes)
            matrix += jacobian.T @ jacobian
            gradient += jacobian.T @ residual
            total += float(residual @ residual)
        return matrix, gradient, total

    def _jacobian(
        self,
        split: list[tuple[FloatArray, FloatArray]],
        values: list[FloatArray],
        slopes: list[FloatArray],
    ) -> FloatArray:
        """Derivative of the output of each row by each weight, backwards through the layers."""
        count = len(values[0])
        jacobian = np.empty((count, self.count))
        back = np.ones((count, 1))
        end = self.count
        for depth in range(len(split) - 1, -1, -1):
            a, b = split[depth][0].shape
            jacobian[:, end - b : end] = back
            outer = values[depth][:, :, None] * back[:, None, :]
            jacobian[:, end - (a + 1) * b : end - b] = outer.reshape(count, a * b)
            end -= (a + 1) * b
            if depth:
                back = (back @ split[depth][0].T) * slopes[depth - 1]
        return jacobian

    def _blocks(self) -> list[slice]:
        return [slice(at, at + _BLOCK_ROWS) for at in range(0, len(self.y), _BLOCK_ROWS)]


def _activate(activation: Activation, z: FloatArray) -> tuple[Any, Any]:
    """Value and slope of an activation."""
    from scipy.special import expit

    if activation == "tanh":
        value = np.tanh(z)
        return value, 1.0 - value * value
    share = expit(z)
    if activation == "logistic":
        return share, share * (1.0 - share)
    if activation == "silu":
        value = z * share
        return value, share + value * (1.0 - share)
    message = f"activation '{activation}' has no slope here"
    raise ValueError(message)
