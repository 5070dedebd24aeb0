"""From a design to a blast: complete and check the inputs, run near field and burden motion.

The inputs are a mapping of the names of `castblast.variables` to SI values. `resolve_inputs`
completes it and refuses impossible designs, `make_case` turns it into the records the physics
takes, `run_blast` runs both models and `result_values` names every output. The strength rate
factor multiplies uniaxial compressive and tensile strength here, nowhere else.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite, nan
from typing import NamedTuple

from castblast.burden.case import BurdenGeometry, BurdenParameters, BurdenResult
from castblast.burden.motion import no_burden_motion, solve_burden_motion
from castblast.errors import SpecError, Status, nearest_name
from castblast.explosive.isentrope import Explosive, in_hole_velocity
from castblast.nearfield.case import EndMode, Hole, NearFieldSettings, Rock, TensionMode
from castblast.nearfield.solver import NearFieldResult, solve_near_field
from castblast.variables import (
    BURDEN_PARAMETER_SETS,
    INPUTS,
    OUTPUT_NAMES,
    STEMMING_RATIO,
    VARIABLES,
)

#: The near field is a slice across a long charge. A charge shorter than this many diameters acts
#: as a concentrated one (Lang 1976, after Livingston), which the model does not describe.
COLUMN_CHARGE_DIAMETERS = 6.0
#: Lengths that must add up are compared with this relative tolerance.
_ROUND_OFF = 1e-9
#: Inputs for which 0 means "the default of the end mode".
_OPTIONAL = frozenset({"outer_radius", "zones"})
_INPUTS = {v.name: v for v in INPUTS}


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


def resolve_inputs(
    values: Mapping[str, float], explosive: Explosive, parameter_set: str = "authors"
) -> dict[str, float]:
    """Complete the inputs with all defaults and check the design.

    Parameters
    ----------
    values : mapping
        Input names of `castblast.variables` to SI values; what is missing is filled in. A
        resolved mapping is returned unchanged.
    explosive : Explosive
        Gives the in-hole velocity of detonation for the default rise time.
    parameter_set : str
        Burden-model defaults, a key of `variables.BURDEN_PARAMETER_SETS`.

    Returns
    -------
    dict
        Every name of `variables.INPUTS`, in that order. `outer_radius` and `zones` are 0 where
        the near field is to choose.

    Raises
    ------
    SpecError
        Unknown names, implausible values and impossible designs, all of them one a line.
    """
    faults = _name_faults(values, parameter_set) or _value_faults(values) + design_faults(values)
    if faults:
        raise SpecError("\n".join(faults))
    filled = _fill_design(values) | BURDEN_PARAMETER_SETS[parameter_set] | dict(values)
    filled.setdefault(
        "rise_time", filled["hole_diameter"] / in_hole_velocity(explosive, filled["hole_diameter"])
    )
    return {name: float(filled.get(name, 0.0)) for name in _INPUTS}


def design_faults(values: Mapping[str, float]) -> list[str]:
    """Say what makes a design impossible; empty if nothing does.

    Parameters
    ----------
    values : mapping
        Input names to SI values; defaults are filled in. Bounds are not checked here.

    Returns
    -------
    list of str
        One line per fault with value, unit and what is allowed.
    """
    full = _fill_design(values)
    faults = []
    stemming, charge, height = (
        full[name] for name in ("stemming_length", "charge_length", "bench_height")
    )
    given_both = "stemming_length" in values and "charge_length" in values
    if given_both and stemming + charge > height * (1.0 + _ROUND_OFF):
        faults.append(
            f"stemming_length {_show('stemming_length', stemming)} and charge_length "
            f"{_show('charge_length', charge)} do not fit a bench_height of "
            f"{_show('bench_height', height)}: their sum must not exceed it"
        )
    if stemming < 0.0:
        faults.append(
            f"charge_length {_show('charge_length', charge)} leaves no room for stemming: at most "
            f"the bench_height of {_show('bench_height', height)}"
        )
    shortest = COLUMN_CHARGE_DIAMETERS * full["hole_diameter"]
    if charge < shortest:
        faults.append(
            f"charge_length {_show('charge_length', charge)} leaves no room for a column charge: "
            f"at least {COLUMN_CHARGE_DIAMETERS:g} hole diameters, "
            f"{_show('charge_length', shortest)} (bench_height {_show('bench_height', height)}, "
            f"stemming_length {_show('stemming_length', stemming)})"
        )
    for smaller, larger in (
        ("charge_diameter", "hole_diameter"),
        ("dilation_angle", "friction_angle"),
    ):
        if full[smaller] > full[larger] * (1.0 + _ROUND_OFF):
            faults.append(
                f"{smaller} {_show(smaller, full[smaller])} must not exceed the {larger} of "
                f"{_show(larger, full[larger])}"
            )
    return faults


def make_case(
    explosive: Explosive,
    values: Mapping[str, float],
    settings: BlastSettings = BlastSettings(),  # noqa: B008  (immutable)
) -> BlastCase:
    """Resolve the inputs and sort them into the records that the physics takes.

    Raises
    ------
    SpecError
        As `resolve_inputs`.
    """
    full = resolve_inputs(values, explosive, settings.parameter_set)
    factor = full["strength_rate_factor"]
    return BlastCase(
        explosive=explosive,
        rock=Rock(
            density=full["rock_density"],
            young_modulus=full["young_modulus"],
            poisson_ratio=full["poisson_ratio"],
            ucs=full["ucs"] * factor,
            friction_angle=full["friction_angle"],
            dilation_angle=full["dilation_angle"],
            tensile_strength=full["tensile_strength"] * factor,
        ),
        hole=Hole(
            diameter=full["hole_diameter"],
            charge_diameter=full["charge_diameter"],
            rise_time=full["rise_time"],
            in_situ_stress=full["in_situ_stress"],
        ),
        near_field=NearFieldSettings(
            mode=int(settings.mode),
            tension=int(settings.tension),
            outer_radius=full["outer_radius"],
            zones=round(full["zones"]),
            quadratic_viscosity=full["quadratic_viscosity"],
            linear_viscosity=full["linear_viscosity"],
            history_points=settings.history_points,
        ),
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
    near, burden = result.near_field, result.burden
    return {
        name: float(getattr(near if hasattr(near, name) else burden, name)) for name in OUTPUT_NAMES
    }


def _fill_design(values: Mapping[str, float]) -> dict[str, float]:
    """Defaults of the table and of the design: all but the rise time."""
    full = {v.name: v.default for v in INPUTS if v.default is not None} | dict(values)
    full.setdefault("charge_diameter", full["hole_diameter"])
    full.setdefault("spacing", full["burden"])
    if "charge_length" not in full:
        full.setdefault("stemming_length", STEMMING_RATIO * full["burden"])
        full["charge_length"] = full["bench_height"] - full["stemming_length"]
    room = full["bench_height"] - full["charge_length"]
    full.setdefault(
        "stemming_length", 0.0 if abs(room) <= _ROUND_OFF * full["bench_height"] else room
    )
    return full


def _name_faults(values: Mapping[str, float], parameter_set: str) -> list[str]:
    """Names that the table does not know."""
    faults = [
        f"unknown input '{name}'{nearest_name(name, _INPUTS)}"
        for name in values
        if name not in _INPUTS
    ]
    if parameter_set not in BURDEN_PARAMETER_SETS:
        faults.append(
            f"unknown burden parameter set '{parameter_set}': one of "
            f"{', '.join(sorted(BURDEN_PARAMETER_SETS))}"
            f"{nearest_name(parameter_set, BURDEN_PARAMETER_SETS)}"
        )
    return faults


def _value_faults(values: Mapping[str, float]) -> list[str]:
    """Values outside their plausibility bounds."""
    faults = []
    for name, value in values.items():
        variable = _INPUTS[name]
        inside = isfinite(value) and variable.lower <= value <= variable.upper
        if not inside and not (name in _OPTIONAL and value == 0.0):
            faults.append(
                f"{name} {variable.show(value)} is not plausible: "
                f"{variable.show(variable.lower)} to {variable.show(variable.upper)}"
            )
    return faults


def _show(name: str, value: float) -> str:
    return VARIABLES[name].show(value)
