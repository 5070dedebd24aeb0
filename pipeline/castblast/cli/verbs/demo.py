"""`castblast demo`: the whole chain at a small size, ending in one report."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from castblast.cli.options import START, Workers
from castblast.cli.screen import Screen
from castblast.cli.verb import verb


def demo(
    screen: Screen,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the results.")] = Path(
        "demo"
    ),
    workers: Workers = None,
    restart: Annotated[
        bool, typer.Option("--restart", help="Discard existing results and start over.")
    ] = False,
) -> Mapping[str, Any]:
    """Run the whole chain at a small size; a second run reuses valid results.

    Dataset, surrogate, export, prediction and muckpile, ending in one report.
    """
    from castblast.stages.demo.run import STEPS, make_demo, next_commands, summarise

    job = make_demo(out, workers=workers, restart=restart)
    for number, step in enumerate(STEPS, start=1):
        with screen.progress(f"{number}/{len(STEPS)} {step.title}") as progress:
            lines = step.run(job, progress)
        for line in lines:
            screen.say(f"    {line}")
    screen.say("\nTry next:")
    for line in next_commands(job):
        screen.say(f"    {line}")
    return summarise(job)


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    verb(
        app,
        needs=("simulate", "data", "train", "plot", "export"),
        compiles="nearfield",
        panel=START,
        example="demo --out demo",
    )(demo)
