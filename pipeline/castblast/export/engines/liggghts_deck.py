"""A cast as input for LIGGGHTS, for users whose case outgrows one machine.

`balls.data` (state), `cast.in` (law, walls, firing, stop rule) and an STL file for each kind of
wall that is no plane along the axes; run with ``mpirun liggghts -in cast.in``. The law is ``gran
model hooke/stiffness tangential history rolling_friction epsd2``: the linear law of this package
term by term, with the rolling spring of Iwashita and Oda (1998) and its limit mu_r Rbar F_n. What
differs: the limits ask for the normal force of spring and dashpot together, the shear dashpot
always rests while a contact slips, walls of triangles act on both sides, and stiffness and
dashpots are those of one pair of types of radius. Atoms are numbered in the order in which they
are fired, since LIGGGHTS cannot group atoms by a number in the data file: `balls.csv` says which
ball of the case each is.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import pi, sqrt
from pathlib import Path

import numpy as np

from castblast.disk.files import write_csv, write_text
from castblast.export.engines.deck import (
    Firings,
    RadiusTypes,
    atom_lines,
    deck_types,
    opening_lines,
    pair_stiffness,
    plan_firings,
    run_lines,
    time_step,
)
from castblast.export.engines.liggghts_walls import WallKind, stl_text, wall_kinds
from castblast.muckpile.balls.contact import ContactLaw, DashpotMode
from castblast.muckpile.balls.particles import ball_mass
from castblast.muckpile.cast.case import CastCase, check_case
from castblast.types import FloatArray

_MODEL = "model hooke/stiffness tangential history rolling_friction epsd2"


def write_liggghts_deck(
    folder: Path, case: CastCase, *, radius_bins: int = 10, steps: int = 0
) -> list[Path]:
    """Write the deck of `case` into `folder`.

    Parameters
    ----------
    folder : path
    case : CastCase
    radius_bins : int
        As in `castblast.export.engines.lammps_deck.write_lammps_deck`.
    steps : int
        Run so many steps after the last firing and end there; 0: until the pile is at rest.

    Raises
    ------
    SpecError
        One line per thing that LIGGGHTS cannot take.
    """
    types = deck_types("LIGGGHTS", case, radius_bins, liggghts_faults(case))
    firings = plan_firings(case)
    kinds = wall_kinds(case.walls, *_reach(case, firings))
    order = np.argsort(firings.number, kind="stable")
    files = [
        write_text(folder / f"walls{k + 1}.stl", stl_text(kind.corner, f"walls{k + 1}"))
        for k, kind in enumerate(kinds)
        if len(kind.corner)
    ]
    count = len(types.radius) + len(kinds)
    data = atom_lines(case, types, count, order)
    lines = _input_lines(case, types, firings, kinds, steps)
    return [
        write_text(folder / "balls.data", "\n".join(data) + "\n"),
        write_text(folder / "cast.in", "\n".join(lines) + "\n"),
        write_csv(folder / "balls.csv", {"atom": np.arange(len(order)) + 1, "ball": order}),
        *files,
    ]


def liggghts_faults(case: CastCase) -> list[str]:
    """Return what of `case` LIGGGHTS cannot take, in words; empty: it can take all."""
    faults = check_case(case)
    cut = case.law.dashpot_mode in (DashpotMode.SLIP_CUT, DashpotMode.NO_TENSION_SLIP_CUT)
    if case.law.damping_shear > 0.0 and not cut:
        faults.append(
            f"dashpot_mode = {int(case.law.dashpot_mode)}: the shear dashpot of LIGGGHTS always "
            "rests while a contact slips; use 2 or 3"
        )
    return faults


def _reach(case: CastCase, firings: Firings) -> tuple[FloatArray, FloatArray]:
    """Box that no ball leaves unless others push it: least and largest corner (3,) [m]."""
    balls = case.particles
    speeds = [
        np.linalg.norm(v, axis=1).max(initial=0.0) for v in (balls.velocity, firings.velocity)
    ]
    v, g, margin = max(speeds), max(case.gravity, 1e-3), 4.0 * float(balls.radius.max())
    low, high = balls.position.min(axis=0) - margin, balls.position.max(axis=0) + margin
    fall = float(high[2] - min(low[2], 0.0))
    aside = v * (v + sqrt(v * v + 2.0 * g * fall)) / g + fall
    rise = v * v / (2.0 * g)
    return low - np.array([aside, aside, 0.0]), high + np.array([aside, aside, rise])


def _input_lines(
    case: CastCase, types: RadiusTypes, firings: Firings, kinds: list[WallKind], steps: int
) -> Iterator[str]:
    """Lines of the input script."""
    step = time_step(case, firings)
    yield "# A cast written by castblast: mpirun liggghts -in cast.in"
    yield "units si\natom_style sphere\natom_modify map array\nboundary m m m\nnewton off"
    yield "communicate single vel yes\nprocessors * * 1"
    yield "read_data balls.data"
    yield from opening_lines(case, step)
    yield from _law_lines(case.law, types.radius, kinds)
    yield from _wall_lines(case.law, len(types.radius), kinds)
    yield f"\nfix gravity all gravity {case.gravity:.17g} vector 0 0 -1"
    ends = np.concatenate([[0], np.cumsum(np.bincount(firings.number, minlength=1))])

    def members(number: int) -> str:
        return f"id {ends[number] + 1}:{ends[number + 1]}"

    if not case.hold_unfired:
        yield "group free union all"
    elif ends[1] > 0:
        yield f"group free {members(0)}"
    else:
        yield "group free subtract all all"
    columns = "id type radius x y z vx vy vz"
    yield from run_lines(case, firings, step, steps, members, columns)
    yield (
        "dump final all custom 1 final.dump id type radius x y z vx vy vz omegax omegay omegaz\n"
        "dump_modify final sort id\nrun 0"
    )


def _law_lines(law: ContactLaw, radius: FloatArray, kinds: list[WallKind]) -> Iterator[str]:
    """Properties of all pairs of types: those of balls first, then one for each kind of wall."""
    balls, count = len(radius), len(radius) + len(kinds)
    mass = ball_mass(radius, law.density)
    kn, shared = np.ones((count, count)), np.ones((count, count))
    kn[:balls, :balls] = pair_stiffness(radius[:, None], radius[None, :], law.effective_modulus)
    shared[:balls, :balls] = mass[:, None] * mass / (mass[:, None] + mass)
    kn[:balls, balls:] = (pi * law.effective_modulus * radius)[:, None]
    shared[:balls, balls:] = mass[:, None]
    friction, rolling = np.full_like(kn, law.friction), np.full_like(kn, law.rolling_friction)
    for k, kind in enumerate(kinds):
        if not np.isnan(kind.friction):
            friction[:balls, balls + k] = kind.friction
        if not np.isnan(kind.rolling_friction):
            rolling[:balls, balls + k] = kind.rolling_friction
    # A dashpot is given per unit of the mass that two balls share.
    rate = np.sqrt(kn / shared)
    ks = 1.0 / law.stiffness_ratio
    yield "\n# Contact law: one value per pair of types, the last types are those of the walls\n"
    for name, table in (
        ("kn", kn),
        ("kt", ks * kn),
        ("gamman", 2.0 * law.damping_normal * rate),
        ("gammat", 2.0 * law.damping_shear * sqrt(ks) * rate),
        ("coefficientFriction", friction),
        ("coefficientRollingFriction", rolling),
    ):
        upper = np.triu(table)
        whole = upper + np.triu(table, 1).T
        words = " ".join(f"{v:.12g}" for v in whole.ravel())
        yield f"fix {name} all property/global {name} peratomtypepair {count} {words}"
    yield f"pair_style gran {_MODEL} {_settings(law)}\npair_coeff * *"


def _settings(law: ContactLaw) -> str:
    no_tension = law.dashpot_mode in (DashpotMode.NO_TENSION, DashpotMode.NO_TENSION_SLIP_CUT)
    return f"limitForce {'on' if no_tension else 'off'} tangential_damping on"


def _wall_lines(law: ContactLaw, balls: int, kinds: list[WallKind]) -> Iterator[str]:
    yield "\n# Walls\n"
    for k, kind in enumerate(kinds):
        number = balls + k + 1
        for i, words in enumerate(kind.planes):
            yield (
                f"fix plane{k + 1}_{i + 1} all wall/gran {_MODEL} "
                f"primitive type {number} {words} {_settings(law)}"
            )
        if len(kind.corner):
            mesh = f"mesh{k + 1}"
            yield f"fix {mesh} all mesh/surface file walls{k + 1}.stl type {number}"
            yield (
                f"fix walls{k + 1} all wall/gran {_MODEL} "
                f"mesh n_meshes 1 meshes {mesh} {_settings(law)}"
            )
