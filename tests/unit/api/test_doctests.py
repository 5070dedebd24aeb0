"""Every public name has an example, and every example gives what it shows."""

import doctest
from importlib import import_module
from pathlib import Path

import pytest

import castblast

_FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
_API = Path(castblast.__path__[0], "api")
_MODULES = sorted(
    ".".join(path.relative_to(_API).with_suffix("").parts) for path in _API.rglob("[a-z]*.py")
)


@pytest.mark.parametrize("name", _MODULES)
def test_examples_of_a_module(name: str) -> None:
    found = doctest.testmod(import_module(f"castblast.api.{name}"), optionflags=_FLAGS)
    assert not found.failed


@pytest.mark.parametrize("name", [n for n in castblast.__all__ if not n.startswith("_")])
def test_every_public_name_has_an_example(name: str) -> None:
    assert ">>> import castblast as cb" in getattr(castblast, name).__doc__
