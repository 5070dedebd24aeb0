"""Pages of the site that are not files of pipeline/docs, and links that leave the site.

The README, the changelog and the pages beside data and models are shown where they are; inputs,
command line and Python face are written from the code, so that they cannot fall behind it.
"""

from __future__ import annotations

import json
import os
import posixpath
import re
from pathlib import Path

import click
import typer.main
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import castblast
from castblast.cli.app import app

ROOT = Path(__file__).resolve().parents[2]
#: Pages of the site by their place in the repository.
ELSEWHERE = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "pipeline/README.md": "pipeline.md",
    "data_specs/README.md": "data_specs.md",
    "data_specs/FORMAT.md": "FORMAT.md",
    "models/README.md": "models.md",
    "pipeline/notebooks/engineer.ipynb": "notebooks/engineer.md",
    "pipeline/notebooks/data_maker.ipynb": "notebooks/data_maker.md",
    "pipeline/notebooks/modeller.ipynb": "notebooks/modeller.md",
}
_LINK = re.compile(r"(!?)\[([^\]]*)\]\((?!https?:|mailto:|#)([^)\s#]+)(#[^)\s]*)?\)")
#: Not for the reader of a reference.
_HIDDEN = {"--help", "--debug", "--quiet"}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages from elsewhere, the pictures they show, and the pages written from the code."""
    for source, page in ELSEWHERE.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        if source.endswith(".ipynb"):
            files.append(File.generated(config, f"notebooks/{Path(source).name}", content=text))
            text = notebook_page(text, Path(source).name)
        files.append(File.generated(config, page, content=text))
    for picture in sorted((ROOT / "models/figures").glob("*.png")):
        uri = f"models/figures/{picture.name}"
        files.append(File.generated(config, uri, abs_src_path=str(picture)))
    for page, text in {
        "reference/inputs.md": inputs_page(),
        "reference/cli.md": cli_page(),
        "reference/python.md": python_page(),
    }.items():
        files.append(File.generated(config, page, content=text))
    return files


def notebook_page(text: str, name: str) -> str:
    """Text and code of a notebook as a page, with the file itself to take along."""
    parts = []
    for cell in json.loads(text)["cells"]:
        source = "".join(cell["source"])
        parts.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
    title, *rest = "\n\n".join(parts).split("\n", 1)
    link = f'<a href="{name}" download>{name}</a>'
    return f"{title}\n\nThe notebook itself, to run and to change: {link}.\n{rest[0]}\n"


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links between files of the repository into links of the site.

    What is not on the site, code above all, is named without a link.
    """
    uri = page.file.src_uri
    source = {page: place for place, page in ELSEWHERE.items()}.get(uri, f"pipeline/docs/{uri}")

    def relink(match: re.Match[str]) -> str:
        mark, text, target, part = match.groups()
        place = posixpath.normpath(posixpath.join(posixpath.dirname(source), target))
        shown = ELSEWHERE.get(place, place.removeprefix("pipeline/docs/"))
        if files.get_file_from_path(shown) is None:
            return text if text.startswith("`") or mark else f"`{text}`"
        way = os.path.relpath(shown, posixpath.dirname(uri) or ".")
        return f"{mark}[{text}]({way}{part or ''})"

    return _LINK.sub(relink, markdown)


def inputs_page() -> str:
    """Table of every variable of a blast."""
    lines = ["# Inputs and outputs", "", "Written from the table of variables in the code."]
    table = castblast.variables()
    for kind, group in table.groupby("kind", sort=False):
        lines += ["", f"## {str(kind).capitalize()}s", ""]
        lines += [
            "| name | meaning | unit | default | lowest | highest |",
            "|---|---|---|---:|---:|---:|",
        ]
        for name, row in group.iterrows():
            numbers = (_number(row[key] * row["factor"]) for key in ("default", "lower", "upper"))
            unit = "" if row["shown_unit"] == "1" else row["shown_unit"]
            lines.append(f"| `{name}` | {row['meaning']} | {unit} | {' | '.join(numbers)} |")
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    return "" if value != value else f"{value:.6g}"


def cli_page() -> str:
    """Every verb with its options, as `--help` has them."""
    lines = [
        "# Command line",
        "",
        "Every verb has `--help`; what follows is written from the same texts.",
    ]
    command = typer.main.get_command(app)
    lines += _verbs(command, "castblast", click.Context(command, info_name="castblast"))
    return "\n".join(lines) + "\n"


def _verbs(command: click.Command, path: str, context: click.Context) -> list[str]:
    lines: list[str] = []
    for name, verb in sorted(getattr(command, "commands", {}).items()):
        here = f"{path} {name}"
        inner = click.Context(verb, info_name=name, parent=context)
        if getattr(verb, "commands", None):
            lines += _verbs(verb, here, inner)
            continue
        lines += ["", f"## {here}", "", _plain(verb.help or "")]
        if verb.epilog:
            lines += ["", "```sh", verb.epilog.removeprefix("Example: ").strip(), "```"]
        lines += ["", "| option | default | meaning |", "|---|---|---|"]
        lines += [_option(each, inner) for each in verb.params if not _HIDDEN & set(each.opts)]
    return lines


def _option(parameter: click.Parameter, context: click.Context) -> str:
    names = ", ".join(parameter.opts) if parameter.param_type_name == "option" else parameter.name
    default = parameter.get_default(context)
    shown = "" if default in (None, False, ()) or callable(default) else f"`{default}`"
    return f"| `{names}` | {shown} | {_plain(getattr(parameter, 'help', '') or '')} |"


def _plain(text: str) -> str:
    """Text of a help without its escapes for the terminal."""
    return text.replace("\\[", "[").replace("\b", "").replace("|", "\\|").strip()


def python_page() -> str:
    """Reference of the public names, from their docstrings."""
    lines = [
        "# Python",
        "",
        "`import castblast as cb` gives these names, each loaded when first used.",
    ]
    homes = {name: f"castblast.api.{home}.{name}" for name, home in castblast._HOMES.items()}
    for name in (n for n in castblast.__all__ if n in homes):
        lines += ["", f"::: {homes[name]}"]
    return "\n".join(lines) + "\n"
