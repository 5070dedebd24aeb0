"""How much farther than in free flight a muckpile goes: the throw factor of `castblast.bands`.

nice python pipeline/studies/throw_factor.py

Slices between mirrors on a level floor, rows fired one after the other, thrown level. Prints the
throw of the centre of mass over `2/3 v sqrt(2 H / g)`, and mean and standard deviation of its
logarithm. A few minutes on two cores.
"""

from __future__ import annotations

import math
import tempfile
from itertools import product
from pathlib import Path

import numpy as np

from castblast.muckpile.results.ballistic import block_throw
from castblast.stages.muckpile.run import run_muckpile

HEIGHTS = (8.0, 12.5, 24.0)
SPEEDS = (6.0, 12.0, 18.0)
ROWS = (2, 4, 8)
FRICTIONS = (0.4, 0.5, 0.6)
BALLS = 800

BENCH = """
name: slice
bench:
  length: {length} m
  width: {width} m
  height: {height} m
  burden: {burden} m
  spacing: {burden} m
  ends: mirror
firing: {{pattern: row, delay: {delay} ms}}
velocity: {speed} m/s
balls: {{count: {balls}, relative_deviation: 0.3}}
contact: {{friction: {friction}}}
"""


def main() -> None:
    """Print the ratio of every slice, then mean and spread of its logarithm."""
    designs = [(h, v, n, 0.5) for h, v, n in product(HEIGHTS, SPEEDS, ROWS)]
    designs += [(12.5, 12.0, 4, friction) for friction in FRICTIONS if friction != 0.5]
    logs = []
    print("height m, velocity m/s, rows, friction: throw over free flight")
    with tempfile.TemporaryDirectory(prefix="castblast-") as folder:
        for number, (height, speed, rows, friction) in enumerate(designs):
            ratio = throw_ratio(Path(folder) / str(number), height, speed, rows, friction)
            logs.append(math.log(ratio))
            print(f"{height:g}, {speed:g}, {rows}, {friction:g}: {ratio:.2f}", flush=True)
    print(f"factor {math.exp(np.mean(logs)):.3f}, sd of ln {np.std(logs, ddof=1):.3f}")
    print(f"from {math.exp(min(logs)):.2f} to {math.exp(max(logs)):.2f}")


def throw_ratio(folder: Path, height: float, speed: float, rows: int, friction: float) -> float:
    """Throw of one slice over that of a block in free flight; 10 ms of delay a metre of burden."""
    burden = min(6.0, 0.25 * height)
    folder.mkdir(parents=True)
    bench = folder / "bench.yaml"
    bench.write_text(
        BENCH.format(
            length=2.0 * burden, width=rows * burden, height=height, burden=burden,
            delay=10.0 * burden, speed=speed, balls=BALLS, friction=friction,
        ),
        encoding="utf-8",
    )  # fmt: skip
    outcome = run_muckpile(bench, folder / "run")
    return float(outcome.document["throw"][0]) / block_throw(speed, height)


if __name__ == "__main__":
    main()
