"""One blast by the physics itself: inputs with or without units in, a `Blast` out."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

from castblast.api.blast import Blast
from castblast.api.shared.values import Quantity, si_values
from castblast.blast.inputs import resolve_inputs
from castblast.blast.run import BlastCase, BlastSettings, make_case, result_values, run_blast
from castblast.design.hole import expanded_hole_faults
from castblast.design.rule import as_columns, require_possible
from castblast.design.variables import INPUT_NAMES
from castblast.errors import SimulationError, SpecError, Status, nearest_name
from castblast.extras import require
from castblast.nearfield.case import EndMode, TensionMode
from castblast.specs.explosive import ExplosiveSpec, load_explosive, require_consistent
from castblast.stopping import interruptible

_Kind = TypeVar("_Kind", bound=IntEnum)


class PreparedBlast(NamedTuple):
    """A blast that can be run: its inputs are completed and possible."""

    explosive: str
    settings: BlastSettings
    inputs: dict[str, float]
    case: BlastCase
    remarks: list[str]


def simulate(
    explosive: str | Path = "anfo",
    /,
    *,
    mode: str = "equilibrium",
    tension: str = "ductile",
    parameters: str = "authors",
    allow_inconsistent: bool = False,
    **inputs: object,
) -> Blast:
    """Simulate one blast: near field, then burden motion.

    Parameters
    ----------
    explosive : str or path
        Name or alias in the catalogue (see `castblast.explosives`), or an explosive file.
    mode : {"equilibrium", "paper"}
        End of the near-field run: the hole wall at rest, or 0.9 of the travel time of the p-wave.
    tension : {"ductile", "brittle", "none"}
        Behaviour of rock that yields in tension.
    parameters : {"authors", "field"}
        Parameter set of the burden model; neither is calibrated on measured blasts.
    allow_inconsistent : bool
        Run an explosive whose numbers do not belong together.
    **inputs
        Any input of `castblast.variables`: text with unit (``"80 MPa"``), a number in SI, a pint
        quantity or an xarray scalar. What is left out takes its default.

    Returns
    -------
    Blast

    Raises
    ------
    MissingLibraryError
        Numba or SciPy is not installed.
    SpecError
        Unknown names, units, impossible designs; a hole that expands as wide as its burden or
        spacing. `field`, `value` and `allowed` say where.
    CheckError
        An inconsistent explosive, unless `allow_inconsistent`.
    SimulationError
        The run did not reach its end state.

    Examples
    --------
    >>> import castblast as cb
    >>> blast = cb.simulate("anfo", burden="4 m", ucs=80e6)
    >>> blast.burden_velocity
    10.1 m/s (prediction band 5.7 to 18)
    >>> round(float(blast.near_field.hole_radius[-1]), 3)
    0.133
    """
    require("simulate", purpose="castblast.simulate")
    given = si_values(inputs, "simulate")
    return run_prepared(
        prepare_blast(
            load_explosive(explosive),
            given,
            mode=mode,
            tension=tension,
            parameters=parameters,
            allow_inconsistent=allow_inconsistent,
        )
    )


def prepare_blast(
    spec: ExplosiveSpec,
    given: Mapping[str, float],
    *,
    mode: str = "equilibrium",
    tension: str = "ductile",
    parameters: str = "authors",
    allow_inconsistent: bool = False,
) -> PreparedBlast:
    """Complete and check a blast; parameters and faults as `simulate`, inputs in SI."""
    remarks = require_consistent(spec, allow_inconsistent=allow_inconsistent)
    products = spec.to_explosive()
    inputs = resolve_inputs(given, products, parameters)
    settings = blast_settings(mode, tension, parameters)
    return PreparedBlast(
        explosive=spec.name,
        settings=settings,
        inputs=inputs,
        case=make_case(products, inputs, settings),
        remarks=remarks,
    )


def run_prepared(prepared: PreparedBlast) -> Blast:
    """Run a prepared blast; a failed run raises.

    Raises
    ------
    SpecError
        The hole expands as wide as its burden or spacing.
    SimulationError
        The run did not reach its end state.
    """
    inputs, remarks = prepared.inputs, list(prepared.remarks)
    result = interruptible(run_blast, prepared.case)
    status = Status(result.status)
    if status is Status.BAD_INPUT:
        columns = as_columns(inputs, 1)
        radius = np.array([result.near_field.expanded_hole_radius])
        require_possible(expanded_hole_faults(columns, radius))
    if status is not Status.OK:
        message = f"{prepared.explosive}: the simulation failed ({status.name}): {status.meaning}"
        raise SimulationError(message)
    if not result.near_field.settled:
        remarks.append("the hole wall was still moving at the end (settled: false)")
    if inputs["charge_diameter"] < inputs["hole_diameter"]:
        remarks.append("decoupled charge: the work of the gas on the air gap is neglected")
    outputs = {name: Quantity(name, value) for name, value in result_values(result).items()}
    return Blast(
        explosive=prepared.explosive,
        mode=EndMode(prepared.settings.mode).name.lower(),
        parameters=prepared.settings.parameter_set,
        inputs={name: Quantity(name, inputs[name]) for name in INPUT_NAMES},
        outputs=outputs,
        remarks=remarks,
        result=result,
    )


def blast_settings(mode: str, tension: str, parameters: str) -> BlastSettings:
    """Settings of a run by their names.

    Raises
    ------
    SpecError
        An unknown mode or behaviour in tension.
    """
    return BlastSettings(
        mode=_kind(EndMode, mode, "mode"),
        tension=_kind(TensionMode, tension, "tension"),
        parameter_set=parameters,
    )


def _kind(kinds: type[_Kind], name: str, field: str) -> _Kind:
    known = {kind.name.lower(): kind for kind in kinds}
    if name not in known:
        allowed = ", ".join(known)
        message = f"{field}: '{name}': one of {allowed}{nearest_name(str(name), known)}"
        raise SpecError(message, field=field, value=name, allowed=tuple(known))
    return known[name]
