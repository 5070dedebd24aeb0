"""Whether the result of a cast may be believed: its energy balance and how far balls overlapped."""

from __future__ import annotations

import math

from castblast.muckpile.cast.case import CastResult
from castblast.muckpile.engine.survey import DEEP

#: Largest open share of the energy balance.
MOST_OPEN = 0.01
#: Largest number, over that of the balls, of contacts deeper than `DEEP` radii of the smaller ball
#: at any one time. Single small balls that are caught between large ones are no fault of a result.
MOST_DEEP = 0.01


def cast_faults(result: CastResult) -> list[str]:
    """Reasons not to believe a result, in words; empty: none."""
    faults = []
    residual = result.ledger.residual
    if not math.isfinite(residual):
        faults.append("the energy balance could not be formed")
    elif abs(residual) > MOST_OPEN:
        faults.append(
            f"the energy balance is off by {_percent(residual)} (allowed: {_percent(MOST_OPEN)})"
        )
    deep = result.counters.deep_share
    if not deep <= MOST_DEEP:
        faults.append(
            f"{_percent(deep)} of the balls overlapped by more than {DEEP:g} radii at one time "
            f"(allowed: {_percent(MOST_DEEP)}); raise contact.effective_modulus"
        )
    return faults


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"
