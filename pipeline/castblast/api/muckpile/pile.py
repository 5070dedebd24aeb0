"""A muckpile for people: metrics, blocks, surface, balls, pictures, files."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from castblast.api.bench import picture
from castblast.api.muckpile.document import HEADER, metric_rows
from castblast.api.muckpile.files import OPTIONAL_FILES, write_results
from castblast.api.muckpile.ore import OreRun
from castblast.api.muckpile.tables import block_columns, middle_section, pile_surface
from castblast.api.muckpile.velocity import velocity_remarks
from castblast.api.shared.frames import library
from castblast.api.shared.markup import box, table
from castblast.disk.files import staged
from castblast.errors import SpecError
from castblast.extras import is_installed, require
from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.cast.solver import CastCase, CastResult
from castblast.muckpile.ground.walls import Walls
from castblast.muckpile.results.metrics import UNITS, PileMetrics
from castblast.muckpile.results.profile import HeightField, mean_profile
from castblast.scene.begun import Start
from castblast.scene.plan import Plan
from castblast.specs.bench.bench import BenchSpec
from castblast.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure


class Run(NamedTuple):
    """Everything that a cast began with and came to."""

    spec: BenchSpec
    folder: Path
    plan: Plan
    start: Start
    case: CastCase
    result: CastResult
    metrics: PileMetrics
    ore: OreRun | None
    document: dict[str, Any]
    snapshots: list[tuple[float, FloatArray]]


@dataclass(frozen=True, eq=False, repr=False)
class Muckpile:
    """A muckpile and the bench it came from; made by `cast`.

    Attributes
    ----------
    run : Run
        The records of the simulation.
    plot : PilePlots
        Pictures: ``plot.section()``, ``plot.plan()``, ``plot.view()``, ``plot.energy()``.
    """

    run: Run
    plot: PilePlots = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "plot", PilePlots(self.run))

    @property
    def document(self) -> dict[str, Any]:
        """Everything in ``metrics.json``: plain values, SI."""
        return self.run.document

    @property
    def faults(self) -> list[str]:
        """Reasons not to believe the result; empty: none."""
        return list(self.run.document["faults"])

    @property
    def remarks(self) -> list[str]:
        """How to read the result."""
        ground = self.run.document.get("ground_remarks", ())
        return [*ground, *velocity_remarks(self.run.plan.prediction)]

    @cached_property
    def metrics(self) -> pd.Series:
        """Throw, run-out, swell, ... [SI]; units in ``attrs["units"]``.

        `initial_velocity` has the ends of its prediction band beside it where it was predicted.
        """
        pandas = library("pandas", "Muckpile.metrics")
        values: dict[str, float] = {"initial_velocity": self.document["initial_velocity"]}
        units = {"initial_velocity": "m s-1"}
        for end, number in self.document["prediction_band"].get("burden_velocity", {}).items():
            values[f"initial_velocity_prediction_{end}"] = number
            units[f"initial_velocity_prediction_{end}"] = "m s-1"
        for name, unit in UNITS.items():
            value = getattr(self.run.metrics, name)
            if name == "throw":
                for letter, number in zip("xyz", value, strict=True):
                    values[f"throw_{letter}"], units[f"throw_{letter}"] = float(number), unit
            elif np.ndim(value) == 0:
                values[name], units[name] = float(value), unit
        series = pandas.Series(values, name=self.run.spec.name)
        series.attrs["units"] = units
        return series

    @cached_property
    def blocks(self) -> pd.DataFrame:
        """One row for each block: delay, speed, throw, heave, place before, movement, spread."""
        pandas = library("pandas", "Muckpile.blocks")
        run = self.run
        bench = run.spec.bench.to_bench()
        columns = block_columns(run.case, run.result.particles, bench, run.plan.label)
        heads = {head: head.partition(" [") for head in columns}
        made = pandas.DataFrame({heads[head][0]: values for head, values in columns.items()})
        made.attrs["units"] = {
            name: unit.rstrip("]").replace("m/s", "m s-1") or "1"
            for name, _, unit in heads.values()
        }
        return made.set_index("block")

    @cached_property
    def surface(self) -> xr.DataArray:
        """Top of the pile, or of the ground where there is none, over `y` and `x` [m]."""
        xarray = library("xarray", "Muckpile.surface")
        field = _surface(self.run)
        about = {
            "x": {"units": "m", "long_name": "distance in front of the toe of the face"},
            "y": {"units": "m", "long_name": "distance along the bench"},
        }
        made: xr.DataArray = xarray.DataArray(
            field.height,
            coords={"y": ("y", field.y, about["y"]), "x": ("x", field.x, about["x"])},
            dims=("y", "x"),
            name="height",
            attrs={"units": "m", "long_name": "height of the surface over the floor of the bench"},
        )
        return made

    @cached_property
    def balls(self) -> xr.Dataset:
        """Balls: final place and that before the blast [m], radius [m], block (-1: none)."""
        xarray = library("xarray", "Muckpile.balls")
        before, after = self.run.case.particles, self.run.result.particles
        columns: dict[str, Any] = {}
        for words, suffix, position in (
            ("after the blast", "", after.position),
            ("before the blast", "_before", before.position),
        ):
            for k, letter in enumerate("xyz"):
                about = {"units": "m", "long_name": f"{letter} of the centre {words}"}
                columns[f"{letter}{suffix}"] = ("ball", position[:, k], about)
        columns["radius"] = ("ball", after.radius, {"units": "m", "long_name": "radius"})
        about = {"units": "1", "long_name": "block that the ball belongs to; -1: none"}
        columns["block"] = ("ball", after.block, about)
        made: xr.Dataset = xarray.Dataset(
            columns,
            coords={"ball": np.arange(len(after.radius))},
            attrs={"bench": self.run.spec.name},
        )
        return made

    @cached_property
    def snapshots(self) -> xr.DataArray:
        """Places of the balls on the way, over `time`, `ball` and `axis`; see `cast`.

        Raises
        ------
        SpecError
            None were asked for.
        """
        xarray = library("xarray", "Muckpile.snapshots")
        if not self.run.snapshots:
            message = "snapshots: none were kept; ask cast for them, such as snapshots='0.5 s'"
            raise SpecError(message, field="snapshots")
        times = [time for time, _ in self.run.snapshots]
        made: xr.DataArray = xarray.DataArray(
            np.stack([position for _, position in self.run.snapshots]),
            coords={
                "time": ("time", times, {"units": "s", "long_name": "time since the first firing"}),
                "axis": list("xyz"),
            },
            dims=("time", "ball", "axis"),
            name="position",
            attrs={"units": "m", "long_name": "centres of the balls"},
        )
        return made

    def save(self, folder: str | Path) -> list[Path]:
        """Write all that ``castblast muckpile`` writes: state, tables, metrics, pictures.

        Raises
        ------
        OutputError
            The folder cannot be written to, or the disk is full.
        """
        require("plot", purpose="Muckpile.save")
        folder, run = Path(folder), self.run
        write = partial(
            write_results,
            spec=run.spec,
            case=run.case,
            result=run.result,
            document=run.document,
            ore=run.ore,
            label=run.plan.label,
        )
        with staged(folder, replaces=OPTIONAL_FILES) as scratch:
            files = [path.relative_to(scratch) for path in write(scratch)]
        return [folder / path for path in files]

    def _title(self) -> str:
        count = len(self.run.result.particles.radius)
        throw = self.run.metrics.throw[0]
        return f"{self.run.spec.name}: {count:,} balls, thrown {throw:.1f} m"

    def __repr__(self) -> str:
        return f"<Muckpile {self._title()}>"

    def _repr_html_(self) -> str:
        parts = [table(HEADER, metric_rows(self.document))]
        if is_installed("matplotlib"):
            from castblast.report.style import figure_png

            parts.append(picture(figure_png(self.plot.section(), dpi=70), "section of the pile"))
        return box(self._title(), *parts, lead="; ".join([*self.faults, *self.remarks]))


class PilePlots:
    """Pictures of a muckpile, each a matplotlib Figure; nothing is written.

    Parameters
    ----------
    run : Run
    """

    def __init__(self, run: Run) -> None:
        self._run = run

    def section(self, y: float | None = None) -> Figure:
        """Bench and muckpile in section at `y` [m]; default: the middle of the bench."""
        self._need()
        from castblast.report.piles.muckpile_figures import section_figure

        before, after, bench, walls = self._scene()
        place = middle_section(before, bench) if y is None else float(y)
        mean = mean_profile(_surface(self._run))
        return section_figure(before, after, bench, walls, y=place, mean_profile=mean)

    def plan(self) -> Figure:
        """Bench and muckpile from above, each ball in the colour of its block."""
        self._need()
        from castblast.report.piles.muckpile_figures import plan_figure

        before, after, bench, _ = self._scene()
        return plan_figure(before, after, bench)

    def view(self) -> Figure:
        """Bench and muckpile on their ground, from above and aside."""
        self._need()
        from castblast.report.piles.muckpile_view import view_figure

        return view_figure(*self._scene())

    def energy(self) -> Figure:
        """Kinetic energies and movement over time, and the budget."""
        self._need()
        from castblast.report.piles.muckpile_figures import energy_figure

        return energy_figure(self._run.result.history, self._run.result.ledger)

    def _need(self) -> None:
        require("plot", purpose="Muckpile.plot")

    def _scene(self) -> tuple[Particles, Particles, Any, Walls]:
        run = self._run
        bench = run.spec.bench.to_bench()
        return run.case.particles, run.result.particles, bench, run.case.walls


def _surface(run: Run) -> HeightField:
    bench = run.spec.bench.to_bench()
    return pile_surface(run.case.particles, run.result.particles, bench, run.case.walls)
