"""Every relative link of a page leads to a file of the repository."""

import re
from pathlib import Path

import pytest

_LINK = re.compile(r"\]\((?!https?:|mailto:|#)([^)\s#]+)(?:#[^)]*)?\)")
_FOLDERS = ("", "data_specs", "models", "pipeline", "pipeline/docs", "pipeline/docs/guide")


def _dead(page: Path) -> list[str]:
    """Targets that a page links and that are not there."""
    links = _LINK.findall(page.read_text(encoding="utf-8"))
    return [link for link in links if not (page.parent / link).exists()]


def test_a_dead_link_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("[a](page.md) [b](gone.md#part) ![c](no.png) [d](https://x.org) [e](#part)")
    assert _dead(page) == ["gone.md", "no.png"]


@pytest.mark.parametrize("folder", _FOLDERS)
def test_no_dead_links(repository: Path, folder: str) -> None:
    pages = sorted((repository / folder).glob("*.md"))
    assert pages
    assert {str(page): dead for page in pages if (dead := _dead(page))} == {}
