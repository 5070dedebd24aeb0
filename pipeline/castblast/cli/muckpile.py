"""`castblast muckpile`: throw a bench with the discrete-element model."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from castblast.cli.options import OutFolder
from castblast.cli.screen import Screen
from castblast.cli.verb import verb


def muckpile(
    screen: Screen,
    bench: Annotated[
        str, typer.Argument(help="Bench file (YAML), or the name of one that comes with castblast.")
    ],
    out: OutFolder = None,
    balls: Annotated[
        int | None,
        typer.Option(
            min=10, help="About this many balls (changes their size).", show_default=False
        ),
    ] = None,
    threads: Annotated[
        int | None, typer.Option(min=1, help="Threads; default: all cores.", show_default=False)
    ] = None,
    velocity: Annotated[
        str | None,
        typer.Option(
            help='Burden velocity instead of the file\'s, "12.7 m/s".', show_default=False
        ),
    ] = None,
    packings: Annotated[
        Path | None,
        typer.Option(
            help="Folder of packings to use again and to add to; default: in the output folder.",
            show_default=False,
        ),
    ] = None,
) -> Mapping[str, Any]:
    """Pack, fire and settle a bench; writes final state, profile, pictures and metrics."""
    from castblast.stages.muckpile import run_muckpile

    with screen.progress("muckpile") as progress:
        outcome = run_muckpile(
            bench,
            out,
            balls=balls,
            threads=threads,
            velocity=velocity,
            packings=packings,
            progress=progress,
        )
    screen.table(("quantity", "value", "unit"), outcome.rows, title=outcome.title)
    for path in outcome.files:
        screen.say(f"wrote {path}")
    return outcome.document


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    verb(app)(muckpile)
