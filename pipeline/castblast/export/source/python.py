"""`Network` to Python: one file of the standard library for CPython 3.6 and later.

The interpreters inside PFC and FLAC are 3.6 (versions 6 and 7) and 3.10 (version 9), and packages
cannot be counted on there: no NumPy, and no word of the language that came after 3.6.
"""

from __future__ import annotations

from castblast.export.source.plain import Files, compact, example_row, render
from castblast.network import Network

#: The output that a bench is thrown with.
VELOCITY = "burden_velocity"
#: Oldest Python that reads the file.
OLDEST = (3, 6)


def to_python(network: Network) -> Files:
    """Write ``model.py``; with functions for a bench of blocks if it gives a burden velocity."""
    text = render(
        "model.py.j2",
        n=compact(network),
        example=example_row(network),
        velocity=VELOCITY if VELOCITY in network.output_names else None,
    )
    return {"model.py": text}
