"""`castblast infill`: which designs to simulate next."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from castblast.cli.options import DATA, AllowCode
from castblast.cli.screen import Screen
from castblast.cli.verb import verb


def infill(
    screen: Screen,
    dataset: Annotated[Path, typer.Argument(help="Dataset (netCDF).")],
    model: Annotated[Path, typer.Argument(help="Model spec (YAML) or a fit of castblast train.")],
    rows: Annotated[int, typer.Option(min=1, help="Designs to choose.")] = 500,
    out: Annotated[Path, typer.Option(help="Design file (CSV).")] = Path("next.csv"),
    members: Annotated[int, typer.Option(min=2, help="Ensemble members.")] = 3,
    allow_code: AllowCode = False,
) -> Mapping[str, Any]:
    """Select the designs an ensemble disagrees on most, for `dataset extend --design`."""
    from castblast.stages.datasets.infill import infill as run

    with screen.progress("infill") as progress:
        outcome = run(
            dataset, model, rows, out, members=members, allow_code=allow_code, progress=progress
        )
    return screen.show(outcome)


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    verb(
        app,
        needs=("simulate", "data", "train"),
        compiles="nearfield",
        panel=DATA,
        example="infill data/paper/1.3.0/data.nc levenberg --rows 500",
    )(infill)
