"""How many runs are enough: a power law through the learning curve, and where it meets a mark."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from castblast.surrogate.training import LearningPoint


@dataclass(frozen=True, eq=False)
class PowerLaw:
    """error = floor + scale * rows^-exponent, with bootstrap draws of its parameters."""

    floor: float
    scale: float
    exponent: float


def fit_power_law(rows: Sequence[float], errors: Sequence[float]) -> PowerLaw:
    """Fit in logarithms."""
    raise NotImplementedError


def learning_report(points: Sequence[LearningPoint], marks: Mapping[str, float]) -> dict[str, Any]:
    """Say per target what the learning curve promises.

    Parameters
    ----------
    points : sequence of LearningPoint
        From `training.learning_curve`, largest last.
    marks : mapping of target name to float
        95 % relative error to be reached.

    Returns
    -------
    dict
        target -> ``rows``, ``error``, ``floor``, ``scale``, ``exponent``, their 95 % intervals,
        ``fit`` ("good" or why it is not trusted), ``mark``, ``reached_at`` (rows measured or
        None), ``runs_for_mark`` (None with a ``reason`` where refused) with its interval,
        ``stop`` (bool: further runs gain little) and ``advice`` (a sentence).
    """
    raise NotImplementedError
