"""How long work tells what it is doing: a callback, so that no layer knows the screen."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import TypeAlias

#: Called with the finished share (0 to 1) and a short line for people.
ProgressCallback: TypeAlias = Callable[[float, str], None]


def silent(share: float, line: str) -> None:
    """Report nothing."""


def part(progress: ProgressCallback, first: float, last: float) -> ProgressCallback:
    """Report the progress of one step as the stretch from `first` to `last` of the whole."""
    return lambda share, line: progress(first + share * (last - first), line)


#: Least wall time [s] and share after which the time that is left can be guessed.
_SECONDS_SEEN, _SHARE_SEEN = 10.0, 0.02


def with_time_left(
    progress: ProgressCallback, clock: Callable[[], float] = perf_counter
) -> ProgressCallback:
    """Add to each line about how long the work will go on, by the share done so far.

    Work that is resumed begins with a share that this process has not done.
    """
    began, first = clock(), -1.0

    def report(share: float, line: str) -> None:
        nonlocal first
        first = share if first < 0.0 else first
        seconds, done = clock() - began, share - first
        if share < 1.0 and seconds >= _SECONDS_SEEN and done >= _SHARE_SEEN:
            left = seconds * (1.0 - share) / done
            line = f"{line}, about {duration_words(left)} left"
        progress(share, line)

    return report


def duration_words(seconds: float) -> str:
    """A duration for people, to two digits or so: ``40 s``, ``3 min``, ``2.5 h``."""
    if seconds < 90.0:
        return f"{max(round(seconds, -1), 10.0):.0f} s"
    if seconds < 5400.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.2g} h" if seconds < 172800.0 else f"{seconds / 86400.0:.2g} days"
