"""A bench of a few hundred balls, for tests of what happens around a cast."""

from pathlib import Path
from typing import Any

import yaml

SMALL: dict[str, Any] = {
    "name": "small",
    "bench": {"length": "4 m", "width": "4 m", "height": "3 m", "burden": "2 m", "spacing": "2 m"},
    "velocity": "6 m/s",
    "balls": {"count": 150},
}


def write_bench(folder: Path, **changes: Any) -> Path:
    """Write the small bench with some keys changed (None: left out)."""
    folder.mkdir(parents=True, exist_ok=True)
    content = {key: value for key, value in (SMALL | changes).items() if value is not None}
    path = folder / "bench.yaml"
    path.write_text(yaml.safe_dump(content))
    return path
