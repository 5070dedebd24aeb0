"""Names of things: what becomes a file stays below its folder, what is shown is shown as it is."""

from collections.abc import Callable
from pathlib import Path

import pytest

from castblast.cli.screen import Screen
from castblast.design.variables import VARIABLES
from castblast.errors import CastblastError
from castblast.names import (
    cell_text,
    check_label,
    check_name,
    is_label,
    people_unit,
    printable,
    shortened,
)
from castblast.specs.bench.bench import BenchSpec
from castblast.specs.explosive import load_explosive
from castblast.specs.loading import make_spec, read_yaml
from castblast.specs.models.model import read_model_spec
from castblast.specs.recipe import load_recipe
from castblast.specs.units import unit_factor

#: Path traversal, absolute paths, markup of the terminal and of pictures, formulas, code, escapes.
BAD_NAMES = (
    "../../x", "..", ".", "/etc/x", "a/b", "a\\b", "C:x", "", " ", "x[/b]", "$\\frac$", "=1+1",
    "+1", "-1", "@x", "a\nb", "a\tb", "\x1b[2J", "a\"b", "a'b", "*/", "<b>", "nul", "COM1.txt",
    "a" * 65, "x.", "a b", "\u202ex", "x;y", "x`y", "{{x}}", "%s%n" * 20,
)  # fmt: skip


@pytest.mark.parametrize("name", BAD_NAMES)
def test_names_that_could_be_more_than_a_name_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match=r"allowed|Windows"):
        check_name(name)


@pytest.mark.parametrize("name", ["north_wall", "A", "0", "x-1.5", "paper", "v1.2.3", "a" * 64])
def test_plain_names_pass(name: str) -> None:
    assert check_name(name) == name


@pytest.mark.parametrize("text", ["ANFO 94/6", "Émulsion (gassed, 1.15)", "TNT", "HG #3", "50 %"])
def test_labels_are_for_people(text: str) -> None:
    assert check_label(text) == text


@pytest.mark.parametrize(
    "text", ["x[/b]", "$x$", "=A1", "-x", "a*/", 'a"', "a'", "a\\", "a\n", "<i>", "a ", "", "{x}"]
)
def test_labels_hold_nothing_that_means_something_elsewhere(text: str) -> None:
    with pytest.raises(ValueError, match="allowed"):
        check_label(text)
    assert not is_label(text) or text != text.strip()


def _bench(repository: Path, name: str, folder: Path) -> None:
    del folder
    content = read_yaml(repository / "data_specs/benches/demo.yaml")
    make_spec({**content, "name": name}, BenchSpec, "bench.yaml")


def _recipe(repository: Path, name: str, folder: Path) -> None:
    content = (repository / "data_specs/recipes/paper.yaml").read_text()
    path = folder / "recipe.yaml"
    path.write_text(content.replace("name: paper", f"name: {name!r}"))
    load_recipe(path)


def _model(repository: Path, name: str, folder: Path) -> None:
    path = folder / "spec.yaml"
    text = (repository / "models/specs/ridge.yaml").read_text()
    path.write_text(f"name: {name!r}\n{text}")
    read_model_spec(path)


def _explosive(repository: Path, name: str, folder: Path) -> None:
    path = folder / "explosive.yaml"
    text = (repository / "data_specs/explosives/anfo.yaml").read_text()
    path.write_text(text.replace("name: anfo", f"name: {name!r}"))
    load_explosive(path)


@pytest.mark.parametrize("name", ["../../x", "x[/b]", "$\\frac$", "=1+1", "/x"])
@pytest.mark.parametrize("read", [_bench, _recipe, _model, _explosive])
def test_every_kind_of_spec_refuses_them(
    repository: Path, tmp_path: Path, read: Callable[[Path, str, Path], None], name: str
) -> None:
    with pytest.raises(CastblastError, match=r"name: .*allowed") as fault:
        read(repository, name, tmp_path)
    assert len(str(fault.value).splitlines()) == 1


@pytest.mark.parametrize("text", ["=1+1", "+x", "-x", "@x", "\t=x", "\r=x", "=cmd|' /C calc'!A0"])
def test_a_cell_is_no_formula(text: str) -> None:
    assert cell_text(text) == f"'{text}"
    assert cell_text("anfo") == "anfo"
    assert not cell_text("").startswith("'")


def test_a_terminal_gets_no_escape_sequences(capsys: pytest.CaptureFixture[str]) -> None:
    assert printable("a\x1b[31mb\u202e\x07") == "a\\x1b[31mb\\u202e\\x07"
    assert printable("3\u00a0m") == "3 m"
    screen = Screen()
    screen.say("a\x1b[2Jb\nc")
    screen.note("\x07")
    screen.table(["x[/b]", "y"], [["[bold]x[/bold]", "[/b]"], [":smile:", "\x1b[31m"]], "t[/i]")
    out, err = capsys.readouterr()
    assert "\x1b" not in out
    assert "a\\x1b[2Jb\nc" in out
    assert err == "\\x07\n"
    for literal in ("x[/b]", "[bold]x[/bold]", ":smile:", "\\x1b[31m", "t[/i]"):
        assert literal in out


def test_any_value_is_shown_in_one_short_line() -> None:
    bomb: object = "lol"
    for _ in range(40):
        bomb = [bomb] * 10
    for value in (10**5000, -(10**5000), ["x" * 10**6], {"a": 1}, "é\n\x1b" * 10**6, bomb, None):
        if value is not bomb:
            assert len(shortened(value)) <= 60
            assert shortened(value).isprintable()
    assert shortened(10**5000) == "an integer of about 5000 digits"


@pytest.mark.parametrize(
    ("udunits", "people"),
    [("m s-1", "m/s"), ("kg m-3", "kg/m3"), ("MJ m-1", "MJ/m"), ("kg m-2 s-1", "kg/(m2 s)"),
     ("s-1", "1/s"), ("m2 s-2", "m2/s2"), ("Pa s", "Pa s"), ("deg", "deg"), ("1", "1"),
     ("J/kg", "J/kg")],
)  # fmt: skip
def test_units_are_shown_as_people_write_them(udunits: str, people: str) -> None:
    """No negative powers on screens."""
    assert people_unit(udunits) == people


@pytest.mark.parametrize("name", VARIABLES)
def test_a_shown_unit_can_be_typed_again(name: str) -> None:
    """What a screen shows is read back as the same unit, and has no negative power."""
    variable = VARIABLES[name]
    assert "-" not in variable.shown_unit
    shown, written = (
        unit_factor(u, variable.unit) for u in (variable.shown_unit, variable.file_unit)
    )
    assert shown == written
