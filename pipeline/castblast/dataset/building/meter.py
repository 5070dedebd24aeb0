"""What a run costs: samples per second, memory, and the time that workers do not simulate.

Times are compared within one process only, so that the clocks of several machines do not matter.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from castblast.dataset.building.process import peak_memory, process_name

if TYPE_CHECKING:
    from castblast.dataset.building.shards import ShardReport

_MB = 1e6


class Meter:
    """Counts the reports of workers.

    Attributes
    ----------
    rows : int
        Simulated so far in this run.
    """

    def __init__(self) -> None:
        self.rows = 0
        self._start = time.perf_counter()
        self._lines: dict[str, tuple[float, float, float]] = {}  # worker: begin, end, busy
        self._peaks: dict[str, int] = {}

    def add(self, report: ShardReport) -> None:
        """Count one report."""
        self.rows += report.span.end - report.span.begin
        begin, end, busy = self._lines.get(report.worker, (report.begin, report.end, 0.0))
        self._lines[report.worker] = (
            min(begin, report.begin),
            max(end, report.end),
            busy + report.end - report.begin,
        )
        self._peaks[report.process] = max(report.peak_memory, self._peaks.get(report.process, 0))

    @property
    def seconds(self) -> float:
        """Time since the start [s]."""
        return time.perf_counter() - self._start

    @property
    def rate(self) -> float:
        """Samples per second so far."""
        return self.rows / max(self.seconds, 1e-9)

    @property
    def scheduling_share(self) -> float:
        """Share of the time between its first and last shard that a worker waited for work."""
        present = sum(end - begin for begin, end, _ in self._lines.values())
        busy = sum(busy for _, _, busy in self._lines.values())
        return 1.0 - busy / present if present > 0.0 else 0.0

    def idle_share(self, threads: int) -> float:
        """Share of the time of `threads` workers before their first and after their last shard."""
        present = sum(end - begin for begin, end, _ in self._lines.values())
        return max(0.0, 1.0 - present / max(self.seconds * threads, 1e-9))

    @property
    def memory(self) -> str:
        """Peaks for people: of this process, and of the largest worker where that is another."""
        line = f"peak {peak_memory() / _MB:.0f} MB"
        if set(self._peaks) - {process_name()}:
            line += f", largest worker {max(self._peaks.values()) / _MB:.0f} MB"
        return line
