"""Firing: the balls of a block get the velocity of the block at its delay."""

from __future__ import annotations

import numpy as np

from castblast.muckpile.cast.case import CastCase
from castblast.muckpile.cast.ledger import mechanical_energy
from castblast.muckpile.engine.simulation import Simulation


def fire_blocks(case: CastCase, run: Simulation, time: float) -> float:
    """Give the blocks due at `time` their velocity; return the energy added [J].

    With the velocity comes the load of contacts inside the block, which nobody asked for before.
    """
    block = case.particles.block
    chosen = np.isin(block, np.flatnonzero(case.block_delay == time))
    before = sum(mechanical_energy(run, case.gravity))
    velocity = np.zeros((len(block), 3))
    velocity[chosen] = case.block_velocity[block[chosen]]
    run.fire(chosen, velocity)
    return sum(mechanical_energy(run, case.gravity)) - before
