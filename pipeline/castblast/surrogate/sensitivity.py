"""Which inputs matter: Sobol indices of a surrogate over the joint domain, checked by physics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from castblast.progress import ProgressCallback, silent
from castblast.surrogate.domain import Domain
from castblast.surrogate.training import Fit


def sobol_report(
    fit: Fit,
    domain: Domain,
    *,
    rows: int = 8192,
    checked: Sequence[str] = (),
    checked_rows: int = 1024,
    seed: int = 0,
    progress: ProgressCallback = silent,
) -> dict[str, Any]:
    """First and total Sobol index of every varied input on every target, with 95 % intervals.

    Parameters
    ----------
    rows : int
        Base sample; 5 evaluations of the surrogate per input and row.
    checked : sequence of str
        Inputs whose indices the simulator gives as well; default: the two that matter most.
    checked_rows : int
        Base sample of the check: 5 runs of the simulator (1.3 ms) per input and row.

    Returns
    -------
    dict
        ``method``, ``indices``: target -> input -> first, first_interval, total, total_interval;
        ``physics``: the same for the checked inputs, with the surrogate's on the same rows.
    """
    raise NotImplementedError
