"""Ctrl-C and SIGTERM on the command line: soon, with one line and the exit code of the signal."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")

#: The command line, which says when a near field has begun.
SIMULATE = """
import sys
import castblast.api.simulation as stage
from castblast.cli import main
run = stage.run_blast
def announced(case):
    print("begun", flush=True)
    return run(case)
stage.run_blast = announced
sys.exit(main(["simulate", "--set", "zones=20000"]))
"""


def started(*arguments: object, **options: Any) -> subprocess.Popen[str]:
    """A Python process that has said that its work has begun."""
    process = subprocess.Popen(
        [sys.executable, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        **options,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "begun\n"
    return process


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_long_near_field_hears_a_signal(tmp_path: Path, number: int, code: int) -> None:
    """20,000 zones take minutes in one call of compiled code."""
    process = started("-c", SIMULATE, cwd=tmp_path)
    time.sleep(1.0)
    assert process.poll() is None
    begun = time.monotonic()
    process.send_signal(number)
    _, errors = process.communicate(timeout=60)
    assert time.monotonic() - begun < 10.0
    assert process.returncode == code
    assert len(errors.splitlines()) == 1
    assert "stopped" in errors
    assert list(tmp_path.iterdir()) == []


#: Two processes at work for a minute, below the command line.
JOBS = """
import sys, time
import castblast.stages.predict_table as stage
from castblast.cli import main
from castblast.jobs import Job, run_jobs
def work(*arguments, **options):
    def tell(share, line):
        print("begun", flush=True)
    run_jobs([Job("one", time.sleep, (60.0,)), Job("two", time.sleep, (60.0,))], 2, tell)
stage.predict_csv = work
if __name__ == "__main__":
    sys.exit(main(["predict", "--csv", "none.csv"]))
"""


@pytest.mark.parametrize("delay", [0.1, 4.0])
def test_processes_at_work_end_without_a_word(tmp_path: Path, delay: float) -> None:
    """Ctrl-C of a terminal goes to all processes, those that just start and those at work."""
    script = tmp_path / "jobs.py"
    script.write_text(JOBS)
    process = started(script, start_new_session=True)
    time.sleep(delay)
    begun = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert time.monotonic() - begun < 10.0
    assert process.returncode == 130
    assert errors == "stopped; run the same command again to resume\n"
