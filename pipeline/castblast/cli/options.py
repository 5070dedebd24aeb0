"""Options and headings that several verbs share, with one wording."""

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

#: Headings of ``castblast --help``, in the order of the chain.
START = "Start here"
BLAST = "One blast"
DATA = "Datasets"
MODELS = "Models"
PILES = "Muckpiles"

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
Restart: TypeAlias = Annotated[
    bool, typer.Option("--restart", help="Discard existing shards and start over.")
]
AllowCode: TypeAlias = Annotated[
    bool,
    typer.Option("--allow-code", help="Allow model specs of kind custom to run their Python code."),
]
