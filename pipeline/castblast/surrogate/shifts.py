"""Beyond random splits: explosives never seen, corners of the domain, extreme dimensionless groups.

Every test refits the spec on part of the rows and judges it on rows of another kind.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from castblast.progress import ProgressCallback, silent
from castblast.specs.model import ModelSpec
from castblast.surrogate.domain import Domain
from castblast.surrogate.features import Table
from castblast.surrogate.training import Fit, fit_spec


def shift_tests(
    fit: Fit,
    table: Table,
    domain: Domain | None = None,
    *,
    refit: Callable[[ModelSpec, Table], Fit] = fit_spec,
    progress: ProgressCallback = silent,
) -> dict[str, Any]:
    """Run all tests on the spec of a fit: one refit per explosive (if able), corner and group.

    Parameters
    ----------
    fit : Fit
        The spec fitted on all training rows, for comparison.
    table : Table
    domain : Domain, optional
        Gives the explosion pressures; without it the groups with it are left out.
    refit : callable
        Fits a spec; pass one with fewer restarts to save time.

    Returns
    -------
    dict
        ``explosives``, ``corner``, ``groups``: plain JSON values.
    """
    raise NotImplementedError
