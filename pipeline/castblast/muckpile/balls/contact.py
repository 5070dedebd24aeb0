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
precision, half of one in single. It is written when the contact closes. What a contact does in a
step is in `castblast.muckpile.engine.contact_step`.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from math import pi, sqrt
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import DTypeLike

from castblast.kernel import inline_kernel
from castblast.muckpile.balls.columns import (
    DAMPING,
    ROLL_X,
    ROLL_Y,
    ROLL_Z,
    SHEAR_X,
    SHEAR_Y,
    SHEAR_Z,
    STIFFNESS,
    X,
    Y,
    Z,
)
from castblast.types import RealArray

Vector: TypeAlias = tuple[float, float, float]

#: Words of one row of contact memory.
ROW = 8
#: Stands for zero in a denominator, in single precision as well.
_TINY = 1e-30
#: A slipping contact is at its limit but for rounding, which in single precision takes some 1e-7.
_ALMOST = 1.0 - 1e-5


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
    zero, half, one, tiny : float
        Numbers of the law in its working precision; a plain 0.5 would turn all into double.
    almost : float [-]
        Share of the limit from which on a contact counts as slipping.
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
    zero: float
    half: float
    one: float
    tiny: float
    almost: float


def law_constants(law: ContactLaw, real: DTypeLike = np.float64) -> Constants:
    """Prepare `law` for kernels that work in the precision `real`."""
    kind: Callable[[float], Any] = float if np.dtype(real) == np.float64 else np.float32
    shear_ratio = 1.0 / float(law.stiffness_ratio)
    mode = int(law.dashpot_mode)
    return Constants(
        modulus=kind(law.effective_modulus),
        shear_ratio=kind(shear_ratio),
        friction=kind(law.friction),
        rolling_friction=kind(law.rolling_friction),
        damping_normal=kind(law.damping_normal),
        damping_shear=kind(float(law.damping_shear) * sqrt(shear_ratio)),
        no_tension=mode in (DashpotMode.NO_TENSION, DashpotMode.NO_TENSION_SLIP_CUT),
        slip_cut=mode in (DashpotMode.SLIP_CUT, DashpotMode.NO_TENSION_SLIP_CUT),
        density=kind(law.density),
        cap_on_total=bool(law.cap_on_total),
        zero=kind(0.0),
        half=kind(0.5),
        one=kind(1.0),
        tiny=kind(_TINY),
        almost=kind(_ALMOST),
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
    memory[p, STIFFNESS] = stiffness
    memory[p, DAMPING] = 2.0 * sqrt(mass * stiffness)
    if len(dash) > 0:
        dash[p, X], dash[p, Y], dash[p, Z] = 0.0, 0.0, 0.0


@inline_kernel
def spring_energy(
    memory: RealArray, p: int, overlap: float, effective_radius: float, shear_ratio: float
) -> float:
    """Elastic energy [J] of contact `p`: normal, shear and rolling spring."""
    kn = float(memory[p, STIFFNESS])
    shear = float(memory[p, SHEAR_X] ** 2 + memory[p, SHEAR_Y] ** 2 + memory[p, SHEAR_Z] ** 2)
    moment = float(memory[p, ROLL_X] ** 2 + memory[p, ROLL_Y] ** 2 + memory[p, ROLL_Z] ** 2)
    bent = shear + moment / (effective_radius * effective_radius)
    return 0.5 * (kn * overlap * overlap + bent / (kn * shear_ratio))


def damped_step_factor(law: ContactLaw) -> float:
    """Factor by which damping shortens the stable step: sqrt(1 + b^2) - b (PFC manual)."""
    beta = max(law.damping_normal, law.damping_shear)
    return sqrt(1.0 + beta * beta) - beta
