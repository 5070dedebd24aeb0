"""Gaussian process on a part of the rows: its cost grows with the cube of their number."""

from __future__ import annotations

import warnings
from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

from castblast.types import FloatArray


class SubsetGaussianProcess(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """Lengths of the kernel by maximum likelihood on few rows, posterior on more of them.

    Parameters
    ----------
    rows, tuning_rows : int
        Rows drawn at random for the posterior, and how many of these for the likelihood.
    smoothness : float
        ``nu`` of the Matern kernel.
    random_state : int
    """

    def __init__(
        self,
        rows: int = 3000,
        tuning_rows: int = 500,
        smoothness: float = float("inf"),
        random_state: int = 0,
    ) -> None:
        self.rows = rows
        self.tuning_rows = tuning_rows
        self.smoothness = smoothness
        self.random_state = random_state

    def fit(self, x: Any, y: Any) -> Self:
        """Fit scaled rows x (n, k) to scaled targets y (n,) or (n, m), which share the kernel."""
        inputs, targets = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        order = np.random.default_rng(self.random_state).permutation(len(inputs))
        kernel = ConstantKernel(10.0, (1e-2, 1e5)) * Matern(
            length_scale=np.full(inputs.shape[1], 5.0), length_scale_bounds=(0.1, 1e4),
            nu=self.smoothness,
        ) + WhiteKernel(1e-5, (1e-8, 1e-1))  # fmt: skip
        few = order[: min(self.tuning_rows, self.rows)]
        with warnings.catch_warnings():
            # Lengths at their bounds mean inputs without influence.
            warnings.simplefilter("ignore", ConvergenceWarning)
            tuned = GaussianProcessRegressor(kernel).fit(inputs[few], targets[few])
        most = order[: self.rows]
        self.process_ = GaussianProcessRegressor(tuned.kernel_, optimizer=None)
        self.process_.fit(inputs[most], targets[most])
        return self

    def predict(self, x: Any) -> FloatArray:
        """Posterior mean at scaled rows (n, k)."""
        rows = np.asarray(x, dtype=np.float64)
        parts = [self.process_.predict(rows[at : at + 1000]) for at in range(0, len(rows), 1000)]
        mean: FloatArray = np.concatenate(parts)
        return mean
