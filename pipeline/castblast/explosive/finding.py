"""Outcome of one check: a named relation, its value, what is allowed and the verdict."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple


class Level(StrEnum):
    """Verdict on one relation."""

    OK = "ok"
    WARN = "warn"
    REJECT = "reject"


class Finding(NamedTuple):
    """One relation held against its limit.

    Attributes
    ----------
    relation : str
        Name of the relation.
    value : float
        What was found, in `unit`.
    unit : str
    limit : str
        What is allowed, in words.
    level : Level
    fields : str
        Fields of an explosive file that the relation holds against each other.
    """

    relation: str
    value: float
    unit: str
    limit: str
    level: Level
    fields: str = ""

    def __str__(self) -> str:
        line = f"{self.relation}: {self.shown_value}; allowed: {self.limit}"
        return f"{line}; what does not fit: {self.fields}" if self.fields else line

    @property
    def shown_value(self) -> str:
        """Value with its unit; percentages with their sign."""
        if self.unit == "%":
            return f"{self.value:+.3g} %"
        return f"{self.value:.5g}" + (f" {self.unit}" if self.unit else "")


def rejected(findings: list[Finding]) -> list[Finding]:
    """Findings that make an explosive unusable."""
    return [finding for finding in findings if finding.level is Level.REJECT]


def warned(findings: list[Finding]) -> list[Finding]:
    """Findings that a user should know of."""
    return [finding for finding in findings if finding.level is Level.WARN]


def judge_flag(
    relation: str, value: float, limit: str, passed: bool, unit: str = "", fields: str = ""
) -> Finding:
    """Judge a relation that holds or not."""
    return Finding(
        relation=relation,
        value=value,
        unit=unit,
        limit=limit,
        level=Level.OK if passed else Level.REJECT,
        fields=fields,
    )


def judge_deviation(
    relation: str, value: float, warn: float, reject: float | None, fields: str = ""
) -> Finding:
    """Judge a relative deviation; `warn` and `reject` are shares."""
    off = abs(value)
    level = Level.OK if off <= warn else Level.WARN
    if reject is not None and not off <= reject:
        level = Level.REJECT
    limit = f"within {100 * warn:.3g} %"
    if reject is not None:
        limit += f" (rejected beyond {100 * reject:.3g} %)"
    return Finding(
        relation=relation, value=100.0 * value, unit="%", limit=limit, level=level, fields=fields
    )


def judge_range(
    relation: str,
    value: float,
    warn: tuple[float, float],
    reject: tuple[float, float],
    fields: str = "",
) -> Finding:
    """Judge a value against the range that is usual and the one beyond which it is rejected."""
    level = Level.OK if warn[0] <= value <= warn[1] else Level.WARN
    if not reject[0] <= value <= reject[1]:
        level = Level.REJECT
    limit = f"{warn[0]:g} to {warn[1]:g} (rejected outside {reject[0]:g} to {reject[1]:g})"
    return Finding(relation=relation, value=value, unit="", limit=limit, level=level, fields=fields)
