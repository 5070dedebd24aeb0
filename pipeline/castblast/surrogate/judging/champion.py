"""What is seen of a comparison at first sight: the errors of its champion, as flat numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from castblast.disk.plain import finite
from castblast.surrogate.fitting.features import SPLITS
from castblast.surrogate.fitting.metrics import relative_errors
from castblast.surrogate.fitting.training import Fit
from castblast.surrogate.judging.comparison import League


def champion_name(league: League) -> str:
    """Name of the chosen model; of the best exportable one where none passes the physics gate."""
    return league["chosen"] or league["best_exportable"]


def champion_figures(fits: Sequence[Fit], league: League) -> dict[str, float | int | None]:
    """Errors of the champion in percent and the rows behind them, without times.

    Parameters
    ----------
    fits : sequence of Fit
        Those of the league.
    league : League

    Returns
    -------
    dict of str to number
        ``valid_error_percent`` (what the choice is made by) and ``test_error_percent`` (held-out),
        both as in the league; for each target of the league ``test_median_percent_<target>``,
        ``test_p95_percent_<target>`` and ``test_r2_<target>``; ``gate_passed`` (0 or 1) where the
        gate judged; ``models`` and ``rows_<split>``. None: not finite.
    """
    name = champion_name(league)
    fit = next(fit for fit in fits if fit.spec.name == name)
    entry = next(entry for entry in league["league"] if entry["name"] == name)
    figures: dict[str, float | int | None] = {
        "valid_error_percent": percent(entry["valid_error"]),
        "test_error_percent": percent(entry["test_error"]),
    }
    rows = fit.table.rows("test")
    for target in league["targets"]:
        j = fit.table.target_names.index(target)
        errors = np.abs(relative_errors(fit.table.targets[rows, j], fit.predicted[rows, j]))
        median = float(np.quantile(errors, 0.5, method="inverted_cdf"))
        scores = entry["targets"][target]
        figures[f"test_median_percent_{target}"] = percent(finite(median))
        figures[f"test_p95_percent_{target}"] = percent(scores["relative_error_95"])
        figures[f"test_r2_{target}"] = scores["r2"]
    if entry["gate_passed"] is not None:
        figures["gate_passed"] = int(entry["gate_passed"])
    figures["models"] = len(league["league"])
    return figures | {f"rows_{split}": len(fit.table.rows(split)) for split in SPLITS}


def percent(share: float | None) -> float | None:
    """A share in percent; None stays None."""
    return None if share is None else 100.0 * share
