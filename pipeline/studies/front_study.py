"""Rock that yields in the wave front: mesh and viscosity refined, together and each alone.

    python pipeline/studies/front_study.py            # about ten minutes on two cores

Designs of the full recipe in which N nu / (1 - nu) < 1, against the default mesh refined four times
everywhere and never merged. The table `front` of `pipeline/docs/mesh_study.md` is written by this
script, between its marks.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from mesh_study import PAGE, Change, Setting, keep, never_merged, put, run_all, table
from study_cases import draw_cases

from castblast.blast.run import BlastCase
from castblast.disk.files import write_text
from castblast.nearfield.march import Annulus
from castblast.nearfield.mesh import EQUILIBRIUM_ZONES

SEED, DRAWN = 31, 800


def viscous(linear: float) -> Change:
    """A viscosity over 0.04 radii, which such rock does not have."""

    def change(a: Annulus) -> Annulus:
        return a._replace(material=a.material._replace(linear_viscosity=linear))

    return change


def front_study(cases: Sequence[BlastCase]) -> list[str]:
    """Rock that yields in the wave front: mesh and viscosity refined together and each alone."""
    n = EQUILIBRIUM_ZONES
    fine = run_all(cases, Setting("", never_merged, 4 * n))
    settings = [
        Setting("default", keep),
        Setting("default, never merged", never_merged),
        *(Setting(f"refined {k} times", keep, k * n) for k in (2, 4)),
        *(
            Setting(f"refined twice, C_L {c:g}", viscous(c), 2 * n)
            for c in (0.15, 0.05, 0.02, 0.005)
        ),
    ]
    lines, _ = table(settings, cases, fine.targets)
    return lines


def main() -> None:
    """Run the study and write its table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--cases", type=int, default=160)
    parser.add_argument("--page", type=Path, default=PAGE)
    options = parser.parse_args()
    cases = draw_cases(options.cases, SEED, yields=True, of=DRAWN)
    page = options.page.read_text(encoding="utf-8")
    write_text(options.page, put(page, "front", front_study(cases)))


if __name__ == "__main__":
    main()
