"""Time of a march: the step, the load on the wall, and when the run is over.

Scalars in, scalars out, shared by the march of one hole and the march of many in lockstep.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from castblast.kernel import inline_kernel

#: A step may be at most this much longer than the one before.
STEP_GROWTH = 1.05
#: Share of the rise time that is round-off.
_NO_TIME = 1e-9


class Schedule(NamedTuple):
    """What the clock of a run needs to know of its case.

    Attributes
    ----------
    start_pressure : float [Pa]
        Wall pressure at time zero.
    rise_time : float [s]
        Linear rise from the start pressure to the full one.
    settling_factor : float [-]
        Without an end time: end at this multiple of the time at which the wall turns back.
    courant : float [-]
        Share of the largest stable step.
    """

    start_pressure: float
    rise_time: float
    settling_factor: float
    courant: float


class Clock(NamedTuple):
    """Where a run stands.

    Attributes
    ----------
    time : float [s]
    step, previous_step : float [s]
        The next step and the last one (0 at the start).
    end : float [s]
        0 as long as it is not known.
    reversal : float [s]
        When the wall first turned back; 0: not yet.
    speed : float [m s-1]
        Wall velocity at the end of the last step.
    pressure, full_pressure : float [Pa]
        On the wall now, and what it would be without a rise time.
    """

    time: float
    step: float
    previous_step: float
    end: float
    reversal: float
    speed: float
    pressure: float
    full_pressure: float


@inline_kernel
def risen(schedule: Schedule, time: float, full: float) -> float:
    """Wall pressure [Pa] at a time [s]."""
    if time >= schedule.rise_time:
        return full
    start = schedule.start_pressure
    return start + time / schedule.rise_time * (full - start)


@inline_kernel
def is_last(clock: Clock) -> bool:
    """Say whether the next step reaches the end."""
    return clock.end > 0.0 and clock.time + clock.step * (1.0 + 1e-9) >= clock.end


@inline_kernel
def last_step(clock: Clock) -> Clock:
    """Clock whose next step ends at the end."""
    c = clock
    step = c.end - c.time
    return Clock(
        c.time, step, c.previous_step, c.end, c.reversal, c.speed, c.pressure, c.full_pressure
    )


@inline_kernel
def start_clock(schedule: Schedule, first_step: float, end: float, full: float) -> Clock:
    """Clock at time zero; `full` is the wall pressure [Pa] without a rise time."""
    return Clock(0.0, first_step, 0.0, end, 0.0, 0.0, risen(schedule, 0.0, full), full)


@inline_kernel
def after_step(
    schedule: Schedule,
    clock: Clock,
    limit: float,
    full: float,
    radius: float,
    inner_force: float,
    inner_velocity: float,
    inner_mass: float,
) -> Clock:
    """Clock after a step.

    The wall is taken to have turned back when its velocity, interpolated in time, passes zero
    after the rise of the load.

    Parameters
    ----------
    limit : float [s]
        Largest stable step of the new state.
    full : float [Pa]
        Full pressure at the new `radius` [m] of the wall.
    inner_force : float [N]
        Of the rock on the wall, per radian and metre.
    inner_velocity : float [m s-1]
        In the middle of the step.
    """
    step = clock.step
    time = clock.time + step
    pressure = risen(schedule, time, full)
    speed = inner_velocity + 0.5 * step * (inner_force + pressure * radius) / inner_mass
    reversal, end = clock.reversal, clock.end
    if reversal == 0.0 and speed <= 0.0 and clock.speed > 0.0 and time > schedule.rise_time:
        reversal = time - step * speed / (speed - clock.speed)
        if end == 0.0:
            end = schedule.settling_factor * reversal
    following = min(STEP_GROWTH * step, schedule.courant * limit)
    left = schedule.rise_time - time
    if left > _NO_TIME * schedule.rise_time:
        # A step that ran across the corner of the load would lose work by leaps: with the number
        # of steps in the rise.
        following = left / np.ceil(left / following)
    return Clock(time, following, step, end, reversal, speed, pressure, full)


@inline_kernel
def load_work(before: Clock, after: Clock, old_radius: float, radius: float) -> tuple[float, float]:
    """Work [J/m per radian] of the wall pressure, and what a pressure without rise would add."""
    growth = 0.5 * (radius * radius - old_radius * old_radius)
    lost = before.full_pressure - before.pressure + after.full_pressure - after.pressure
    return 0.5 * (before.pressure + after.pressure) * growth, 0.5 * lost * growth
