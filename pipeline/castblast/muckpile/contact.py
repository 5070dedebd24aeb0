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

A row of contact memory holds F_s (3), M (3), k_n and 2 sqrt(m_c k_n): one cache line in double
precision, half of one in single. It is written when the contact closes; all arithmetic is done in
double precision, whatever the rows are stored in.
"""

from __future__ import annotations

from enum import IntEnum
from math import pi, sqrt
from typing import NamedTuple, TypeAlias

from castblast.kernel import inline_kernel
from castblast.muckpile.particles import FloatArray, RealArray

Vector: TypeAlias = tuple[float, float, float]

#: Words of one row of contact memory.
ROW = 8
#: Stands for zero in a denominator; its square root times any force is finite.
_TINY = 1e-200


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
    cap_on_total : bool
        The limits of slip and rolling ask for the forces of springs and dashpots together, as in
        LAMMPS and LIGGGHTS; False: for those of the springs alone, as in PFC.
    """

    effective_modulus: float = 1e7
    stiffness_ratio: float = 2.0
    friction: float = 0.5
    rolling_friction: float = 0.5
    damping_normal: float = 0.2
    damping_shear: float = 0.2
    dashpot_mode: int = DashpotMode.NO_TENSION_SLIP_CUT
    density: float = 2600.0
    cap_on_total: bool = False


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
    cap_on_total : bool
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
    cap_on_total: bool


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
        bool(law.cap_on_total),
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


@inline_kernel
def ball_stiffness(radius1: float, radius2: float, modulus: float) -> float:
    """Normal stiffness [N m-1] between two balls: A E*/L, A = pi min(R)^2, L = R1 + R2."""
    smaller = min(radius1, radius2)
    return pi * smaller * smaller * modulus / (radius1 + radius2)


@inline_kernel
def wall_stiffness(radius: float, modulus: float) -> float:
    """Normal stiffness [N m-1] between a ball and a wall: pi R E*."""
    return pi * radius * modulus


@inline_kernel
def close_contact(
    memory: RealArray, dash: RealArray, p: int, stiffness: float, mass: float
) -> None:
    """Begin the memory of contact `p`: k_n `stiffness` [N m-1], m_c `mass` [kg], no load yet."""
    for word in range(6):
        memory[p, word] = 0.0
    memory[p, 6] = stiffness
    memory[p, 7] = 2.0 * sqrt(mass * stiffness)
    if len(dash) > 0:
        dash[p, 0], dash[p, 1], dash[p, 2] = 0.0, 0.0, 0.0


@inline_kernel
def contact_force(
    memory: RealArray,
    dash: RealArray,
    p: int,
    law: Constants,
    friction: float,
    rolling_friction: float,
    normal: Vector,
    overlap: float,
    effective_radius: float,
    slide: Vector,
    roll: Vector,
    spin: float,
    step: float,
    work: FloatArray,
    w: int,
) -> tuple[Vector, Vector]:
    """Advance contact `p` by a step: update its memory, return what it does to the second partner.

    Parameters
    ----------
    memory : array (p, 8)
        Rows of contact memory; F_s and M are updated in place.
    dash : array (p, 3) or (0, 3) [N]
        Dashpot force of the last step, for the ledger only; empty: no ledger is kept.
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
    work : array (k, 3) [J]
        Row `w` collects the work of slip, rolling slip and dashpots.

    Returns
    -------
    3 floats [N], 3 floats [N m]
        Force and rolling moment on the second partner.

    Notes
    -----
    The shear force is carried into the new contact plane without change of length, then grows by
    -k_s du_s and is cut back to mu F_n, F_n being the force of the spring alone. The moment does
    the same with the bending part of the relative rotation.
    """
    nx, ny, nz = normal
    kn = memory[p, 6]
    ks = kn * law.shear_ratio
    fn = kn * overlap
    vn = slide[0] * nx + slide[1] * ny + slide[2] * nz
    vx, vy, vz = slide[0] - vn * nx, slide[1] - vn * ny, slide[2] - vn * nz

    # vn < 0 while the partners approach.
    push = -law.damping_normal * memory[p, 7] * vn
    if law.no_tension:
        push = max(push, -fn)
    drag = law.damping_shear * memory[p, 7]
    grip, hidden = fn, 0.0
    if law.cap_on_total:
        grip, hidden = max(fn + push, 0.0), drag

    turned = _follow(memory[p, 0], memory[p, 1], memory[p, 2], normal, spin * step)
    force, cut, length = _grow(turned, (vx, vy, vz), ks, step, friction * grip, hidden)
    fx, fy, fz = force
    memory[p, 0], memory[p, 1], memory[p, 2] = fx, fy, fz
    # At the limit is slipping: a frictionless contact slips before its spring has grown.
    if law.slip_cut and not law.cap_on_total:
        drag = drag if length < friction * grip else 0.0

    wn = roll[0] * nx + roll[1] * ny + roll[2] * nz
    bend = (roll[0] - wn * nx, roll[1] - wn * ny, roll[2] - wn * nz)
    kr = ks * effective_radius * effective_radius
    limit = rolling_friction * effective_radius * grip
    bent = _follow(memory[p, 3], memory[p, 4], memory[p, 5], normal, spin * step)
    moment, roll_cut, roll_length = _grow(bent, bend, kr, step, limit, 0.0)
    memory[p, 3], memory[p, 4], memory[p, 5] = moment

    dx, dy, dz = push * nx - drag * vx, push * ny - drag * vy, push * nz - drag * vz
    if len(dash) > 0:
        # Half of the work of the force before and half of the force now, over the same path: the
        # form in which kick-drift-kick integration exchanges energy.
        held = (fx - hidden * vx, fy - hidden * vy, fz - hidden * vz)
        work[w, 0] += _slip_work(turned, held, cut, length, ks)
        work[w, 1] += _slip_work(bent, moment, roll_cut, roll_length, kr)
        work[w, 2] -= (
            0.5
            * step
            * (
                (dash[p, 0] + dx) * slide[0]
                + (dash[p, 1] + dy) * slide[1]
                + (dash[p, 2] + dz) * slide[2]
            )
        )
        dash[p, 0], dash[p, 1], dash[p, 2] = dx, dy, dz
    return (fn * nx + fx + dx, fn * ny + fy + dy, fn * nz + fz + dz), moment


