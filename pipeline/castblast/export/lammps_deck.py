"""A cast as input for LAMMPS, for users whose case outgrows one machine.

Two files: `balls.data` (state, and with which firing each ball goes) and `cast.in` (law, walls,
firing, stop rule), run with ``mpirun lmp -in cast.in``. The law maps onto ``pair_style granular``
term by term: ``hooke`` with ``damping tsuji``, whose coefficient alpha(e) (Tsuji et al. 1992) is
set to twice the share of critical damping; ``linear_history`` for shear; ``sds`` for rolling
(Luding 2008), with the stiffness k_s Rbar^2 and the limit mu_r Rbar F_n of this law. Two things
differ: LAMMPS holds the limits of slip and rolling against the forces of spring and dashpot
together (`ContactLaw.cap_on_total` does so here), and it takes one normal stiffness per pair of
atom types, so that balls are sorted into types by radius. Left out: triangulated ground, which
LAMMPS releases of the last years cannot take.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations_with_replacement
from math import ceil, inf, pi, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np

from castblast.errors import SpecError
from castblast.export.lammps_walls import WallRegion, wall_regions
from castblast.files import write_text
from castblast.muckpile.case import CastCase, check_case
from castblast.muckpile.contact import ContactLaw, DashpotMode, damped_step_factor
from castblast.muckpile.particles import FloatArray, IntArray, Particles, ball_mass

#: LAMMPS has 32 groups; one per type, and a few others.
MOST_TYPES = 24
#: Damping coefficient alpha of restitution e, from e^0 to e^6 (Tsuji et al. 1992).
_TSUJI = (1.2728, -4.2783, 11.087, -22.348, 27.467, -18.022, 4.8218)
_SKIN_RATIO = 0.15


class RadiusTypes(NamedTuple):
    """Balls sorted into types by radius.

    Attributes
    ----------
    type : array (n,), int64
        From 0.
    radius : array (t,) [m]
        Whose stiffness the type has: the mean of its balls.
    """

    type: IntArray
    radius: FloatArray


class Firings(NamedTuple):
    """What happens when.

    Attributes
    ----------
    time : array (f,) [s]
    velocity : array (f, 3) [m s-1]
    number : array (n,), int64
        Firing of each ball, from 1; 0: free from the start; f + 1: held for good.
    """

    time: FloatArray
    velocity: FloatArray
    number: IntArray


def write_lammps_deck(folder: Path, case: CastCase, *, radius_bins: int = 10) -> list[Path]:
    """Write `balls.data` and `cast.in` into `folder`.

    Parameters
    ----------
    folder : path
    case : CastCase
    radius_bins : int
        Types of radius. A case with no more distinct radii has one type for each, and then its
        stiffnesses are exact; otherwise ten types leave an rms error of 6 per cent in the
        stiffness of single contacts and of less than one in the mean.

    Raises
    ------
    SpecError
        One line per thing that LAMMPS cannot take.
    """
    faults = deck_faults(case)
    if not 1 <= radius_bins <= MOST_TYPES:
        faults.append(f"radius_bins = {radius_bins}: must be 1 to {MOST_TYPES}")
    if faults:
        raise SpecError("\n".join(f"LAMMPS deck: {fault}" for fault in faults))
    types = radius_types(case.particles.radius, radius_bins)
    firings = plan_firings(case)
    step = time_step(case, firings)
    return [
        write_text(folder / "balls.data", "\n".join(_data_lines(case, types, firings)) + "\n"),
        write_text(folder / "cast.in", "\n".join(_input_lines(case, types, firings, step)) + "\n"),
    ]


def deck_faults(case: CastCase) -> list[str]:
    """Return what of `case` LAMMPS cannot take, in words; empty: it can take all."""
    faults = check_case(case)
    law = case.law
    if 2.0 * law.damping_normal > _TSUJI[0]:
        faults.append(
            f"damping_normal = {law.damping_normal:g}: at most {0.5 * _TSUJI[0]:.3f} can be written"
        )
    if law.damping_normal == 0.0 and law.damping_shear > 0.0:
        faults.append("damping_shear needs a damping_normal: LAMMPS scales one from the other")
    if len(case.walls.corner):
        faults.append(
            f"{len(case.walls.corner)} facets: triangulated ground cannot be written; "
            "use planes and slopes"
        )
    return faults + wall_regions(case.walls)[1]


def radius_types(radius: FloatArray, bins: int) -> RadiusTypes:
    """Sort radii (n,) [m] into types: one per distinct radius, or bins of equal width."""
    distinct, number = np.unique(radius, return_inverse=True)
    if len(distinct) > bins:
        edges = np.linspace(distinct[0], distinct[-1], bins + 1)
        raw = np.clip(np.searchsorted(edges, radius, side="right") - 1, 0, bins - 1)
        number = np.unique(raw, return_inverse=True)[1]
    mean = np.bincount(number, weights=radius) / np.bincount(number)
    return RadiusTypes(number.astype(np.int64), np.asarray(mean))


def restitution_for(damping: float) -> float:
    """Return e with which the formula of Tsuji et al. gives alpha(e) = 2 damping.

    0.44035 for a damping of 0.2.
    """
    from scipy.optimize import brentq

    def open_(e: float) -> float:
        return float(np.polynomial.polynomial.polyval(e, _TSUJI)) - 2.0 * damping

    # alpha(1) is 0.0003, not zero.
    return 1.0 if open_(1.0) >= 0.0 else float(brentq(open_, 0.0, 1.0, xtol=1e-12))


def plan_firings(case: CastCase) -> Firings:
    """Put blocks that go at the same time with the same velocity into one firing, in time order."""
    due = np.isfinite(case.block_delay) & (case.block_delay < case.max_time)
    due &= np.isin(np.arange(len(due)), case.particles.block)
    plan = np.column_stack([case.block_delay, case.block_velocity])
    events, number = np.unique(plan[due], axis=0, return_inverse=True)
    of_block = np.full(len(due) + 1, len(events) + 1 if case.hold_unfired else 0)
    of_block[:-1][due] = number.ravel() + 1
    of_block[-1] = 0
    return Firings(events[:, 0], events[:, 1:4], of_block[case.particles.block].astype(np.int64))


def time_step(case: CastCase, firings: Firings) -> float:
    """Step [s] by the rule of `castblast.muckpile.stability`, for the contacts at the start.

    Stiffnesses of a ball are summed without regard to direction, so this is a little shorter. If
    the times of firing are multiples of one interval, a whole number of steps fills it.
    """
    if case.time_step > 0.0:
        return case.time_step
    law = case.law
    least = _least_period(case.particles, law)
    rule = case.step_safety * damped_step_factor(law) * least
    times = np.unique(np.concatenate([[0.0], firings.time]))
    interval = float(np.diff(times).min()) if len(times) > 1 else inf
    return rule if interval == inf else interval / ceil(interval / rule)


def _least_period(particles: Particles, law: ContactLaw) -> float:
    """Least sqrt(m/k) and sqrt(I/k_r) [s] over all balls, each with at least one wall contact."""
    from scipy.spatial import cKDTree

    radius = particles.radius
    shear = 1.0 / law.stiffness_ratio
    mass = ball_mass(radius, law.density)
    alone = pi * radius * law.effective_modulus
    push, turn = np.zeros(len(radius)), np.zeros(len(radius))
    pairs = cKDTree(particles.position).query_pairs(2.0 * radius.max(), output_type="ndarray")
    i, j = pairs[:, 0], pairs[:, 1]
    gap = np.linalg.norm(particles.position[i] - particles.position[j], axis=1)
    touch = gap < radius[i] + radius[j]
    i, j = i[touch], j[touch]
    kn = _stiffness(radius[i], radius[j], law.effective_modulus)
    mean = radius[i] * radius[j] / (radius[i] + radius[j])
    for ball in (i, j):
        np.add.at(push, ball, kn)
        np.add.at(turn, ball, kn * shear * (radius[ball] ** 2 + mean**2))
    # A third of the contacts of a ball acts along any one axis, two thirds turn it about one.
    push = np.maximum((1.0 + 2.0 * shear) / 3.0 * push, alone)
    turn = np.maximum(2.0 / 3.0 * turn, 2.0 * alone * shear * radius**2)
    return float(np.sqrt(np.minimum(mass / push, 0.4 * mass * radius**2 / turn)).min())


def _stiffness(one: FloatArray, two: FloatArray, modulus: float) -> FloatArray:
    return np.asarray(pi * np.minimum(one, two) ** 2 * modulus / (one + two))


def _data_lines(case: CastCase, types: RadiusTypes, firings: Firings) -> Iterator[str]:
    """Lines of the data file; atom k + 1 is ball k."""
    balls = case.particles
    count = len(balls.radius)
    low = (balls.position - balls.radius[:, None]).min(axis=0) - balls.radius.max()
    high = (balls.position + balls.radius[:, None]).max(axis=0) + balls.radius.max()
    yield f"castblast: {count} balls in {len(types.radius)} types of radius"
    yield f"\n{count} atoms\n{len(types.radius)} atom types\n"
    for name, a, b in zip("xyz", low, high, strict=True):
        yield f"{a:.9g} {b:.9g} {name}lo {name}hi"
    yield "\nAtoms # sphere\n"
    for k in range(count):
        x, y, z = balls.position[k]
        diameter = 2.0 * balls.radius[k]
        yield (
            f"{k + 1} {types.type[k] + 1} {diameter:.17g} {case.law.density:.17g} "
            f"{x:.17g} {y:.17g} {z:.17g}"
        )
    yield "\nVelocities\n"
    held = (balls.block >= 0) & case.hold_unfired
    state = np.hstack([balls.velocity, balls.angular_velocity])
    state[held] = 0.0
    for k in range(count):
        yield f"{k + 1} " + " ".join(f"{value:.17g}" for value in state[k])
    yield "\nFiring\n"
    for k in range(count):
        yield f"{k + 1} {firings.number[k]}"


def _input_lines(
    case: CastCase, types: RadiusTypes, firings: Firings, step: float
) -> Iterator[str]:
    """Lines of the input script."""
    radius, law = types.radius, case.law
    yield "# A cast written by castblast: mpirun lmp -in cast.in"
    yield "units si\natom_style sphere\natom_modify map array\nboundary s s s\nnewton off"
    yield "comm_modify vel yes\nprocessors * * 1"
    yield "# The molecule number of a ball is its firing; 0: free from the start"
    yield "fix firing all property/atom mol"
    yield "read_data balls.data fix firing NULL Firing"
    yield f"neighbor {_SKIN_RATIO * 2.0 * np.mean(case.particles.radius):.6g} bin"
    yield "neigh_modify delay 0 every 1 check yes"
    yield f"timestep {step:.12g}\n\n# Contact law: one stiffness per pair of types\n"
    yield "pair_style granular"
    for i, j in combinations_with_replacement(range(len(radius)), 2):
        kn = float(_stiffness(radius[[i]], radius[[j]], law.effective_modulus)[0])
        words = _law_words(law, kn, law.friction, law.rolling_friction)
        yield f"pair_coeff {i + 1} {j + 1} {words}"
    yield "\n# Walls: their stiffness depends on the ball, so each type has its own\n"
    for k in range(len(radius)):
        yield f"group type{k + 1} type {k + 1}"
    for wall in wall_regions(case.walls)[0]:
        yield from _wall_lines(wall, radius, law)
    yield f"\nfix gravity all gravity {case.gravity:.17g} vector 0 0 -1"
    yield "group free molecule 0" if case.hold_unfired else "group free union all"
    yield "fix motion free nve/sphere"
    yield "compute ke all ke\nthermo_style custom step time atoms c_ke"
    yield f"thermo {_samples(case, step)}\nthermo_modify norm no lost warn"
    if case.snapshot_interval > 0.0:
        every = max(1, round(case.snapshot_interval / step))
        yield f"dump frames all custom {every} frames.dump id type diameter x y z vx vy vz mol"
    yield from _firing_lines(case, firings, step)
    yield from _rest_lines(case, firings, step)


def _law_words(law: ContactLaw, kn: float, friction: float, rolling: float) -> str:
    """Contact law of one pair of types, or of one type and a wall."""
    ks = kn / law.stiffness_ratio
    ratio = law.damping_shear / law.damping_normal if law.damping_normal > 0.0 else 0.0
    words = (
        f"hooke {kn:.12g} {restitution_for(law.damping_normal):.10g} "
        f"tangential linear_history {ks:.12g} {ratio / sqrt(law.stiffness_ratio):.10g} "
        f"{friction:.10g} rolling sds {ks:.12g} 0.0 {rolling:.10g} damping tsuji"
    )
    mode = int(law.dashpot_mode)
    no_tension = mode in (DashpotMode.NO_TENSION, DashpotMode.NO_TENSION_SLIP_CUT)
    return words + " limit_damping" if no_tension else words


def _wall_lines(wall: WallRegion, radius: FloatArray, law: ContactLaw) -> Iterator[str]:
    friction = law.friction if np.isnan(wall.friction) else wall.friction
    rolling = law.rolling_friction if np.isnan(wall.rolling_friction) else wall.rolling_friction
    yield f"region {wall.name} {wall.words}"
    for k, r in enumerate(radius):
        words = _law_words(law, pi * float(r) * law.effective_modulus, friction, rolling)
        yield (
            f"fix {wall.name}_{k + 1} type{k + 1} wall/gran/region granular {words} "
            f"region {wall.name}"
        )


def _firing_lines(case: CastCase, firings: Firings, step: float) -> Iterator[str]:
    yield "\n# Firing: balls of a block stand until it is fired, then move freely\n"
    before = 0
    for k, (time, velocity) in enumerate(zip(firings.time, firings.velocity, strict=True)):
        now = round(float(time) / step)
        if now > before:
            yield f"run {now - before}"
            before = now
        vx, vy, vz = velocity
        yield f"group due molecule {k + 1}"
        yield f"velocity due set {vx:.17g} {vy:.17g} {vz:.17g} units box"
        yield "group due delete"
        if case.hold_unfired:
            yield f"group free molecule {k + 1}"


def _samples(case: CastCase, step: float) -> int:
    return max(1, round(case.sample_interval / step))


def _rest_lines(case: CastCase, firings: Firings, step: float) -> Iterator[str]:
    """Run in pieces of a sample until the translational energy has stayed low long enough."""
    piece = _samples(case, step)
    start = round(float(firings.time[-1]) / step) if len(firings.time) else 0
    longest = max(start + 1, int(case.max_time / step))
    earliest = ceil(case.min_time / step)
    yield "\n# Until the pile is at rest\n"
    yield "variable most equal 0.0\nvariable quiet equal 0"
    yield f"label piece\nrun {piece}\nvariable now equal $(c_ke)"
    yield 'if "${now} > ${most}" then "variable most equal ${now}"'
    yield (
        f'if "$(v_now/(v_most+1e-300)) <= {case.stop_energy_ratio:.10g}" '
        'then "variable quiet equal $(v_quiet+1)" else "variable quiet equal 0"'
    )
    quiet = ceil(case.stop_duration / (piece * step)) + 1
    yield f'if "${{quiet}} >= {quiet} && $(step) >= {earliest}" then "jump SELF rest"'
    yield f'if "$(step) >= {longest}" then "jump SELF rest"'
    yield "jump SELF piece\nlabel rest"
    yield (
        "write_dump all custom final.dump id type diameter x y z vx vy vz "
        "omegax omegay omegaz mol modify sort id"
    )
