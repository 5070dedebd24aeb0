"""Build a dataset of the recipe `full` over the stand-in for the physics and say what it cost.

``python measured_build.py RECIPE FOLDER ROWS SHARD_SIZE SECONDS WORKERS`` prints one JSON line;
a process of its own, so that its peak memory is that of the build.
"""

import json
import sys
import time
from pathlib import Path

import yaml
from fake_blast import fake_generate, fake_simulator

from castblast.dataset.building.process import peak_memory


def main(recipe, folder, rows, shard_size, seconds, workers):
    content = yaml.safe_load(Path(recipe).read_text(encoding="utf-8"))
    content |= {"size": rows, "shard_size": shard_size}
    path = folder / "recipe.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    simulator = fake_simulator(path, seconds=seconds)
    begin = time.perf_counter()
    outcome = fake_generate(path, folder / "data.nc", simulator=simulator, workers=workers)
    return {
        "seconds": time.perf_counter() - begin,
        "peak": peak_memory(),
        "lines": outcome.lines,
        "bytes": (folder / "data.nc").stat().st_size,
    }


if __name__ == "__main__":
    place = Path(sys.argv[2])
    numbers = int(sys.argv[3]), int(sys.argv[4]), float(sys.argv[5]), int(sys.argv[6])
    print(json.dumps(main(sys.argv[1], place, *numbers)))