@inline_kernel
def open_contact(
    memory: RealArray,
    dash: RealArray,
    p: int,
    shear_ratio: float,
    effective_radius: float,
    slide: Vector,
    step: float,
    work: FloatArray,
    w: int,
) -> None:
    """Close the books of a contact that has just opened.

    The springs hold almost nothing then, because their limits fell to zero with the normal force;
    what the last step left in them counts as slip. Arguments as in `contact_force`.
    """
    if len(dash) > 0:
        ks = memory[p, 6] * shear_ratio
        work[w, 0] += (memory[p, 0] ** 2 + memory[p, 1] ** 2 + memory[p, 2] ** 2) / (2.0 * ks)
        work[w, 1] += (memory[p, 3] ** 2 + memory[p, 4] ** 2 + memory[p, 5] ** 2) / (
            2.0 * ks * effective_radius * effective_radius
        )
        work[w, 2] -= (
            0.5 * step * (dash[p, 0] * slide[0] + dash[p, 1] * slide[1] + dash[p, 2] * slide[2])
        )


@inline_kernel
def _grow(
    force: Vector, rate: Vector, stiffness: float, step: float, limit: float, drag: float
) -> tuple[Vector, float, float]:
    """Let a spring force grow by -stiffness rate dt up to `limit`.

    With a `drag` the limit holds for the sum of the spring and a dashpot -drag rate. Returns the
    force of the spring, its share that is left (below 1: it slips), and its length before [N].
    No branch: whether a contact slips cannot be predicted, and a wrong guess costs more.
    """
    grown = stiffness * step + drag
    x, y, z = force[0] - grown * rate[0], force[1] - grown * rate[1], force[2] - grown * rate[2]
    length = sqrt(x * x + y * y + z * z)
    cut = min(1.0, limit / max(length, _TINY))
    left = (cut * x + drag * rate[0], cut * y + drag * rate[1], cut * z + drag * rate[2])
    return left, cut, length


@inline_kernel
def _slip_work(before: Vector, left: Vector, cut: float, length: float, stiffness: float) -> float:
    """Work [J] of a slip: mean of the force before and after, times the path not taken up."""
    if cut >= 1.0 or length == 0.0:
        return 0.0
    mean = before[0] * left[0] + before[1] * left[1] + before[2] * left[2]
    limit = cut * length
    mean = 0.5 * (mean / limit + limit) if limit > 0.0 else 0.0
    return mean * (length - limit) / stiffness


@inline_kernel
def _follow(x: float, y: float, z: float, normal: Vector, angle: float) -> Vector:
    """Carry a tangential vector into the plane of `normal` and turn it by a small `angle`."""
    nx, ny, nz = normal
    square = x * x + y * y + z * z
    along = x * nx + y * ny + z * nz
    x -= along * nx
    y -= along * ny
    z -= along * nz
    tx = x + angle * (ny * z - nz * y)
    ty = y + angle * (nz * x - nx * z)
    tz = z + angle * (nx * y - ny * x)
    # Nothing stays nothing.
    scale = sqrt(square / max(tx * tx + ty * ty + tz * tz, _TINY))
    return tx * scale, ty * scale, tz * scale


@inline_kernel
def spring_energy(
    memory: RealArray, p: int, overlap: float, effective_radius: float, shear_ratio: float
) -> float:
    """Elastic energy [J] of contact `p`: normal, shear and rolling spring."""
    kn = float(memory[p, 6])
    shear = float(memory[p, 0] ** 2 + memory[p, 1] ** 2 + memory[p, 2] ** 2)
    moment = float(memory[p, 3] ** 2 + memory[p, 4] ** 2 + memory[p, 5] ** 2)
    bent = shear + moment / (effective_radius * effective_radius)
    return 0.5 * (kn * overlap * overlap + bent / (kn * shear_ratio))


def damped_step_factor(law: ContactLaw) -> float:
    """Factor by which damping shortens the stable step: sqrt(1 + b^2) - b (PFC manual)."""
    beta = max(law.damping_normal, law.damping_shear)
    return sqrt(1.0 + beta * beta) - beta
