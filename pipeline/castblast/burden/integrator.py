"""Explicit adaptive integration of the burden motion: Dormand & Prince (1980), order 5(4).

The right-hand side jumps where venting starts and where the stemming leaves the hole. Steps end
exactly on these times, and on the time at which the gas stops pushing, so that the result is a
smooth function of the inputs, without noise of the step size.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from castblast.burden.balance import (
    DISPLACEMENT,
    PLUG_DISPLACEMENT,
    STATE_SIZE,
    Balance,
    loaded_area,
    rates,
)
from castblast.burden.venting import ATMOSPHERIC_PRESSURE
from castblast.errors import Status
from castblast.explosive.isentrope import FloatArray
from castblast.kernel import kernel

MAX_STEPS: Final = 6000
_RELATIVE_TOLERANCE: Final = 1e-9
#: Tolerance in units of the natural scale of each state, for states that start at zero.
_ABSOLUTE_TOLERANCE: Final = 1e-11
#: The run ends at this pressure over the open air, where acceleration has all but ended.
_END_PRESSURE: Final = 1.01 * ATMOSPHERIC_PRESSURE
_EVENT_TOLERANCE: Final = 1e-12

_NODES = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0])
_STAGES = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
#: Fifth-order less fourth-order weights.
_ERROR = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])


class Path(NamedTuple):
    """Path of the integrator.

    Where the right-hand side jumps, one time appears twice, with the rates before and after.

    Attributes
    ----------
    times : array (n,) [s]
    states, slopes : arrays (n, 11)
        State and its time derivative, SI units.
    """

    times: FloatArray
    states: FloatArray
    slopes: FloatArray


class _Work(NamedTuple):
    """Arrays of the integrator: states at both ends of a step, rates of its stages, scales."""

    state: FloatArray
    new_state: FloatArray
    stages: FloatArray
    scale: FloatArray


@kernel
def _step(
    b: Balance, venting: bool, plugged: bool, time: float, step: float, work: _Work
) -> tuple[float, float]:
    """Take one step; `stages[0]` holds the rate at its start, `stages[6]` the one at its end.

    Returns the error over the tolerance and the gas pressure at the end.
    """
    p = 0.0
    for stage in range(1, 7):
        for i in range(STATE_SIZE):
            increment = 0.0
            for earlier in range(stage):
                increment += _STAGES[stage, earlier] * work.stages[earlier, i]
            work.new_state[i] = work.state[i] + step * increment
        stage_time = time + _NODES[stage] * step
        p = rates(b, venting, plugged, stage_time, work.new_state, work.stages[stage])
    worst = 0.0
    for i in range(STATE_SIZE):
        error = 0.0
        for stage in range(7):
            error += _ERROR[stage] * work.stages[stage, i]
        size = max(abs(work.state[i]), abs(work.new_state[i]))
        allowed = _RELATIVE_TOLERANCE * size + _ABSOLUTE_TOLERANCE * work.scale[i]
        ratio = abs(step * error) / allowed
        if not ratio <= worst:  # also true for NaN
            worst = ratio
    return worst, p


@kernel
def _event_value(b: Balance, ejection: bool, p: float, state: FloatArray) -> float:
    """Share of an event still to come: 0 where it happens, negative beyond.

    Ejection: stemming in the hole over its length. Otherwise the end of the run: force that still
    drives the burden over the force of the open air.
    """
    if ejection:
        return float(1.0 - state[PLUG_DISPLACEMENT] / b.stemming_length)
    area = loaded_area(b, state[DISPLACEMENT])
    force = (p - _END_PRESSURE) * area - b.friction_force
    return force / (ATMOSPHERIC_PRESSURE * area)


@kernel
def _locate(
    b: Balance,
    ejection: bool,
    venting: bool,
    plugged: bool,
    time: float,
    step: float,
    before: float,
    after: float,
    work: _Work,
) -> float:
    """Shorten a step so that it ends on an event, by the Illinois rule (Dowell & Jarratt 1971).

    `before` and `after` are the event values at the ends of the full step, of opposite sign.
    """
    low, high = 0.0, step
    trial = step
    side = 0
    for _ in range(100):
        trial = low + (high - low) * before / (before - after)
        _, p = _step(b, venting, plugged, time, trial, work)
        value = _event_value(b, ejection, p, work.new_state)
        if abs(value) <= _EVENT_TOLERANCE or high - low <= _EVENT_TOLERANCE * step:
            break
        if value < 0.0:
            high, after = trial, value
            before *= 0.5 if side < 0 else 1.0
            side = -1
        else:
            low, before = trial, value
            after *= 0.5 if side > 0 else 1.0
            side = 1
    return trial


@kernel
def _record(path: Path, point: int, time: float, work: _Work) -> int:
    """Write the start of the next step into the path; return the next free row."""
    path.times[point] = time
    path.states[point] = work.state
    path.slopes[point] = work.stages[0]
    return point + 1


@kernel
def integrate(
    b: Balance, state: FloatArray, scale: FloatArray, time_limit: float, path: Path
) -> tuple[int, int, int, float]:
    """Integrate until the gas stops pushing the burden faster.

    Parameters
    ----------
    b : Balance
    state : array (11,)
        State at time zero; overwritten.
    scale : array (11,)
        Natural size of each state.
    time_limit : float [s]
        Without an end by then the run has not converged.
    path : Path
        Filled from row 0.

    Returns
    -------
    status, points, steps : int
        Outcome, used rows of the path, accepted steps.
    ejection_time : float [s]
        inf if the stemming stays.
    """
    work = _Work(state, np.zeros(STATE_SIZE), np.zeros((7, STATE_SIZE)), scale)
    venting = False
    plugged = b.stemming_length > 0.0
    ejection_time = np.inf if plugged else 0.0
    time, steps = 0.0, 0
    p = rates(b, venting, plugged, time, state, work.stages[0])
    points = _record(path, 0, time, work)
    drive = _event_value(b, False, p, state)
    step = 1e-4 / np.max(np.abs(work.stages[0]) / (np.abs(state) + scale))
    while drive > _EVENT_TOLERANCE:
        if points + 2 > path.times.size or time >= time_limit:
            return Status.NOT_CONVERGED.value, points, steps, ejection_time
        to_venting = b.venting_time - time
        starts = not venting and step >= to_venting
        length = to_venting if starts else step
        error, p = _step(b, venting, plugged, time, length, work)
        if not error <= 1.0:
            step = length * (max(0.2, 0.9 * error**-0.2) if error < np.inf else 0.1)
            if not step > 1e-16 * time_limit:
                return Status.UNSTABLE_STEP.value, points, steps, ejection_time
            continue
        step = length * min(5.0, 0.9 * max(error, 1e-10) ** -0.2)
        # The earlier of two events in one step wins: the end of the run is located first.
        new_drive = _event_value(b, False, p, work.new_state)
        if new_drive < 0.0:
            starts = False
            length = _locate(b, False, venting, plugged, time, length, drive, new_drive, work)
            new_drive = 0.0
        after = _event_value(b, True, p, work.new_state) if plugged else 1.0
        ejected = after <= 0.0
        if ejected:
            starts = False
            before = _event_value(b, True, p, state)
            length = _locate(b, True, venting, plugged, time, length, before, after, work)
            ejection_time = time + length
        time = b.venting_time if starts else time + length
        steps += 1
        state[:] = work.new_state
        work.stages[0] = work.stages[6]
        drive = new_drive
        points = _record(path, points, time, work)
        if ejected or starts:
            venting = venting or starts
            plugged = plugged and not ejected
            p = rates(b, venting, plugged, time, state, work.stages[0])
            drive = _event_value(b, False, p, state)
            points = _record(path, points, time, work)
            step = min(step, length)
    return Status.OK.value, points, steps, ejection_time
