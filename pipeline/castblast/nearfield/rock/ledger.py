"""The energy ledger of the near field: what the gas does to the rock, and where it goes.

Everything is per radian and metre of hole. At the end of a run the work of the gas (`LOAD`) equals
kinetic and elastic energy, the plastic work of shear and tension, what viscosity and merging turned
into heat, and what went out through the boundary. The share that is open is `energy_residual`; a
run that is open by more than `LEDGER_TOLERANCE` of `castblast.nearfield.outcome` fails.
"""

from __future__ import annotations

from castblast.kernel import inline_kernel

# Slots of the work of a march [J/m per radian]: plastic work of shear and of tension, viscosity,
# the outer boundary, the gas on the wall, and that part of it which the rise of the load withholds.
SHEAR, TENSION, VISCOUS, BOUNDARY, LOAD, RAMP = 0, 1, 2, 3, 4, 5
LEDGER_SIZE = 6


@inline_kernel
def lost_to_growth(previous_step: float, step: float, spent: float) -> float:
    """Energy [J/m per radian] that a leapfrog loses where its step grows.

    It keeps an energy that departs from the true one by m a^2 dt^2 / 8 a node. With the step that
    share changes, and the motion gains so much less than the forces work: a numerical dissipation
    like that of the viscosity, known exactly.

    Parameters
    ----------
    previous_step, step : float [s]
    spent : float [N m s-1]
        Force times the change of the velocity in the kick, summed over the nodes.
    """
    return 0.25 * (step - previous_step) * spent
