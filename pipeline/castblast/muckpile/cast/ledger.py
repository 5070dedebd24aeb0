"""The energy ledger of a cast: what firing puts in, what contacts take, what is left open."""

from __future__ import annotations

from math import nan
from typing import NamedTuple

import numpy as np

from castblast.muckpile.engine.simulation import Simulation


class EnergyLedger(NamedTuple):
    """Where the energy went; all in J but the residual.

    Attributes
    ----------
    initial : float
        Kinetic, potential and elastic energy at the start.
    fired : float
        Kinetic energy added by the firing of blocks.
    kinetic, potential, spring : float
        At the end.
    slip, rolling_slip, dashpot : float
        Dissipated on the way; NaN when not recorded.
    residual : float [-]
        Open balance over the largest of: energy put in by firing, potential energy released, and
        kinetic energy at the start.
    """

    initial: float
    fired: float
    kinetic: float
    potential: float
    spring: float
    slip: float
    rolling_slip: float
    dashpot: float
    residual: float


def mechanical_energy(run: Simulation, gravity: float) -> tuple[float, float, float]:
    """Kinetic, potential and elastic energy [J] of the present state."""
    balls = run.survey_balls()
    kinetic = balls.translational_energy + balls.rotational_energy
    potential = balls.mass * gravity * float(balls.centre_of_mass[2])
    return kinetic, potential, run.survey_contacts().energy


def close_ledger(
    run: Simulation,
    gravity: float,
    initial: tuple[float, float, float],
    fired: float,
    *,
    recorded: bool,
) -> EnergyLedger:
    """Ledger of the present state.

    Parameters
    ----------
    run : Simulation
    gravity : float [m s-2]
    initial : tuple of float [J]
        `mechanical_energy` at the start.
    fired : float [J]
        Added by the firing of blocks.
    recorded : bool
        The run has summed up what contacts dissipate.
    """
    kinetic, potential, spring = mechanical_energy(run, gravity)
    spent = run.dissipated if recorded else np.full(3, nan)
    slip, rolling_slip, dashpot = map(float, spent)
    before = sum(initial)
    gone = slip + rolling_slip + dashpot
    open_balance = before + fired - kinetic - potential - spring - gone
    scale = max(abs(fired), abs(initial[1] - potential), initial[0], 1e-300)
    return EnergyLedger(
        initial=before,
        fired=fired,
        kinetic=kinetic,
        potential=potential,
        spring=spring,
        slip=slip,
        rolling_slip=rolling_slip,
        dashpot=dashpot,
        residual=open_balance / scale,
    )
