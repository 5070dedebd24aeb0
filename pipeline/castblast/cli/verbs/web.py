"""`castblast web`: the page that needs nothing but a browser."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from castblast.cli.options import START
from castblast.cli.screen import Screen
from castblast.cli.verb import verb


def web(
    screen: Screen,
    out: Annotated[
        Path | None,
        typer.Option(help="Copy the page to this file or folder.", show_default=False),
    ] = None,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
) -> Mapping[str, Any]:
    """Open the web page that ships with castblast; it works offline."""
    from castblast.stages.web import shipped_page

    page = shipped_page(out).resolve()
    opened = False
    if browser and out is None and not screen.as_json:
        import webbrowser

        opened = webbrowser.open(page.as_uri())
    screen.say(f"{'opened' if opened else 'open in a browser:'} {page}")
    return {"page": str(page), "opened": opened}


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    verb(app, panel=START, example="web --out blast.html")(web)
