"""Explicit adaptive integration of the burden motion, with steps that end on its switches.

The right-hand side jumps where venting starts and where the stemming leaves the hole. Steps end
exactly on these times, and on the time at which the gas stops pushing, so that the result is a
smooth function of the inputs, without noise of the step size.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from castblast.burden.balance import CORE_SIZE, STATE_SIZE, Balance, rates
from castblast.burden.runge_kutta import (
    CHOKE,
    EJECTION,
    END_OF_PUSH,
    EVENT_TOLERANCE,
    NO_EVENT,
    STEMMING_HOLDS,
    SWITCHES,
    Phase,
    Work,
    event_value,
    step_to_event,
    take_step,
)
from castblast.errors import Status
from castblast.kernel import kernel, lean_kernel
from castblast.types import BoolArray, FloatArray

MAX_STEPS: Final = 6000
#: A trial step with a greater error over the tolerance says nothing of events.
_WORTH_LOCATING: Final = 1e3
#: First step after an event over the step that was tried when it came.
_RESTART: Final = 0.7
#: Columns of `Path.phases`.
VENTING: Final = 0
PLUGGED: Final = 1


class Path(NamedTuple):
    """Accepted points of the integrator, reused from case to case.

    Attributes
    ----------
    times : array (n,) [s]
    states : array (n, 5)
        SI units, without the integrals of the ledger.
    phases : bool array (n, 2)
        Venting and plugged, in the step that starts at the point.
    """

    times: FloatArray
    states: FloatArray
    phases: BoolArray


@kernel
def make_path() -> Path:
    """Make room for the longest path."""
    return Path(
        np.empty(MAX_STEPS + 1),
        np.empty((MAX_STEPS + 1, CORE_SIZE)),
        np.empty((MAX_STEPS + 1, 2), dtype=np.bool_),
    )


@lean_kernel
def _record(path: Path, point: int, phase: Phase, time: float, state: FloatArray) -> None:
    path.times[point] = time
    for i in range(CORE_SIZE):
        path.states[point, i] = state[i]
    path.phases[point, VENTING] = phase.venting
    path.phases[point, PLUGGED] = phase.plugged


@lean_kernel
def _end_on_first_event(
    b: Balance, phase: Phase, time: float, step: float, error: float, work: Work
) -> tuple[int, float, float]:
    """Shorten a step that passes events so that it ends on the first of them.

    Returns the event, the length of the step [s] and its error over the tolerance.
    """
    first = NO_EVENT
    for event in range(SWITCHES):
        if not phase.plugged and event in (EJECTION, STEMMING_HOLDS):
            continue
        # An event located earlier in this loop has shortened the step.
        side = work.sides[event]
        if event_value(b, event, side, time + step, work.new_state) <= 0.0:
            step, error = step_to_event(b, phase, event, side, time, step, work)
            first = event
    return first, step, error


@lean_kernel
def _start(b: Balance, work: Work) -> float:
    """Note on which side of each switch the run starts; return a first step [s]."""
    for event in range(SWITCHES):
        behind = event_value(b, event, 1.0, 0.0, work.state) < 0.0
        work.sides[event] = -1.0 if behind and event in (CHOKE, STEMMING_HOLDS) else 1.0
    fastest = 0.0
    for i in range(STATE_SIZE):
        relative = abs(work.stages[0, i]) / (abs(work.state[i]) + work.scale[i])
        fastest = max(fastest, relative)
    return float(1e-2 / fastest)


@lean_kernel
def integrate(b: Balance, time_limit: float, work: Work, path: Path) -> tuple[int, int, float]:
    """Integrate until the gas stops pushing the burden faster.

    Parameters
    ----------
    b : Balance
    time_limit : float [s]
        Without an end by then the run has not converged.
    work : Work
        With the state at time zero, which becomes the one at the end, and its scale.
    path : Path
        Filled from row 0.

    Returns
    -------
    status, steps : int
        Outcome and accepted steps; the end of the path is its row `steps`.
    ejection_time : float [s]
        inf if the stemming stays.
    """
    phase = Phase(False, b.stemming_length > 0.0)
    ejection_time = np.inf if phase.plugged else 0.0
    time, steps, event = 0.0, 0, NO_EVENT
    rates(b, phase.venting, phase.plugged, time, work.state, work.stages[0])
    if event_value(b, END_OF_PUSH, 1.0, time, work.state) <= EVENT_TOLERANCE:
        event = END_OF_PUSH
    step = _start(b, work)
    _record(path, 0, phase, time, work.state)
    last_length, last_error, rejected = 0.0, 1.0, False
    while event != END_OF_PUSH:
        if steps == MAX_STEPS or time >= time_limit:
            return Status.NOT_CONVERGED.value, steps, ejection_time
        to_venting = b.venting_time - time
        starts = not phase.venting and step >= to_venting
        tried = to_venting if starts else step
        length, event = tried, NO_EVENT
        error = take_step(b, phase, time, length, work)
        if error < _WORTH_LOCATING:
            event, length, error = _end_on_first_event(b, phase, time, tried, error, work)
        if not error <= 1.0:
            step = length * (max(0.2, 0.9 * error**-0.125) if error < np.inf else 0.1)
            if not step > 1e-16 * time_limit:
                return Status.UNSTABLE_STEP.value, steps, ejection_time
            event, rejected = NO_EVENT, True
            continue
        starts = starts and event == NO_EVENT
        time = b.venting_time if starts else time + length
        steps += 1
        for i in range(STATE_SIZE):
            work.state[i] = work.new_state[i]
        if starts or event != NO_EVENT:
            step, last_length = _RESTART * step, 0.0
            if event == EJECTION:
                ejection_time = time
            elif event != NO_EVENT:
                work.sides[event] = -work.sides[event]
            phase = Phase(phase.venting or starts, phase.plugged and event != EJECTION)
        else:
            error = max(error, 1e-8)
            growth = 0.9 * error**-0.125
            # Predictive control (Gustafsson 1994): goes on shrinking where steps have to shrink.
            growth = min(growth, growth * length / last_length * (last_error / error) ** 0.125)
            step = length * max(0.2, min(growth, 1.0 if rejected else 6.0))
            last_length, last_error = length, error
        rejected = False
        rates(b, phase.venting, phase.plugged, time, work.state, work.stages[0])
        _record(path, steps, phase, time, work.state)
    return Status.OK.value, steps, ejection_time
