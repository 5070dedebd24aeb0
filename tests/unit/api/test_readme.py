"""The Python block of the README does what it says: every comment behind an expression is true."""

import ast
import re
from pathlib import Path
from typing import Any

_BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)


def _is_expression(line: str) -> bool:
    try:
        return isinstance(ast.parse(line).body[0], ast.Expr)
    except (SyntaxError, IndexError):
        return False


def test_the_python_block_of_the_readme(repository: Path, tmp_path: Path, monkeypatch: Any) -> None:
    (block,) = _BLOCK.findall((repository / "README.md").read_text(encoding="utf-8"))
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    shown = 0
    for line in block.splitlines():
        if not _is_expression(line):
            exec(line, names)
            continue
        code, _, comment = line.partition("  #")
        value = eval(code, names)
        assert repr(value) == comment.strip()
        shown += 1
    monkeypatch.undo()
    assert shown >= 4
    assert {"blast", "designs", "runs", "answer", "ds", "pile"} <= set(names)
    assert not list(tmp_path.iterdir())
