"""Files from a stranger run nothing: no planted pickle is opened, no named function called."""

import ast
import json
import os
import pickle
from pathlib import Path

import pytest

from castblast.cli import main
from castblast.surrogate.fitting import kept as store

SPEC = "kind: ridge\ninput_transform: log\ntarget_transform: log\n"
#: Leaves a trace when it is imported, and another when its function is called.
MODULE = """
from pathlib import Path
Path({trace!r}, "imported").touch()

def make():
    from sklearn.linear_model import LinearRegression
    Path({trace!r}, "called").touch()
    return LinearRegression()
"""
CUSTOM = "kind: custom\nfactory: strange_models:make\n" + SPEC.partition("\n")[2]
OPTIONS = ("--quick", "--workers", "1", "--no-tracking")


class Bomb:
    """A pickle that makes a folder when it is opened."""

    def __init__(self, place: Path) -> None:
        self.place = place

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.mkdir, (str(self.place),)


@pytest.fixture
def trace(tmp_path: Path) -> Path:
    """Folder in which whatever runs leaves something."""
    folder = tmp_path / "trace"
    folder.mkdir()
    return folder


@pytest.fixture
def data(toy_dataset, tmp_path: Path) -> Path:
    """A dataset, a spec, and a spec with a module beside it."""
    toy_dataset(400).to_netcdf(tmp_path / "toy.nc")
    (tmp_path / "plain.yaml").write_text(SPEC)
    (tmp_path / "strange.yaml").write_text(CUSTOM)
    (tmp_path / "strange_models.py").write_text(MODULE.format(trace=str(tmp_path / "trace")))
    return tmp_path


def run(*arguments: object) -> int:
    return main([str(argument) for argument in arguments])


def test_the_bomb_works(trace: Path) -> None:
    """Else nothing below proves anything."""
    pickle.loads(pickle.dumps(Bomb(trace / "opened")))
    assert (trace / "opened").is_dir()


def test_a_planted_pickle_is_never_opened(data: Path, trace: Path, monkeypatch) -> None:
    """Beside the dataset under every name ever used, and in the store of the user, unsealed."""
    fits, out = data / "fits", data / "out"
    bomb = pickle.dumps({"key": {}, "spec": Bomb(trace / "opened"), "value": b""})
    whole = pickle.dumps(Bomb(trace / "opened"))
    for folder, names in (
        (fits / "plain", ("fit.pickle", "fit.sealed", "plain.sealed", "estimator.pickle")),
        (fits / "parts", ("curve_plain.pickle", "probe.pickle", "shifts_plain.pickle")),
    ):
        folder.mkdir(parents=True)
        for name in names:
            (folder / name).write_bytes(bomb if name == "fit.pickle" else whole)
    for place in (fits / "plain", fits / "curve_plain.part"):
        entry = store._entry(place)
        assert entry is not None
        entry.parent.mkdir(parents=True, exist_ok=True)
        entry.write_bytes(bytes(32) + bomb)
    assert run("export", fits / "plain", "--out", out, "--to", "onnx") == 2
    assert run("compare", fits, "--out", out, *OPTIONS) == 2
    assert run("train", data / "toy.nc", data / "plain.yaml", "--no-tracking") == 0
    assert run("compare", data / "toy.nc", data / "plain.yaml", "--fits", fits, "--out", out,
               *OPTIONS) == 0  # fmt: skip
    assert run("compare", fits, "--out", out, *OPTIONS) == 0
    assert run("export", fits / "plain", "--out", out, "--to", "json") == 0
    assert run("infill", data / "toy.nc", fits / "plain", "--out", data / "next.csv") == 4
    assert not list(trace.iterdir())


@pytest.mark.parametrize(
    "words",
    [
        ("train", "toy.nc", "plain.yaml", "strange.yaml"),
        ("compare", "toy.nc", "plain.yaml", "strange.yaml"),
        ("compare", "toy.nc", "."),
        ("tune", "toy.nc", "strange.yaml", "--trials", "1"),
        ("infill", "toy.nc", "strange.yaml"),
    ],
)
def test_a_spec_that_runs_code_is_refused_unless_asked_for(
    data: Path, trace: Path, words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    given = [data / word if word.startswith(".") or "." in word else word for word in words]
    assert run(*given, "--out", data / "out") == 2
    said = capsys.readouterr().err
    assert "strange: kind custom runs Python code, strange_models:make" in said
    assert "--allow-code" in said
    assert not list(trace.iterdir())
    assert not (data / "out").exists()


def test_a_spec_that_runs_code_is_run_when_asked_for(data: Path, trace: Path) -> None:
    given = (data / "toy.nc", data / "strange.yaml", "--no-tracking", "--allow-code")
    assert run("train", *given) == 0
    assert {path.name for path in trace.iterdir()} == {"imported", "called"}
    assert (data / "fits" / "strange" / "fit.json").is_file()


def test_a_network_or_a_folder_of_fits_of_a_stranger_runs_nothing(
    data: Path, trace: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A spec travels in both; one that names a function of the system is a spec that runs code."""
    assert run("train", data / "toy.nc", data / "plain.yaml", "--no-tracking") == 0
    folder = data / "fits" / "plain"
    spec = {
        "name": "plain",
        "kind": "custom",
        "factory": "os:mkdir",
        "options": {"path": str(trace / "made")},
    }
    for name, levels in (("network.json", ("provenance", "spec")), ("fit.json", ("spec",))):
        document = json.loads((folder / name).read_text())
        inner = document
        for level in levels[:-1]:
            inner = inner[level]
        inner[levels[-1]] = spec
        (folder / name).write_text(json.dumps(document))
    stranger = (data / "fits").rename(data / "from_elsewhere")
    capsys.readouterr()
    assert run("infill", data / "toy.nc", stranger / "plain", "--out", data / "next.csv") == 2
    assert run("compare", stranger, "--out", data / "out", *OPTIONS) == 2
    assert capsys.readouterr().err.count("kind custom runs Python code, os:mkdir") == 2
    assert not list(trace.iterdir())


def _opens_code(node: ast.AST) -> bool:
    """Whether a call may run what it reads: loading of pickles, or of text as code."""
    if not isinstance(node, ast.Call):
        return False
    said = ast.unparse(node.func)
    module, _, name = said.rpartition(".")
    if module.rpartition(".")[2] in (
        "pickle",
        "joblib",
        "dill",
        "cloudpickle",
        "marshal",
        "shelve",
    ):
        return name in ("load", "loads", "open", "Unpickler")
    if said in ("torch.load", "eval", "exec", "yaml.unsafe_load", "yaml.full_load"):
        return True
    return any(
        word.arg == "allow_pickle" and ast.unparse(word.value) != "False" for word in node.keywords
    )


def test_pickles_are_opened_in_one_place_only(repository: Path) -> None:
    """In the store of fits, which asks the seal first; nothing else turns a file into code."""
    found = {
        path.stem
        for path in (repository / "pipeline" / "castblast").rglob("*.py")
        if any(map(_opens_code, ast.walk(ast.parse(path.read_text(encoding="utf-8")))))
    }
    assert found == {"fit_store"}
