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
    found: dict[str, dict[str, object]] = document["stages"]
    return found


def test_dvc_reads_it(repository: Path) -> None:
    pytest.importorskip("dvc", reason="DVC is an extra")
    done = subprocess.run(
        [sys.executable, "-m", "dvc", "stage", "list", "--name-only"],
        cwd=repository, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "generate" in done.stdout.split()


def test_dependencies_exist_or_are_made(repository: Path, stages: dict) -> None:
    def paths(stage: dict, key: str) -> list[str]:
        return [p if isinstance(p, str) else next(iter(p)) for p in stage.get(key, [])]

    made = {
        p for stage in stages.values() for key in ("outs", "metrics") for p in paths(stage, key)
    }
    for name, stage in stages.items():
        for path in paths(stage, "deps"):
            assert path in made or (repository / path).exists(), f"{name}: {path}"


def test_commands_are_verbs(castblast: Run, stages: dict) -> None:
    for name, stage in stages.items():
        words = shlex.split(stage["cmd"])
        assert words[0] == "castblast", name
        verb = words[1:3] if words[1] in ("dataset", "explosive") else words[1:2]
        assert castblast(*verb, "--help").returncode == 0, name
