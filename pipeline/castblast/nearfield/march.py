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
from castblast.kernel import kernel
from castblast.nearfield.lagrangian import (
    BOUNDARY,
    LEDGER_SIZE,
    LOAD,
    RAMP,
    Body,
    FloatArray,
    Material,
    graded_radii,
    make_body,
    update_zones,
)
from castblast.nearfield.mohr_coulomb import make_yield_model

_OK = int(Status.OK)
_NOT_CONVERGED = int(Status.NOT_CONVERGED)
_UNSTABLE = int(Status.UNSTABLE_STEP)
_OUT_OF_TABLE = int(Status.OUT_OF_ISENTROPE)

#: A step may be at most this much longer than the one before.
STEP_GROWTH = 1.05
#: Share of the highest wall speed so far below which rock counts as not yet reached.
_AT_REST = 1e-9


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
    inner_radius, outer_radius, first_width : float [m]
    zones : int
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
    zones: int
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
    steps, fallbacks : int
    """

    status: int
    body: Body
    record: FloatArray
    work: FloatArray
    reversal_time: float
    wall_velocity: float
    half_kick: float
    steps: int
    fallbacks: int


@kernel
def full_pressure(load: WallLoad, radius: float) -> float:
    """Wall pressure [Pa] once the rise is over, at a hole radius [m]."""
    if load.gas:
        ratio = radius / load.charge_radius
        return pressure(load.isentrope, ratio * ratio)
    return load.target_pressure


@kernel
def wall_pressure(load: WallLoad, time: float, radius: float) -> float:
    """Wall pressure [Pa] at a time [s] and hole radius [m]."""
    full = full_pressure(load, radius)
    if time >= load.rise_time:
        return full
    return load.start_pressure + time / load.rise_time * (full - load.start_pressure)


@kernel
def _kick(body: Body, active: int, dt: float, case: Annulus, work: FloatArray) -> None:
    """Advance the velocities by `dt`; the outer node feels its boundary.

    The node at the edge of the active zones rests: the force of the next zone is not known there.
    """
    last = case.zones
    for i in range(active):
        body.velocity[i] += dt * body.force[i] / body.mass[i]
    if active < last:
        return
    radius = body.radius[last]
    force = body.force[last] - case.in_situ_stress * radius
    old = body.velocity[last]
    damping = 0.0
    spring = 0.0
    if case.quiet:
        m = case.material
        stiffness = m.bulk_modulus + 4.0 / 3.0 * m.shear_modulus
        damping = dt * np.sqrt(stiffness * m.density) * radius / body.mass[last]
        spring = 2.0 * m.shear_modulus * (radius - body.initial_radius[last])
    new = ((1.0 - 0.5 * damping) * old + dt * (force - spring) / body.mass[last]) / (
        1.0 + 0.5 * damping
    )
    body.velocity[last] = new
    mean = 0.5 * (old + new)
    resistance = case.in_situ_stress * radius + spring + damping * body.mass[last] / dt * mean
    work[BOUNDARY] += resistance * mean * dt


@kernel
def _load_work(
    load: WallLoad, old_radius: float, new_radius: float, old: float, new: float, work: FloatArray
) -> None:
    """Book the work of the wall pressure and what a pressure without rise time would add."""
    growth = 0.5 * (new_radius * new_radius - old_radius * old_radius)
    work[LOAD] += 0.5 * (old + new) * growth
    lost = full_pressure(load, old_radius) - old + full_pressure(load, new_radius) - new
    work[RAMP] += 0.5 * lost * growth


@kernel
def _longer(record: FloatArray, used: int) -> FloatArray:
    """Return the record with at least one free row."""
    if used < record.shape[0]:
        return record
    longer = np.empty((2 * record.shape[0], 3))
    longer[:used] = record
    return longer


@kernel
def march(case: Annulus) -> March:
    """Run an annulus to its end state.

    The wall is taken to have turned back when its velocity, interpolated in time, passes zero
    after the rise of the load.
    """
    material, load = case.material, case.load
    nodes = graded_radii(case.inner_radius, case.outer_radius, case.zones, case.first_width)
    body = make_body(nodes, material, case.in_situ_stress)
    model = make_yield_model(
        material.bulk_modulus, material.shear_modulus, case.friction, case.dilation
    )
    work = np.zeros(LEDGER_SIZE)
    wave_speed = np.sqrt(model.stiffness / material.density)
    record = np.empty((2048, 3))
    time = 0.0
    active = min(4, case.zones)
    dt = 1e-9 * body.width[0] / wave_speed
    _, fallbacks = update_zones(body, active, dt, material, model, work)
    now = wall_pressure(load, 0.0, body.radius[0])
    body.force[0] += now * body.radius[0]
    record[0, 0], record[0, 1], record[0, 2] = 0.0, body.radius[0], now
    dt = 1e-2 * case.courant * body.width[0] / wave_speed
    previous, last_speed, peak = 0.0, 0.0, 0.0
    reversal, end, status, steps = 0.0, case.end_time, _NOT_CONVERGED, 0
    while steps < case.max_steps:
        finished = end > 0.0 and time + dt * (1.0 + 1e-9) >= end
        if finished:
            dt = end - time
        _kick(body, active, 0.5 * (previous + dt), case, work)
        peak = max(peak, abs(body.velocity[0]))
        if active < case.zones and abs(body.velocity[active - 1]) > _AT_REST * peak:
            active += 1
        old_radius = body.radius[0]
        moving = active + 1 if active == case.zones else active
        for i in range(moving):
            body.radius[i] += dt * body.velocity[i]
        time += dt
        steps += 1
        limit, failed = update_zones(body, active, dt, material, model, work)
        fallbacks += failed
        new = wall_pressure(load, time, body.radius[0])
        body.force[0] += new * body.radius[0]
        _load_work(load, old_radius, body.radius[0], now, new, work)
        now = new
        record = _longer(record, steps)
        record[steps, 0], record[steps, 1], record[steps, 2] = time, body.radius[0], now
        speed = body.velocity[0] + 0.5 * dt * body.force[0] / body.mass[0]
        if limit <= 0.0 or not np.isfinite(speed):
            status = _UNSTABLE
            break
        if load.gas and not inside_table(
            load.isentrope, (body.radius[0] / load.charge_radius) ** 2
        ):
            status = _OUT_OF_TABLE
            break
        if reversal == 0.0 and speed <= 0.0 and last_speed > 0.0 and time > load.rise_time:
            reversal = time - dt * speed / (speed - last_speed)
            if end == 0.0:
                end = case.settling_factor * reversal
        last_speed = speed
        previous = dt
        if finished:
            status = _OK
            break
        dt = min(STEP_GROWTH * dt, case.courant * limit)
    return March(
        status, body, record[: steps + 1].copy(), work, reversal, last_speed, 0.5 * previous,
        steps, fallbacks,
    )  # fmt: skip
