"""What people read before they run anything: help texts, lists of inputs, files to start from."""

import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
import typer
import typer.main

from castblast.cli import main
from castblast.cli.app import app
from castblast.cli.screen import Screen
from castblast.cli.verb import literal, verb
from castblast.design.variables import INPUTS
from castblast.disk.resources import SPEC_FOLDERS, find_spec, shipped_specs
from castblast.specs.bench.bench import load_bench
from castblast.specs.case import read_case
from castblast.specs.explosive import load_explosive
from castblast.specs.models.model import read_model_spec
from castblast.specs.recipe import load_recipe

_ROOT = typer.main.get_command(app)


def _verbs(group: click.Command, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    for name, command in getattr(group, "commands", {}).items():
        inner = _verbs(command, (*path, name)) if hasattr(command, "commands") else [(*path, name)]
        yield from inner


def _words(text: str) -> str:
    """Text without line breaks and the frame that the terminal library draws."""
    return re.sub(r"[\s│]+", " ", text)


@pytest.mark.parametrize("verb", list(_verbs(_ROOT)), ids=" ".join)
def test_help_shows_every_bracket(
    verb: tuple[str, ...], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Units in brackets reach the screen: the terminal library must not take them for markup."""
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("TERMINAL_WIDTH", "200")
    command = _ROOT
    for name in verb:
        command = command.commands[name]  # type: ignore[attr-defined]
    assert main([*verb, "--help"]) == 0
    shown = _words(capsys.readouterr().out)
    for parameter in command.params:
        for unit in re.findall(r"\\(\[[^\]]*\])", getattr(parameter, "help", "") or ""):
            assert unit in shown
    assert "\\[" not in shown


def test_units_of_help_texts_are_there_to_be_lost(capsys: pytest.CaptureFixture[str]) -> None:
    """The two texts that once lost their unit."""
    assert main(["tune", "--help"]) == 0
    assert "[s]" in capsys.readouterr().out
    assert main(["predict", "--help"]) == 0
    assert "[m]" in capsys.readouterr().out
    assert main(["explosive", "list"]) == 0
    assert "[kg/m3]" in capsys.readouterr().out


def test_escaping_changes_brackets_only() -> None:
    assert literal("this [s], [/b] and [1, 2]") == "this \\[s], \\[/b] and [1, 2]"
    assert literal(literal("[m]")) == literal("[m]")


def test_completion_can_be_installed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    assert "--install-completion" in capsys.readouterr().out


def test_inputs_are_listed_with_unit_range_and_default(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["inputs"]) == 0
    shown = capsys.readouterr().out
    assert all(variable.name in shown for variable in INPUTS)
    assert main(["inputs", "hole", "--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)["inputs"]}
    assert set(rows) == {v.name for v in INPUTS if v.role == "hole"}
    assert rows["hole_diameter"]["unit"] == "m"
    assert rows["hole_diameter"]["default"] == 0.15


def test_examples_are_usable_copies(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Every copy is read by the reader of its kind, from where it now lies."""
    out = tmp_path / "mine"
    assert main(["examples", str(out)]) == 0
    capsys.readouterr()
    for path in sorted(out.glob("recipes/*.yaml")):
        load_recipe(path)
    for path in sorted(out.glob("benches/*.yaml")):
        load_bench(path)
    for path in sorted(out.glob("models/*.yaml")):
        read_model_spec(path)
    for path in sorted(out.glob("explosives/*.yaml")):
        load_explosive(path)
    for path in sorted(out.glob("cases/*.yaml")):
        read_case(path)
    (out / "cases").joinpath("granite_quarry.yaml").write_text("mine")
    assert main(["examples", str(out)]) == 2
    assert "already exists" in capsys.readouterr().err
    assert (out / "cases" / "granite_quarry.yaml").read_text() == "mine"


@pytest.mark.parametrize("kind", SPEC_FOLDERS)
def test_what_ships_is_found_by_name(kind: str, tmp_path: Path) -> None:
    known = shipped_specs(kind)
    assert known
    for name, path in known.items():
        assert find_spec(name, kind) == path
    own = tmp_path / "own.yaml"
    assert find_spec(own, kind) == own


def test_verbs_take_names_that_ship(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["generate", "papr", "--out", str(tmp_path)]) == 2
    assert "unknown recipe 'papr', did you mean 'paper'?" in capsys.readouterr().err
    missing = str(tmp_path / "data.nc")
    assert main(["tune", missing, "levenbrg"]) == 2
    assert "unknown model spec 'levenbrg', did you mean 'levenberg'?" in capsys.readouterr().err
    assert main(["export", "full", "--to", "json", "--out", str(tmp_path / "out")]) == 0
    assert (tmp_path / "out" / "network.json").is_file()


@pytest.mark.parametrize(("package", "said"), [("nearfield", True), (None, False)])
def test_the_first_run_says_that_it_compiles(
    package: str | None,
    said: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("castblast.kernel._prepare_cache", lambda: str(tmp_path))
    small = typer.Typer()

    def work(screen: Screen) -> None:
        screen.say("done")

    verb(small, compiles=package)(work)
    small([], standalone_mode=False)
    assert ("compiling the physics kernels" in capsys.readouterr().err) is said
    (tmp_path / "nearfield_123").mkdir()
    (tmp_path / "nearfield_123" / "march.nbi").touch()
    small([], standalone_mode=False)
    assert "compiling" not in capsys.readouterr().err


@pytest.mark.parametrize("verb", list(_verbs(_ROOT)), ids=" ".join)
def test_help_ends_with_an_example_that_parses(verb: tuple[str, ...]) -> None:
    """Its words are taken by the parser of the very verb: no unknown option, nothing missing."""
    command = _ROOT
    for name in verb:
        command = command.commands[name]  # type: ignore[attr-defined]
    words = shlex.split((command.epilog or "").replace("\\[", "["))
    assert words[: 2 + len(verb)] == ["Example:", "castblast", *verb]
    context = command.make_context(" ".join(verb), words[2 + len(verb) :])
    assert set(context.params) >= {p.name for p in command.params if p.required}


def test_every_verb_is_listed_under_a_heading(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    shown = capsys.readouterr().out
    headings = ("Start here", "One blast", "Datasets", "Models", "Muckpiles")
    assert [shown.index(f" {heading} ") for heading in headings] == sorted(
        shown.index(f" {heading} ") for heading in headings
    )
    assert " Commands " not in shown
