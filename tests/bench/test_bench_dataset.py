"""What the machinery of a dataset costs beside the physics: memory, seconds per row, scheduling."""

import json
import re
import subprocess
import sys

import measured_build
import pytest
from stand_in import ENVIRONMENT

ROWS = 200_000


def build(repository, folder, rows, shard_size, seconds, workers):
    recipe = repository / "data_specs" / "recipes" / "full.yaml"
    arguments = (recipe, folder, rows, shard_size, seconds, workers)
    done = subprocess.run(
        [sys.executable, measured_build.__file__, *map(str, arguments)],
        capture_output=True, text=True, env=ENVIRONMENT, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_memory_of_a_long_dataset(benchmark, repository, tmp_path):
    """200,000 rows with histories stay far below 3 GB: nothing is held but the design."""
    outcome = benchmark.pedantic(build, (repository, tmp_path, ROWS, 500, 0.0, 2), rounds=1)
    benchmark.extra_info |= {
        "peak in GB": outcome["peak"] / 1e9,
        "us per row": 1e6 * outcome["seconds"] / ROWS,
        "file bytes per row": outcome["bytes"] / ROWS,
    }
    print("\n", benchmark.extra_info, *outcome["lines"], sep="\n")
    assert outcome["peak"] < 3e9


@pytest.mark.parametrize("seconds", [0.25, 1.0])
def test_scheduling_share(benchmark, repository, tmp_path, seconds):
    """Shards of a quarter of a second and more leave less than 3 % to Dask and to writing."""
    shards = round(8 / seconds)
    arguments = (repository, tmp_path, 500 * shards, 500, seconds, 2)
    outcome = benchmark.pedantic(build, arguments, rounds=1)
    share = float(re.search(r"scheduling ([\d.]+)%", "\n".join(outcome["lines"]))[1]) / 100.0
    benchmark.extra_info |= {"scheduling share": share}
    print("\n", benchmark.extra_info, *outcome["lines"], sep="\n")
    assert share < 0.03
