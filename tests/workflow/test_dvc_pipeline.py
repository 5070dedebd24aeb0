"""The DVC pipeline: well formed, complete in its dependencies, and every command a real verb."""

import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

Run = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="module")
def stages(repository: Path) -> dict[str, dict[str, object]]:
    document = yaml.safe_load((repository / "dvc.yaml").read_text(encoding="utf-8"))
    found: dict[str, dict[str, object]] = {}
    for name, stage in document["stages"].items():
        for spec in stage.get("matrix", {}).get("spec", [""]):
            text = yaml.safe_dump(stage).replace("${item.spec}", spec)
            found[f"{name}@{spec}" if spec else name] = yaml.safe_load(text)
    return found


def _paths(stage: dict, key: str) -> list[str]:
    return [p if isinstance(p, str) else next(iter(p)) for p in stage.get(key, [])]


def test_every_model_spec_is_a_stage(repository: Path, stages: dict) -> None:
    """Each fit depends on its own spec alone, and the comparison on every fit."""
    specs = {path.stem for path in (repository / "models" / "specs").glob("*.yaml")}
    assert {name.removeprefix("train@") for name in stages if name.startswith("train@")} == specs
    for spec in specs:
        own = [p for p in _paths(stages[f"train@{spec}"], "deps") if p.startswith("models/")]
        assert own == [f"models/specs/{spec}.yaml"]
    compared = {p for p in _paths(stages["compare"], "deps") if p.startswith("data/fits")}
    assert compared == {f"data/fits/{spec}" for spec in specs}


def test_every_source_of_a_fit_is_a_dependency(repository: Path, stages: dict) -> None:
    """What makes a kept fit stale makes its stage stale; else a comparison would refit unseen."""
    from castblast.surrogate.fitting.fit_store import FIT_SOURCES

    deps = _paths(stages["train@ridge"], "deps")
    for source in FIT_SOURCES:
        assert (repository / "pipeline" / "castblast" / source).is_dir()
        assert f"pipeline/castblast/{source}" in deps


def test_every_source_of_a_row_is_a_dependency(repository: Path, stages: dict) -> None:
    """What makes a dataset stale makes the stage that builds it stale."""
    from castblast.dataset.file.provenance import SOURCES

    deps = _paths(stages["generate"], "deps")
    for source in SOURCES:
        path = f"pipeline/castblast/{source}"
        assert (repository / path).exists()
        assert path in deps or str(Path(path).parent) in deps, source


def test_dvc_reads_it(repository: Path) -> None:
    pytest.importorskip("dvc", reason="DVC is an extra")
    done = subprocess.run(
        [sys.executable, "-m", "dvc", "stage", "list", "--name-only"],
        cwd=repository, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "generate" in done.stdout.split()


def test_dependencies_exist_or_are_made(repository: Path, stages: dict) -> None:
    made = {
        p for stage in stages.values() for key in ("outs", "metrics") for p in _paths(stage, key)
    }
    for name, stage in stages.items():
        for path in _paths(stage, "deps"):
            from_stage = path in made or str(Path(path).parent) in made
            assert from_stage or (repository / path).exists(), f"{name}: {path}"


def test_commands_are_verbs(castblast: Run, stages: dict) -> None:
    lines = {tuple(shlex.split(stage["cmd"])) for stage in stages.values()}
    assert {words[0] for words in lines} == {"castblast"}
    verbs = {words[1:3] if words[1] in ("dataset", "explosive") else words[1:2] for words in lines}
    for verb in sorted(verbs):
        assert castblast(*verb, "--help").returncode == 0, verb
