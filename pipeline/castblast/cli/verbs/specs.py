"""`castblast inputs` and `castblast examples`: what can be given, and files to start from."""

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from castblast.cli.options import START
from castblast.cli.screen import Screen
from castblast.cli.verb import verb


class _Role(StrEnum):
    ROCK = "rock"
    HOLE = "hole"
    BENCH = "bench"
    BURDEN_MODEL = "burden_model"
    SOLVER = "solver"


def inputs(
    screen: Screen,
    role: Annotated[
        _Role | None, typer.Argument(help="Only the inputs of this group.", show_default=False)
    ] = None,
) -> Mapping[str, Any]:
    """List the inputs of a blast with unit, default and plausible range.

    Where no default is shown, it is derived from other inputs; see the last column.
    """
    from castblast.stages.inputs import HEADER, input_rows, list_inputs

    screen.table(HEADER, input_rows(role), title="Inputs of predict, simulate, recipes and benches")
    return {"inputs": list_inputs(role)}


def examples(
    screen: Screen,
    folder: Annotated[Path, typer.Argument(help="Folder for the copies.")],
) -> Mapping[str, Any]:
    """Copy the specs that come with castblast (cases, explosives, recipes, benches, models)."""
    from castblast.stages.examples import copy_examples

    written = copy_examples(folder)
    screen.say(f"wrote {len(written)} files to {folder}")
    return {"folder": str(folder), "files": [str(path) for path in written]}


def add_to(app: typer.Typer) -> None:
    """Register the verbs."""
    verb(app, panel=START, example="inputs rock")(inputs)
    verb(app, panel=START, example="examples mine")(examples)
