"""Joint domain of the training rows: a Gaussian mixture, kept as a few sums of squares.

Ranges and linear rules leave out what a design ties together otherwise, and a user's own dataset
may come with no rules at all. The score of a row is that of the mixture term it is most likely
from, so every language computes it with multiplications, additions and one comparison. Its bound is
a quantile over rows that the mixture has not seen.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import TypeVar

import numpy as np

from castblast.network import DensityScore, Shell, scale_columns
from castblast.surrogate.fitting.features import Table
from castblast.types import FloatArray

#: Share of rows of the training distribution that are to count as inside.
LEVEL = 0.995
#: Terms of the mixture at most, and training rows wanted for every number of a term.
_TERMS = 8
_ROWS_PER_NUMBER = 5
#: Least variance in any direction, in units of a scaled input.
_LEAST_VARIANCE = 1e-6

_AnyShell = TypeVar("_AnyShell", bound=Shell)


def with_density(shell: _AnyShell, table: Table) -> _AnyShell:
    """Give a network or shell with the joint density of the training rows of its table."""
    numeric = table.frame[list(shell.input_names)].to_numpy(dtype=np.float64)
    scaled = scale_columns(numeric, shell.inputs)
    held = scaled[table.rows("valid", "calibration")]
    return replace(shell, density=fit_density(scaled[table.rows("train")], held))


def fit_density(
    train: FloatArray, held: FloatArray, terms: int | None = None, seed: int = 0
) -> DensityScore:
    """Fit the score and its bound.

    Parameters
    ----------
    train : (n, k)
        Scaled inputs of the training rows.
    held : (h, k)
        Scaled inputs of rows that fitted nothing here: the bound is their quantile of `LEVEL`,
        with the rank that holds for one more such row (as in split-conformal bands). With fewer
        than 199 rows it is their largest score, and `level` says for what share that stands.
    terms : int, optional
        Of the mixture; default: `term_count`.
    seed : int
        Of the starting centres.

    Returns
    -------
    DensityScore

    References
    ----------
    Dempster, Laird & Rubin (1977), Maximum likelihood from incomplete data via the EM algorithm,
    J. R. Stat. Soc. B 39, 1-38, for the fit; Vovk, Gammerman & Shafer (2005), Algorithmic Learning
    in a Random World, for the rank.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.mixture import GaussianMixture
    from threadpoolctl import threadpool_limits

    mixture = GaussianMixture(
        terms or term_count(*train.shape),
        reg_covar=_LEAST_VARIANCE,
        max_iter=200,
        random_state=seed,
    )
    with warnings.catch_warnings(), threadpool_limits(1):
        # A mixture that could still be improved a little scores as well as any.
        warnings.simplefilter("ignore", ConvergenceWarning)
        mixture.fit(train)
    whitening = np.ascontiguousarray(np.swapaxes(mixture.precisions_cholesky_, 1, 2))
    diagonals = np.diagonal(whitening, axis1=1, axis2=2)
    offsets = -2.0 * (np.log(diagonals).sum(axis=1) + np.log(mixture.weights_))
    score = DensityScore(
        centres=mixture.means_,
        whitening=whitening,
        offsets=offsets - offsets.min(),
        threshold=1.0,
        level=LEVEL,
    )
    rank = min(math.ceil((len(held) + 1) * LEVEL), len(held))
    threshold = float(np.sort(score.distances(held).min(axis=0))[rank - 1])
    return replace(score, threshold=threshold, level=min(LEVEL, rank / (len(held) + 1)))


def term_count(rows: int, inputs: int) -> int:
    """Terms that so many training rows can carry; a term has a weight, a mean and a covariance."""
    numbers = (inputs + 1) * (inputs + 2) // 2
    return max(1, min(_TERMS, rows // (_ROWS_PER_NUMBER * numbers)))
