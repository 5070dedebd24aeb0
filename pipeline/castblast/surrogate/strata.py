"""Where a surrogate errs: by explosive, by every input in tenths, and its worst ten rows."""

from __future__ import annotations

from typing import Any

from castblast.surrogate.features import Split
from castblast.surrogate.training import Fit


def strata(fit: Fit, split: Split = "test", bins: int = 10) -> dict[str, Any]:
    """Scores of every target by explosive and by bins of equal count of every input.

    Returns
    -------
    dict
        ``rows``, ``by_explosive`` and ``by_input`` (input -> list of bins with lower, upper, rows
        and targets -> score): plain JSON values.
    """
    raise NotImplementedError


def worst_cases(fit: Fit, count: int = 10, split: Split = "test") -> list[dict[str, Any]]:
    """Rows with the largest relative error of any target, worst first.

    Returns
    -------
    list of dict
        sample, explosive, inputs [SI], target, relative_error, truth and predicted of every
        target, in_domain (bool) and place (how far the row is inside the box, 0 at its edge).
    """
    raise NotImplementedError
