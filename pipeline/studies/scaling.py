"""Rates of a build on this machine: samples per second, by number of workers and per core.

    python pipeline/studies/scaling.py --workers 1 2      # a minute or two on two cores

Runs `castblast generate` on the full recipe, with threads of one process and with Dask workers over
TCP, and writes the table of `pipeline/docs/scaling.md` between its marks. Run it on a quiet machine
of the kind that is meant, with compiled kernels in the cache.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from dask.distributed import LocalCluster
from mesh_study import put

from castblast.disk.files import write_text

ROOT = Path(__file__).resolve().parent.parent
PAGE, RECIPE = ROOT / "docs/scaling.md", ROOT.parent / "data_specs/recipes/full.yaml"
THREADS, TCP = "threads of one process", "processes over TCP"
#: Load before the start above which the figures are not to be trusted.
_BUSY = 0.5


class Rate(NamedTuple):
    """What a build took.

    Attributes
    ----------
    wall, core : float [s]
        Wall time of the command and processor time of all processes, start and end included.
    rate : float [1/s]
        Samples per second while shards run.
    scheduling : float [percent]
        Share of the workers' time in which they waited for the next shard.
    peak : float [MB]
        Memory of the process that runs the command.
    """

    wall: float
    core: float
    rate: float
    scheduling: float
    peak: float


def measure(where: str, workers: int, samples: int) -> Rate:
    """Time one build by so many workers of one thread each."""
    before = _core_seconds()
    with TemporaryDirectory() as folder:
        if where == THREADS:
            wall, log = _build(folder, samples, "--workers", str(workers))
        else:
            with LocalCluster(
                n_workers=workers, threads_per_worker=1, memory_limit=0, dashboard_address=None
            ) as cluster:
                wall, log = _build(folder, samples, "--scheduler", cluster.scheduler_address)
    found = re.search(r"([\d.]+) samples/s, peak ([\d.]+) MB.*scheduling ([\d.]+)%", log, re.DOTALL)
    if found is None:
        raise RuntimeError(log)
    rate, peak, scheduling = map(float, found.groups())
    return Rate(
        wall=wall, core=_core_seconds() - before, rate=rate, scheduling=scheduling, peak=peak
    )


def _build(folder: str, samples: int, *options: str) -> tuple[float, str]:
    """Run the command; returns wall time [s] and what it said."""
    call = [sys.executable, "-m", "castblast", "generate", RECIPE, "--size", samples]
    begin = time.perf_counter()
    done = subprocess.run(
        [*map(str, call), "--out", f"{folder}/data.nc", *options],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return time.perf_counter() - begin, done.stdout + done.stderr


def _core_seconds() -> float:
    """Processor time [s] of this process and of those that it has started and that have ended."""
    spent = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(use.ru_utime + use.ru_stime for use in spent)


def main() -> None:
    """Measure every number of workers and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--samples", type=int, default=10_000, help="for each worker")
    given = parser.parse_args()
    load = os.getloadavg()[0]
    lines = [
        "| workers | where | samples | samples/s while shards run | of the whole command "
        "| samples per core-second | waiting for shards | peak |",
        "|---:|---|" + "---:|" * 6,
    ]
    for where in (THREADS, TCP):
        for workers in given.workers:
            samples = workers * given.samples
            rate = measure(where, workers, samples)
            lines.append(
                f"| {workers} | {where} | {samples:,} | {rate.rate:.0f} "
                f"| {samples / rate.wall:.0f} | {samples / rate.core:.0f} "
                f"| {rate.scheduling:.1f} % | {rate.peak:.0f} MB |"
            )
            print(lines[-1], flush=True)
    busy = "" if load < _BUSY else " **The machine was busy: rates are too low.**"
    lines += ["", f"{os.cpu_count()} cores with a load of {load:.1f} before the start.{busy}"]
    write_text(PAGE, put(PAGE.read_text(encoding="utf-8"), "rates", lines))


if __name__ == "__main__":
    main()
