r"""March an annulus of rock in time under the load on its wall.

Leapfrog: velocities at half steps, everything else at whole steps. A step is limited by the
tangent wave speed and the viscosity of every zone and may grow by 5 percent at a time. Zones the
signal has not reached are left out; they are exactly at rest.

The outer boundary is quiet, an impedance rho c_p for waves (Lysmer & Kuhlemeyer 1969) plus the
stiffness 2 G / r of the elastic rock beyond, so that the static limit is right too; or it is a
free surface under the in-situ stress.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from castblast.errors import Status
from castblast.explosive.isentrope import ProductIsentrope, inside_table, pressure
from castblast.kernel import inline_kernel, kernel
from castblast.nearfield.clock import (
    Clock,
    Schedule,
    after_step,
    is_last,
    last_step,
    load_work,
    start_clock,
)
from castblast.nearfield.rock.body_merging import merge_body
from castblast.nearfield.rock.lagrangian import (
    Body,
    FloatArray,
    Material,
    graded_radii,
    make_body,
    update_zones,
)
from castblast.nearfield.rock.ledger import (
    BOUNDARY,
    LEDGER_SIZE,
    LOAD,
    RAMP,
    VISCOUS,
    lost_to_growth,
)
from castblast.nearfield.rock.merging import EVERY, Coarse, Passed
from castblast.nearfield.rock.mohr_coulomb import YieldModel, make_yield_model

OK = int(Status.OK)
NOT_CONVERGED = int(Status.NOT_CONVERGED)
UNSTABLE = int(Status.UNSTABLE_STEP)
OUT_OF_TABLE = int(Status.OUT_OF_ISENTROPE)

#: Share of the highest wall speed so far below which rock counts as not yet reached.
AT_REST = 1e-7
#: Zones in motion at the start.
FIRST_ZONES = 4


class WallLoad(NamedTuple):
    """Pressure on the hole wall.

    Attributes
    ----------
    gas : bool
        True: products on their isentrope; False: `target_pressure`.
    isentrope : ProductIsentrope
    charge_radius : float [m]
        Radius at which the relative volume is 1.
    start_pressure, target_pressure : float [Pa]
        Pressure at time zero, and the prescribed pressure after the rise (no gas).
    rise_time : float [s]
        Linear rise from the start pressure to the full one.
    """

    gas: bool
    isentrope: ProductIsentrope
    charge_radius: float
    start_pressure: float
    target_pressure: float
    rise_time: float


class Annulus(NamedTuple):
    """Everything a march needs.

    Attributes
    ----------
    material : Material
    friction, dilation : float [-]
        N of the friction and of the dilation angle.
    inner_radius, outer_radius, first_width, reach : float [m]
        The mesh, see `graded_radii`.
    zones : float
        See `graded_radii`.
    coarse : Coarse
        Widths up to which zones merge behind the front of the wave.
    in_situ_stress : float [Pa]
    quiet : bool
        Quiet outer boundary; False: free surface under the in-situ stress.
    load : WallLoad
    end_time : float [s]
        0: end by `settling_factor`.
    settling_factor : float [-]
        End at this multiple of the time at which the wall first turns back.
    courant : float [-]
        Share of the largest stable step.
    max_steps : int
    """

    material: Material
    friction: float
    dilation: float
    inner_radius: float
    outer_radius: float
    first_width: float
    reach: float
    zones: float
    coarse: Coarse
    in_situ_stress: float
    quiet: bool
    load: WallLoad
    end_time: float
    settling_factor: float
    courant: float
    max_steps: int


class March(NamedTuple):
    """What a march leaves behind.

    Attributes
    ----------
    status : int
    body : Body
    record : array (steps + 1, 3)
        Time [s], wall radius [m] and wall pressure [Pa] after every step.
    work : array (6,) [J/m per radian]
        Ledger: shear, tension, viscous, boundary, load, ramp.
    reversal_time : float [s]
        When the wall first turned back; 0: it did not.
    wall_velocity : float [m s-1]
    half_kick : float [s]
        Time by which the velocities of `body` lag behind its positions.
    active : int
        Zones that the wave has reached.
    steps, zone_steps, fallbacks : int
        Steps, zones in motion summed over them, failed stress returns.
    """

    status: int
    body: Body
    record: FloatArray
    work: FloatArray
    reversal_time: float
    wall_velocity: float
    half_kick: float
    active: int
    steps: int
    zone_steps: int
    fallbacks: int


@kernel
def full_pressure(load: WallLoad, radius: float) -> float:
    """Wall pressure [Pa] once the rise is over, at a hole radius [m]."""
    if load.gas:
        ratio = radius / load.charge_radius
        return pressure(load.isentrope, ratio * ratio)
    return load.target_pressure


@kernel
def _kick(body: Body, active: int, clock: Clock, case: Annulus, work: FloatArray) -> None:
    """Advance the velocities to the middle of the next step; the outer node feels its boundary.

    The node at the edge of the active zones rests: the force of the next zone is not known there.
    """
    last = body.width.size
    dt = kick_of(clock)
    spent = 0.0
    for i in range(active):
        gained = dt * body.force[i] * body.per_mass[i]
        body.velocity[i] += gained
        spent += body.force[i] * gained
    work[VISCOUS] += lost_to_growth(clock.previous_step, clock.step, spent)
    if active == last:
        body.velocity[last], spent = kick_boundary(
            case, dt, body.radius[last], body.initial_radius[last], body.velocity[last],
            body.force[last], body.mass[last],
        )  # fmt: skip
        work[BOUNDARY] += spent


@inline_kernel
def kick_of(clock: Clock) -> float:
    """Time [s] from the middle of the last step to that of the next."""
    return 0.5 * (clock.previous_step + clock.step)


@inline_kernel
def kick_boundary(
    case: Annulus, dt: float, radius: float, initial: float, old: float, force: float, mass: float
) -> tuple[float, float]:
    """Velocity of the outermost node after a kick, and what it spent on its boundary."""
    force = force - case.in_situ_stress * radius
    damping = 0.0
    spring = 0.0
    if case.quiet:
        m = case.material
        stiffness = m.bulk_modulus + 4.0 / 3.0 * m.shear_modulus
        damping = dt * np.sqrt(stiffness * m.density) * radius / mass
        spring = 2.0 * m.shear_modulus * (radius - initial)
    new = ((1.0 - 0.5 * damping) * old + dt * (force - spring) / mass) / (1.0 + 0.5 * damping)
    mean = 0.5 * (old + new)
    resistance = case.in_situ_stress * radius + spring + damping * mass / dt * mean
    return new, resistance * mean * dt


@kernel
def _longer(record: FloatArray, used: int) -> FloatArray:
    """Return the record with at least one free row."""
    if used < record.shape[0]:
        return record
    longer = np.empty((2 * record.shape[0], 3))
    for k in range(used):
        for i in range(3):
            longer[k, i] = record[k, i]
    return longer


@inline_kernel
def schedule_of(case: Annulus) -> Schedule:
    """What the clock of a case needs."""
    load = case.load
    return Schedule(load.start_pressure, load.rise_time, case.settling_factor, case.courant)


@kernel
def prepare(case: Annulus) -> tuple[Body, YieldModel, FloatArray, Clock, int]:
    """Body under the pressure of time zero, yield model, ledger, clock, zones in motion."""
    material, load = case.material, case.load
    nodes = graded_radii(
        case.inner_radius, case.outer_radius, case.zones, case.first_width, case.reach
    )
    model = make_yield_model(
        material.bulk_modulus, material.shear_modulus, case.friction, case.dilation
    )
    body = make_body(nodes, material, model, case.in_situ_stress)
    work = np.zeros(LEDGER_SIZE)
    active = min(FIRST_ZONES, body.width.size)
    transit = body.width[0] / np.sqrt(model.planes.stiffness / material.density)
    update_zones(body, active, 1e-9 * transit, material, model, work)
    full = full_pressure(load, body.radius[0])
    clock = start_clock(schedule_of(case), 1e-2 * case.courant * transit, case.end_time, full)
    body.force[0] += clock.pressure * body.radius[0]
    return body, model, work, clock, active


@kernel
def status_after(load: WallLoad, clock: Clock, limit: float, radius: float) -> int:
    """What a step led to: OK, a zone turned inside out, or gas beyond its isentrope."""
    if limit <= 0.0 or not np.isfinite(clock.speed):
        return UNSTABLE
    if load.gas and not inside_table(load.isentrope, (radius / load.charge_radius) ** 2):
        return OUT_OF_TABLE
    return OK


@inline_kernel
def merges_after(coarse: Coarse, steps: int) -> bool:
    """Say whether zones may merge after so many steps."""
    return coarse.first > 0.0 and steps % EVERY == 0


@inline_kernel
def passed_by(
    wall: float, stiffness: float, density: float, clock: Clock, rise_time: float
) -> Passed:
    """How far the wave that left the wall at the end of the rise has come."""
    front = wall + np.sqrt(stiffness / density) * (clock.time - rise_time)
    return Passed(wall=wall, front=front, turned=clock.reversal > 0.0)


@kernel
def march(case: Annulus) -> March:
    """Run an annulus to its end state."""
    load = case.load
    schedule = schedule_of(case)
    body, model, work, clock, active = prepare(case)
    origin = np.arange(body.radius.size)
    record = np.empty((2048, 3))
    record[0, 0], record[0, 1], record[0, 2] = 0.0, body.radius[0], clock.pressure
    peak = 0.0
    status = status_after(load, clock, 1.0, body.radius[0])
    steps, zone_steps, fallbacks = 0, 0, 0
    if status == OK:
        status = NOT_CONVERGED
    while status == NOT_CONVERGED and steps < case.max_steps:
        finished = is_last(clock)
        if finished:
            clock = last_step(clock)
        _kick(body, active, clock, case, work)
        peak = max(peak, abs(body.velocity[0]))
        if active < body.width.size and abs(body.velocity[active - 1]) > AT_REST * peak:
            active += 1
        old_radius = body.radius[0]
        for i in range(active + 1):
            body.radius[i] += clock.step * body.velocity[i]
        steps += 1
        zone_steps += active
        limit, failed = update_zones(body, active, clock.step, case.material, model, work)
        fallbacks += failed
        radius = body.radius[0]
        before = clock
        clock = after_step(
            schedule, clock, limit, full_pressure(load, radius), radius, body.force[0],
            body.velocity[0], body.mass[0],
        )  # fmt: skip
        body.force[0] += clock.pressure * radius
        done, ramp = load_work(before, clock, old_radius, radius)
        work[LOAD] += done
        work[RAMP] += ramp
        record = _longer(record, steps)
        record[steps, 0], record[steps, 1], record[steps, 2] = clock.time, radius, clock.pressure
        status = status_after(load, clock, limit, radius)
        if status == OK and not finished:
            status = NOT_CONVERGED
        if status == NOT_CONVERGED and merges_after(case.coarse, steps):
            passed = passed_by(
                case.inner_radius, model.planes.stiffness, case.material.density, clock,
                load.rise_time,
            )  # fmt: skip
            body, active = merge_body(
                body, origin, active, case.coarse, passed, 0.5 * clock.previous_step,
                clock.pressure * radius, case.material.density, model.planes, work,
            )  # fmt: skip
    return March(
        status, body, record[: steps + 1].copy(), work, clock.reversal, clock.speed,
        0.5 * clock.previous_step, active, steps, zone_steps, fallbacks,
    )  # fmt: skip
