"""`Network` to JavaScript: one ES module for browsers and node, without dependencies."""

from __future__ import annotations

from castblast.export.source.plain import Files, compact, example_row, render
from castblast.network import Network


def to_javascript(network: Network) -> Files:
    """Write ``model.js``."""
    text = render("model.js.j2", n=compact(network), example=example_row(network))
    return {"model.js": text}
