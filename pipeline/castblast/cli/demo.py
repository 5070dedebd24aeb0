"""`castblast demo`: the whole chain at a small size, ending in one report."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from castblast.cli.options import Workers
from castblast.cli.screen import Screen
from castblast.cli.verb import verb


def demo(
    screen: Screen,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the results.")] = Path(
        "demo"
    ),
    workers: Workers = None,
    restart: Annotated[bool, typer.Option("--restart", help="Discard earlier results.")] = False,
) -> Mapping[str, Any]:
    """Dataset, surrogate, export, prediction and muckpile; a second run reuses what is valid."""
    from castblast.stages.demo import STEPS, run_demo

    screen.note("The first run compiles the kernels once; that takes about a minute.")
    outcome = None
    for step in STEPS:
        with screen.progress(f"{step.number}/{len(STEPS)} {step.title}") as progress:
            outcome = run_demo(step, out, workers=workers, restart=restart, progress=progress)
        for line in outcome.lines:
            screen.say(f"   {line}")
    assert outcome is not None
    screen.say("\nTry next:")
    for line in outcome.next_commands:
        screen.say(f"   {line}")
    return outcome.document


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    verb(app)(demo)
