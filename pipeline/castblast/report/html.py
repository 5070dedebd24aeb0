"""One self-contained HTML report: text, tables and pictures inside a single file."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from castblast.disk.files import write_text

_MEDIA = {".png": "image/png", ".svg": "image/svg+xml", ".gif": "image/gif"}


@dataclass(frozen=True)
class Table:
    """A table of texts; the first column is a heading of its row."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""


@dataclass(frozen=True)
class Picture:
    """A picture file and what it shows."""

    path: Path
    caption: str

    @property
    def data_uri(self) -> str:
        """The file as a data URI."""
        content = base64.b64encode(self.path.read_bytes()).decode("ascii")
        return f"data:{_MEDIA[self.path.suffix]};base64,{content}"


@dataclass(frozen=True)
class Section:
    """One chapter of the report."""

    title: str
    paragraphs: Sequence[str] = ()
    tables: Sequence[Table] = ()
    pictures: Sequence[Picture] = ()
    points: Sequence[str] = field(default=())


def write_report(path: Path, title: str, lead: str, sections: Sequence[Section]) -> Path:
    """Render the sections into one file that needs nothing beside it."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("castblast.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    template = environment.get_template("report.html.j2")
    return write_text(path, template.render(title=title, lead=lead, sections=sections))
