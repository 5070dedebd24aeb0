"""Firing times of holes from the delays of the connectors between them."""

from __future__ import annotations

import math

import numpy as np

from castblast.errors import SpecError
from castblast.specs.tables.table import Table
from castblast.types import FloatArray


def firing_times(table: Table, from_hole: str, delay: str) -> FloatArray:
    """Sum the delays of the connectors from the first hole to each.

    Parameters
    ----------
    table : Table
        With ids.
    from_hole : str
        Column of the id of the hole that the connector comes from; a hole that names itself or none
        is where the firing begins. A prefix up to a colon, such as the name of the blast, is left
        out.
    delay : str
        Column of the delay of the connector [s].

    Returns
    -------
    array (n,) [s]

    Raises
    ------
    SpecError
        Unknown holes, empty delays, rings: each with its line.
    """
    if not table.label:
        message = f"{table.path}: '{from_hole}' names holes, but no column holds their ids"
        raise SpecError(message)
    number = {label: k for k, label in enumerate(table.label)}
    before, faults = [], []
    for k, text in enumerate(table.text[from_hole]):
        origin = number.get(text, number.get(text.rpartition(":")[2].strip(), -1))
        if text and origin < 0:
            faults.append(f"{table.where(k)}: {from_hole}: '{text}' is none of the holes")
        if not math.isfinite(table.number[delay][k]):
            faults.append(f"{table.where(k)}: {delay}: empty: a number is needed")
        before.append(k if origin < 0 else origin)
    if faults:
        raise SpecError("\n".join(faults[:20]))
    return _summed(table, np.array(before), table.number[delay])


def _summed(table: Table, before: np.ndarray, delay: FloatArray) -> FloatArray:
    """Add up along the chains, all holes at once, twice as far with each round."""
    own = np.arange(len(before))
    total = delay.copy()
    reached = before.copy()
    # A hole where the firing begins passes on its own delay once.
    total[before == own] = 0.0
    first = np.where(before == own, delay, 0.0)
    for _ in range(max(1, math.ceil(math.log2(len(before) + 1)))):
        total = total + total[reached]
        reached = reached[reached]
    ring = np.flatnonzero(before[reached] != reached)
    if len(ring):
        message = f"{table.where(int(ring[0]))}: its connectors lead round in a ring"
        raise SpecError(message)
    return np.asarray(total + first[reached])
