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
from math import pi, sqrt
from pathlib import Path

import numpy as np

from castblast.disk.files import write_text
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
from castblast.export.engines.lammps_walls import WallRegion, wall_regions
from castblast.muckpile.balls.contact import ContactLaw, DashpotMode
from castblast.muckpile.cast.case import CastCase, check_case
from castblast.types import FloatArray

#: Damping coefficient alpha of restitution e, from e^0 to e^6 (Tsuji et al. 1992).
_TSUJI = (1.2728, -4.2783, 11.087, -22.348, 27.467, -18.022, 4.8218)


def write_lammps_deck(
    folder: Path, case: CastCase, *, radius_bins: int = 10, steps: int = 0
) -> list[Path]:
    """Write `balls.data` and `cast.in` into `folder`.

    Parameters
    ----------
    folder : path
    case : CastCase
    radius_bins : int
        Types of radius. A case with no more distinct radii has one type for each, and then its
        stiffnesses are exact; otherwise ten types leave an rms error of 6 per cent in the
        stiffness of single contacts and of less than one in the mean.
    steps : int
        Run so many steps after the last firing and end there; 0: until the pile is at rest.

    Raises
    ------
    SpecError
        One line per thing that LAMMPS cannot take.
    """
    types = deck_types("LAMMPS", case, radius_bins, deck_faults(case))
    firings = plan_firings(case)
    lines = _input_lines(case, types, firings, steps)
    return [
        write_text(folder / "balls.data", "\n".join(_data_lines(case, types, firings)) + "\n"),
        write_text(folder / "cast.in", "\n".join(lines) + "\n"),
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
            "use planes and slopes, or LIGGGHTS, which takes it"
        )
    return faults + wall_regions(case.walls)[1]


def restitution_for(damping: float) -> float:
    """Return e with which the formula of Tsuji et al. gives alpha(e) = 2 damping.

    0.44035 for a damping of 0.2.
    """
    from scipy.optimize import brentq

    def open_(e: float) -> float:
        return float(np.polynomial.polynomial.polyval(e, _TSUJI)) - 2.0 * damping

    # alpha(1) is 0.0003, not zero.
    return 1.0 if open_(1.0) >= 0.0 else float(brentq(open_, 0.0, 1.0, xtol=1e-12))


def _data_lines(case: CastCase, types: RadiusTypes, firings: Firings) -> Iterator[str]:
    """Lines of the data file; atom k + 1 is ball k."""
    yield from atom_lines(case, types, len(types.radius))
    yield "\nFiring\n"
    for k, number in enumerate(firings.number):
        yield f"{k + 1} {number}"


def _input_lines(case: CastCase, types: RadiusTypes, firings: Firings, steps: int) -> Iterator[str]:
    """Lines of the input script."""
    radius, law = types.radius, case.law
    step = time_step(case, firings)
    yield "# A cast written by castblast: mpirun lmp -in cast.in"
    yield "units si\natom_style sphere\natom_modify map array\nboundary s s s\nnewton off"
    yield "comm_modify vel yes\nprocessors * * 1"
    yield "# The molecule number of a ball is its firing; 0: free from the start"
    yield "fix firing all property/atom mol"
    yield "read_data balls.data fix firing NULL Firing"
    yield from opening_lines(case, step)
    yield "\n# Contact law: one stiffness per pair of types\n"
    yield "pair_style granular"
    for i, j in combinations_with_replacement(range(len(radius)), 2):
        kn = float(pair_stiffness(radius[[i]], radius[[j]], law.effective_modulus)[0])
        words = _law_words(law, kn, law.friction, law.rolling_friction)
        yield f"pair_coeff {i + 1} {j + 1} {words}"
    yield "\n# Walls: their stiffness depends on the ball, so each type has its own\n"
    for k in range(len(radius)):
        yield f"group type{k + 1} type {k + 1}"
    for wall in wall_regions(case.walls)[0]:
        yield from _wall_lines(wall, radius, law)
    yield f"\nfix gravity all gravity {case.gravity:.17g} vector 0 0 -1"
    yield "group free molecule 0" if case.hold_unfired else "group free union all"
    columns = "id type diameter x y z vx vy vz mol"
    yield from run_lines(case, firings, step, steps, lambda number: f"molecule {number}", columns)
    yield (
        "write_dump all custom final.dump id type diameter x y z vx vy vz "
        "omegax omegay omegaz mol modify sort id"
    )


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
