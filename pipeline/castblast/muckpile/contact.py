"""Rolling-resistance linear contact law, ball against ball and ball against wall.

A linear spring with dashpots along the normal, a linear spring with Coulomb slip and a dashpot
along the tangent, and a rolling spring whose moment is limited by the normal force. Sources:
Cundall and Strack (1979) for the incremental shear force; Iwashita and Oda (1998) for the rolling
spring and its stiffness k_r = k_s Rbar^2; Ai et al. (2011) and Wensrich and Katterfeld (2012) for
the limit mu_r Rbar F_n; the `rrlinear` model of PFC for the way these are joined and for the
stiffness from an effective modulus (k_n = A E*/L). Left out: twisting resistance, adhesion and a
dashpot of the rolling motion, so a ball that spins about a contact normal does not stop.

Conventions: the normal n points from the first to the second partner; F and M are what the
contact exerts on the *second* partner, the first receives their opposites; the contact point lies
in the middle of the overlap, so that forces and moments conserve angular momentum exactly.

A row of contact memory holds F_s (3), M (3), k_n and 2 sqrt(m_c k_n): one cache line.
"""

from __future__ import annotations

from enum import IntEnum
from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from castblast.kernel import kernel
from castblast.muckpile.particles import FloatArray

#: Words of one row of contact memory.
ROW = 8


class DashpotMode(IntEnum):
    """What the dashpots may do (numbers as in PFC's `dp_mode`).

    FULL: they always act. NO_TENSION: spring and dashpot together never pull. SLIP_CUT: the shear
    dashpot rests while the contact slips. NO_TENSION_SLIP_CUT: both rules.
    """

    FULL = 0
    NO_TENSION = 1
    SLIP_CUT = 2
    NO_TENSION_SLIP_CUT = 3


class ContactLaw(NamedTuple):
    """Constants of the contact law, the same for all contacts.

    Attributes
    ----------
    effective_modulus : float [Pa]
        E* of the deformability method.
    stiffness_ratio : float [-]
        Normal over shear stiffness.
    friction, rolling_friction : float [-]
    damping_normal, damping_shear : float [-]
        Shares of critical damping, below 1.
    dashpot_mode : DashpotMode
    density : float [kg m-3]
        Density of the balls.
    """

    effective_modulus: float = 1e7
    stiffness_ratio: float = 2.0
    friction: float = 0.5
    rolling_friction: float = 0.5
    damping_normal: float = 0.2
    damping_shear: float = 0.2
    dashpot_mode: int = DashpotMode.NO_TENSION_SLIP_CUT
    density: float = 2600.0


class Constants(NamedTuple):
    """`ContactLaw` as kernels want it: the same types whatever the caller wrote.

    Attributes
    ----------
    modulus, density : float
        As in `ContactLaw`.
    shear_ratio : float [-]
        Shear over normal stiffness.
    friction, rolling_friction, damping_normal : float [-]
        As in `ContactLaw`.
    damping_shear : float [-]
        Factor on 2 sqrt(m_c k_n), i.e. the shear damping times sqrt(shear_ratio).
    no_tension, slip_cut : bool
        The two rules of the dashpots.
    """

    modulus: float
    shear_ratio: float
    friction: float
    rolling_friction: float
    damping_normal: float
    damping_shear: float
    no_tension: bool
    slip_cut: bool
    density: float


def law_constants(law: ContactLaw) -> Constants:
    """Prepare `law` for kernels."""
    shear_ratio = 1.0 / float(law.stiffness_ratio)
    mode = int(law.dashpot_mode)
    return Constants(
        float(law.effective_modulus),
        shear_ratio,
        float(law.friction),
        float(law.rolling_friction),
        float(law.damping_normal),
        float(law.damping_shear) * sqrt(shear_ratio),
        mode in (DashpotMode.NO_TENSION, DashpotMode.NO_TENSION_SLIP_CUT),
        mode in (DashpotMode.SLIP_CUT, DashpotMode.NO_TENSION_SLIP_CUT),
        float(law.density),
    )


def check_law(law: ContactLaw) -> list[str]:
    """Return every fault of `law` in words; an empty list means that it can be used."""
    faults = [
        f"{name} = {value:g}: must be positive"
        for name, value in (
            ("effective_modulus", law.effective_modulus),
            ("stiffness_ratio", law.stiffness_ratio),
            ("density", law.density),
        )
        if not value > 0.0
    ]
    faults += [
        f"{name} = {value:g}: must not be negative"
        for name, value in (
            ("friction", law.friction),
            ("rolling_friction", law.rolling_friction),
        )
        if not value >= 0.0
    ]
    faults += [
        f"{name} = {value:g}: must be at least 0 and below 1"
        for name, value in (
            ("damping_normal", law.damping_normal),
            ("damping_shear", law.damping_shear),
        )
        if not 0.0 <= value < 1.0
    ]
    if int(law.dashpot_mode) not in set(DashpotMode):
        faults.append(f"dashpot_mode = {law.dashpot_mode}: must be one of 0, 1, 2, 3")
    return faults


@kernel
def ball_stiffness(radius1: float, radius2: float, modulus: float) -> float:
    """Normal stiffness [N m-1] between two balls: A E*/L, A = pi min(R)^2, L = R1 + R2."""
    smaller = min(radius1, radius2)
    return pi * smaller * smaller * modulus / (radius1 + radius2)


@kernel
def wall_stiffness(radius: float, modulus: float) -> float:
    """Normal stiffness [N m-1] between a ball and a wall: pi R E*."""
    return pi * radius * modulus


