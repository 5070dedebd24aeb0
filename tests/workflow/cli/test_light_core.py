"""The light core: what runs with the required libraries alone."""

import subprocess
import sys
from pathlib import Path

import pytest

from castblast.extras import EXTRAS

#: Hides every library of an extra, then runs one command line.
_SCRIPT = """
import sys
from importlib.machinery import PathFinder

hidden = set(sys.argv[1].split(","))

class Core(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        if name.partition(".")[0] in hidden:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return None

sys.meta_path.insert(0, Core)
from castblast.cli import main
sys.exit(main(sys.argv[2:]))
"""


def _run(*arguments: str) -> "subprocess.CompletedProcess[str]":
    hidden = ",".join(library for brought in EXTRAS.values() for library in brought)
    return subprocess.run(
        [sys.executable, "-c", _SCRIPT, hidden, *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


@pytest.mark.parametrize(
    "arguments",
    [
        ("predict", "--burden", "3.5 m"),
        ("web", "--no-browser"),
        ("explosive", "list"),
        ("inputs",),
        ("--help",),
    ],
    ids=" ".join,
)
def test_the_core_runs(arguments: tuple[str, ...]) -> None:
    done = _run(*arguments)
    assert done.returncode == 0, done.stderr
    assert done.stdout


def test_a_table_of_designs_is_answered(tmp_path: Path) -> None:
    (tmp_path / "designs.csv").write_text("burden [m]\n3\n3.5\n")
    done = _run("predict", "--csv", str(tmp_path / "designs.csv"))
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("\n") == 3


@pytest.mark.parametrize("verb", ["simulate", "generate", "muckpile", "compare", "export"])
def test_what_needs_more_names_the_extra(verb: str) -> None:
    arguments = {
        "generate": ("paper",),
        "muckpile": ("demo",),
        "compare": ("data.nc",),
        "export": ("full", "--to", "c"),
    }
    done = _run(verb, *arguments.get(verb, ()))
    assert done.returncode == 2
    assert 'pip install "castblast[' in done.stderr
    assert len([line for line in done.stderr.splitlines() if line.startswith("error")]) == 1
