"""The verbs of castblast, one module each; science libraries are imported inside the verbs."""

import typer

from castblast.cli.options import BLAST, DATA
from castblast.cli.verbs import (
    datasets,
    demo,
    explosive,
    generate,
    infill,
    muckpile,
    predict,
    simulate,
    specs,
    surrogates,
    web,
)

app = typer.Typer(
    name="castblast",
    help="Predict how rock moves when it is blasted: from explosive, rock and bench to burden "
    "velocity and muckpile.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


def _version(wanted: bool) -> None:
    if wanted:
        from castblast.version import __version__

        print(f"castblast {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Print the version and exit."
    ),
) -> None:
    """Take the options that stand before a verb."""


for _module in (demo, web, specs, predict, simulate, generate, surrogates, infill, muckpile):
    _module.add_to(app)
app.add_typer(datasets.app, name="dataset", rich_help_panel=DATA)
app.add_typer(explosive.app, name="explosive", rich_help_panel=BLAST)
