"""Texts of a foreign record are texts: none becomes code, markup or a formula in any export.

Two lines of defence, each tested without the other: a record refuses texts that are no plain
names, and the writers make literals and harmless comments of whatever they get.
"""

import ast
import io
import re
import shutil
import subprocess
from dataclasses import fields, replace
from html.parser import HTMLParser
from pathlib import Path

import openpyxl
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from toy_network import toy_network

from castblast.errors import SpecError
from castblast.export.source.c import STRICT_FLAGS
from castblast.export.targets import TARGETS
from castblast.names import printable
from castblast.network import Network
from castblast.network.json_file import from_json, to_json

_PIECES = (
    "*/", "/*", "//", "\\", "\n", "\r", "\u2028", '"', "'", '"""', "'''", "`", "${", "}", "{", ")",
    "</script>", "<!--", "<script>", "#", "=", "+", "-", "@", "??/", "\x00", "{{", "%}", "%", ";",
    "!", "$(", "|", "é", "\u202e", "&", "[", "]", ",", " ", "x", "1", "\t", "__import__('os')",
    "\nimport os\n", "*/ #error x /*", "alert(1)", "=cmd|' /C calc'!A0",
)  # fmt: skip
HOSTILE = st.one_of(
    st.lists(st.sampled_from(_PIECES), min_size=1, max_size=6).map("".join),
    st.text(min_size=1, max_size=20),
)
#: What compilers, node and spreadsheets get to read in earnest.
WORST = (
    '*/ int castblast_pwned(void) { return 1; } /* \\*/ "',
    "*\\/ globalThis.pwned = 1; /*",
    '*/ globalThis.pwned = 1; /* "); globalThis.pwned = 1; ("',
    "`${globalThis.pwned = 1}` ??/\n globalThis.pwned = 1; //",
    '""" \nimport os\nos.environ["PWNED"] = "1"\n"""',
    "''' + str(__import__('os').environ.setdefault('PWNED', '1')) + '''",
    '=1+1","x")&HYPERLINK("http://x',
    "</script><script>globalThis.pwned = 1</script><!-- <script>",
)


class _Unchecked(Network):
    """A record whose first line of defence is gone."""

    def _faults(self) -> list[str]:
        return []


BENIGN = toy_network()


def hostile(text: str) -> Network:
    """Put a text wherever a record has one."""
    own = {entry.name: getattr(BENIGN, entry.name) for entry in fields(Network)}
    first, *others = BENIGN.inputs
    velocity, *outputs = BENIGN.outputs
    derived = replace(BENIGN.derived[0], name=text + "d", unit=text)
    coefficients = {text if n == first.name else n: c for n, c in derived.coefficients.items()}
    rule = BENIGN.constraints[0]
    terms = {text if n == first.name else n: c for n, c in rule.coefficients.items()}
    golden = replace(
        BENIGN.golden,
        explosives=tuple(text if n == "anfo" else n for n in BENIGN.golden.explosives),
    )
    about = {"name": text, "dataset_version": text, "content_sha256": text}
    own |= {
        "inputs": (replace(first, name=text, unit=text), *others),
        "outputs": (velocity, *(replace(c, name=text + "o", unit=text) for c in outputs)),
        "derived": (replace(derived, coefficients=coefficients),),
        "explosives": (text, *BENIGN.explosives[1:]),
        "constraints": (replace(rule, label=text, unit=text, coefficients=terms),),
        "golden": golden,
        "provenance": {
            "spec": {"name": text},
            "dataset": about,
            "castblast_version": text,
            "scores": {"test": {text: {text: 1.0}}},
            "held_inputs": {text: 1.0},
        },
    }
    return _Unchecked(**own)


def _written(target: str, text: str) -> dict[str, bytes]:
    try:
        return TARGETS[target].write(hostile(text))
    except SpecError:  # two names became the same in C
        assume(False)
        raise


@given(HOSTILE)
@settings(max_examples=60, deadline=None)
def test_a_record_takes_plain_texts_only(text: str) -> None:
    """The first line: what is read back after all is harmless by its letters alone."""
    document = to_json(hostile(text))
    message = ""
    try:
        names = from_json(document).explosives
    except SpecError as fault:
        names, message = (), str(fault)
    assert all(line.isprintable() for line in message.splitlines())
    assert all(re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9 _.,:+/()%#-]*", name) for name in names)


def _python_shape(source: bytes) -> str:
    """Syntax tree without the contents of its constants."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant):
            node.value = type(node.value).__name__
    return ast.dump(tree)


_TOKENS = re.compile(
    r"""/\*.*?\*/ | //[^\n]* | "(?:\\.|[^"\\\n])*" | '(?:\\.|[^'\\\n])*'""", re.DOTALL | re.VERBOSE
)


def _plain_shape(source: bytes) -> str:
    """C or JavaScript without comments, strings and the endings of names made of texts."""
    bare = _TOKENS.sub(lambda m: "S" if m[0][0] in "\"'" else " ", source.decode("ascii"))
    return " ".join(re.sub(r"CASTBLAST_\w+", "NAME", bare).split())


class _Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.found.append(tag)


