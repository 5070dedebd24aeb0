"""What a verb may do with the terminal: lines, tables, a progress bar, or one JSON document.

Rich is imported only when something is drawn, so that `--help` and `predict` start at once.
"""

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from castblast.disk.plain import json_text
from castblast.errors import CheckError
from castblast.names import printable
from castblast.progress import ProgressCallback, silent

if TYPE_CHECKING:
    from castblast.stages.outcome import Outcome

#: First characters of a number.
_NUMERIC = "+-.0123456789"


@dataclass
class Screen:
    """Output of one run of the command line.

    Attributes
    ----------
    as_json : bool
        Print nothing but the result, as one JSON document on standard output.
    quiet : bool
        Print the result only, no progress.
    debug : bool
        Show tracebacks.
    exit_code : int
        What the process returns when the verb ends without an error.
    """

    as_json: bool = False
    quiet: bool = False
    debug: bool = False
    exit_code: int = 0

    def say(self, line: str = "") -> None:
        """Print a line for people."""
        if not self.as_json:
            print(_lines(line))

    def note(self, line: str) -> None:
        """Print a remark on standard error unless quiet."""
        if not self.quiet:
            print(_lines(line), file=sys.stderr)

    def fail(self, line: str, exit_code: int = CheckError.exit_code) -> None:
        """Say on standard error that the result is not good, and leave with `exit_code`."""
        print(_lines(line), file=sys.stderr)
        self.exit_code = exit_code

    def table(self, header: Sequence[str], rows: Sequence[Sequence[str]], title: str = "") -> None:
        """Print a table for people; columns of numbers are aligned right, words left."""
        if self.as_json:
            return
        from rich import box
        from rich.console import Console
        from rich.table import Table
        from rich.text import Text

        # Texts, not markup: a head like "heat [MJ/kg]" and a name like "x[/b]" stand as they are.
        heading = Text(printable(title)) if title else None
        table = Table(title=heading, title_justify="left", box=box.SIMPLE_HEAD)
        for index, name in enumerate(header):
            numbers = index > 0 and any(row[index][:1] in _NUMERIC for row in rows if row[index])
            justify: Literal["left", "right"] = "right" if numbers else "left"
            table.add_column(Text(printable(name)), justify=justify, no_wrap=index == 0)
        for row in rows:
            table.add_row(*(Text(printable(cell)) for cell in row))
        Console(width=None if sys.stdout.isatty() else 120).print(table)

    def show(self, outcome: "Outcome") -> Mapping[str, Any]:
        """Show what a verb found and return its document; exit code 4 if something is wrong."""
        if outcome.title or outcome.rows:
            self.table(outcome.header, outcome.rows, title=outcome.title)
        for line in outcome.faults:
            self.fail(f"not ok: {line}")
        for line in outcome.remarks:
            self.note(line)
        for line in (*outcome.lines, *(f"wrote {path}" for path in outcome.files)):
            self.say(line)
        if not outcome.ok:
            self.exit_code = CheckError.exit_code
        return outcome.document

    def document(self, payload: Mapping[str, Any]) -> None:
        """Print the result as JSON; NaN and infinity become null, as JSON has no such numbers."""
        print(json_text(payload), end="")

    @contextmanager
    def progress(self, title: str) -> Iterator[ProgressCallback]:
        """Give a callback that draws a bar, or plain lines where there is no terminal."""
        if self.quiet or self.as_json:
            yield silent
        elif not sys.stderr.isatty():
            yield _PlainLines(title)
        else:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

            columns = (
                TextColumn("{task.description}", style="bold", markup=False),
                BarColumn(bar_width=28),
                TextColumn("{task.percentage:>3.0f} %"),
                TimeElapsedColumn(),
                TextColumn("{task.fields[line]}", markup=False),
            )
            with Progress(*columns, console=Console(stderr=True)) as bar:
                task = bar.add_task(title, total=1.0, line="")

                def update(share: float, line: str) -> None:
                    bar.update(task, completed=share, line=printable(line))

                yield update
                bar.update(task, completed=1.0)


class _PlainLines:
    """Progress without a terminal: a line at every tenth, so that logs stay short."""

    def __init__(self, title: str) -> None:
        self.title = title
        self.tenth = -1

    def __call__(self, share: float, line: str) -> None:
        tenth = math.floor(share * 10 + 1e-9)
        if tenth > self.tenth:
            self.tenth = tenth
            print(f"{self.title}: {share:4.0%} {line}", file=sys.stderr, flush=True)


def _lines(text: str) -> str:
    """Text of several lines without control characters."""
    return "\n".join(map(printable, text.split("\n")))
