"""The scripts of the web page that draw nothing, asked in node."""

import json
import shutil
from typing import Any

import pytest

from castblast.export.source.runners import run_program, written
from castblast.export.web import PAGE, to_web
from castblast.network import Network


def page_scripts(network: Network) -> str:
    """Model and computing scripts of the page of a network; they ask for no document."""
    text = to_web(network)[PAGE].decode().split('<script type="module">')[1]
    return text.split("/* The page: one state")[0].replace("<\\/", "</")


def ask(scripts: str, expression: str) -> Any:
    """Value of an expression of JavaScript; skips the test where node is not installed."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    program = f"{scripts}\nconsole.log(JSON.stringify({expression}));\n"
    with written({"ask.mjs": program.encode()}) as folder:
        return json.loads(run_program([node, folder / "ask.mjs"]))
