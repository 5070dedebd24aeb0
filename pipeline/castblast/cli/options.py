"""Options that several verbs share, with one wording."""

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

OutFolder: TypeAlias = Annotated[
    Path | None, typer.Option("--out", "-o", help="Folder for the results.", show_default=False)
]
Settings: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar='NAME="VALUE UNIT"',
        help='Set an input, e.g. --set burden="3 m"; may be repeated.',
        show_default=False,
    ),
]
ExplosiveName: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--explosive", help="Name in the catalogue, or an explosive file.", show_default=False
    ),
]
Workers: TypeAlias = Annotated[
    int | None,
    typer.Option(
        "--workers", min=1, help="Worker threads; default: all cores.", show_default=False
    ),
]
Scheduler: TypeAlias = Annotated[
    str | None, typer.Option(help="Address of a running Dask scheduler.", show_default=False)
]
Restart: TypeAlias = Annotated[bool, typer.Option("--restart", help="Discard earlier shards.")]
AllowCode: TypeAlias = Annotated[
    bool,
    typer.Option("--allow-code", help="Run the Python code that specs of kind custom name."),
]
