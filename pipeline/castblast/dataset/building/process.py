"""What a process says of itself: its name among all machines, and its peak of memory."""

from __future__ import annotations

import os
import platform
import sys
from pathlib import Path


def process_name() -> str:
    """Name of this process, unlike that of any other running one on any machine."""
    return f"{platform.node()}-{os.getpid()}"


def peak_memory() -> int:
    """Largest resident memory of this process so far [byte]; 0 where the system does not tell."""
    try:  # getrusage would count the parent that started this process
        for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    try:
        import resource
    except ImportError:
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024
