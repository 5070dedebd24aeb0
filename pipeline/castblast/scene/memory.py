"""Refuse a muckpile that cannot fit into memory, before anything is packed."""

from __future__ import annotations

from pathlib import Path

from castblast.errors import SpecError
from castblast.muckpile.balls.state import estimate_memory

_GIB = 1024.0**3


def require_memory(balls: int, name: str, available: int | None = None) -> None:
    """Say so if `balls` balls need more memory than there is.

    Parameters
    ----------
    balls : int
    name : str
        Of the bench, for the message.
    available : int, optional [bytes]
        Default: what the machine says; nothing is refused where it does not say.

    Raises
    ------
    SpecError
    """
    there = available_memory() if available is None else available
    needed = estimate_memory(balls)
    if there is not None and needed > there:
        base = estimate_memory(0)
        fitting = max(there - base, 0) * balls // (needed - base)
        raise SpecError(
            f"{name}: {balls:,} balls need about {needed / _GIB:.2g} GiB of memory, "
            f"{there / _GIB:.2g} GiB are free; about {fitting:,} balls fit: "
            f"set 'balls.count' or --balls"
        )


def available_memory() -> int | None:
    """Memory [bytes] that a process may still take, by system and container; None: unknown."""
    limits = []
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        limits += [1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvail")]
    except (OSError, ValueError, IndexError):
        pass
    group = Path("/sys/fs/cgroup")
    try:
        most = (group / "memory.max").read_text().strip()
        if most != "max":
            limits.append(int(most) - int((group / "memory.current").read_text()))
    except (OSError, ValueError):
        pass
    return max(min(limits), 0) if limits else None
