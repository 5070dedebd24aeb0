"""Failed samples: counted by cause, and refused where there are too many."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from castblast.dataset.rows.design import Design
from castblast.design.variables import VARIABLES
from castblast.errors import SimulationError, Status
from castblast.specs.recipe import Recipe

_SHOWN = 5


def causes(status: NDArray[np.integer]) -> list[tuple[Status, int]]:
    """Failures by cause, the most frequent first; equally frequent ones by code."""
    codes, counts = np.unique(status, return_counts=True)
    found = [(Status(code), int(n)) for code, n in zip(codes.tolist(), counts, strict=True)]
    return sorted(
        ((cause, n) for cause, n in found if cause != Status.OK), key=lambda entry: -entry[1]
    )


def summary(status: NDArray[np.integer]) -> str:
    """One line for people: ``100 samples: ok 98 failed 2 (not_converged 2)``."""
    found = causes(status)
    failed = sum(count for _, count in found)
    named = ", ".join(f"{cause.name.lower()} {count}" for cause, count in found)
    line = f"{len(status)} samples: ok {len(status) - failed} failed {failed}"
    return f"{line} ({named})" if named else line


def require_success(
    recipe: Recipe, explosives: tuple[str, ...], design: Design, status: NDArray[np.integer]
) -> None:
    """Refuse a dataset with too many holes.

    Raises
    ------
    SimulationError
        The share, every cause, and the inputs of five samples, the most frequent cause first.
    """
    failed = np.flatnonzero(status != Status.OK)
    share = len(failed) / len(status)
    if share <= recipe.max_failed_share:
        return
    found = causes(status)
    lines = [f"  {count} {cause.name.lower()}: {cause.meaning}" for cause, count in found]
    rank = {int(cause): number for number, (cause, _) in enumerate(found)}
    order = np.argsort([rank[code] for code in status[failed].tolist()], kind="stable")
    for i in failed[order[:_SHOWN]].tolist():
        shown = ", ".join(
            f"{spec.name} {VARIABLES[spec.name].show(float(design.columns[spec.name][i]))}"
            for spec in recipe.sampled
        )
        cause = Status(int(status[i])).name.lower()
        lines.append(
            f"  sample {design.sample[i]}, {cause}: {explosives[design.explosive[i]]}, {shown}"
        )
    message = (
        f"{len(failed)} of {len(status)} samples failed ({share:.1%}), more than the "
        f"max_failed_share of {recipe.max_failed_share:.1%}\n" + "\n".join(lines)
    )
    raise SimulationError(message)