def _page_shape(source: bytes) -> tuple[list[str], str]:
    tags = _Tags()
    tags.feed(source.decode())
    script = source.decode().split('<script type="module">')[1].split("</script>")[0]
    return tags.found, _plain_shape(script.encode("ascii", "replace"))


_SHAPES = {
    ".py": _python_shape,
    ".c": _plain_shape,
    ".h": _plain_shape,
    ".js": _plain_shape,
    ".dat": lambda source: source.decode("ascii").count("\n"),
    ".in": lambda source: source.decode("ascii").count("\n"),
}


@pytest.mark.parametrize(
    ("target", "examples"),
    [("python", 20), ("c", 15), ("js", 20), ("pfc", 6), ("lammps", 6)],
)
def test_source_of_a_hostile_record_has_the_shape_of_a_benign_one(
    target: str, examples: int
) -> None:
    """The second line: the same program, whatever the texts; only literals and comments differ."""
    known = {
        name: _SHAPES[Path(name).suffix](content)
        for name, content in _written(target, "plain").items()
        if not name.endswith(".csv")
    }

    @given(HOSTILE)
    @settings(max_examples=examples, deadline=None)
    def check(text: str) -> None:
        files = _written(target, text)
        for name, shape in known.items():
            files[name].decode("ascii")
            assert _SHAPES[Path(name).suffix](files[name]) == shape

    check()


@pytest.mark.parametrize("text", [*WORST, "<img src=x onerror=alert(1)>", "--><b>"])
def test_a_page_has_the_tags_and_the_script_of_a_benign_one(text: str) -> None:
    benign = _page_shape(_written("web", "plain")["index.html"])
    found = _page_shape(_written("web", text)["index.html"])
    assert found[0] == benign[0]
    assert found[1] == benign[1]


@pytest.fixture(scope="module")
def compiler() -> str:
    found = shutil.which("gcc") or shutil.which("cc")
    if found is None:
        pytest.skip("no C compiler")
    return found


def test_c_of_the_worst_texts_compiles(compiler: str, tmp_path: Path) -> None:
    for number, text in enumerate(WORST):
        folder = tmp_path / str(number)
        folder.mkdir()
        for name, content in _written("c", text).items():
            (folder / name).write_bytes(content)
        command = [compiler, *STRICT_FLAGS, "-fsyntax-only", "-DCASTBLAST_SELF_TEST", "model.c"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


def test_c_keeps_every_byte_of_a_name(compiler: str, tmp_path: Path) -> None:
    text = 'é ??/ "\\ 7?1\t\x01'
    for name, content in _written("c", text).items():
        (tmp_path / name).write_bytes(content)
    user = '#include "model.h"\n#include <stdio.h>\nint main(void) {'
    user += ' printf("%s", castblast_explosive_names[0]); return 0; }'
    (tmp_path / "user.c").write_text(user)
    command = [compiler, "-std=c99", "user.c", "model.c", "-lm", "-o", "user"]
    subprocess.run(command, cwd=tmp_path, check=True)
    assert subprocess.run(["./user"], cwd=tmp_path, capture_output=True).stdout == text.encode()


def test_scripts_of_the_worst_texts_run_nothing(tmp_path: Path) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node")
    for number, text in enumerate(WORST):
        (tmp_path / f"m{number}.mjs").write_bytes(_written("js", text)["model.js"])
    lines = [
        f'const m{k} = await import("./m{k}.mjs"); names.push(m{k}.explosives[0]);'
        for k in range(len(WORST))
    ]
    last = "console.log(JSON.stringify([globalThis.pwned ?? null, names]));"
    (tmp_path / "all.mjs").write_text("\n".join(["const names = [];", *lines, last]))
    done = subprocess.run([node, "all.mjs"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    pwned, names = ast.literal_eval(done.stdout.replace("null", "None"))
    assert pwned is None
    assert names == list(WORST)


def test_python_of_the_worst_texts_runs_nothing() -> None:
    for text in WORST:
        names: dict[str, object] = {"__name__": "model"}
        exec(compile(_written("python", text)["model.py"], "model.py", "exec"), names)
        assert names["EXPLOSIVES"][0] == text  # type: ignore[index]
        assert "os" not in names


def _formulas(content: bytes) -> dict[str, set[str]]:
    book = openpyxl.load_workbook(io.BytesIO(content))
    return {
        sheet.title: {
            cell.coordinate for row in sheet.iter_rows() for cell in row if cell.data_type == "f"
        }
        for sheet in book
    }


@pytest.mark.parametrize("text", ["=1+1", "@SUM(A1)", '=1","x")&A1&("', "	=1"])
def test_no_text_becomes_a_formula(text: str) -> None:
    benign, found = _written("excel", "plain"), _written("excel", text)
    assert _formulas(found["model.xlsx"]) == _formulas(benign["model.xlsx"])
    cells = openpyxl.load_workbook(io.BytesIO(found["model.xlsx"]))["Predict"]
    assert cells["B4"].value == printable(text)
    assert cells["B4"].data_type == "s"
    table = found["lookup.csv"].decode()
    starts = {line[:1] for line in table.splitlines()[1:]} | {
        line.split(",")[0][:2] for line in table.splitlines()[1:]
    }
    assert not starts & {"=", "+", "-", "@", "\t", '"=', '"+', '"-', '"@', '"\t'}
