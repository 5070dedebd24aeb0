"""The house: rooms of few and short files, and no two files that need each other."""

import ast
from collections import Counter
from pathlib import Path

import pytest

MOST_FILES, MOST_LINES = 15, 400
#: What people write; cases and data for tests are as many as there are cases.
SOURCES = {".py", ".md", ".j2", ".js", ".mjs", ".css", ".ipynb"}


def _modules(root: Path) -> dict[str, Path]:
    """Every module below a source root by its name, packages by the name of their folder."""
    found = {}
    for path in root.glob("castblast/**/*.py"):
        parts = path.relative_to(root).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def _imports(path: Path, modules: set[str]) -> set[str]:
    """Modules that a file imports anywhere: at its top, inside functions, for types only."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{path}: relative import"
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                found.add(inner if inner in modules else str(node.module))
    return found & modules


def _circle(graph: dict[str, set[str]]) -> list[str]:
    """Names along one circle of a graph; empty if there is none."""
    done: set[str] = set()

    def walk(name: str, way: list[str]) -> list[str]:
        if name in way:
            return [*way[way.index(name) :], name]
        if name in done:
            return []
        for other in sorted(graph[name]):
            if found := walk(other, [*way, name]):
                return found
        done.add(name)
        return []

    return next((found for name in sorted(graph) if (found := walk(name, []))), [])


@pytest.mark.parametrize(
    ("graph", "circle"),
    [
        ({"a": {"b"}, "b": set()}, []),
        ({"a": {"b", "c"}, "b": {"c"}, "c": set()}, []),
        ({"a": {"b"}, "b": {"c"}, "c": {"b"}}, ["b", "c", "b"]),
    ],
)
def test_a_circle_is_found(graph: dict[str, set[str]], circle: list[str]) -> None:
    assert _circle(graph) == circle


def test_no_circle_between_files(repository: Path) -> None:
    """Nor for types alone, nor put off into a function: the lower file would know the upper."""
    modules = _modules(repository / "pipeline")
    graph = {name: _imports(path, set(modules)) - {name} for name, path in modules.items()}
    assert len(graph) > 200
    assert sum(map(len, graph.values())) > 1000
    assert not _circle(graph)


@pytest.mark.parametrize("top", ["pipeline", "tests"])
def test_folders_hold_few_files(repository: Path, top: str) -> None:
    counts = Counter(
        path.parent for path in (repository / top).rglob("*") if path.suffix in SOURCES
    )
    full = {
        str(folder.relative_to(repository)): n for folder, n in counts.items() if n > MOST_FILES
    }
    assert counts
    assert not full


@pytest.mark.parametrize("top", ["pipeline", "tests"])
def test_files_stay_short(repository: Path, top: str) -> None:
    long = {
        str(path.relative_to(repository)): lines
        for path in (repository / top).rglob("*.py")
        if (lines := len(path.read_text(encoding="utf-8").splitlines())) > MOST_LINES
    }
    assert not long
