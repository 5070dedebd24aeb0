"""Spec files: every fault on a line of its own, named by file, field, value and what is allowed."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Literal

import pytest

from castblast.errors import SpecError
from castblast.specs.loading import Spec, load_spec, read_yaml
from castblast.specs.quantity import QuantityIn, VariableIn


class Rock(Spec):
    ucs: Annotated[float, VariableIn("ucs")]
    kind: Literal["hard", "soft"] = "hard"


class Case(Spec):
    name: str
    burden: Annotated[float, VariableIn("burden")] = 3.0
    delay: Annotated[float, QuantityIn("s", lower=0.0)] | None = None
    rock: Rock | None = None
    layers: tuple[Rock, ...] = ()


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "case.yaml"
    path.write_text(text)
    return path


def said(path: Path) -> str:
    with pytest.raises(SpecError) as caught:
        load_spec(path, Case)
    return str(caught.value).replace(str(path), "FILE")


def test_reads_units(tmp_path: Path) -> None:
    text = "name: x\nburden: 350 cm\ndelay: 30 ms\nrock: {ucs: 90 MPa}\n"
    case = load_spec(written(tmp_path, text), Case)
    assert (case.burden, case.delay, case.rock.ucs) == (3.5, 0.03, 90e6)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "FILE: is empty"),
        ("# nothing\n", "FILE: is empty"),
        ("a: 1\nb: 2\na: 2\n", "FILE: line 3, column 1: the key 'a' is given twice"),
        ("a:\n  - [1\n", "FILE: line 3, column 1: expected ',' or ']', but got '<stream end>'"),
        ("- 1\n- 2\n", "FILE: holds a list; lines of the form 'key: value' are needed"),
        ("anfo", "FILE: holds a single value; lines of the form 'key: value' are needed"),
        ("3: 4", "FILE: the key 3 is not a name"),
    ],
)
def test_files_that_are_no_mapping(tmp_path: Path, text: str, line: str) -> None:
    assert said(written(tmp_path, text)) == line


def test_missing_and_unreadable_files(tmp_path: Path) -> None:
    written(tmp_path, "name: x")
    assert said(tmp_path / "cse.yaml").endswith("no such file, did you mean 'case.yaml'?")
    assert "does not exist" in said(tmp_path / "nowhere" / "case.yaml")
    assert "is a folder" in said(tmp_path)
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\x81")
    assert "not a text file" in said(tmp_path / "binary.yaml")


def test_every_fault_is_named_at_once(tmp_path: Path) -> None:
    text = """
burdn: 3 m
burden: 300
delay: 3 kg
rock: {usc: 3 MPa, ucs: 3 GPa, kind: weak}
layers: [{ucs: 20 MPa}, {}, 5]
"""
    assert set(said(written(tmp_path, text)).splitlines()) == {
        "FILE: name: is missing",
        "FILE: burdn: unknown key, did you mean 'burden'?",
        "FILE: burden: 300: no unit given; a length is needed, such as '3 m'",
        "FILE: delay: 3 kg: 'kg' is a mass; a time is needed, such as '30 ms'",
        "FILE: rock.usc: unknown key, did you mean 'ucs'?",
        "FILE: rock.ucs: 3 GPa: implausible (3000 MPa); allowed: 1 to 600 MPa",
        "FILE: rock.kind: weak: allowed: 'hard' or 'soft'",
        "FILE: layers[1].ucs: is missing",
        "FILE: layers[2]: 5: a group of keys is needed: kind, ucs",
    }


def test_unknown_key_without_a_near_one_lists_the_known(tmp_path: Path) -> None:
    line = said(written(tmp_path, "name: x\nzzz: 1"))
    assert line == "FILE: zzz: unknown key; known keys: burden, delay, layers, name, rock"


def test_numbers_as_people_write_them(tmp_path: Path) -> None:
    """YAML 1.1 takes 1e8 for text; people mean a number."""
    assert read_yaml(written(tmp_path, "a: 1e8\nb: 2.5E-3\nc: 1.0e+2\nd: e8\n")) == {
        "a": 1e8,
        "b": 2.5e-3,
        "c": 100.0,
        "d": "e8",
    }


def test_hash_is_of_the_content(tmp_path: Path) -> None:
    one = load_spec(written(tmp_path, "name: x\nburden: 3.5 m # measured\n"), Case)
    same = load_spec(written(tmp_path, "burden: 350 cm\nname: x\n"), Case)
    other = load_spec(written(tmp_path, "burden: 351 cm\nname: x\n"), Case)
    assert one.sha256() == same.sha256() != other.sha256()


def _bomb(depth: int, merge: bool = False) -> str:
    """Nine aliases a level: nine to the power of the depth values in a few hundred bytes."""
    lines = ["a0: &a0 {x: 1}" if merge else "a0: &a0 [x]"]
    for k in range(1, depth):
        parts = ", ".join([f"*a{k - 1}"] * 9)
        lines.append(f"a{k}: &a{k} {{<<: [{parts}]}}" if merge else f"a{k}: &a{k} [{parts}]")
    return "\n".join(lines) + "\nname: x\n"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (_bomb(12), "written out"),
        (_bomb(12, merge=True), "written out"),
        ("name: &a [*a]\n", "an alias stands for what it is part of"),
        ("name: &a {b: *a}\n", "an alias stands for what it is part of"),
        ("name: " + "[" * 20_000, "nested too deeply"),
        ("name: " + "9" * 5000, "is not a usable number"),
        ("name: 0x" + "f" * 5000, "is not a usable number"),
        ("name: " + "1" + ":1" * 5000, "is not a usable number"),
        ("name: " + "9" * 5000 + ".0", "is not a usable number"),
        ("name: !!int x", "'x' is not a usable number"),
        ("name: !!float x", "'x' is not a usable number"),
        ("name: !!bool x", "cannot be read as its tag says"),
        ("name: !!python/object/apply:os.system [ls]", "could not determine a constructor"),
        ("name: !!timestamp 2001-99-99", "could not determine a constructor"),
        ("name: !!binary ====", "could not determine a constructor"),
        ('name: "a\\0b"', "the character '\\x00' is not allowed"),
        ('name: "a\\ud800b"', "the character '\\ud800' is not allowed"),
        ('name: "\\e[2J"', "the character '\\x1b' is not allowed"),
        ("x: " + "y" * (2 << 20), "is larger than 1 MB, the most a YAML file may have"),
        ("name: x\nrock: {ucs: 2001-01-01}", "rock.ucs: 2001-01-01: "),
        ("name: x\nburden: 2001-01-01", "burden: 2001-01-01: "),
        ("name: 2001-99-99\nburden: 9" + "9" * 300, "burden: an integer of about 301 digits"),
    ],
    ids=range(22),
)
def test_what_a_file_may_not_do_to_its_reader(tmp_path: Path, text: str, line: str) -> None:
    """Bombs, tags and control characters: one line, in bounded time."""
    start = time.process_time()
    found = said(written(tmp_path, text))
    assert time.process_time() - start < 3.0
    assert line in found
    assert len(found.splitlines()) == 1
    assert len(found) < 300


def test_a_few_aliases_and_merges_are_read(tmp_path: Path) -> None:
    text = (
        "name: 2024-01-01\nrock: &r {ucs: 90 MPa}\nlayers: [*r, {<<: *r, kind: soft}]\n"
        "burden: 3\u00a0m\n"
    )
    case = load_spec(written(tmp_path, text), Case)
    assert case.name == "2024-01-01", "a date stays text"
    assert [layer.kind for layer in case.layers] == ["hard", "soft"]
