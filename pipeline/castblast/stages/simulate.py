"""Simulate one blast with the physics itself and say what came out."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from castblast.bands import BAND_HEADER, BAND_WORDS, band_document, show_band, show_value
from castblast.blast.inputs import resolve_inputs
from castblast.blast.run import BlastResult, BlastSettings, make_case, result_values, run_blast
from castblast.design.hole import expanded_hole_faults
from castblast.design.rule import as_columns, require_possible
from castblast.design.variables import VARIABLES
from castblast.disk.files import require_writable, write_csv, write_json, written_together
from castblast.errors import SimulationError, Status
from castblast.extras import require
from castblast.nearfield.case import EndMode, TensionMode
from castblast.specs.case import parse_values
from castblast.specs.explosive import load_explosive
from castblast.stages.explosives import require_consistent
from castblast.stages.outcome import Outcome
from castblast.stopping import interruptible


def simulate(
    *,
    explosive: str,
    values: Mapping[str, Any],
    mode: str = "equilibrium",
    tension: str = "ductile",
    parameter_set: str = "authors",
    where: str = "--set",
    allow_inconsistent: bool = False,
    out: Path | None = None,
) -> Outcome:
    """Run near field and burden motion once.

    Parameters
    ----------
    explosive : str
        Name in the catalogue or path of an explosive file.
    values : mapping of str to quantity
        Inputs with units; the rest takes the defaults of `castblast.design.variables`.
    mode, tension, parameter_set : str
        See `castblast.specs.case.CaseSpec`.
    out : path, optional
        Folder for histories (CSV), the document (JSON) and pictures.

    Raises
    ------
    SpecError
        Unknown names, units, impossible designs; a hole that expands as wide as its burden or
        spacing.
    CheckError
        An inconsistent explosive, unless `allow_inconsistent`.
    OutputError
        The folder cannot be written to, or the disk is full.
    SimulationError
        The run did not reach its end state.
    """
    if out is not None:
        require("plot", purpose="castblast simulate --out")
    given = parse_values(values, where)
    spec = load_explosive(explosive)
    remarks = require_consistent(spec, allow_inconsistent=allow_inconsistent)
    products = spec.to_explosive()
    inputs = resolve_inputs(given, products, parameter_set)
    settings = BlastSettings(
        mode=EndMode[mode.upper()],
        tension=TensionMode[tension.upper()],
        parameter_set=parameter_set,
    )
    case = make_case(products, inputs, settings)
    if out is not None:
        require_writable(out)
    result = interruptible(run_blast, case)
    document = _document(spec.name, mode, parameter_set, inputs, result)
    status = Status(result.status)
    if status is Status.BAD_INPUT:
        columns = as_columns(inputs, 1)
        radius = np.array([result.near_field.expanded_hole_radius])
        require_possible(expanded_hole_faults(columns, radius))
    if status is not Status.OK:
        message = f"{spec.name}: the simulation failed ({status.name}): {status.meaning}"
        raise SimulationError(message)
    if not result.near_field.settled:
        remarks.append("the hole wall was still moving at the end (settled: false)")
    if inputs["charge_diameter"] < inputs["hole_diameter"]:
        remarks.append("decoupled charge: the work of the gas on the air gap is neglected")
    remarks.append(BAND_WORDS)
    files = []
    if out is not None:
        files = written_together(out, partial(_write, document=document, result=result))
    title = f"{spec.name}, {mode} mode, {parameter_set} parameters"
    return Outcome(
        document=document,
        title=title,
        header=BAND_HEADER,
        rows=_rows(document),
        remarks=remarks,
        files=files,
    )


def _document(
    name: str,
    mode: str,
    parameter_set: str,
    inputs: Mapping[str, float],
    result: BlastResult,
) -> dict[str, Any]:
    outputs: dict[str, Any] = dict(result_values(result))
    outputs["settled"] = bool(result.near_field.settled)
    return {
        "explosive": name,
        "mode": mode,
        "parameter_set": parameter_set,
        "status": Status(result.status).name.lower(),
        **outputs,
        **band_document(result_values(result)),
        "inputs": dict(inputs),
    }


def _rows(document: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    rows = []
    for name, value in document.items():
        variable = VARIABLES.get(name)
        if variable is None or isinstance(value, bool):
            continue
        words, unit = name.replace("_", " "), variable.shown_unit
        rows.append((words, show_value(name, value), show_band(name, value), unit))
    return rows


def _write(out: Path, document: Mapping[str, Any], result: BlastResult) -> list[Path]:
    from castblast.report.simulation_figures import draw_simulation

    near, burden = result.near_field, result.burden
    files = [
        write_json(out / "result.json", document),
        write_csv(
            out / "near_field_history.csv",
            {
                "time [s]": near.history_time,
                "pressure [Pa]": near.history_pressure,
                "hole_radius [m]": near.history_radius,
            },
        ),
        write_csv(
            out / "burden_history.csv",
            {
                "time [s]": burden.history_time,
                "pressure [Pa]": burden.history_pressure,
                "velocity [m s-1]": burden.history_velocity,
                "displacement [m]": burden.history_displacement,
            },
        ),
    ]
    return [*files, draw_simulation(out / "simulation.png", document, near, burden)]
