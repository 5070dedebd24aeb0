"""March many annuli, sixteen at a time: a lane that has finished takes the next case.

What a lane does in a step is what `castblast.nearfield.march.march` does, from the same functions
in the same order, so that the results are the same bits, whatever runs in the other lanes. The
cases are taken in the order given; with the longest first, few lanes idle at the end.
"""

from __future__ import annotations

import numpy as np

from castblast.explosive.packed import packed_pressure
from castblast.kernel import kernel, lean_kernel
from castblast.nearfield.clock import Clock, Schedule, after_step, is_last, last_step, load_work
from castblast.nearfield.lockstep.lanes import (
    ACTIVE,
    AREA,
    BLOCK,
    DENSITY,
    FASTEST,
    FORCE,
    KICK,
    KICKED,
    LANES,
    LAST,
    LIMIT,
    PER_SECOND,
    RADIUS,
    SHEAR_WORK,
    STEP,
    STIFFNESS,
    TENSILE_WORK,
    VELOCITY,
    VISCOUS_WORK,
    clear_lane,
    kick_and_move,
    load_lane,
    unload_lane,
    update_lanes,
)
from castblast.nearfield.lockstep.merging import load_at_rest, merge_lane
from castblast.nearfield.lockstep.state import (
    IDLE,
    Cases,
    Lanes,
    annulus,
    clock_of,
    coarse_of,
    make_lanes,
    rest_of,
    set_clock,
    with_blocks,
)
from castblast.nearfield.march import (
    AT_REST,
    NOT_CONVERGED,
    OK,
    March,
    kick_boundary,
    kick_of,
    merges_after,
    passed_by,
    prepare,
    schedule_of,
    status_after,
)
from castblast.nearfield.outcome import end_state, histories
from castblast.nearfield.rock.lagrangian import FloatArray, make_body, step_limit
from castblast.nearfield.rock.ledger import (
    BOUNDARY,
    LEDGER_SIZE,
    LOAD,
    RAMP,
    SHEAR,
    TENSION,
    VISCOUS,
    lost_to_growth,
)
from castblast.nearfield.rock.merging import node_mass
from castblast.nearfield.rock.mohr_coulomb import IntArray, make_yield_model

#: Zones in motion for which there is room at first.
_BLOCKS = 160


@kernel
def _start(state: Lanes, cases: Cases, lane: int, row: int, record: FloatArray) -> None:
    """Put a case into a lane."""
    case = annulus(cases, row)
    body, model, _, clock, active = prepare(case)
    last = body.width.size
    ready = min(active + 1, last)
    load_lane(state.zones, state.rows, state.edges, lane, body, case.material, model, ready)
    for j in range(last + 1):
        state.nodes[lane, j], state.origin[lane, j] = body.initial_radius[j], j
    state.rest[lane, 0], state.rest[lane, 1] = body.radial[last - 1], body.tension[last - 1]
    state.rest[lane, 2] = body.shear_multiplier[last - 1]
    state.rest[lane, 3] = body.tensile_multiplier[last - 1]
    for k in range(len(case.coarse)):
        state.coarse[lane, k] = case.coarse[k]
    state.case[lane], state.active[lane] = row, active
    state.steps[lane] = state.zone_steps[lane] = state.fallbacks[lane] = 0
    state.finishing[lane] = 0
    set_clock(state, lane, clock)
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
        if state.case[lane] == IDLE:
            continue
        clock = clock_of(state, lane)
        if is_last(clock):
            clock = last_step(clock)
            state.finishing[lane] = 1
            state.clock[lane, 1] = clock.step
        rows[STEP + lane] = clock.step
        rows[KICK + lane] = kick_of(clock)
        rows[KICKED + lane] = 0.0
        rows[PER_SECOND + lane] = 1.0 / clock.step
        rows[ACTIVE + lane] = state.active[lane]
        state.old_radius[lane] = state.zones[RADIUS + lane]


@kernel
def _after_kick(state: Lanes, cases: Cases) -> int:
    """Let the waves reach their next zone and move outermost nodes; highest number of zones."""
    zones = state.zones
    most = 0
    for lane in range(LANES):
        if state.case[lane] == IDLE:
            continue
        spent = state.rows[KICKED + lane]
        clock = clock_of(state, lane)
        state.rows[VISCOUS_WORK + lane] += lost_to_growth(clock.previous_step, clock.step, spent)
        active, last = state.active[lane], int(state.rows[LAST + lane])
        if active == last:
            _move_boundary(state, cases, lane)
        peak = max(state.peak[lane], abs(zones[VELOCITY + lane]))
        state.peak[lane] = peak
        if active < last and abs(zones[(active - 1) * BLOCK + VELOCITY + lane]) > AT_REST * peak:
            active += 1
            state.active[lane] = active
            state.rows[ACTIVE + lane] = active
            if active < last:
                load_at_rest(
                    zones, state.rows, lane, active, state.nodes[lane], rest_of(state, lane)
                )
        state.zone_steps[lane] += active
        most = max(most, active)
    return most