@kernel
def contact_force(
    row: FloatArray,
    law: Constants,
    friction: float,
    rolling_friction: float,
    normal: tuple[float, float, float],
    overlap: float,
    effective_radius: float,
    slide: tuple[float, float, float],
    roll: tuple[float, float, float],
    spin: float,
    step: float,
    work: FloatArray,
) -> tuple[float, float, float]:
    """Advance one contact by a step: update its memory `row`, return the force on the second.

    Parameters
    ----------
    row : array (8,)
        Memory of the contact; F_s and M are updated in place.
    law : Constants
    friction, rolling_friction : float [-]
        Of this contact (walls may have their own).
    normal : 3 floats
        Unit vector from the first to the second partner.
    overlap : float [m]
        Positive.
    effective_radius : float [m]
        Rbar = R1 R2/(R1 + R2); R against a wall.
    slide : 3 floats [m s-1]
        Velocity of the second relative to the first at the contact point.
    roll : 3 floats [rad s-1]
        Spin of the second relative to the first.
    spin : float [rad s-1]
        Mean spin of both about the normal: turns the contact plane with its partners.
    step : float [s]
    work : array (3,) [J]
        Work of slip, rolling slip and dashpots; what this step dissipates is added.

    Returns
    -------
    3 floats [N]
        Force on the second partner. The moment on it is left in ``row[3:6]``.

    Notes
    -----
    The shear force is carried into the new contact plane without change of length, then grows by
    -k_s du_s and is cut back to mu F_n, F_n being the force of the spring alone. The moment does
    the same with the bending part of the relative rotation.
    """
    nx, ny, nz = normal
    kn = row[6]
    ks = kn * law.shear_ratio
    fn = kn * overlap
    vn = slide[0] * nx + slide[1] * ny + slide[2] * nz
    vx, vy, vz = slide[0] - vn * nx, slide[1] - vn * ny, slide[2] - vn * nz

    # Shear spring: follow the plane, grow, slip.
    fx, fy, fz = _follow(row[0], row[1], row[2], nx, ny, nz, spin * step)
    grow = ks * step
    fx -= grow * vx
    fy -= grow * vy
    fz -= grow * vz
    limit = friction * fn
    square = fx * fx + fy * fy + fz * fz
    slips = square > limit * limit
    if slips:
        length = sqrt(square)
        cut = limit / length
        # Slip is what the spring did not take up; the friction force is the mean over the step.
        work[0] += limit * (length - limit) / ks
        fx *= cut
        fy *= cut
        fz *= cut
    row[0], row[1], row[2] = fx, fy, fz

    # Rolling spring.
    wn = roll[0] * nx + roll[1] * ny + roll[2] * nz
    kr = ks * effective_radius * effective_radius
    grow = kr * step
    mx, my, mz = _follow(row[3], row[4], row[5], nx, ny, nz, spin * step)
    mx -= grow * (roll[0] - wn * nx)
    my -= grow * (roll[1] - wn * ny)
    mz -= grow * (roll[2] - wn * nz)
    limit = rolling_friction * effective_radius * fn
    square = mx * mx + my * my + mz * mz
    if square > limit * limit:
        length = sqrt(square)
        cut = limit / length
        work[1] += limit * (length - limit) / kr
        mx *= cut
        my *= cut
        mz *= cut
    row[3], row[4], row[5] = mx, my, mz

    # Dashpots. vn < 0 while the partners approach.
    dash = -law.damping_normal * row[7] * vn
    if law.no_tension and fn + dash < 0.0:
        dash = -fn
    work[2] -= dash * vn * step
    if not (slips and law.slip_cut):
        drag = law.damping_shear * row[7]
        fx -= drag * vx
        fy -= drag * vy
        fz -= drag * vz
        work[2] += drag * (vx * vx + vy * vy + vz * vz) * step
    fn += dash
    return fn * nx + fx, fn * ny + fy, fn * nz + fz


@kernel
def _follow(
    x: float, y: float, z: float, nx: float, ny: float, nz: float, angle: float
) -> tuple[float, float, float]:
    """Carry a tangential vector into the plane of normal n and turn it by a small `angle`."""
    square = x * x + y * y + z * z
    if square == 0.0:
        return 0.0, 0.0, 0.0
    along = x * nx + y * ny + z * nz
    x -= along * nx
    y -= along * ny
    z -= along * nz
    tx = x + angle * (ny * z - nz * y)
    ty = y + angle * (nz * x - nx * z)
    tz = z + angle * (nx * y - ny * x)
    reached = tx * tx + ty * ty + tz * tz
    if reached == 0.0:
        return 0.0, 0.0, 0.0
    scale = sqrt(square / reached)
    return tx * scale, ty * scale, tz * scale


@kernel
def spring_energy(row: FloatArray, overlap: float, radius: float, shear_ratio: float) -> float:
    """Elastic energy [J] of a contact of effective radius `radius`."""
    kn = row[6]
    ks = kn * shear_ratio
    shear = row[0] * row[0] + row[1] * row[1] + row[2] * row[2]
    moment = row[3] * row[3] + row[4] * row[4] + row[5] * row[5]
    return 0.5 * (kn * overlap * overlap + (shear + moment / (radius * radius)) / ks)


def default_step_factor(law: ContactLaw) -> float:
    """Factor by which damping shortens the stable step: sqrt(1 + b^2) - b (PFC manual)."""
    beta = max(law.damping_normal, law.damping_shear)
    return float(np.sqrt(1.0 + beta * beta) - beta)
