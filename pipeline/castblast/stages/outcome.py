"""What a verb found, in the one form that the command line shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """A result for programs, and the same for people.

    Attributes
    ----------
    document : mapping
        SI units; what ``--json`` prints.
    title, header, rows
        A table; without title and rows there is none.
    lines : list of str
        What else there is to say, below the table.
    remarks : list of str
        How to read the result; on standard error, and not with ``--quiet``.
    files : list of path
        What was written.
    faults : list of str
        Reasons not to believe the result.
    ok : bool
        Whether all is as it should be; if not, the verb ends with exit code 4.
    """

    document: Mapping[str, Any]
    title: str = ""
    header: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    lines: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    ok: bool = True
