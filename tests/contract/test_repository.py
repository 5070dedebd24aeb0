"""Promises of the repository: layers, sizes, names, what a wheel holds, what start-up costs."""

import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from castblast.design.variables import INPUTS, OUTPUTS, VARIABLES, Variable

HEAVY = (
    "torch",
    "mlflow",
    "dask",
    "distributed",
    "sklearn",
    "xarray",
    "scipy",
    "numba",
    "pandas",
    "onnx",
)


def _modules_after(code: str) -> set[str]:
    script = f"{code}\nimport sys\nprint(*sorted(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=60
    )
    return {name.split(".")[0] for name in done.stdout.splitlines()[-1].split()}


def _fastest(command: list[str], tries: int = 5) -> float:
    """Processor time [s] of the fastest of some tries: what else runs here must not count."""
    seconds = []
    for _ in range(tries):
        before = os.times()
        subprocess.run(command, capture_output=True, check=True, timeout=60)
        after = os.times()
        user = after.children_user - before.children_user
        seconds.append(user + after.children_system - before.children_system)
    return min(seconds)


def test_help_loads_nothing_heavy() -> None:
    loaded = _modules_after("from castblast.cli import main\nmain(['--help'])")
    assert not loaded & set(HEAVY)


def test_predict_loads_nothing_heavy() -> None:
    loaded = _modules_after("from castblast.cli import main\nassert main(['predict']) == 0")
    assert not loaded & set(HEAVY)


def test_start_up_times() -> None:
    """Help opens in half a second, a prediction in one; the best of a few tries is the cost."""
    assert _fastest([sys.executable, "-m", "castblast", "--help"]) < 0.5
    assert _fastest([sys.executable, "-m", "castblast", "predict"]) < 1.0


def test_the_python_face_costs_nothing_until_it_is_used() -> None:
    """`import castblast` loads no array library, and names its whole face all the same."""
    loaded = _modules_after("import castblast\nassert 'simulate' in dir(castblast)")
    assert not loaded & {*HEAVY, "numpy", "pydantic", "yaml", "matplotlib"}
    bare = _fastest([sys.executable, "-c", "pass"])
    assert _fastest([sys.executable, "-c", "import castblast"]) - bare < 0.05


def test_no_second_copy_of_the_package() -> None:
    """The source root `pipeline/` must never be imported as a package of its own."""
    assert not [name for name in sys.modules if name.split(".")[0] == "pipeline"]


def test_wheel_holds_the_package_only(repository: Path, tmp_path: Path) -> None:
    """A wheel installs `castblast/` with its specs and its network, and nothing beside it."""
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", tmp_path, repository],
        check=True,
        timeout=300,
    )
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    tops = {name.split("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"castblast"}
    for needed in ("data_specs/recipes/quickstart.yaml", "models/chosen/network.json"):
        assert f"castblast/_data/{needed}" in names


@pytest.mark.parametrize("variable", INPUTS + OUTPUTS, ids=lambda v: v.name)
def test_every_variable_is_complete(variable: Variable) -> None:
    assert re.fullmatch(r"[a-z][a-z0-9_]*", variable.name)
    assert variable.lower < variable.upper
    assert variable.long_name
    assert variable.unit
    assert variable.display_factor > 0
    if variable.default is not None:
        assert variable.lower <= variable.default <= variable.upper


def test_variable_names_are_unique() -> None:
    assert len(VARIABLES) == len(INPUTS) + len(OUTPUTS)
