"""What a march of the annulus means: end state, zones of damage, histories.

`end_state` names its numbers by position: `STATE_NAMES`, in the order of `NearFieldResult`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from castblast.errors import Status
from castblast.explosive.isentrope import energy, pressure
from castblast.kernel import kernel
from castblast.nearfield.march import Annulus, March
from castblast.nearfield.rock.lagrangian import Body, FloatArray, elastic_energy, kinetic_energy
from castblast.nearfield.rock.ledger import BOUNDARY, LOAD, RAMP, SHEAR, TENSION, VISCOUS

_OK = int(Status.OK)
_RETURN_MAP_FAILED = int(Status.RETURN_MAP_FAILED)
_LEDGER_OPEN = int(Status.LEDGER_OPEN)

#: Numbers of an end state, in this order.
STATE_NAMES = (
    "status", "equilibrium_pressure", "expanded_hole_radius", "crushed_zone_radius",
    "plastic_zone_radius", "hoop_crushed_radius", "tensile_zone_radius", "intense_shear_radius",
    "explosion_pressure", "equilibrium_time", "end_time", "wall_velocity", "settled", "gas_work",
    "kinetic_energy", "elastic_energy", "plastic_work", "tensile_work", "viscous_work",
    "boundary_work", "head_energy", "ramp_energy", "gas_energy", "energy_residual", "n_steps",
    "zone_steps", "return_map_fallbacks",
)  # fmt: skip
#: The end state is the mean over this window, in units of the time at which the wall turns back.
WINDOW = (1.6, 1.9)
#: Relative swing of the hole radius in the window below which the hole has settled.
SETTLED_SWING = 0.01
#: Wall velocity over wave speed below which the hole has settled (paper mode).
SETTLED_VELOCITY = 1e-3
#: Largest open share of the energy ledger.
LEDGER_TOLERANCE = 1e-3
_SETTLED, _STEPS = STATE_NAMES.index("settled"), STATE_NAMES.index("n_steps")
#: Plastic shear multiplier that bounds the crushed zone.
CRUSHED_STRAIN = 0.01
#: Plastic multiplier that counts as yield: far below any elastic strain at yield.
YIELD_STRAIN = 1e-6
#: Accumulated plastic strain that bounds the zone of intense shear.
INTENSE_STRAIN = 0.2


class Window(NamedTuple):
    """Hole radius over a span of time.

    Attributes
    ----------
    mean, lowest, highest : float [m]
    """

    mean: float
    lowest: float
    highest: float


@kernel
def mean_over(record: FloatArray, start: float, end: float) -> Window:
    """Time mean and extremes of the recorded radius between two times [s]."""
    area = 0.0
    lowest, highest = np.inf, -np.inf
    for k in range(record.shape[0] - 1):
        t0, t1 = max(record[k, 0], start), min(record[k + 1, 0], end)
        if t1 <= t0:
            continue
        slope = (record[k + 1, 1] - record[k, 1]) / (record[k + 1, 0] - record[k, 0])
        r0 = record[k, 1] + slope * (t0 - record[k, 0])
        r1 = record[k, 1] + slope * (t1 - record[k, 0])
        area += 0.5 * (r0 + r1) * (t1 - t0)
        lowest = min(lowest, r0, r1)
        highest = max(highest, r0, r1)
    return Window(area / (end - start), lowest, highest)


@kernel
def last_time_outside(record: FloatArray, value: float, band: float) -> float:
    """Last time [s] at which the recorded radius differs from `value` by more than `band`."""
    for k in range(record.shape[0] - 1, -1, -1):
        gap = abs(record[k, 1] - value)
        if gap > band:
            if k == record.shape[0] - 1:
                return float(record[k, 0])
            next_gap = abs(record[k + 1, 1] - value)
            share = (gap - band) / max(gap - next_gap, 1e-300)
            return float(record[k, 0] + min(share, 1.0) * (record[k + 1, 0] - record[k, 0]))
    return 0.0


@kernel
def _outermost(values: FloatArray, threshold: float) -> int:
    """Last zone whose value is above a threshold; -1 if none is."""
    for j in range(values.size - 1, -1, -1):
        if values[j] > threshold:
            return j
    return -1


@kernel
def _between(nodes: FloatArray, j: int, share: float, power: float) -> float:
    """Radius [m] at a share of the way from the centre of zone `j` to the next, logarithmically."""
    centre = np.log(_centre(nodes[j], nodes[j + 1], power))
    following = np.log(_centre(nodes[j + 1], nodes[j + 2], power))
    return float(np.exp(centre + share * (following - centre)))


@kernel
def _centre(inner: float, outer: float, power: float) -> float:
    """Radius [m] at which what goes as a power of the radius has its mean over the area of a zone.

    In a wide zone the middle would be too far out for a strain that falls with the radius.
    """
    ratio, order = outer / inner, power + 2.0
    if abs(power) < 1e-3:
        return 0.5 * (inner + outer)
    total = np.log(ratio) if abs(order) < 1e-6 else (ratio**order - 1.0) / order
    return float(inner * (total / (0.5 * (ratio * ratio - 1.0))) ** (1.0 / power))


@kernel
def _power(nodes: FloatArray, j: int, ratio: float) -> float:
    """Power of the radius by which zone means fall to a `ratio` from zone `j` to the next."""
    power = -2.0
    for _ in range(3):
        inside, outside = (
            _centre(nodes[j], nodes[j + 1], power),
            _centre(nodes[j + 1], nodes[j + 2], power),
        )
        power = min(-1e-2, max(-20.0, np.log(ratio) / np.log(outside / inside)))
    return power


@kernel
def threshold_radius(nodes: FloatArray, strain: FloatArray, threshold: float) -> float:
    """Outermost initial radius [m] at which a zone strain reaches a threshold.

    A power law between zone centres, so that it moves smoothly and not by whole zones; the radius
    of the wall if the threshold is reached nowhere.

    Parameters
    ----------
    nodes : array (n + 1,) [m]
        Initial node radii.
    strain : array (n,) [-]
        Values at zone centres.
    threshold : float [-]
        Positive.
    """
    j = _outermost(strain, threshold)
    if j < 0:
        return float(nodes[0])
    if j == strain.size - 1:
        return float(nodes[j + 1])
    ratio = max(strain[j + 1], 1e-9 * threshold) / strain[j]
    share = np.log(threshold / strain[j]) / np.log(ratio)
    return _between(nodes, j, share, _power(nodes, j, ratio))


@kernel
def steep_radius(nodes: FloatArray, strain: FloatArray, threshold: float) -> float:
    """As `threshold_radius`, from three zones: near the wall strain is no power of the radius."""
    j = _outermost(strain, threshold)
    first = max(j - 1, 0)
    if j < 0 or first + 2 >= strain.size or strain[first + 2] < 1e-2 * threshold:
        return threshold_radius(nodes, strain, threshold)
    power = _power(nodes, j, strain[j + 1] / strain[j])
    wanted, place = np.log(threshold), 0.0
    for a in range(first, first + 3):
        weight = 1.0
        for b in range(first, first + 3):
            if b != a:
                weight *= (wanted - np.log(strain[b])) / np.log(strain[a] / strain[b])
        place += weight * np.log(_centre(nodes[a], nodes[a + 1], power))
    return float(np.exp(place))


@kernel
def yield_radius(nodes: FloatArray, multiplier: FloatArray) -> float:
    """Outermost initial radius [m] that has yielded; the wall if none has.

    Between the last zone that yielded and the next, where the multiplier is minus the strain by
    which it fell short, it is interpolated linearly: a zone that starts to yield moves the radius
    continuously.
    """
    j = _outermost(multiplier, YIELD_STRAIN)
    if j < 0:
        return float(nodes[0])
    if j == multiplier.size - 1:
        return float(nodes[j + 1])
    inside = multiplier[j] - YIELD_STRAIN
    return _between(nodes, j, inside / (multiplier[j] - multiplier[j + 1]), 0.0)


@kernel
def damage_radii(body: Body) -> tuple[float, float, float, float, float]:
    """Initial radii [m]: crushed, plastic, crushed under hoop compression, tensile, intense."""
    nodes = body.initial_radius
    return (
        threshold_radius(nodes, body.shear_multiplier, CRUSHED_STRAIN),
        yield_radius(nodes, body.shear_multiplier),
        yield_radius(nodes, body.hoop_multiplier),
        yield_radius(nodes, body.tensile_multiplier),
        steep_radius(nodes, body.shear_strain, INTENSE_STRAIN),
    )


@kernel
def histories(record: FloatArray, out: FloatArray) -> None:
    """Time [s], pressure [Pa] and radius [m] on a fixed number of points, dense at the start.

    The times are end * (k / (points - 1))^2, k = 0 ... points - 1; values are interpolated
    between steps. `out` (3, points) is filled.
    """
    last = record.shape[0] - 1
    points = out.shape[1]
    step = 0
    for k in range(points):
        place = k / (points - 1)
        time = record[last, 0] * place * place
        while step < last - 1 and record[step + 1, 0] < time:
            step += 1
        share = (time - record[step, 0]) / (record[step + 1, 0] - record[step, 0])
        out[0, k] = time
        out[1, k] = record[step, 2] + share * (record[step + 1, 2] - record[step, 2])
        out[2, k] = record[step, 1] + share * (record[step + 1, 1] - record[step, 1])


@kernel
def no_state(status: int, steps: int, zone_steps: int, fallbacks: int, out: FloatArray) -> None:
    """End state that holds nothing but its status and counts."""
    for k in range(out.size):
        out[k] = np.nan
    out[0], out[_SETTLED] = status, 0.0
    out[_STEPS], out[_STEPS + 1], out[_STEPS + 2] = steps, zone_steps, fallbacks


@kernel
def end_state(case: Annulus, run: March, total_energy: float, out: FloatArray) -> None:
    """Read the end state off a march.

    Parameters
    ----------
    case : Annulus
    run : March
    total_energy : float [J m-3]
        Of the explosive, per initial volume.
    out : array (len(STATE_NAMES),)
        Filled; NaN if the march has no end state.
    """
    if run.status != _OK:
        no_state(run.status, run.steps, run.zone_steps, run.fallbacks, out)
        return
    record, load = run.record, case.load
    end = record[-1, 0]
    if case.end_time > 0.0:
        radius = record[-1, 1]
        material = case.material
        stiffness = material.bulk_modulus + 4.0 / 3.0 * material.shear_modulus
        wave_speed = np.sqrt(stiffness / material.density)
        settled = abs(run.wall_velocity) < SETTLED_VELOCITY * wave_speed
    else:
        window = mean_over(record, WINDOW[0] * run.reversal_time, end)
        radius = window.mean
        settled = window.highest - window.lowest < SETTLED_SWING * radius
    crushed, plastic, hoop, tensile, intense = damage_radii(run.body)
    per_charge = 1.0 / (load.charge_radius * load.charge_radius)
    charge = np.pi * load.charge_radius * load.charge_radius
    volume = radius * radius * per_charge
    start_volume = case.inner_radius * case.inner_radius * per_charge
    final_volume = record[-1, 1] * record[-1, 1] * per_charge
    turn = 2.0 * np.pi
    work = run.work
    kinetic = turn * kinetic_energy(run.body, run.active, run.half_kick)
    initial = case.in_situ_stress**2 / (2.0 * case.material.bulk_modulus)
    elastic = turn * (
        elastic_energy(run.body, case.material) - initial * run.body.initial_area.sum()
    )
    done = turn * work[LOAD]
    spent = turn * (work[SHEAR] + work[TENSION] + work[VISCOUS] + work[BOUNDARY])
    residual = (done - kinetic - elastic - spent) / done if done != 0.0 else np.nan
    status = _OK
    if run.fallbacks > 0:
        status = _RETURN_MAP_FAILED
    elif not abs(residual) <= LEDGER_TOLERANCE:
        status = _LEDGER_OPEN
    values = (
        float(status), pressure(load.isentrope, volume), radius, crushed, plastic, hoop, tensile,
        intense, pressure(load.isentrope, start_volume),
        last_time_outside(record, radius, 0.01 * radius), end, run.wall_velocity,
        1.0 if settled else 0.0, done, kinetic, elastic, turn * work[SHEAR], turn * work[TENSION],
        turn * work[VISCOUS], turn * work[BOUNDARY],
        charge * (total_energy - energy(load.isentrope, start_volume)), turn * work[RAMP],
        charge * energy(load.isentrope, final_volume), residual, float(run.steps),
        float(run.zone_steps), float(run.fallbacks),
    )  # fmt: skip
    for k in range(len(values)):
        out[k] = values[k]
