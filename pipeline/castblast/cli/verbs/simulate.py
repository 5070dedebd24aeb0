"""`castblast simulate`: one near-field and burden-motion run of the physics itself."""

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from castblast.cli.options import BLAST, ExplosiveName, OutFolder, Settings
from castblast.cli.screen import Screen
from castblast.cli.verb import verb


class _Mode(StrEnum):
    EQUILIBRIUM = "equilibrium"
    PAPER = "paper"


class _Tension(StrEnum):
    DUCTILE = "ductile"
    BRITTLE = "brittle"
    NONE = "none"


class _ParameterSet(StrEnum):
    AUTHORS = "authors"
    FIELD = "field"


def simulate(
    screen: Screen,
    case: Annotated[
        Path | None, typer.Argument(help="Case file (YAML).", show_default=False)
    ] = None,
    explosive: ExplosiveName = None,
    mode: Annotated[
        _Mode | None, typer.Option(help="When the near-field run ends.", show_default="equilibrium")
    ] = None,
    tension: Annotated[
        _Tension | None,
        typer.Option(help="Behaviour of rock that yields in tension.", show_default="ductile"),
    ] = None,
    parameter_set: Annotated[
        _ParameterSet | None,
        typer.Option(help="Parameter set of the burden model.", show_default="authors"),
    ] = None,
    settings: Settings = None,
    allow_inconsistent: Annotated[
        bool, typer.Option(help="Run even if the explosive fails its consistency checks.")
    ] = False,
    out: OutFolder = None,
) -> Mapping[str, Any]:
    """Simulate one blast: near field, then burden motion; pictures and histories with --out."""
    from castblast.specs.case import read_case, split_assignments
    from castblast.stages.simulate import simulate as run

    spec = read_case(case)
    values = {**spec.values, **split_assignments(settings or [])}
    outcome = run(
        explosive=explosive or spec.explosive,
        values=values,
        mode=(mode or spec.mode),
        tension=(tension or spec.tension),
        parameter_set=(parameter_set or spec.parameter_set),
        where=str(case) if case else "--set",
        allow_inconsistent=allow_inconsistent,
        out=out,
    )
    return screen.show(outcome)


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    example = 'simulate --explosive anfo --set burden="4 m" --set ucs="80 MPa" --out simulation'
    verb(app, needs=("simulate",), compiles="nearfield", panel=BLAST, example=example)(simulate)
