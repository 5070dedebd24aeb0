"""Ground files as other tools write them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from castblast.muckpile.bench.geometry import Bench
from castblast.specs.bench.ground.spec import Ground, GroundSpec, read_ground
from castblast.specs.loading import make_spec

CASES = Path(__file__).parents[1] / "cases" / "ground"
BENCH = Bench(12.0, 6.0, 6.0)
GRID = np.array([452300.0, 7389200.0, 598.0])
SHIFT = ["-452300 m", "-7389200 m", "-598 m"]


def ground(name: str, folder: Path = CASES, **more: Any) -> Ground:
    key = "stl" if name.endswith(".stl") else "heightmap"
    return read_ground((make_spec({key: name} | more, GroundSpec, "bench"),), folder, BENCH)
