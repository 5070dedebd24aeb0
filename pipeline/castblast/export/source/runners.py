"""Run exported files in their own language, on this machine, and read what they answer.

Every runner takes the files of one target and rows, works in a folder of its own that is gone
afterwards, and says with what it ran. What is missing here raises `NotVerifiedError`; a file that
does not compile or run raises `CheckError`.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from castblast.errors import CheckError
from castblast.export.onnx.file import run_onnx_rows
from castblast.export.source.answers import (
    Answers,
    NotVerifiedError,
    answers,
    parse_answers,
    row_lines,
)
from castblast.export.source.c import STRICT_FLAGS
from castblast.export.source.plain import Files
from castblast.export.source.python import OLDEST
from castblast.network import Network
from castblast.network.json_file import from_json
from castblast.types import FloatArray, IntArray

_SECONDS = 300
RUN_ROWS = Path(__file__).parents[1] / "templates" / "run_rows.mjs"

#: Network (for its names only), files and rows in; answers and the name of the tool out.
Runner = Callable[[Network, Files, FloatArray, IntArray], tuple[Answers, str]]


def run_json(
    network: Network, files: Files, numeric: FloatArray, index: IntArray
) -> tuple[Answers, str]:
    """Read the record back and evaluate it."""
    return answers(from_json(files["network.json"].decode()), numeric, index), "NumPy"


def run_onnx(
    network: Network, files: Files, numeric: FloatArray, index: IntArray
) -> tuple[Answers, str]:
    """Run with onnxruntime, or the reference of ONNX."""
    return run_onnx_rows(files["model.onnx"], numeric, index), "ONNX"


def run_c(
    network: Network, files: Files, numeric: FloatArray, index: IntArray
) -> tuple[Answers, str]:
    """Compile with every warning an error, run the self-test, then the rows."""
    with written(files) as folder:
        program = compile_c(folder)
        run_program([program])
        return parse_answers(
            run_program([program, "--rows"], row_lines(numeric, index)), numeric.shape[1]
        ), "gcc -std=c99"


def compile_c(folder: Path) -> Path:
    """Compile the self-test of ``model.c`` in a folder; return the program."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        message = "no C compiler (gcc) is installed"
        raise NotVerifiedError(message)
    program = folder / "model_test"
    run_program(
        [compiler, *STRICT_FLAGS, "-O2", "-DCASTBLAST_SELF_TEST", folder / "model.c", "-lm", "-o",
         program]
    )  # fmt: skip
    return program


def run_js(
    network: Network, files: Files, numeric: FloatArray, index: IntArray
) -> tuple[Answers, str]:
    """Import the module in node and answer the rows."""
    node = shutil.which("node")
    if node is None:
        message = "node is not installed"
        raise NotVerifiedError(message)
    with written(files) as folder:
        (folder / "package.json").write_text('{"type": "module"}')
        text = run_program([node, RUN_ROWS, folder / "model.js"], row_lines(numeric, index))
    return parse_answers(text, numeric.shape[1]), "node"


def run_python(
    network: Network, files: Files, numeric: FloatArray, index: IntArray
) -> tuple[Answers, str]:
    """Run the self-test and the rows in the oldest interpreter at hand."""
    program, version = oldest_python()
    with written(files) as folder:
        run_program([program, "model.py"], folder=folder)
        text = run_program([program, "model.py", "--rows"], row_lines(numeric, index), folder)
    return parse_answers(text, numeric.shape[1]), f"CPython {version}"


@cache
def oldest_python() -> tuple[str, str]:
    """Oldest CPython from 3.6 on that starts here, of pyenv or on the path: program, version."""
    home = Path(os.environ.get("HOME", "/"))
    kept = Path(os.environ.get("PYENV_ROOT") or home / ".pyenv") / "versions"
    for minor in range(OLDEST[1], sys.version_info.minor):
        name = f"python3.{minor}"
        found = [str(path) for path in sorted(kept.glob(f"3.{minor}.*/bin/{name}"))]
        for program in [*found, shutil.which(name)]:
            if program and f"Python 3.{minor}." in _version(program):
                return program, f"3.{minor}"
    return sys.executable, f"{sys.version_info.major}.{sys.version_info.minor}"


def _version(program: str) -> str:
    """What a program prints as its version; nothing if it does not start."""
    try:
        done = subprocess.run(
            [program, "--version"], capture_output=True, text=True, check=False, timeout=60
        )
    except OSError:
        return ""
    return done.stdout if done.returncode == 0 else ""


@contextmanager
def written(files: Files) -> Iterator[Path]:
    """Give a temporary folder that holds the files."""
    with TemporaryDirectory(prefix="castblast-") as name:
        for file, content in files.items():
            (Path(name) / file).write_bytes(content)
        yield Path(name)


def run_program(command: Sequence[str | Path], text: str = "", folder: Path | None = None) -> str:
    """Run a program with a text on its standard input; return what it printed.

    Raises
    ------
    CheckError
        It failed; the message ends with the last lines it wrote.
    """
    words = [str(word) for word in command]
    environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        words, input=text, capture_output=True, text=True, check=False, timeout=_SECONDS,
        cwd=folder, env=environment,
    )  # fmt: skip
    if done.returncode != 0:
        said = (done.stderr + done.stdout).strip().splitlines()[-5:]
        name = Path(words[0]).name
        raise CheckError("\n".join([f"{name} failed with exit code {done.returncode}", *said]))
    return done.stdout
