"""From inputs to blasts: near field, then burden motion, one blast or many at once.

The inputs are a mapping of the names of `castblast.variables` to SI values, completed by
`castblast.inputs`. For one blast, `make_case` turns it into the records the physics takes,
`run_blast` runs both models and `result_values` names every output. `run_blasts` and
`batch_values` do the same for columns of many blasts. The strength rate factor multiplies
uniaxial compressive and tensile strength here, nowhere else.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import nan
from typing import Any, NamedTuple, TypeVar

from castblast.burden.case import BurdenGeometry, BurdenParameters, BurdenResult
from castblast.burden.motion import no_burden_motion, solve_burden_motion
from castblast.errors import Status
from castblast.explosive.isentrope import Explosive, FloatArray
from castblast.inputs import resolve_inputs
from castblast.nearfield.case import EndMode, Hole, NearFieldSettings, Rock, TensionMode
from castblast.nearfield.solver import NearFieldResult, solve_near_field
from castblast.variables import OUTPUT_NAMES

_Value = TypeVar("_Value", float, FloatArray)


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


def _outputs(near_field: Any, burden: Any) -> dict[str, Any]:
    """Outputs by name: what the near field does not know comes from the burden motion."""
    return {
        name: getattr(near_field if hasattr(near_field, name) else burden, name)
        for name in OUTPUT_NAMES
    }
