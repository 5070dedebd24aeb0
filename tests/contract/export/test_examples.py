"""The examples of the page about exports are run as they stand there."""

import re
import shutil
import sys
from pathlib import Path

import pytest

from castblast.export.source.c import STRICT_FLAGS
from castblast.export.source.plain import Files
from castblast.export.source.runners import run_program, written
from castblast.export.targets import TARGETS
from castblast.specs.models.model import PAPER_FEATURES, PAPER_TARGETS, RidgeSpec
from castblast.surrogate.fitting.features import read_table
from castblast.surrogate.fitting.training import fit_spec


@pytest.fixture(scope="module")
def files(toy_dataset) -> Files:
    """Every export of a network with the inputs of the paper."""
    spec = RidgeSpec(name="ridge", input_transform="log", target_transform="log")
    network = fit_spec(spec, read_table(toy_dataset(600), PAPER_FEATURES, PAPER_TARGETS)).network
    every: Files = {}
    for target in TARGETS.values():
        every |= target.write(network)
    return every


@pytest.fixture(scope="module")
def examples(repository: Path) -> dict[str, list[str]]:
    text = (repository / "pipeline" / "docs" / "exports.md").read_text(encoding="utf-8")
    found: dict[str, list[str]] = {}
    for language, code in re.findall(r"```(\w+)\n(.*?)```", text, re.DOTALL):
        found.setdefault(language, []).append(code)
    return found


def test_c(files: Files, examples: dict[str, list[str]]) -> None:
    compiler = shutil.which("gcc")
    if compiler is None:
        pytest.skip("gcc is not installed")
    (code,) = examples["c"]
    with written(files | {"user.c": code.encode()}) as folder:
        sources = [folder / "user.c", folder / "model.c"]
        run_program([compiler, *STRICT_FLAGS, *sources, "-lm", "-o", folder / "user"])
        said = run_program([folder / "user"])
    assert re.fullmatch(r"\d+\.\d+ m/s \(\d+\.\d+ to \d+\.\d+\), inside: [01]\n", said)


def test_js(files: Files, examples: dict[str, list[str]]) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    (code,) = examples["js"]
    extra = {"package.json": b'{"type": "module"}', "user.js": code.encode()}
    with written(files | extra) as folder:
        assert float(run_program([node, folder / "user.js"]).split()[0]) > 0.0


def test_python(files: Files, examples: dict[str, list[str]]) -> None:
    """Every block of Python, with a stand-in of PFC's module for the one that asks for it."""
    stand_in = b"""
class Ball:
    def __init__(self, group): self.group = group
    def in_group(self, name, slot): return name == self.group
    def set_vel(self, velocity): pass
class ball:
    @staticmethod
    def list(): return iter([Ball("block_1"), Ball("block_2")])
"""
    pytest.importorskip("onnxruntime", reason="one block runs ONNX")
    assert len(examples["python"]) == 4
    for code in examples["python"]:
        with written(files | {"user.py": code.encode(), "itasca.py": stand_in}) as folder:
            assert run_program([sys.executable, "user.py"], folder=folder).strip()


def test_sh(files: Files, examples: dict[str, list[str]]) -> None:
    if not all(map(shutil.which, ("cc", "lmp", "sh", "python3"))):
        pytest.skip("cc or LAMMPS (lmp) is not installed")
    for code in examples["sh"]:
        with written(files) as folder:
            assert run_program(["sh", "-e", "-c", code], folder=folder).strip()
