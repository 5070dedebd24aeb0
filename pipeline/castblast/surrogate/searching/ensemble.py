"""Fits of one spec that differ in their random start: how far they disagree, row by row.

Deep ensembles in the sense of Lakshminarayanan, Pritzel & Blundell (2017): no member is better, so
their disagreement is error that more data or more fitting would remove. It is no band: what all
members get wrong alike it does not show. The band stays the conformal one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from castblast.errors import SpecError
from castblast.progress import ProgressCallback, part, silent
from castblast.specs.models.model import ModelSpec
from castblast.surrogate.fitting.estimators import predict
from castblast.surrogate.fitting.features import Table
from castblast.surrogate.fitting.training import Fit, fit_spec
from castblast.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd


def fit_members(
    spec: ModelSpec, table: Table, count: int, progress: ProgressCallback = silent
) -> list[Fit]:
    """Fit a spec from `count` random starts, one fit each.

    Raises
    ------
    SpecError
        The family has no random start, or fewer than two members are asked for.
    """
    if not hasattr(spec, "seed") or not hasattr(spec, "restarts"):
        message = f"{spec.name}: family '{spec.kind}' has no random start; take one with a seed"
        raise SpecError(message)
    if count < 2:
        message = f"members: {count}; an ensemble needs at least two members"
        raise SpecError(message)
    return [
        fit_spec(
            spec.model_copy(update={"seed": spec.seed + number, "restarts": 1}),
            table,
            part(progress, number / count, (number + 1) / count),
        )
        for number in range(count)
    ]


def ensemble_spread(fits: Sequence[Fit], frame: pd.DataFrame) -> FloatArray:
    """Relative standard deviation over the fits, (n, m): over the absolute value of the first."""
    answers = np.stack([predict(fit.estimator, frame) for fit in fits])
    return np.asarray(np.std(answers, axis=0, ddof=1) / np.abs(answers[0]))
