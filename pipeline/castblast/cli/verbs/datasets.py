"""`castblast dataset`: work on a written dataset."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from castblast.cli.options import OutFolder, Restart, Scheduler, Workers
from castblast.cli.screen import Screen
from castblast.cli.verb import verb

app = typer.Typer(
    help="Check, describe, compare and extend written datasets.", no_args_is_help=True
)

_Dataset = Annotated[Path, typer.Argument(help="Dataset (netCDF).")]


@verb(app, needs=("simulate", "data"), example="dataset check data/paper/1.3.0/data.nc")
def check(screen: Screen, dataset: _Dataset) -> Mapping[str, Any]:
    """Check a dataset against the format and report all faults (exit code 4 if any)."""
    from castblast.stages.datasets.dataset import check_dataset

    with screen.progress("check") as progress:
        faults = check_dataset(dataset, progress)
    for fault in faults:
        screen.say(f"{dataset}: {fault}")
    if faults:
        screen.exit_code = 4
    else:
        screen.say(f"{dataset}: no faults")
    return {"dataset": str(dataset), "faults": faults}


@verb(app, needs=("simulate", "data"), example="dataset describe data/paper/1.3.0/data.nc")
def describe(screen: Screen, dataset: _Dataset) -> Mapping[str, Any]:
    """Summarise a dataset: size, ranges, failures, versions."""
    from castblast.stages.datasets.dataset import describe_dataset

    return screen.show(describe_dataset(dataset))


@verb(
    app,
    needs=("simulate", "data"),
    compiles="nearfield",
    example="dataset reproduce data/paper/1.3.0/data.nc --sample 7",
)
def reproduce(
    screen: Screen,
    dataset: _Dataset,
    sample: Annotated[int, typer.Option(min=0, help="Id of the sample.")] = 0,
) -> Mapping[str, Any]:
    """Recompute one sample from the file alone and compare it (exit code 4 if it differs)."""
    from castblast.stages.datasets.dataset import reproduce_sample

    return screen.show(reproduce_sample(dataset, sample))


@verb(
    app,
    needs=("simulate", "data"),
    compiles="nearfield",
    example="dataset extend data/paper/1.3.0/data.nc --design next.csv",
)
def extend(
    screen: Screen,
    dataset: _Dataset,
    add: Annotated[
        int | None, typer.Option("--add", min=1, help="Samples to draw.", show_default=False)
    ] = None,
    design: Annotated[
        Path | None,
        typer.Option(
            help="CSV of designs instead, as castblast infill writes it; all become training rows.",
            show_default=False,
        ),
    ] = None,
    out: OutFolder = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    restart: Restart = False,
) -> Mapping[str, Any]:
    """Add samples to a dataset: a new file with the next minor version; the old one stays."""
    from castblast.errors import SpecError
    from castblast.stages.datasets.extend import extend as run

    rows = add if design is None else design
    if rows is None or None not in (add, design):
        message = "give either --add N or --design FILE"
        raise SpecError(message)
    with screen.progress("extend") as progress:
        outcome = run(
            dataset,
            rows,
            out,
            workers=workers,
            scheduler=scheduler,
            restart=restart,
            progress=progress,
        )
    return screen.show(outcome)


@verb(
    app,
    needs=("simulate", "data"),
    example="dataset diff data/paper/1.1.0/data.nc data/paper/1.3.0/data.nc",
)
def diff(
    screen: Screen,
    first: Annotated[Path, typer.Argument(help="Dataset (netCDF).")],
    second: Annotated[Path, typer.Argument(help="Dataset to compare it with, row by row by id.")],
) -> Mapping[str, Any]:
    """Report differences between two datasets (exit code 4 if any).

    Compares provenance, variables, rows and values.
    """
    from castblast.stages.datasets.diff import diff_datasets

    with screen.progress("diff") as progress:
        outcome = diff_datasets(first, second, progress)
    return screen.show(outcome)


@verb(
    app,
    needs=("simulate", "data"),
    example="dataset export data/paper/1.3.0/data.nc --to csv,parquet",
)
def export(
    screen: Screen,
    dataset: _Dataset,
    to: Annotated[
        str, typer.Option(help="Formats, separated by commas: csv, parquet.", metavar="FORMATS")
    ] = "csv",
    out: OutFolder = None,
) -> Mapping[str, Any]:
    """Write the rows as CSV or Parquet for other tools, with a Croissant metadata file."""
    from castblast.stages.datasets.export import export_dataset

    return screen.show(export_dataset(dataset, to.split(","), out))
