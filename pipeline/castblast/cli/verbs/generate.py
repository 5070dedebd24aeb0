"""`castblast generate`: a recipe becomes a dataset, on this machine or on a cluster."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from castblast.cli.options import DATA, OutFolder, Restart, Scheduler, Workers
from castblast.cli.screen import Screen
from castblast.cli.verb import verb


def generate(
    screen: Screen,
    recipe: Annotated[
        Path,
        typer.Argument(help="Recipe file (YAML), or the name of one that ships with castblast."),
    ],
    out: OutFolder = None,
    size: Annotated[
        int | None,
        typer.Option(min=1, help="Number of samples (overrides the recipe).", show_default=False),
    ] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    restart: Restart = False,
) -> Mapping[str, Any]:
    """Simulate the samples of a recipe and write one netCDF file; resumes an interrupted run."""
    from castblast.stages.datasets.generate import generate as run

    with screen.progress("generate") as progress:
        outcome = run(
            recipe,
            out,
            size=size,
            workers=workers,
            scheduler=scheduler,
            restart=restart,
            progress=progress,
        )
    return screen.show(outcome)


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    verb(
        app,
        needs=("simulate", "data"),
        compiles="nearfield",
        panel=DATA,
        example="generate paper --size 1000",
    )(generate)
