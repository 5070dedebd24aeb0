"""`castblast train` and `castblast export`: from a dataset to a model other tools can use."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from castblast.cli.options import OutFolder
from castblast.cli.screen import Screen
from castblast.cli.verb import verb


def train(
    screen: Screen,
    dataset: Annotated[Path, typer.Argument(help="Dataset (netCDF).")],
    specs: Annotated[
        list[Path] | None,
        typer.Argument(help="Model specs (YAML); default: the reference.", show_default=False),
    ] = None,
    out: OutFolder = None,
    tracking: Annotated[bool, typer.Option(help="Keep a record of the runs in MLflow.")] = True,
) -> Mapping[str, Any]:
    """Fit models, score them on rows never trained on and draw the paper's Figure 2."""
    from castblast.stages.train import train as run

    with screen.progress("train") as progress:
        outcome = run(dataset, specs or [], out, tracking=tracking, progress=progress)
    screen.table(outcome.header, outcome.rows, title=outcome.title)
    for line in outcome.lines:
        screen.say(line)
    return outcome.document


def export(
    screen: Screen,
    fit: Annotated[Path, typer.Argument(help="Folder of a fit, or a network.json.")],
    out: OutFolder = None,
    to: Annotated[str, typer.Option(help="Targets, separated by commas.")] = "json,onnx",
    verify: Annotated[bool, typer.Option(help="Run every export and compare it.")] = True,
) -> Mapping[str, Any]:
    """Write the network for other tools and prove that it gives the same numbers."""
    from castblast.stages.export import export as run

    outcome = run(fit, out, targets=to.split(","), verify=verify)
    for line in outcome.lines:
        screen.say(line)
    return outcome.document


def add_to(app: typer.Typer) -> None:
    """Register the verbs."""
    verb(app)(train)
    verb(app)(export)
