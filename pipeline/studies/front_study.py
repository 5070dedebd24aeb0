"""Rock that yields in the wave front: mesh and viscosity refined, together and each alone.

    python pipeline/studies/front_study.py            # about five minutes on two cores

Designs of the full recipe in which N nu / (1 - nu) < 1. The table `front` of
`pipeline/docs/mesh_study.md` is written by this script, between its marks.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from mesh_study import PAGE, Change, Setting, keep, put, run_all, table
from study_cases import draw_cases

from castblast.blast.run import BlastCase
from castblast.disk.files import write_text
from castblast.nearfield.march import Annulus
from castblast.nearfield.setup import EQUILIBRIUM_REACH, EQUILIBRIUM_ZONES, FRONT_ZONES

SEED, DRAWN = 31, 800
REFERENCE_ZONES = 2400


def front_setting(zones: int, linear: float, *, before: bool = False) -> Change:
    """Mesh refined everywhere alike, and a viscosity over 0.04 radii in all rock.

    `before` : the mesh of rock whose front stays elastic, which was once that of all rock.
    """

    def change(a: Annulus) -> Annulus:
        material = a.material._replace(linear_viscosity=linear)
        usual = EQUILIBRIUM_ZONES if before else a.zones
        reach = EQUILIBRIUM_REACH * a.inner_radius if before else a.reach
        width = a.first_width * usual / zones
        return a._replace(zones=float(zones), first_width=width, reach=reach, material=material)

    return change


def front_study(cases: Sequence[BlastCase]) -> list[str]:
    """Rock that yields in the wave front: mesh and viscosity refined together and each alone."""
    fine = run_all(cases, Setting("", front_setting(REFERENCE_ZONES, 0.0)))
    n = EQUILIBRIUM_ZONES
    settings = [
        Setting(f"{n} zones, C_L 0.15 (before)", front_setting(n, 0.15, before=True)),
        Setting(f"{n} zones, C_L 0", front_setting(n, 0.0, before=True)),
        Setting(f"{FRONT_ZONES} zones (default)", keep),
        *(Setting(f"{z} zones", front_setting(z, 0.0)) for z in (600, 1200)),
        *(
            Setting(f"600 zones, C_L {c:g}", front_setting(600, c))
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
