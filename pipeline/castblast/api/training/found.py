"""How much a comparison does, and what it found out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from castblast.surrogate.fitting.features import Table
    from castblast.surrogate.fitting.training import Fit
    from castblast.surrogate.judging.comparison import League


@dataclass(frozen=True)
class Extent:
    """How much a comparison does.

    Attributes
    ----------
    name : str
    train_rows : int or None
        Training rows at most; the other splits stay.
    quick_specs : bool
        Fit every spec in the quick form of its family.
    every_curve : bool
        A learning curve for every model, not for the chosen one alone.
    curve_sizes : tuple of int
        Training rows of the curves.
    shifts : bool
        Fit the chosen spec, quickly, without one explosive, corner or group after the other.
    always_choose : bool
        Take the best exportable model where all fail the physics gate, and say so.
    probe_points, dense_points : int
        Places where the simulator and the surrogates are asked for the physics gate.
    sobol_rows, checked_rows : int
        Base samples of the Sobol indices and of their check by the simulator; 0: none.
    """

    name: str
    train_rows: int | None = None
    quick_specs: bool = False
    every_curve: bool = True
    curve_sizes: tuple[int, ...] = (250, 500, 1000, 2000, 4000)
    shifts: bool = True
    always_choose: bool = False
    probe_points: int = 1024
    dense_points: int = 8192
    sobol_rows: int = 8192
    checked_rows: int = 1024

    @property
    def suffix(self) -> str:
        """What folders of another extent than the full one end in."""
        return "" if self.name == "full" else f"_{self.name}"

    def stated(self) -> dict[str, Any]:
        """What was left out, as plain JSON values."""
        return {**vars(self), "curve_sizes": list(self.curve_sizes)}


@dataclass(frozen=True)
class Comparison:
    """What was found out, as the writers take it.

    Attributes
    ----------
    fits : list of Fit
    table : Table
    league : League
        From `surrogate.judging.comparison.compare`.
    gates : mapping of name to dict
        Empty where the domain is not known.
    chosen : Fit
        The chosen one; the best exportable one where all fail the gate.
    curves : mapping of name to list of LearningPoint
    shifts : mapping of name to dict
    sobol : dict or None
    remarks : list of str
        What could not be done, and why.
    times : mapping of part to mapping
        ``seconds`` and ``cpu_seconds``, as measured when the part was made.
    extent : Extent
    """

    fits: list[Fit]
    table: Table
    league: League
    gates: Mapping[str, dict[str, Any]]
    chosen: Fit
    curves: Mapping[str, Any]
    shifts: Mapping[str, dict[str, Any]]
    sobol: dict[str, Any] | None
    remarks: list[str]
    times: Mapping[str, Mapping[str, float]]
    extent: Extent
