"""The command line over a stand-in for the physics, for builds that are disturbed on purpose.

``python stand_in.py SECONDS ARGUMENTS...`` runs ``castblast ARGUMENTS`` with shards that take
SECONDS each; `Cluster` is a Dask scheduler with workers, each a process of its own, over TCP.
"""

import json
import os
import subprocess
import sys
import time
from dataclasses import fields
from importlib import import_module
from pathlib import Path

from fake_blast import FakeBlast

HERE = Path(__file__).resolve().parent
ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, [str(HERE), *sys.path]))}
_START_SECONDS = 60.0


class SlowBlast(FakeBlast):
    """Takes its time for shards, none for the single row that compiles."""

    def run(self, inputs, explosive):
        if len(explosive) > 1:
            time.sleep(self.seconds)
        return FakeBlast.run(self.without_rest(), inputs, explosive)

    def without_rest(self):
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return FakeBlast(**{**values, "seconds": 0.0})


def start_castblast(seconds, *arguments, **options):
    """Start the command line over the stand-in."""
    return subprocess.Popen(
        [sys.executable, __file__, str(seconds), *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=ENVIRONMENT,
        **options,
    )


class Cluster:
    """A scheduler and workers of one thread each, as separate processes that talk over TCP."""

    def __init__(self, folder: Path, workers: int = 2) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        note = folder / f"scheduler-{time.monotonic_ns()}.json"
        self.scheduler = self._start(
            "dask_scheduler",
            "--host",
            "127.0.0.1",
            "--port",
            "0",
            "--no-dashboard",
            "--scheduler-file",
            note,
        )
        wait_for(note.exists)
        self.address = json.loads(note.read_text())["address"]
        self.workers = []
        for _ in range(workers):
            self.add_worker()

    def add_worker(self):
        self.workers.append(
            self._start(
                "dask_worker",
                self.address,
                "--nthreads",
                "1",
                "--no-nanny",
                "--no-dashboard",
                "--memory-limit",
                "0",
                "--local-directory",
                self.folder,
            )
        )

    def wait(self, workers):
        """Wait until so many workers have come."""
        from dask.distributed import Client

        with Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=_START_SECONDS)

    def close(self):
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()

    def _start(self, what, *arguments):
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.{what}", *map(str, arguments)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=ENVIRONMENT,
        )


def wait_for(condition, seconds=_START_SECONDS):
    """Wait until something is so."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.02)


def main(seconds, arguments):
    import castblast.dataset.building.produce
    import castblast.stages.datasets.extend
    from castblast.cli import main as run
    from castblast.dataset.rows.simulation import blast_simulator

    def stand_in(recipe, explosives):
        real = blast_simulator(recipe, explosives)
        values = {field.name: getattr(real, field.name) for field in fields(real)}
        # as workers import it, not as the script that this is
        return import_module("stand_in").SlowBlast(**values, seconds=seconds)

    castblast.dataset.building.produce.blast_simulator = stand_in
    castblast.stages.datasets.extend.blast_simulator = stand_in
    return run(arguments)


if __name__ == "__main__":
    sys.exit(main(float(sys.argv[1]), sys.argv[2:]))
