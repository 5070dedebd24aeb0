"""Simulate one blast with the physics itself and say what came out."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from castblast.api.simulation import prepare_blast, run_prepared
from castblast.bands import BAND_HEADER, BAND_WORDS, show_band, show_value
from castblast.blast.run import BlastResult
from castblast.design.variables import VARIABLES
from castblast.disk.files import require_writable, write_csv, write_json, written_together
from castblast.extras import require
from castblast.names import as_words
from castblast.specs.case import parse_values
from castblast.specs.explosive import load_explosive
from castblast.stages.outcome import Outcome


def simulate(
    *,
    explosive: str,
    values: Mapping[str, Any],
    mode: str = "equilibrium",
    tension: str = "ductile",
    parameter_set: str = "authors",
    where: str = "--set",
    allow_inconsistent: bool = False,
    out: str | Path | None = None,
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
    prepared = prepare_blast(
        load_explosive(explosive),
        given,
        mode=mode,
        tension=tension,
        parameters=parameter_set,
        allow_inconsistent=allow_inconsistent,
    )
    if out is not None:
        out = Path(out)
        require_writable(out)
    blast = run_prepared(prepared)
    document = blast.document()
    files = []
    if out is not None:
        files = written_together(out, partial(_write, document=document, result=blast.result))
    title = f"{blast.explosive}, {mode} mode, {parameter_set} parameters"
    return Outcome(
        document=document,
        title=title,
        header=BAND_HEADER,
        rows=_rows(document),
        remarks=[*blast.remarks, BAND_WORDS],
        files=files,
    )


def _rows(document: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    rows = []
    for name, value in document.items():
        variable = VARIABLES.get(name)
        if variable is None or isinstance(value, bool):
            continue
        shown = (show_value(name, value), show_band(name, value), variable.shown_unit)
        rows.append((as_words(name), *shown))
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
