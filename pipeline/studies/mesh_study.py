"""Mesh, viscosity and end time of the near field against their error, over random designs.

    python pipeline/studies/mesh_study.py            # about two minutes on two cores

Designs are drawn from the full recipe by the dataset's own functions; rock that yields in the wave
front has a study of its own, `front_study.py`. Every setting is compared with the default mesh
refined eight times everywhere. Cost is counted, not timed: zones in motion summed over the steps.
The tables and figures of `pipeline/docs/mesh_study.md` are written by this script, between its
marks.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from study_cases import ROOT, draw_cases

from castblast.blast.run import BlastCase
from castblast.disk.files import write_text
from castblast.errors import Status
from castblast.explosive.isentrope import pressure
from castblast.nearfield.case import NearFieldSettings
from castblast.nearfield.march import Annulus, March, march
from castblast.nearfield.mesh import (
    EASING,
    ELASTIC_SPLIT,
    EQUILIBRIUM_REACH,
    EQUILIBRIUM_WIDTH,
    EQUILIBRIUM_ZONES,
    FRONT_SPLIT,
    FRONT_WIDTH,
    FRONT_ZONES,
    WALL_SPLIT,
)
from castblast.nearfield.outcome import STATE_NAMES, WINDOW, end_state, mean_over
from castblast.nearfield.setup import EQUILIBRIUM_RADII
from castblast.nearfield.solver import _annulus
from castblast.report.style import CYCLE, GREY, in_style, new_figure, save_figure
from castblast.types import FloatArray

Change: TypeAlias = Callable[[Annulus], Annulus]

PAGE = ROOT / "pipeline/docs/mesh_study.md"
STUDY_SEED, CHECK_SEED = 7, 99
#: The default refined everywhere: the reference, and that of the check.
FINEST, FINE = 8 * EQUILIBRIUM_ZONES, 4 * EQUILIBRIUM_ZONES
#: Changes no number of the tables.
_THREADS = 2
#: Long runs for the end time: last windows, in units of the time at which the wall turns back.
LONG, LATE = 6.0, (4.0, 6.0)
WINDOWS = ((1.3, 1.8), (1.5, 1.8), (1.6, 1.9), (1.6, 2.2), (2.0, 3.0), (2.5, 3.5))

#: Heading of each target and the outputs that it adds up.
TARGETS: dict[str, tuple[str, ...]] = {
    "pressure": ("equilibrium_pressure",),
    "hole radius": ("expanded_hole_radius",),
    "crushed": ("crushed_zone_radius",),
    "intense": ("intense_shear_radius",),
    "yield": ("plastic_zone_radius",),
    "gas work": ("gas_work",),
    "plastic": ("plastic_work", "tensile_work"),
    "radiated": ("kinetic_energy", "elastic_energy", "viscous_work", "boundary_work"),
}
#: Limits of the dataset default: 95th percentile of the error [percent].
LIMITS = {"pressure": 0.3, "hole radius": 0.1}


class Setting(NamedTuple):
    """One row of a table: what is changed, beginning from the default of the solver.

    `zones` : of rock whose front stays elastic, all meshes refined alike; 0: the default.
    """

    label: str
    change: Change
    zones: int = 0


class Outcome(NamedTuple):
    """Targets (cases, targets), zone-steps, steps and open energy balance (cases,)."""

    targets: FloatArray
    zone_steps: FloatArray
    steps: FloatArray
    residual: FloatArray


def annuli(cases: Sequence[BlastCase], zones: int = 0) -> list[Annulus]:
    """Annulus of every case on a mesh of so many zones, refined everywhere alike; 0: default."""
    return [
        _annulus(c.explosive, c.rock, c.hole, c.near_field._replace(zones=zones)) for c in cases
    ]


def run_all(cases: Sequence[BlastCase], setting: Setting) -> Outcome:
    """March all cases under a setting.

    Raises
    ------
    RuntimeError
        A run ended without a result.
    """
    names = [STATE_NAMES.index(name) for parts in TARGETS.values() for name in parts]
    groups = np.repeat(np.arange(len(TARGETS)), [len(parts) for parts in TARGETS.values()])

    def one(pair: tuple[BlastCase, Annulus]) -> FloatArray:
        case, annulus = pair
        run = _finished(setting.change(annulus))
        state = np.empty(len(STATE_NAMES))
        end_state(annulus, run, float(case.explosive.total_energy), state)
        targets = np.bincount(groups, weights=state[names])
        residual = state[STATE_NAMES.index("energy_residual")]
        return np.concatenate([targets, [run.zone_steps, run.steps, residual]])

    with ThreadPoolExecutor(_THREADS) as pool:
        table = np.array(list(pool.map(one, zip(cases, annuli(cases, setting.zones), strict=True))))
    return Outcome(table[:, :-3], table[:, -3], table[:, -2], table[:, -1])


def _finished(annulus: Annulus) -> March:
    run = march(annulus._replace(max_steps=5_000_000))
    if run.status != Status.OK:
        message = f"a run ended with status {Status(run.status).name}: {annulus}"
        raise RuntimeError(message)
    return run


def table(
    settings: Sequence[Setting], cases: Sequence[BlastCase], reference: FloatArray
) -> tuple[list[str], list[Outcome]]:
    """Rows of a Markdown table: cost, then median, 95th percentile and maximum of each error."""
    head = ["setting", "1000 zone-steps", "steps", "balance", *TARGETS]
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
    outcomes = []
    for setting in settings:
        outcome = run_all(cases, setting)
        outcomes.append(outcome)
        lines.append(row(setting.label, outcome, reference))
        print(lines[-1], flush=True)
    return lines, outcomes


def row(label: str, outcome: Outcome, reference: FloatArray) -> str:
    """One row of a table; errors in percent."""
    error = errors(outcome, reference)
    cells = [
        f"{np.median(e):.2f} / {np.percentile(e, 95):.2f} / {e.max():.2f}"
        if e.max() >= 0.095
        else f"{np.median(e):.3f} / {np.percentile(e, 95):.3f} / {e.max():.3f}"
        for e in error.T
    ]
    cost = f"{outcome.zone_steps.mean() / 1e3:.0f}"
    balance = f"{np.abs(outcome.residual).max():.0e}"
    return (
        f"| {label} | {cost} | {outcome.steps.mean():.0f} | {balance} | " + " | ".join(cells) + " |"
    )


def errors(outcome: Outcome, reference: FloatArray) -> FloatArray:
    """Relative errors in percent, (cases, targets)."""
    return np.asarray(100.0 * np.abs(outcome.targets / reference - 1.0))


def keep(annulus: Annulus) -> Annulus:
    """Change nothing."""
    return annulus


def never_merged(annulus: Annulus) -> Annulus:
    """Keep the zones of the front to the end."""
    return annulus._replace(coarse=annulus.coarse._replace(first=0.0))


def merging_to(factor: float) -> Change:
    """Factor on the widths to which zones merge; the front stays as it is."""

    def change(a: Annulus) -> Annulus:
        c = a.coarse
        return a._replace(coarse=c._replace(first=factor * c.first, growth=factor * c.growth))

    return change


def with_viscosity(linear: float, quadratic: float) -> Change:
    """Other viscosities; of the linear one a rock gets the same share as of the default."""
    usual = NearFieldSettings().linear_viscosity

    def change(a: Annulus) -> Annulus:
        share = a.material.linear_viscosity / usual
        material = a.material._replace(
            linear_viscosity=share * linear, quadratic_viscosity=quadratic
        )
        return a._replace(material=material)

    return change


def with_courant(share: float) -> Change:
    """Other share of the largest stable step."""
    return lambda annulus: annulus._replace(courant=share)


def window_errors(cases: Sequence[BlastCase]) -> tuple[list[str], FloatArray]:
    """Error of the window in which the hole radius is averaged, against the late mean.

    Returns
    -------
    lines : list of str
        A Markdown table.
    paths : array (cases, 60)
        Departure of the hole radius from its late mean [percent], in steps of 0.1 from 0 to 6.
    """

    def one(pair: tuple[BlastCase, Annulus]) -> tuple[FloatArray, FloatArray]:
        case, annulus = pair
        run = _finished(annulus._replace(settling_factor=LONG))
        turn, record = run.reversal_time, run.record
        radii = [mean_over(record, a * turn, b * turn).mean for a, b in (*WINDOWS, LATE)]
        per_charge = 4.0 / case.hole.charge_diameter**2
        isentrope = annulus.load.isentrope
        pressures = [pressure(isentrope, r * r * per_charge) for r in radii]
        path = np.interp(np.arange(60) * 0.1 * turn, record[:, 0], record[:, 1])
        return np.array([radii, pressures]), 100.0 * (path / radii[-1] - 1.0)

    with ThreadPoolExecutor(_THREADS) as pool:
        done = list(pool.map(one, zip(cases, annuli(cases, 2 * EQUILIBRIUM_ZONES), strict=True)))
    values = np.array([pair[0] for pair in done])
    error = 100.0 * np.abs(values[:, :, :-1] / values[:, :, -1:] - 1.0)
    lines = ["| window [t_rev] | hole radius | pressure |", "|---|---:|---:|"]
    for k, (start, end) in enumerate(WINDOWS):
        cells = [
            f"{np.median(e):.3f} / {np.percentile(e, 95):.3f} / {e.max():.3f}"
            for e in (error[:, 0, k], error[:, 1, k])
        ]
        mark = " (default)" if (start, end) == tuple(WINDOW) else ""
        lines.append(f"| {start} to {end}{mark} | {cells[0]} | {cells[1]} |")
        print(lines[-1], flush=True)
    return lines, np.array([pair[1] for pair in done])


@in_style
def draw_cost(points: Sequence[tuple[float, float, float]], path: Path) -> None:
    """95th percentile of the error over the cost, for pressure and hole radius."""
    figure, axes = new_figure(1, 2, width=8.0, height=3.0)
    cost, *error = np.array(points).T
    for k, (target, limit) in enumerate(LIMITS.items()):
        axes[k].loglog(cost / 1e3, error[k], "o-", color=CYCLE[0], markersize=4)
        axes[k].axhline(limit, color=GREY, linestyle="--", linewidth=1.0)
        axes[k].set_title(f"Error of the {target}")
        axes[k].set_xlabel("1000 zone-steps per case")
        axes[k].set_ylabel("95th percentile [%]")
    save_figure(figure, path, dpi=110)


@in_style
def draw_paths(paths: FloatArray, path: Path) -> None:
    """Hole radius after the wall has turned back, all cases, against its late mean."""
    figure, axes = new_figure(1, 1, width=6.0, height=3.0)
    time = np.arange(60) * 0.1
    axes.plot(time, paths.T, color=CYCLE[0], alpha=0.3, linewidth=0.8)
    axes.axvspan(*WINDOW, color=CYCLE[1], alpha=0.3, label="window of the end state")
    axes.set_xlim(0.7, LONG)
    axes.set_ylim(-1.0, 1.0)
    axes.set_title("Hole radius after the wall has turned back")
    axes.set_xlabel("time over time of turning back")
    axes.set_ylabel("departure from the late mean [%]")
    axes.legend()
    save_figure(figure, path, dpi=110)


def put(page: str, name: str, lines: Sequence[str]) -> str:
    """Replace what stands between the marks of a name."""
    begin, end = f"<!-- begin {name} -->", f"<!-- end {name} -->"
    before, rest = page.split(begin)
    _, after = rest.split(end)
    return before + begin + "\n" + "\n".join(lines) + "\n" + end + after


def study(
    cases: Sequence[BlastCase], checks: dict[str, list[BlastCase]], figures: Path
) -> dict[str, list[str]]:
    """Rock whose front stays elastic; tables by name."""
    fine = run_all(cases, Setting("", keep, FINEST))
    blocks: dict[str, list[str]] = {"default": describe_default()}
    counts = (36, 54, EQUILIBRIUM_ZONES, 108, 144, FINE)
    blocks["zones"], by_zones = table(
        [Setting(_default_mark(z), keep, z) for z in counts], cases, fine.targets
    )
    for name, settings in variations().items():
        blocks[name], _ = table(settings, cases, fine.targets)
    for name, others in checks.items():
        reference = run_all(others, Setting("", keep, FINE)).targets
        lines, _ = table([Setting(f"{name}, {len(others)} designs", keep)], others, reference)
        blocks["check"] = blocks.get("check", lines[:2]) + lines[2:]
    blocks["window"], paths = window_errors([*cases, *checks["full"]])
    points = [_point(outcome, fine.targets) for outcome in by_zones]
    draw_cost(points, figures / "mesh_cost.png")
    draw_paths(paths, figures / "mesh_window.png")
    return blocks


def describe_default() -> list[str]:
    """Formula of the default mesh with the numbers of the solver."""
    return [
        f"{EQUILIBRIUM_ZONES} zones to {EQUILIBRIUM_RADII:,.0f} hole radii behind the front, of "
        "the width",
        "",
        f"    (first + g y) (1 + y / {EQUILIBRIUM_REACH:g})",
        f"    first = {EQUILIBRIUM_WIDTH:g} (x^2 + 0.3^2)^(1/4) / (1 + (x / 6)^2)^(1/4)",
        "",
        f"and {FRONT_ZONES} with {FRONT_WIDTH:g} in rock that yields in the wave front. In the "
        f"front there are {WALL_SPLIT:g} zones for one at the wall, and far out {ELASTIC_SPLIT:g}, "
        f"or {FRONT_SPLIT:g} where the rock yields in it; between I of {EASING[0]:g} and "
        f"{EASING[1]:g} all of that passes over smoothly.",
    ]


def variations() -> dict[str, list[Setting]]:
    """Settings that differ from the default in one thing, by table."""
    viscosities = ((0.1, 1.5), (0.15, 1.5), (0.3, 1.5), (0.15, 0.75), (0.15, 3.0))
    return {
        "merging": [
            Setting("never merged", never_merged),
            *(Setting(f"widths x {f:g}", merging_to(f)) for f in (0.5, 1.0, 2.0, 4.0)),
        ],
        "viscosity": [
            Setting(f"C_L {a:g}, C_Q {b:g}", with_viscosity(a, b)) for a, b in viscosities
        ],
        "courant": [Setting(f"Courant {c:g}", with_courant(c)) for c in (0.5, 0.7, 0.85, 0.95)],
    }


def _default_mark(zones: int) -> str:
    return f"{zones} zones" + (" (default)" if zones == EQUILIBRIUM_ZONES else "")


def _point(outcome: Outcome, reference: FloatArray) -> tuple[float, float, float]:
    error = np.percentile(errors(outcome, reference), 95, axis=0)
    return float(outcome.zone_steps.mean()), float(error[0]), float(error[1])


def main() -> None:
    """Run the study and write its page."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--cases", type=int, default=32)
    parser.add_argument("--check", type=int, default=64)
    parser.add_argument("--page", type=Path, default=PAGE)
    options = parser.parse_args()
    cases = draw_cases(options.cases, STUDY_SEED)
    checks = {name: draw_cases(options.check, CHECK_SEED, name) for name in ("full", "paper")}
    page = options.page.read_text(encoding="utf-8")
    for name, lines in study(cases, checks, options.page.parent / "figures").items():
        page = put(page, name, lines)
    write_text(options.page, page)


if __name__ == "__main__":
    main()
