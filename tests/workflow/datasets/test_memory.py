"""The memory of a build does not grow with its rows, but for the columns of the design."""

import json
import subprocess
import sys

import measured_build
import pytest
from stand_in import ENVIRONMENT


@pytest.mark.skipif(sys.platform != "linux", reason="peak memory in the units of Linux")
def test_peak_memory(repository, tmp_path):
    """24,000 rows more cost less than 3 kB each.

    A row of the design has some 40 numbers, 0.3 kB, a few times over while it is drawn; with its
    results a row has 1.3 kB, and each copy of the whole table would add that. 3 GB for a million
    rows are 3 kB for each. 200,000 rows are a benchmark (`make bench`).
    """
    recipe = repository / "data_specs" / "recipes" / "full.yaml"
    peaks = []
    for rows in (16_000, 40_000):
        folder = tmp_path / str(rows)
        folder.mkdir()
        done = subprocess.run(
            [sys.executable, measured_build.__file__, recipe, folder, str(rows), "500", "0", "2"],
            capture_output=True, text=True, env=ENVIRONMENT, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        peaks.append(json.loads(done.stdout)["peak"])
    assert peaks[1] < 0.6e9
    assert peaks[1] - peaks[0] < 3e3 * 24_000
