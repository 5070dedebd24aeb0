"""The one exception family of castblast and the status codes that kernels return.

An exception carries the exit code of the command line; a kernel never raises but returns a
`Status`, which ends up in the result and, for datasets, in the row of the sample.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from enum import IntEnum


class Status(IntEnum):
    """Outcome of one simulated sample; stored in datasets as a CF flag variable."""

    OK = 0
    NOT_CONVERGED = 1
    UNSTABLE_STEP = 2
    OUT_OF_ISENTROPE = 3
    BAD_INPUT = 4
    RETURN_MAP_FAILED = 5
    LEDGER_OPEN = 6

    @property
    def meaning(self) -> str:
        """One sentence for people: what went wrong."""
        return _MEANINGS[self]


_MEANINGS = {
    Status.OK: "finished",
    Status.NOT_CONVERGED: "the run reached its step or time limit before its end state",
    Status.UNSTABLE_STEP: "the state became non-finite or a zone turned inside out",
    Status.OUT_OF_ISENTROPE: "the gas expanded beyond the tabulated isentrope",
    Status.BAD_INPUT: "the inputs describe no possible case",
    Status.RETURN_MAP_FAILED: "no admissible Mohr-Coulomb stress was found",
    Status.LEDGER_OPEN: "the energy ledger does not close",
}


class CastblastError(Exception):
    """A fault that a user can mend; `exit_code` is what the command line returns.

    Attributes
    ----------
    field : str or None
        Name of the field, column or option at fault; of the first one, where several are; None
        where no single one is.
    value : object
        What was given there.
    allowed : object
        What is allowed there: words for a range, or the names to choose from.
    """

    exit_code = 2

    def __init__(
        self,
        *message: object,
        field: str | None = None,
        value: object = None,
        allowed: object = None,
    ) -> None:
        super().__init__(*message)
        self.field, self.value, self.allowed = field, value, allowed


class SpecError(CastblastError):
    """A file, a field or an option that cannot be used (exit code 2)."""

    exit_code = 2


class MissingLibraryError(SpecError):
    """What was asked for needs a library of an extra that is not installed."""


class StaleResultError(SpecError):
    """Results of an earlier run that were made from something else stand in the way."""


class OutputError(CastblastError):
    """A file or folder that cannot be written, or a disk that is full (exit code 2)."""

    exit_code = 2


class DatasetError(CastblastError):
    """A dataset that is missing, truncated or of another kind than expected (exit code 2)."""

    exit_code = 2


class SimulationError(CastblastError):
    """A simulation that failed, or too many failed samples of a dataset (exit code 3)."""

    exit_code = 3


class CheckError(CastblastError):
    """A check that did not pass: explosive, dataset or export parity (exit code 4)."""

    exit_code = 4


def nearest_name(name: str, allowed: Iterable[str]) -> str:
    """Return ``", did you mean 'x'?"`` for the closest allowed name, or an empty string."""
    spelled = {a.lower(): a for a in allowed}
    close = get_close_matches(name.lower(), spelled, n=1, cutoff=0.6)
    return f", did you mean '{spelled[close[0]]}'?" if close else ""