@kernel
def _move_boundary(state: Lanes, cases: Cases, lane: int) -> None:
    """Kick and move the outermost node of a lane whose wave has arrived there."""
    zones, rows = state.zones, state.rows
    case = annulus(cases, state.case[lane])
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
    return status_after(annulus(cases, row).load, clock, limit, radius)


@lean_kernel
def _finish_step(state: Lanes, cases: Cases, record: FloatArray) -> int:
    """Load the walls, advance the clocks, note the outcome; the number of lanes that are done."""
    zones, rows = state.zones, state.rows
    packed = cases.isentropes
    done = 0
    for lane in range(LANES):
        row = state.case[lane]
        if row == IDLE:
            continue
        before = clock_of(state, lane)
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
        set_clock(state, lane, clock)
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
    case = annulus(cases, row)
    material = case.material
    model = make_yield_model(
        material.bulk_modulus, material.shear_modulus, case.friction, case.dilation
    )
    count = int(state.rows[LAST + lane])
    body = make_body(state.nodes[lane, : count + 1], material, model, case.in_situ_stress)
    unload_lane(state.zones, lane, state.active[lane], body)
    work = np.zeros(LEDGER_SIZE)
    work[SHEAR] = state.rows[SHEAR_WORK + lane]
    work[TENSION] = state.rows[TENSILE_WORK + lane]
    work[VISCOUS] = state.rows[VISCOUS_WORK + lane]
    work[BOUNDARY], work[LOAD] = state.work[lane, 0], state.work[lane, 1]
    work[RAMP] = state.work[lane, 2]
    clock = clock_of(state, lane)
    run = March(
        state.status[lane], body, record[lane, : state.steps[lane] + 1], work, clock.reversal,
        clock.speed, 0.5 * clock.previous_step, state.active[lane], state.steps[lane],
        state.zone_steps[lane], state.fallbacks[lane],
    )  # fmt: skip
    end_state(case, run, cases.holes.total_energy[row], out[row])
    if run.status == OK:
        histories(run.record, points[row])
    state.case[lane] = IDLE
    clear_lane(state.zones, state.rows, lane)


@kernel
def _merge(state: Lanes, lane: int) -> None:
    """Merge the zones of a lane that may."""
    zones, rows = state.zones, state.rows
    clock, stiffness = clock_of(state, lane), rows[STIFFNESS + lane]
    nodes = state.nodes[lane]
    active = merge_lane(
        zones, rows, lane, state.active[lane], nodes, state.origin[lane], rest_of(state, lane),
        coarse_of(state, lane),
        passed_by(
            nodes[0], stiffness, rows[DENSITY + lane], clock, state.schedule[lane, 1]
        ),
        0.5 * clock.previous_step, clock.pressure * zones[RADIUS + lane],
    )  # fmt: skip
    state.active[lane] = active
    state.inner_mass[lane] = node_mass(rows[DENSITY + lane], 0.0, zones[AREA + lane])


@kernel
def _merge_due(state: Lanes) -> None:
    """Merge zones of the lanes whose turn it is."""
    for lane in range(LANES):
        running = state.case[lane] != IDLE and state.status[lane] == NOT_CONVERGED
        if running and merges_after(coarse_of(state, lane), state.steps[lane]):
            _merge(state, lane)


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
    most = int(cases.holes.mesh.zones[order].max())
    blocks = min(most, _BLOCKS)
    state = make_lanes(blocks, most)
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
                if state.case[lane] == IDLE or not ended:
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
            if state.case[lane] != IDLE:
                longest = max(longest, state.steps[lane])
        if longest + 2 > record.shape[1]:
            record = _longer(record)
        _begin_step(state)
        nodes = 0
        for lane in range(LANES):
            if state.case[lane] != IDLE:
                nodes = max(nodes, state.active[lane])
        if nodes + 2 > blocks and blocks < most:
            blocks = min(2 * blocks, most)
            state = with_blocks(state, blocks)
        kick_and_move(state.zones, state.rows, nodes)
        reached = _after_kick(state, cases)
        update_lanes(state.zones, state.rows, reached, state.edges, state.fallbacks)
        done = _finish_step(state, cases, record)
        _merge_due(state)
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
