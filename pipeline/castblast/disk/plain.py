"""Results as plain values and as text of a JSON file. Imports no NumPy: the screen needs it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any


def as_plain(value: Any) -> Any:
    """Arrays, NumPy scalars, tuples and paths as what Python and JSON hold, at any depth."""
    if isinstance(value, Mapping):
        return {str(key): as_plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [as_plain(item) for item in value]
    if hasattr(value, "tolist"):
        return as_plain(value.tolist())
    return value if isinstance(value, bool | int | float | str) or value is None else str(value)


def finite(value: Any) -> Any:
    """As `as_plain`, with None for NaN and infinity: JSON has no such numbers."""
    return _known(as_plain(value))


def _known(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _known(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_known(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def json_text(document: Any) -> str:
    """Text of a JSON file, indented; NaN and infinity become null."""
    return json.dumps(finite(document), indent=2, allow_nan=False) + "\n"
