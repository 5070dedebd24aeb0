"""What a cast needs and what comes out of it: plain records of numbers and arrays, in SI units."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from castblast.errors import Status
from castblast.muckpile.balls.contact import ContactLaw, check_law
from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.balls.state import PRECISIONS
from castblast.muckpile.cast.ledger import EnergyLedger
from castblast.muckpile.ground.walls import Walls
from castblast.types import FloatArray, IntArray


class CastCase(NamedTuple):
    """Everything a cast needs.

    Attributes
    ----------
    particles : Particles
        At rest, or moving if they belong to no block.
    law : ContactLaw
    walls : Walls
    block_delay : array (b,) [s]
        Firing time of each block; infinite: never fired.
    block_velocity : array (b, 3) [m s-1]
        Velocity that the balls of the block receive.
    gravity : float [m s-2]
    hold_unfired : bool
        Blocks stand as intact rock until they are fired; False: they are loose from the start.
    max_time, min_time : float [s]
        The run ends between them.
    stop_energy_ratio : float [-]
        Share of the largest translational energy below which the pile is at rest ...
    stop_duration : float [s]
        ... once it has stayed there so long.
    step_safety : float [-]
        Share of the stable step that is used.
    time_step : float [s]
        A fixed step; 0: by the rule, checked at each renewal of the lists.
    skin : float [m]
        Of the pair lists; 0: by the rule. Results do not depend on it but for rounding.
    ballistic : bool
        Pair lists along the paths of flight. Results do not depend on it but for rounding.
    threads : int
        0: all. Results do not depend on it, to the last bit.
    keep_ledger : bool
        Record dissipated energies; costs a few per cent of the time.
    sample_interval : float [s]
        Of the history and of the test for rest.
    snapshot_interval : float [s]
        0: only the first and the last state.
    precision : {"float64", "mixed"}
        Mixed: motion and contact memory are stored in single precision; see
        `castblast.muckpile.balls.state`.
    """

    particles: Particles
    law: ContactLaw
    walls: Walls
    block_delay: FloatArray
    block_velocity: FloatArray
    gravity: float = 9.81
    hold_unfired: bool = True
    max_time: float = 30.0
    min_time: float = 0.0
    stop_energy_ratio: float = 1e-4
    stop_duration: float = 0.2
    step_safety: float = 0.8
    time_step: float = 0.0
    skin: float = 0.0
    ballistic: bool = True
    threads: int = 0
    keep_ledger: bool = True
    sample_interval: float = 0.02
    snapshot_interval: float = 0.0
    precision: str = "float64"


class CastHistory(NamedTuple):
    """The run over time, k samples.

    Attributes
    ----------
    time : array (k,) [s]
    translational_energy, rotational_energy : array (k,) [J]
    centre_of_mass : array (k, 3) [m]
    contacts : array (k,), int64
        Between balls.
    """

    time: FloatArray
    translational_energy: FloatArray
    rotational_energy: FloatArray
    centre_of_mass: FloatArray
    contacts: IntArray


class CastCounters(NamedTuple):
    """What the run cost and how close it came to its limits.

    Attributes
    ----------
    steps, rebuilds, particle_steps : int
    smallest_step, largest_step : float [s]
        Of the stable step by the rule, over the run.
    largest_overlap : float [-]
        Over the radius of the smaller ball, among the samples.
    deep_share : float [-]
        Contacts that overlap by more than `castblast.muckpile.engine.survey.DEEP` radii of the
        smaller ball, over the number of balls; the largest among the samples.
    seconds : float [s]
        Wall time, with compilation if there was any.
    """

    steps: int
    rebuilds: int
    particle_steps: int
    smallest_step: float
    largest_step: float
    largest_overlap: float
    deep_share: float
    seconds: float


class CastResult(NamedTuple):
    """Outcome of a cast.

    Attributes
    ----------
    particles : Particles
        Final state, in the order of the case.
    time : float [s]
    status : Status
        OK: at rest; NOT_CONVERGED: `max_time` was reached first; UNSTABLE_STEP: the state became
        non-finite, or a ball passed through another.
    failed_ball : int
        Ball with which that began; -1: none.
    failed_time : float [s]
        When that was noticed; NaN: never.
    history : CastHistory
    ledger : EnergyLedger
    counters : CastCounters
    """

    particles: Particles
    time: float
    status: Status
    failed_ball: int
    failed_time: float
    history: CastHistory
    ledger: EnergyLedger
    counters: CastCounters


def check_case(case: CastCase) -> list[str]:
    """Return every fault in the sizes and values of `case`, in words; empty: none."""
    faults = check_law(case.law)
    blocks = len(case.block_delay)
    if case.block_velocity.shape != (blocks, 3):
        faults.append(
            f"block_velocity has the shape {case.block_velocity.shape}, "
            f"block_delay asks for ({blocks}, 3)"
        )
    if len(case.particles.block) and case.particles.block.max() >= blocks:
        faults.append(
            f"a ball belongs to block {case.particles.block.max()}, but there are {blocks} blocks"
        )
    if np.isnan(case.block_delay).any() or (case.block_delay < 0.0).any():
        faults.append("block_delay: a firing time is negative or not a number")
    if case.precision not in PRECISIONS:
        allowed = ", ".join(PRECISIONS)
        faults.append(f"precision = {case.precision!r}: must be one of {allowed}")
    if not 0.0 < case.step_safety < 1.0:
        faults.append(f"step_safety = {case.step_safety:g}: must be above 0 and below 1")
    return faults
