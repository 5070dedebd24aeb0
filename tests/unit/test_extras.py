"""Libraries that are not installed: said before the work, in one line that installs them."""

import ast
import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from castblast.cli import main
from castblast.errors import MissingLibraryError
from castblast.extras import EXTRAS, explained, extra_of, missing_libraries, require

#: What every installation has.
CORE = {"numpy", "pydantic", "pydantic_core", "yaml", "typer", "rich"}
#: Distributions whose import name is another one.
IMPORTED_AS = {
    "scikit-learn": "sklearn", "pillow": "PIL", "vtk": "vtkmodules", "pyyaml": "yaml",
}  # fmt: skip
SPECS = {
    "plain": "kind: ridge\ninput_transform: log\ntarget_transform: log\n",
    "deep": "kind: torch_mlp\nhidden_layers: [3]\nadam_epochs: 1\nmax_iterations: 2\n"
    "search: {adam_epochs: {range: [1, 3]}}\n",
}


class _Absent:
    """A finder by which some libraries are not there."""

    def __init__(self, libraries: tuple[str, ...]) -> None:
        self.libraries = libraries

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        if name.partition(".")[0] in self.libraries:
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)


def hide(monkeypatch: pytest.MonkeyPatch, *libraries: str) -> None:
    """Make libraries look as if they were not installed: neither found nor imported."""
    for name in [name for name in sys.modules if name.partition(".")[0] in libraries]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(sys, "meta_path", [_Absent(libraries), *sys.meta_path])


@pytest.fixture(scope="module")
def toy(toy_dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a dataset and two specs, one of which needs PyTorch."""
    folder = tmp_path_factory.mktemp("toy")
    toy_dataset(400).to_netcdf(folder / "toy.nc")
    for name, text in SPECS.items():
        (folder / f"{name}.yaml").write_text(text)
    return folder


def test_every_library_is_of_the_core_or_of_an_extra(repository: Path) -> None:
    """What a module imports and no extra brings would end as an internal error."""
    found: dict[str, Path] = {}
    for path in (repository / "pipeline" / "castblast").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module or ""]
            found |= {name.partition(".")[0]: path for name in names}
    foreign = set(found) - set(sys.stdlib_module_names) - {"castblast"} - CORE
    strangers = {name: str(found[name]) for name in foreign if extra_of(name) is None}
    assert not strangers
    assert len(foreign) > 15


def test_extras_of_the_package_bring_what_the_table_says(repository: Path) -> None:
    project = tomllib.loads((repository / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for extra, requirements in project["optional-dependencies"].items():
        names = {
            requirement.partition("[")[0].partition(">")[0].strip() for requirement in requirements
        }
        if extra in EXTRAS and "castblast" not in names:
            assert {IMPORTED_AS.get(name, name) for name in names} <= set(EXTRAS[extra]), extra


def test_one_line_names_all_that_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    hide(monkeypatch, "optuna", "torch")
    assert missing_libraries("tune", "torch") == ["optuna", "torch"]
    expected = r'^castblast tune needs Optuna and PyTorch: pip install "castblast\[tune,torch\]"$'
    with pytest.raises(MissingLibraryError, match=expected):
        require("tune", "torch", purpose="castblast tune")
    require("data", purpose="castblast generate")


def test_a_fault_of_an_installed_library_is_no_missing_library() -> None:
    """Only what is really absent is explained away; everything else stays a bug with a trace."""
    assert explained(ModuleNotFoundError("x", name="numpy.no_such_part"), "x") is None
    assert explained(ModuleNotFoundError("x", name="no_such_library_at_all"), "x") is None
    assert explained(ModuleNotFoundError("x"), "x") is None


@pytest.mark.parametrize(
    ("library", "arguments", "extra"),
    [
        ("sklearn", ("train", "toy.nc", "plain.yaml"), "train"),
        ("matplotlib", ("train", "toy.nc", "plain.yaml"), "plot"),
        ("torch", ("train", "toy.nc", "plain.yaml", "deep.yaml"), "torch"),
        ("mlflow", ("train", "toy.nc", "plain.yaml", "--tracking"), "track"),
        ("optuna", ("tune", "toy.nc", "deep.yaml", "--trials", "1"), "tune"),
        ("torch", ("tune", "toy.nc", "deep.yaml", "--trials", "1"), "torch"),
        ("SALib", ("compare", "toy.nc", "plain.yaml"), "train"),
        ("torch", ("compare", "toy.nc", "deep.yaml"), "torch"),
        ("xarray", ("generate", "quickstart.yaml"), "data"),
        ("dask", ("dataset", "describe", "toy.nc"), "data"),
        ("openpyxl", ("export", "net.json", "--to", "excel"), "excel"),
        ("onnx", ("export", "net.json", "--to", "json,onnx"), "export"),
        ("numba", ("simulate",), "simulate"),
        ("matplotlib", ("muckpile", "demo"), "plot"),
    ],
)
def test_a_missing_library_is_said_before_the_work(
    toy: Path, library, arguments, extra, monkeypatch: pytest.MonkeyPatch, capsys, tmp_path: Path
) -> None:
    hide(monkeypatch, library)
    given = [str(toy / word) if word.endswith((".nc", ".yaml")) else word for word in arguments]
    out = [] if arguments[0] in ("dataset", "simulate") else ["--out", str(tmp_path / "out")]
    assert main([*given, *out]) == 2
    said = capsys.readouterr().err
    assert f'pip install "castblast[{extra}]"' in said
    assert said.count("\n") == 1, "one line"
    assert not (tmp_path / "out").exists()


def test_a_comparison_leaves_out_what_is_not_installed(
    toy: Path, monkeypatch: pytest.MonkeyPatch, capsys, tmp_path: Path
) -> None:
    """Ten fits must not be lost to the eleventh: the others are compared, and a remark says so."""
    hide(monkeypatch, "torch", "mlflow")
    paths = [str(toy / name) for name in ("toy.nc", "plain.yaml", "deep.yaml")]
    folders = ["--out", str(tmp_path / "out"), "--fits", str(tmp_path / "fits")]
    assert main(["compare", *paths, *folders, "--quick", "--workers", "1"]) == 0
    said = capsys.readouterr()
    assert 'deep: kind torch_mlp needs PyTorch: pip install "castblast[torch]"' in said.out
    assert 'pip install "castblast[track]"' in said.err, "no record is kept, and that is said"
    document = json.loads((tmp_path / "out" / "comparison.json").read_text())
    assert [entry["name"] for entry in document["league"]] == ["plain"]
    assert any("castblast[torch]" in remark for remark in document["remarks"])


def test_an_import_deep_inside_a_verb_names_the_extra() -> None:
    """The safety net: a library that no verb asked for beforehand is still exit code 2."""
    code = (
        "import sys\nimport castblast.api.catalogue as stage\nsys.modules['scipy'] = None\n"
        "def catalogue():\n    import scipy\nstage.catalogue = catalogue\n"
        "from castblast.cli import main\nsys.exit(main(['explosive', 'list']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr == (
        'error: castblast explosive needs SciPy: pip install "castblast[simulate]"\n'
    )
