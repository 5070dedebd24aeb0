"""One step of the burden motion by the method of `dop853`, and steps that end on an event.

A point between two accepted points is reached by one shorter step from the earlier one, so that
events, the time of 95 percent of the velocity and the histories are as accurate as the path
itself; nothing is interpolated.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from castblast.burden.balance import (
    CORE_SIZE,
    DISPLACEMENT,
    GAS_MASS,
    PLUG_DISPLACEMENT,
    PLUG_VELOCITY,
    STATE_SIZE,
    VELOCITY,
    Balance,
    loaded_area,
    rates,
    relative_volume,
)
from castblast.burden.dop853 import FIFTH_ORDER_ERROR, NODES, STAGES, THIRD_ORDER_ERROR, WEIGHTS
from castblast.burden.stemming import push_margin
from castblast.burden.venting import ATMOSPHERIC_PRESSURE, choke_margin
from castblast.explosive.isentrope import gas_state
from castblast.kernel import kernel, lean_kernel
from castblast.types import FloatArray

STAGE_COUNT: Final = 12
RELATIVE_TOLERANCE: Final = 1e-9
#: Tolerance in units of the natural scale of each state, for states that start at zero.
ABSOLUTE_TOLERANCE: Final = 1e-11
EVENT_TOLERANCE: Final = 1e-12
#: Where the right-hand side has a kink only, a miss by d costs an error of the order of d^2.
_KINK_TOLERANCE: Final = 1e-6
#: The run ends at this pressure over the open air, where acceleration has all but ended.
_END_PRESSURE: Final = 1.01 * ATMOSPHERIC_PRESSURE

# Events at which a step can end. At the last two switches the right-hand side has a kink.
NO_EVENT: Final = -1
END_OF_PUSH: Final = 0
EJECTION: Final = 1
CHOKE: Final = 2
STEMMING_HOLDS: Final = 3
SWITCHES: Final = 4
REACHED_VELOCITY: Final = 4


class Phase(NamedTuple):
    """Which right-hand side holds: does gas vent at the face, is the stemming in the hole."""

    venting: bool
    plugged: bool


class Work(NamedTuple):
    """Arrays of the integrator, reused from case to case.

    Attributes
    ----------
    state, new_state : array (11,)
        At both ends of a step.
    stages : array (13, 11)
        Rates: row 0 at the start of a step, rows 1 to 11 its stages, row 12 at its end.
    scale : array (11,)
        Natural size of each state.
    combinations : array (3, 11)
        Sums over the stages for the step and its two error formulas.
    sides : array (4,)
        For each switch 1 before it and, where it can come back, -1 behind it.
    """

    state: FloatArray
    new_state: FloatArray
    stages: FloatArray
    scale: FloatArray
    combinations: FloatArray
    sides: FloatArray


@kernel
def make_work() -> Work:
    """Make the arrays of the integrator."""
    return Work(
        state=np.zeros(STATE_SIZE),
        new_state=np.zeros(STATE_SIZE),
        stages=np.zeros((STAGE_COUNT + 1, STATE_SIZE)),
        scale=np.ones(STATE_SIZE),
        combinations=np.zeros((3, STATE_SIZE)),
        sides=np.ones(SWITCHES),
    )


@lean_kernel
def take_step(b: Balance, phase: Phase, time: float, step: float, work: Work) -> float:
    """Take one step from `work.state`, whose rate is in row 0 of the stages, to `work.new_state`.

    Returns
    -------
    float
        Error over the tolerance, NaN if the step left the domain of the model.

    Notes
    -----
    Ledger integrals do not act back, so that their stages need not be formed.
    """
    state, new_state, stages = work.state, work.new_state, work.stages
    for stage in range(1, STAGE_COUNT):
        mass, distance, velocity, plug_distance, plug_velocity = 0.0, 0.0, 0.0, 0.0, 0.0
        for earlier in range(stage):
            share = STAGES[stage, earlier]
            mass += share * stages[earlier, GAS_MASS]
            distance += share * stages[earlier, DISPLACEMENT]
            velocity += share * stages[earlier, VELOCITY]
            plug_distance += share * stages[earlier, PLUG_DISPLACEMENT]
            plug_velocity += share * stages[earlier, PLUG_VELOCITY]
        new_state[GAS_MASS] = state[GAS_MASS] + step * mass
        new_state[DISPLACEMENT] = state[DISPLACEMENT] + step * distance
        new_state[VELOCITY] = state[VELOCITY] + step * velocity
        new_state[PLUG_DISPLACEMENT] = state[PLUG_DISPLACEMENT] + step * plug_distance
        new_state[PLUG_VELOCITY] = state[PLUG_VELOCITY] + step * plug_velocity
        stage_time = time + NODES[stage] * step
        rates(b, phase.venting, phase.plugged, stage_time, new_state, stages[stage])
    increment, fifth, third = work.combinations[0], work.combinations[1], work.combinations[2]
    for i in range(STATE_SIZE):
        increment[i], fifth[i], third[i] = 0.0, 0.0, 0.0
    for stage in range(STAGE_COUNT):
        for i in range(STATE_SIZE):
            increment[i] += WEIGHTS[stage] * stages[stage, i]
            fifth[i] += FIFTH_ORDER_ERROR[stage] * stages[stage, i]
            third[i] += THIRD_ORDER_ERROR[stage] * stages[stage, i]
    fifth_sum, third_sum = 0.0, 0.0
    for i in range(STATE_SIZE):
        new_state[i] = state[i] + step * increment[i]
        size = max(abs(state[i]), abs(new_state[i]))
        allowed = RELATIVE_TOLERANCE * size + ABSOLUTE_TOLERANCE * work.scale[i]
        fifth_sum += (fifth[i] / allowed) ** 2
        third_sum += (third[i] / allowed) ** 2
    # Error estimate of Hairer, Norsett & Wanner (1993), equation II.10.17.
    weight = np.sqrt((fifth_sum + 0.01 * third_sum) * STATE_SIZE)
    return float(abs(step) * fifth_sum / weight) if weight > 0.0 else weight


@lean_kernel
def event_value(b: Balance, event: int, target: float, time: float, state: FloatArray) -> float:
    """Share of an event still to come: positive before, 0 where it happens, negative beyond.

    Parameters
    ----------
    b : Balance
    event : int
        End of push: force that still drives the burden over that of the open air. Ejection:
        stemming in the hole over its length. Choke: the nozzle flow is choked. Stemming holds:
        the gas does not push it. Reached velocity: what is missing over the `target`.
    target : float
        Velocity [m s-1]; for choke and hold 1, or -1 where the opposite is awaited.
    time : float [s]
    state : array (11,)
    """
    if event == EJECTION:
        return float(1.0 - state[PLUG_DISPLACEMENT] / b.stemming_length)
    if event == REACHED_VELOCITY:
        return float(1.0 - state[VELOCITY] / target)
    p, k, _ = gas_state(b.isentrope, relative_volume(b, time, state))
    if event == CHOKE:
        return target * choke_margin(p, k)
    if event == STEMMING_HOLDS:
        return target * push_margin(p, state[PLUG_DISPLACEMENT], b.stemming_length, b.wall_rate)
    area = loaded_area(b, state[DISPLACEMENT])
    return float(((p - _END_PRESSURE) * area - b.friction_force) / (ATMOSPHERIC_PRESSURE * area))


@lean_kernel
def _event_slope(
    b: Balance, event: int, target: float, time: float, state: FloatArray, rate: FloatArray,
    step: float, work: Work,
) -> float:  # fmt: skip
    """Time derivative of an event value [s-1] along the path, by a central difference."""
    probe = work.stages[STAGE_COUNT - 1]
    h = 1e-5 * step
    for i in range(CORE_SIZE):
        probe[i] = state[i] + h * rate[i]
    above = event_value(b, event, target, time + h, probe)
    for i in range(CORE_SIZE):
        probe[i] = state[i] - h * rate[i]
    return (above - event_value(b, event, target, time - h, probe)) / (2.0 * h)


@lean_kernel
def _inverse_hermite(
    low: float, high: float, before: float, after: float, slope_low: float, slope_high: float
) -> float:
    """Zero of an event between `low` and `high`: cubic Hermite for time over the event value.

    Halves the bracket where the event value does not fall at both ends.
    """
    gap = after - before
    s = -before / gap
    d0, d1 = gap / slope_low, gap / slope_high
    rise = high - low
    guess = low + s * (d0 + s * (3.0 * rise - 2.0 * d0 - d1 + s * (d0 + d1 - 2.0 * rise)))
    if slope_low < 0.0 and slope_high < 0.0 and low < guess and guess < high:
        return guess
    return low + 0.5 * rise


@lean_kernel
def step_to_event(
    b: Balance, phase: Phase, event: int, target: float, time: float, step: float, work: Work
) -> tuple[float, float]:
    """Shorten a step so that it ends on an event; `work.new_state` becomes the state there.

    On entry `work.new_state` is the end of the full step, in which the event must be passed.

    Returns
    -------
    step, error : float
        Length in s, and error over the tolerance as from `take_step`.
    """
    tolerance = _KINK_TOLERANCE if event in (CHOKE, STEMMING_HOLDS) else EVENT_TOLERANCE
    low, high, trial, error = 0.0, step, step, 0.0
    before = event_value(b, event, target, time, work.state)
    slope_low = _event_slope(b, event, target, time, work.state, work.stages[0], step, work)
    after, slope_high = 0.0, 0.0
    for attempt in range(1, 60):
        end, end_rate = time + trial, work.stages[STAGE_COUNT]
        rates(b, phase.venting, phase.plugged, end, work.new_state, end_rate)
        value = event_value(b, event, target, end, work.new_state)
        if abs(value) <= tolerance or high - low <= EVENT_TOLERANCE * step:
            break
        slope = _event_slope(b, event, target, end, work.new_state, end_rate, step, work)
        if value > 0.0:
            low, before, slope_low = trial, value, slope
        else:
            high, after, slope_high = trial, value, slope
        if attempt % 4 == 0:
            trial = 0.5 * (low + high)
        else:
            trial = _inverse_hermite(low, high, before, after, slope_low, slope_high)
        error = take_step(b, phase, time, trial, work)
    return trial, error
