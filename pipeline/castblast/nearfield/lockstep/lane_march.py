"""March many annuli, sixteen at a time: a lane that has finished takes the next case.

What a lane does in a step is what `castblast.nearfield.march.march` does, from the same functions
in the same order, so that the results are the same bits, whatever runs in the other lanes. The
cases are taken in the order given; with the longest first, few lanes idle at the end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from castblast.explosive.packed import PackedIsentropes, packed_pressure, unpack_isentrope
from castblast.kernel import inline_kernel, kernel, lean_kernel
from castblast.nearfield.clock import (
    Clock,
    Schedule,
    after_step,
    is_last,
    last_step,
    load_work,
)
from castblast.nearfield.lockstep.lanes import (
    ACTIVE,
    BLOCK,
    FASTEST,
    FORCE,
    KICK,
    LANES,
    LAST,
    LIMIT,
    PER_SECOND,
    RADIUS,
    SHEAR_WORK,
    STEP,
    TENSILE_WORK,
    VELOCITY,
    VISCOUS_WORK,
    EdgeModels,
    clear_lane,
    kick_and_move,
    lane_array_sizes,
    load_lane,
    unload_lane,
    update_lanes,
)
from castblast.nearfield.march import (
    AT_REST,
    NOT_CONVERGED,
    OK,
    Annulus,
    March,
    kick_boundary,
    prepare,
    schedule_of,
    status_after,
)
from castblast.nearfield.outcome import end_state, histories
from castblast.nearfield.rock.lagrangian import (
    BOUNDARY,
    LEDGER_SIZE,
    LOAD,
    RAMP,
    SHEAR,
    TENSION,
    VISCOUS,
    FloatArray,
    step_limit,
)
from castblast.nearfield.rock.mohr_coulomb import IntArray
from castblast.nearfield.setup import CommonParameters, HoleParameters, make_annulus

_IDLE = -1


class Lanes(NamedTuple):
    """State of all lanes.

    Attributes
    ----------
    zones, rows : array
        See `castblast.nearfield.lockstep.lanes`.
    edges : EdgeModels
    case, active, steps, zone_steps, fallbacks, status : int array (LANES,)
        Row of the case (-1: idle), zones in motion, steps taken, zones in motion summed over
        them, failed returns, outcome so far.
    finishing : bool array (LANES,)
        The step at hand is the last one.
    clock : array (LANES, 8)
        Fields of `Clock`.
    schedule : array (LANES, 4)
        Fields of `Schedule`.
    charge_radius, inner_mass, outer_mass, old_radius, peak : array (LANES,) [m, kg, kg, m, m/s]
        `old_radius` is that of the wall before the step, `peak` its highest speed so far.
    work : array (LANES, 3) [J/m per radian]
        Boundary, load, ramp.
    """

    zones: FloatArray
    rows: FloatArray
    edges: EdgeModels
    case: IntArray
    active: IntArray
    steps: IntArray
    zone_steps: IntArray
    fallbacks: IntArray
    status: IntArray
    finishing: IntArray
    clock: FloatArray
    schedule: FloatArray
    charge_radius: FloatArray
    inner_mass: FloatArray
    outer_mass: FloatArray
    old_radius: FloatArray
    peak: FloatArray
    work: FloatArray


class Cases(NamedTuple):
    """All cases of a batch.

    Attributes
    ----------
    isentropes : PackedIsentropes
    explosive : int array (n,)
    holes : HoleParameters
    common : CommonParameters
    """

    isentropes: PackedIsentropes
    explosive: IntArray
    holes: HoleParameters
    common: CommonParameters


@kernel
def _annulus(cases: Cases, row: int) -> Annulus:
    isentrope = unpack_isentrope(cases.isentropes, cases.explosive[row])
    return make_annulus(cases.holes, row, cases.common, isentrope)


@kernel
def _make_lanes(zones: int) -> Lanes:
    """All lanes, idle."""
    zone_size, row_size = lane_array_sizes(zones)
    state = Lanes(
        np.zeros(zone_size), np.zeros(row_size),
        EdgeModels(np.zeros((LANES, 11), np.int64), np.zeros((LANES, 11, 3, 3))),
        np.full(LANES, _IDLE), np.zeros(LANES, np.int64), np.zeros(LANES, np.int64),
        np.zeros(LANES, np.int64),
        np.zeros(LANES, np.int64), np.zeros(LANES, np.int64), np.zeros(LANES, np.int64),
        np.zeros((LANES, 8)), np.zeros((LANES, 4)), np.ones(LANES), np.ones(LANES),
        np.ones(LANES), np.zeros(LANES), np.zeros(LANES), np.zeros((LANES, 3)),
    )  # fmt: skip
    for lane in range(LANES):
        clear_lane(state.zones, state.rows, lane)
    return state


@inline_kernel
def _clock(state: Lanes, lane: int) -> Clock:
    c = state.clock
    return Clock(
        c[lane, 0], c[lane, 1], c[lane, 2], c[lane, 3], c[lane, 4], c[lane, 5], c[lane, 6],
        c[lane, 7],
    )  # fmt: skip


@inline_kernel
def _set_clock(state: Lanes, lane: int, clock: Clock) -> None:
    for k in range(len(clock)):
        state.clock[lane, k] = clock[k]


@kernel
def _start(state: Lanes, cases: Cases, lane: int, row: int, record: FloatArray) -> None:
    """Put a case into a lane."""
    case = _annulus(cases, row)
    body, model, _, clock, active = prepare(case)
    load_lane(state.zones, state.rows, state.edges, lane, body, case.material, model)
    state.case[lane], state.active[lane] = row, active
    state.steps[lane] = state.zone_steps[lane] = state.fallbacks[lane] = 0
    state.finishing[lane] = 0
    _set_clock(state, lane, clock)
    schedule = schedule_of(case)
    for k in range(len(schedule)):
        state.schedule[lane, k] = schedule[k]
    state.charge_radius[lane], state.inner_mass[lane] = case.load.charge_radius, body.mass[0]
    state.outer_mass[lane], state.peak[lane] = body.mass[body.width.size], 0.0
    for k in range(state.work.shape[1]):
        state.work[lane, k] = 0.0
    record[lane, 0, 0], record[lane, 0, 1], record[lane, 0, 2] = 0.0, body.radius[0], clock.pressure
    status = status_after(case.load, clock, 1.0, body.radius[0])
    state.status[lane] = NOT_CONVERGED if status == OK else status


@lean_kernel
def _begin_step(state: Lanes) -> None:
    """Set step and kick of every lane."""
    rows = state.rows
    for lane in range(LANES):
        rows[LIMIT + lane] = np.inf
        rows[FASTEST + lane] = 0.0
        if state.case[lane] == _IDLE:
            continue
        clock = _clock(state, lane)
        if is_last(clock):
            clock = last_step(clock)
            state.finishing[lane] = 1
            state.clock[lane, 1] = clock.step
        rows[STEP + lane] = clock.step
        rows[KICK + lane] = 0.5 * (clock.previous_step + clock.step)
        rows[PER_SECOND + lane] = 1.0 / clock.step
        rows[ACTIVE + lane] = state.active[lane]
        state.old_radius[lane] = state.zones[RADIUS + lane]


@lean_kernel
def _after_kick(state: Lanes, cases: Cases) -> int:
    """Let the waves reach their next zone and move outermost nodes; highest number of zones."""
    zones = state.zones
    most = 0
    for lane in range(LANES):
        if state.case[lane] == _IDLE:
            continue
        active, last = state.active[lane], int(state.rows[LAST + lane])
        if active == last:
            _move_boundary(state, cases, lane)
        peak = max(state.peak[lane], abs(zones[VELOCITY + lane]))
        state.peak[lane] = peak
        if active < last and abs(zones[(active - 1) * BLOCK + VELOCITY + lane]) > AT_REST * peak:
            active += 1
            state.active[lane] = active
            state.rows[ACTIVE + lane] = active
        state.zone_steps[lane] += active
        most = max(most, active)
    return most


@kernel
def _move_boundary(state: Lanes, cases: Cases, lane: int) -> None:
    """Kick and move the outermost node of a lane whose wave has arrived there."""
    zones, rows = state.zones, state.rows
    case = _annulus(cases, state.case[lane])
    here = state.active[lane] * BLOCK + lane
    velocity, spent = kick_boundary(
        case, rows[KICK + lane], zones[here + RADIUS], case.outer_radius, zones[here + VELOCITY],
        zones[here + FORCE], state.outer_mass[lane],
    )  # fmt: skip
    zones[here + VELOCITY] = velocity
    zones[here + RADIUS] += rows[STEP + lane] * velocity
    state.work[lane, 0] += spent


@kernel
def _status(cases: Cases, row: int, clock: Clock, limit: float, radius: float) -> int:
    """Status after a step of a case."""
    return status_after(_annulus(cases, row).load, clock, limit, radius)


@lean_kernel
def _finish_step(state: Lanes, cases: Cases, record: FloatArray) -> int:
    """Load the walls, advance the clocks, note the outcome; the number of lanes that are done."""
    zones, rows = state.zones, state.rows
    packed = cases.isentropes
    done = 0
    for lane in range(LANES):
        row = state.case[lane]
        if row == _IDLE:
            continue
        before = _clock(state, lane)
        limit = step_limit(rows[LIMIT + lane], rows[FASTEST + lane], before.step)
        radius = zones[RADIUS + lane]
        ratio = radius / state.charge_radius[lane]
        k = cases.explosive[row]
        full = packed_pressure(packed, k, ratio * ratio)
        s = state.schedule
        clock = after_step(
            Schedule(s[lane, 0], s[lane, 1], s[lane, 2], s[lane, 3]), before, limit, full, radius,
            zones[FORCE + lane], zones[VELOCITY + lane], state.inner_mass[lane],
        )  # fmt: skip
        zones[FORCE + lane] += clock.pressure * radius
        work, ramp = load_work(before, clock, state.old_radius[lane], radius)
        state.work[lane, 1] += work
        state.work[lane, 2] += ramp
        _set_clock(state, lane, clock)
        steps = state.steps[lane] + 1
        state.steps[lane] = steps
        record[lane, steps, 0] = clock.time
        record[lane, steps, 1] = radius
        record[lane, steps, 2] = clock.pressure
        finishing = state.finishing[lane] == 1
        # Whether all is well is looked at closely only where it may not be.
        if finishing or packed.tabulated[k] or not (limit > 0.0 and np.isfinite(clock.speed)):
            status = _status(cases, row, clock, limit, radius)
            if finishing or status != OK:
                state.status[lane] = status
        done += 1 if state.status[lane] != NOT_CONVERGED else 0
    return done


@kernel
def _retire(
    state: Lanes, cases: Cases, lane: int, record: FloatArray, out: FloatArray, points: FloatArray
) -> None:
    """Read the end state of a lane and leave it idle."""
    row = state.case[lane]
    case = _annulus(cases, row)
    body = prepare(case)[0]
    unload_lane(state.zones, lane, body)
    work = np.zeros(LEDGER_SIZE)
    work[SHEAR] = state.rows[SHEAR_WORK + lane]
    work[TENSION] = state.rows[TENSILE_WORK + lane]
    work[VISCOUS] = state.rows[VISCOUS_WORK + lane]
    work[BOUNDARY], work[LOAD] = state.work[lane, 0], state.work[lane, 1]
    work[RAMP] = state.work[lane, 2]
    clock = _clock(state, lane)
    run = March(
        state.status[lane], body, record[lane, : state.steps[lane] + 1], work, clock.reversal,
        clock.speed, 0.5 * clock.previous_step, state.active[lane], state.steps[lane],
        state.zone_steps[lane], state.fallbacks[lane],
    )  # fmt: skip
    end_state(case, run, cases.holes.total_energy[row], out[row])
    if run.status == OK:
        histories(run.record, points[row])
    state.case[lane] = _IDLE
    clear_lane(state.zones, state.rows, lane)


@kernel
def march_many(
    cases: Cases, order: IntArray, max_steps: int, out: FloatArray, points: FloatArray
) -> None:
    """Run cases to their end states.

    Parameters
    ----------
    cases : Cases
    order : int array (m,)
        Rows to run, in the order in which they are begun.
    max_steps : int
        Of a case.
    out : array (n, len(STATE_NAMES))
        The rows of `order` are filled.
    points : array (n, 3, history points)
        Time, pressure and radius; filled where there is an end state.
    """
    state = _make_lanes(int(cases.holes.zones[order].max()))
    record = np.empty((LANES, 2048, 3))
    taken = running = longest = 0
    for lane in range(min(LANES, order.size)):
        _start(state, cases, lane, order[taken], record)
        taken += 1
        running += 1
    done = 1  # a case may have ended before its first step
    while running > 0:
        while done > 0:
            done = 0
            for lane in range(LANES):
                ended = state.status[lane] != NOT_CONVERGED or state.steps[lane] >= max_steps
                if state.case[lane] == _IDLE or not ended:
                    continue
                _retire(state, cases, lane, record, out, points)
                running -= 1
                if taken < order.size:
                    _start(state, cases, lane, order[taken], record)
                    taken += 1
                    running += 1
                    done += 1 if state.status[lane] != NOT_CONVERGED else 0
        if running == 0:
            break
        longest = 0
        for lane in range(LANES):
            if state.case[lane] != _IDLE:
                longest = max(longest, state.steps[lane])
        if longest + 2 > record.shape[1]:
            record = _longer(record)
        _begin_step(state)
        nodes = 0
        for lane in range(LANES):
            if state.case[lane] != _IDLE:
                nodes = max(nodes, state.active[lane])
        kick_and_move(state.zones, state.rows, nodes)
        most = _after_kick(state, cases)
        update_lanes(state.zones, state.rows, most, state.edges, state.fallbacks)
        done = _finish_step(state, cases, record)
        if longest + 1 >= max_steps:
            done += 1


@kernel
def _longer(record: FloatArray) -> FloatArray:
    """The record with twice as many rows."""
    longer = np.empty((LANES, 2 * record.shape[1], 3))
    for lane in range(LANES):
        for k in range(record.shape[1]):
            for i in range(3):
                longer[lane, k, i] = record[lane, k, i]
    return longer
