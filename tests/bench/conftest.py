"""Figures of the benchmarks that count, in one table at the end: ratios, marks passed or missed.

A mark that is missed is shown, not raised: a busy machine is no fault of the code.
"""

from collections.abc import Callable
from typing import NamedTuple

import pytest


class Figure(NamedTuple):
    """A figure with what it should at most or at least be."""

    name: str
    value: float
    unit: str
    at_most: float | None
    at_least: float | None

    @property
    def mark(self) -> str:
        if self.at_most is not None:
            return f"<= {self.at_most:g}"
        return "" if self.at_least is None else f">= {self.at_least:g}"

    @property
    def verdict(self) -> str:
        if not self.mark:
            return ""
        low = self.at_least is None or self.value >= self.at_least
        high = self.at_most is None or self.value <= self.at_most
        return "pass" if low and high else "MISS"


_FIGURES = pytest.StashKey[list[Figure]]()


def pytest_configure(config: pytest.Config) -> None:
    config.stash[_FIGURES] = []


@pytest.fixture(scope="session")
def figure(pytestconfig: pytest.Config) -> Callable[..., None]:
    """Note a figure for the table."""

    def note(name, value, unit="", *, at_most=None, at_least=None):
        pytestconfig.stash.setdefault(_FIGURES, []).append(
            Figure(name, value, unit, at_most, at_least)
        )

    return note


def pytest_terminal_summary(terminalreporter, config: pytest.Config) -> None:
    figures = config.stash.get(_FIGURES, [])
    if not figures:
        return
    terminalreporter.section("figures and marks")
    width = max(len(one.name) for one in figures)
    for one in figures:
        line = (
            f"{one.name:<{width}}  {one.value:>10.4g} {one.unit:<12} {one.mark:<10} {one.verdict}"
        )
        terminalreporter.line(line.rstrip(), red=one.verdict == "MISS", green=one.verdict == "pass")
