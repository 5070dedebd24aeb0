"""What a build asks of the physics: complete a design, refuse it, simulate a batch of rows.

`Simulator` is the whole interface, over columns of equal length, so that a build knows nothing of
blasting. `BlastSimulator` is the real one: `castblast.blast.run`, which advances many rows in
lockstep.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from castblast.blast.inputs import (
    FaultyRows,
    InputColumns,
    design_fault_columns,
    resolve_columns,
)
from castblast.blast.run import BlastSettings, batch_values, run_blasts
from castblast.design.hole import breakout_width, expanded_hole_faults, mean_burden
from castblast.design.variables import OUTPUT_NAMES
from castblast.errors import Status
from castblast.explosive.isentrope import Explosive
from castblast.nearfield.case import EndMode, TensionMode
from castblast.specs.recipe import Recipe
from castblast.types import BoolArray, FloatArray, IndexArray

#: Names of variables to values (n,), SI.
Columns: TypeAlias = Mapping[str, FloatArray]

#: Histories of a sample, all of shape (n, history_points).
HISTORY_NAMES = ("history_time", "history_pressure", "history_radius")
_NUMBER = re.compile(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?")


class BatchResult(NamedTuple):
    """Outcome of n rows.

    Attributes
    ----------
    status : (n,) int8
        `castblast.errors.Status` of each row.
    outputs : dict of (n,) [SI]
        NaN where the status is not OK.
    histories : dict of (n, history_points) [SI]
        The names of `HISTORY_NAMES`; NaN where the status is not OK.
    """

    status: NDArray[np.int8]
    outputs: dict[str, FloatArray]
    histories: dict[str, FloatArray]


class Simulator(Protocol):
    """The physics as a build sees it; must pickle, for workers in other processes."""

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs of every row."""
        ...

    def possible(self, columns: Columns) -> BoolArray:
        """Tell possible rows (n,) from impossible ones."""
        ...

    def faults(self, columns: Columns) -> list[str]:
        """Say for every row what makes it impossible; an empty string where nothing does."""
        ...

    def resolve(self, columns: Columns, explosive: IndexArray) -> dict[str, FloatArray]:
        """Complete the inputs: every input by name, (n,), SI."""
        ...

    def outgrown(self, inputs: Columns, explosive: IndexArray) -> BoolArray:
        """Tell which resolved rows (n,) turn out impossible only when their hole has expanded."""
        ...

    def run(self, inputs: Columns, explosive: IndexArray) -> BatchResult:
        """Simulate resolved rows; physics never raises, it sets a status."""
        ...


@dataclass(frozen=True)
class BlastSimulator:
    """Near field and burden motion of `castblast.blast.run`.

    Attributes
    ----------
    explosives : tuple of Explosive
        In the order of the recipe.
    settings : BlastSettings
    solver_inputs : mapping
        Solver inputs that are the same in every row.
    """

    explosives: tuple[Explosive, ...]
    settings: BlastSettings
    solver_inputs: Mapping[str, float]

    @property
    def output_names(self) -> tuple[str, ...]:
        """Every output of `castblast.design.variables`."""
        return OUTPUT_NAMES

    def possible(self, columns: Columns) -> BoolArray:
        """Rows that break no rule of `inputs.design_fault_columns`."""
        faulty: BoolArray = np.any([fault.rows for fault in self._faults(columns)], axis=0)
        return ~faulty

    def faults(self, columns: Columns) -> list[str]:
        """First fault of every row by `inputs.design_fault_columns`."""
        lines = [""] * _count(columns)
        for fault in reversed(self._faults(columns)):  # the first rule has the last word
            for row in np.flatnonzero(fault.rows).tolist():
                lines[row] = fault.say(row)
        return lines

    def resolve(self, columns: Columns, explosive: IndexArray) -> dict[str, FloatArray]:
        """Every input of every row by `inputs.resolve_columns`."""
        values: InputColumns = {**columns, **self.solver_inputs}
        return resolve_columns(values, self.explosives, explosive, self.settings.parameter_set)

    def outgrown(self, inputs: Columns, explosive: IndexArray) -> BoolArray:
        """Rows whose hole expands as wide as their burden or spacing, by `castblast.design.hole`.

        Only rows near that limit are simulated for it: a hole of these explosives expands to less
        than the width of `_widest_hole`.
        """
        width = breakout_width(inputs["spacing"], mean_burden(inputs))
        outgrown = np.zeros(len(width), dtype=bool)
        rows = np.flatnonzero(width < _widest_hole(inputs))
        if len(rows):
            near = {name: np.asarray(column)[rows] for name, column in inputs.items()}
            batch = run_blasts(self.explosives, np.asarray(explosive)[rows], near, self.settings)
            faults = expanded_hole_faults(near, batch.near_field.expanded_hole_radius)
            outgrown[rows] = np.any([fault.rows for fault in faults], axis=0)
        return outgrown

    def run(self, inputs: Columns, explosive: IndexArray) -> BatchResult:
        """Simulate resolved rows in lockstep by `blast.run.run_blasts`."""
        batch = run_blasts(self.explosives, explosive, inputs, self.settings)
        finished = (batch.status == Status.OK)[:, np.newaxis]
        histories = {
            name: np.where(finished, getattr(batch.near_field, name), np.nan)
            for name in HISTORY_NAMES
        }
        return BatchResult(batch.status, batch_values(batch), histories)

    def _faults(self, columns: Columns) -> list[FaultyRows]:
        return design_fault_columns(columns, _count(columns))


def blast_simulator(recipe: Recipe, explosives: tuple[Explosive, ...]) -> BlastSimulator:
    """Set up the physics for a recipe; `explosives` in the order of the recipe."""
    solver = recipe.solver
    settings = BlastSettings(
        mode=EndMode[solver.mode.upper()],
        tension=TensionMode[solver.tension.upper()],
        history_points=solver.history_points,
        parameter_set=recipe.burden_parameter_set,
    )
    inputs = {
        "quadratic_viscosity": solver.quadratic_viscosity,
        "linear_viscosity": solver.linear_viscosity,
        "outer_radius": solver.outer_radius or 0.0,
        "zones": float(solver.zones),
    }
    return BlastSimulator(explosives, settings, inputs)


def _widest_hole(inputs: Columns) -> FloatArray:
    """Width (n,) [m] that an expanded hole stays below, from the strength of the rock alone.

    Holes of 60,000 designs of the recipe `full` with each of four explosives expand to 1.0 to 3.4
    diameters, at most 0.84 of this width; 1,056 designs over the whole table of inputs, down to
    1 MPa, to at most 10.1 diameters. A wider one would be simulated and fail.
    """
    strength = inputs["ucs"] * inputs["strength_rate_factor"]
    return np.asarray(inputs["hole_diameter"] * np.maximum(2.5, 5.2 * np.cbrt(1e7 / strength)))


def fault_kind(fault: str) -> str:
    """Reduce a fault to its kind by dropping the numbers of its row."""
    return _NUMBER.sub("#", fault)


def _count(columns: Columns) -> int:
    return len(next(iter(columns.values())))
