"""How long work tells what it is doing: a callback, so that no layer knows the screen."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

#: Called with the finished share (0 to 1) and a short line for people.
ProgressCallback: TypeAlias = Callable[[float, str], None]


def silent(share: float, line: str) -> None:
    """Report nothing."""


def part(progress: ProgressCallback, first: float, last: float) -> ProgressCallback:
    """Report the progress of one step as the stretch from `first` to `last` of the whole."""
    return lambda share, line: progress(first + share * (last - first), line)
