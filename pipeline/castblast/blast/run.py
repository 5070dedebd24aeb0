"""From inputs to blasts: near field, then burden motion, one blast or many at once.

The inputs are a mapping of the names of `castblast.design.variables` to SI values, completed by
`castblast.blast.inputs`. For one blast, `make_case` turns it into the records the physics takes,
`run_blast` runs both models and `result_values` names every output. `run_blasts` and
`batch_values` do the same for columns of many blasts. The strength rate factor multiplies
uniaxial compressive and tensile strength here, nowhere else.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import nan
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from castblast.blast.inputs import InputColumns, resolve_columns, resolve_inputs
from castblast.burden.batch import BurdenBatch, solve_burden_motions
from castblast.burden.case import BurdenColumns, BurdenGeometry, BurdenParameters, BurdenResult
from castblast.burden.motion import no_burden_motion, solve_burden_motion
from castblast.design.variables import OUTPUT_NAMES
from castblast.errors import Status
from castblast.explosive.isentrope import Explosive
from castblast.nearfield.case import (
    EndMode,
    Hole,
    NearFieldColumns,
    NearFieldSettings,
    Rock,
    TensionMode,
)
from castblast.nearfield.lockstep.batch import NearFieldBatch, solve_near_fields
from castblast.nearfield.solver import NearFieldResult, solve_near_field
from castblast.types import FloatArray, IndexArray

_Value = TypeVar("_Value", float, FloatArray)
#: Inputs that set up the near-field mesh: rows that share them are solved together.
_SOLVER_INPUTS = ("outer_radius", "zones", "quadratic_viscosity", "linear_viscosity")


class BlastSettings(NamedTuple):
    """How a case is solved, beside its inputs.

    Attributes
    ----------
    mode : EndMode
        When the near field ends.
    tension : TensionMode
    history_points : int
        Length of the near-field histories.
    parameter_set : str
        Burden-model defaults, a key of `variables.BURDEN_PARAMETER_SETS`.
    """

    mode: int = EndMode.EQUILIBRIUM
    tension: int = TensionMode.DUCTILE
    history_points: int = 64
    parameter_set: str = "authors"


class BlastCase(NamedTuple):
    """Everything one blast needs, ready for the kernels; made by `make_case`."""

    explosive: Explosive
    rock: Rock
    hole: Hole
    near_field: NearFieldSettings
    geometry: BurdenGeometry
    parameters: BurdenParameters


class BlastResult(NamedTuple):
    """Outcome of one blast.

    Attributes
    ----------
    status : Status
        Of the first part that failed, else OK.
    near_field : NearFieldResult
    burden : BurdenResult
        Empty (NaN, the status of the near field) if the near field failed.
    """

    status: Status
    near_field: NearFieldResult
    burden: BurdenResult


class BlastBatch(NamedTuple):
    """Outcome of n blasts.

    Attributes
    ----------
    status : (n,) int8
        Of the first part that failed, else OK.
    near_field : NearFieldBatch
    burden : BurdenBatch
        NaN where the near field failed.
    """

    status: NDArray[np.int8]
    near_field: NearFieldBatch
    burden: BurdenBatch


def make_case(
    explosive: Explosive,
    values: Mapping[str, float],
    settings: BlastSettings = BlastSettings(),  # noqa: B008  (immutable)
) -> BlastCase:
    """Resolve the inputs and sort them into the records that the physics takes.

    Raises
    ------
    SpecError
        As `inputs.resolve_inputs`.
    """
    full = resolve_inputs(values, explosive, settings.parameter_set)
    near = _rock_and_hole(full)
    return BlastCase(
        explosive=explosive,
        rock=Rock(**{name: near[name] for name in Rock._fields}),
        hole=Hole(**{name: near[name] for name in Hole._fields}),
        near_field=_near_field_settings(full, settings),
        geometry=BurdenGeometry(**{name: full[name] for name in BurdenGeometry._fields}),
        parameters=BurdenParameters(**{name: full[name] for name in BurdenParameters._fields}),
    )


def run_blast(case: BlastCase) -> BlastResult:
    """Run the near field and, from its end state, the burden motion.

    Never raises on physics: a failure is in the status.
    """
    near = solve_near_field(case.explosive, case.rock, case.hole, case.near_field)
    if near.status != Status.OK:
        status = Status(near.status)
        return BlastResult(status, near, no_burden_motion(status))
    burden = solve_burden_motion(
        case.explosive, case.geometry, case.parameters, near.expanded_hole_radius
    )
    return BlastResult(Status(burden.status), near, burden)


def result_values(result: BlastResult) -> dict[str, float]:
    """Every output of `variables.OUTPUTS` by name, SI; all NaN if the run failed."""
    if result.status != Status.OK:
        return dict.fromkeys(OUTPUT_NAMES, nan)
    return {
        name: float(value) for name, value in _outputs(result.near_field, result.burden).items()
    }


def run_blasts(
    explosives: Sequence[Explosive],
    explosive: IndexArray,
    values: InputColumns,
    settings: BlastSettings = BlastSettings(),  # noqa: B008  (immutable)
) -> BlastBatch:
    """Run n blasts; a row does not depend on the others.

    Parameters
    ----------
    explosives : sequence of Explosive
    explosive : (n,) int
        Index into `explosives`.
    values : mapping
        Input names to SI values, resolved or not.
    settings : BlastSettings

    Raises
    ------
    SpecError
        As `inputs.resolve_columns`; on physics never, a failure is in the status of its row.
    """
    full = resolve_columns(values, explosives, explosive, settings.parameter_set)
    index = np.array(explosive, dtype=np.int64)
    # Plain copies, as kernels are compiled for writable, contiguous columns only.
    columns = {name: np.array(column) for name, column in full.items()}
    holes = NearFieldColumns(explosive=index, **_rock_and_hole(columns))
    parts = [
        (rows, solve_near_fields(explosives, _take(holes, rows), near_field))
        for near_field, rows in _solver_groups(columns, settings)
    ]
    near = _gather(parts, len(index))
    solved = near.status == Status.OK
    radius = np.where(solved, near.expanded_hole_radius, nan)
    shared = (*BurdenGeometry._fields, *BurdenParameters._fields)
    burden = solve_burden_motions(
        explosives,
        BurdenColumns(
            explosive=index, expanded_hole_radius=radius, **{name: columns[name] for name in shared}
        ),
    )
    burden = burden._replace(status=np.where(solved, burden.status, near.status))
    return BlastBatch(burden.status.astype(np.int8), near, burden)


def batch_values(batch: BlastBatch) -> dict[str, FloatArray]:
    """Every output of `variables.OUTPUTS` by name, (n,), SI; NaN in rows that failed."""
    finished = batch.status == Status.OK
    outputs = _outputs(batch.near_field, batch.burden)
    return {name: np.where(finished, values, nan) for name, values in outputs.items()}


def _rock_and_hole(full: Mapping[str, _Value]) -> dict[str, _Value]:
    """Fields of `Rock` and `Hole` from resolved inputs, for one blast or columns of many."""
    factor = full["strength_rate_factor"]
    return {
        "density": full["rock_density"],
        "young_modulus": full["young_modulus"],
        "poisson_ratio": full["poisson_ratio"],
        "ucs": full["ucs"] * factor,
        "friction_angle": full["friction_angle"],
        "dilation_angle": full["dilation_angle"],
        "tensile_strength": full["tensile_strength"] * factor,
        "diameter": full["hole_diameter"],
        "charge_diameter": full["charge_diameter"],
        "rise_time": full["rise_time"],
        "in_situ_stress": full["in_situ_stress"],
    }


def _near_field_settings(solver: Mapping[str, float], settings: BlastSettings) -> NearFieldSettings:
    return NearFieldSettings(
        mode=int(settings.mode),
        tension=int(settings.tension),
        outer_radius=solver["outer_radius"],
        zones=round(solver["zones"]),
        quadratic_viscosity=solver["quadratic_viscosity"],
        linear_viscosity=solver["linear_viscosity"],
        history_points=settings.history_points,
    )


def _solver_groups(
    full: Mapping[str, FloatArray], settings: BlastSettings
) -> Iterator[tuple[NearFieldSettings, NDArray[np.intp]]]:
    """Rows (m,) that are solved with the same settings of the near field, and these settings."""
    table = np.array([full[name] for name in _SOLVER_INPUTS])
    kinds, kind = np.unique(table, axis=1, return_inverse=True)
    for number, values in enumerate(kinds.T.tolist()):
        solver = dict(zip(_SOLVER_INPUTS, values, strict=True))
        yield _near_field_settings(solver, settings), np.flatnonzero(kind.ravel() == number)


def _take(columns: NearFieldColumns, rows: NDArray[np.intp]) -> NearFieldColumns:
    return NearFieldColumns._make(column[rows] for column in columns)


def _gather(parts: Sequence[tuple[NDArray[np.intp], NearFieldBatch]], count: int) -> NearFieldBatch:
    """Put results back into the order of their rows, `count` in all."""
    first = parts[0][1]
    whole = [np.empty((count, *column.shape[1:]), dtype=column.dtype) for column in first]
    for rows, part in parts:
        for target, column in zip(whole, part, strict=True):
            target[rows] = column
    return NearFieldBatch._make(whole)


def _outputs(near_field: Any, burden: Any) -> dict[str, Any]:
    """Outputs by name: what the near field does not know comes from the burden motion."""
    return {
        name: getattr(near_field if hasattr(near_field, name) else burden, name)
        for name in OUTPUT_NAMES
    }
