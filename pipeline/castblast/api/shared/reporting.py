"""Progress of long work for people in a notebook or a script."""

from __future__ import annotations

import sys
from typing import TypeAlias

from castblast.progress import ProgressCallback, silent, with_time_left

#: What functions of the face take: True for a line on the screen, or a callback.
Progress: TypeAlias = ProgressCallback | bool | None


def reporter(progress: Progress) -> ProgressCallback:
    """Turn what was asked for into a callback: nothing, one line on the screen, or their own."""
    if progress is None or progress is False:
        return silent
    return with_time_left(_Line() if progress is True else progress)


class _Line:
    """One line on the standard error stream that is written anew; notebooks show it as well."""

    def __init__(self) -> None:
        self._width = 0

    def __call__(self, share: float, line: str) -> None:
        text = f"{share:4.0%} {line}"
        end = "\n" if share >= 1.0 else ""
        sys.stderr.write("\r" + text.ljust(self._width) + end)
        sys.stderr.flush()
        self._width = len(text)
