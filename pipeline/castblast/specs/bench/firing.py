"""When and which way the blocks of a bench are fired, as written in its file."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from castblast.muckpile.bench.geometry import Bench, block_shape
from castblast.muckpile.bench.timing import echelon_delays, row_delays, v_delays
from castblast.specs.loading import Spec
from castblast.specs.quantity import QuantityError, QuantityIn
from castblast.types import FloatArray

_RIGHT_ANGLE = math.pi / 2.0
_NO_HOLE = "a bearing or a dip is that of the hole, not of the throw: leave it out"
#: Directions that a throw can have; the columns of a file of holes are held against them as well.
THROW_AZIMUTH = QuantityIn("rad", -_RIGHT_ANGLE, _RIGHT_ANGLE, hint=_NO_HOLE)
THROW_ELEVATION = QuantityIn("rad", -math.pi / 4.0, math.pi / 3.0, hint=_NO_HOLE)
_Delay = Annotated[float, QuantityIn("s", 0.0, 10.0)]
#: What each pattern knows besides `start`, `hold_unfired` and `scatter`.
_KNOWN = {
    "echelon": ("delay", "row_delay", "first"),
    "row": ("delay", "hole_delay"),
    "v": ("delay", "row_delay", "apex"),
    "holes": ("holes", "blocks", "columns"),
    "none": (),
}


def _read_columns(value: object) -> object:
    """Let a number of a column stand without quotation marks."""
    if not isinstance(value, dict):
        message = "a group of keys is needed, such as {x: 'Collar X [m]', delay: '4 [ms]'}"
        raise QuantityError(message)
    return {
        name: str(head) if isinstance(head, int) and not isinstance(head, bool) else head
        for name, head in value.items()
    }


class Scatter(Spec):
    """Standard deviations of the firing times: of the detonator over its delay, and of each."""

    relative: Annotated[float, QuantityIn("1", 0.0, 0.2)] = 0.0
    absolute: Annotated[float, QuantityIn("s", 0.0, 0.1)] = 0.0


class FiringPlan(Spec):
    """Order and delay of the blocks; with pattern ``none`` the balls are loose from the start.

    Attributes
    ----------
    pattern : {"echelon", "row", "v", "holes", "none"}
    delay : float [s]
        Between neighbours along a row (echelon, v), or from row to row (row).
    row_delay : float, optional [s]
        From row to row; default: `delay`.
    hole_delay : float [s]
        Between neighbours along a row of pattern ``row``; 0: all of a row at once.
    first : {"near_end", "far_end"}
        Corner where an echelon begins: at y = 0, or at the other end.
    apex : float, optional [m]
        Place along the bench where a V opens; default: the middle.
    holes : str, optional
        CSV of holes, relative to the bench file; makes the pattern ``holes``.
    columns : mapping of str to str or int
        Which columns of the file are meant where its heads are other ones or missing: a head or a
        number from 1, with its unit in brackets where the file gives none.
    blocks : {"grid", "nearest_hole"}
        Each hole of the file fires a block of burden by spacing, or the rock nearest to it.
    start : float [s]
    scatter : Scatter, optional
        Of the detonators; drawn from the seed of the bench.
    hold_unfired : bool
    """

    pattern: Literal["echelon", "row", "v", "holes", "none"] = "echelon"
    delay: _Delay = 0.030
    row_delay: _Delay | None = None
    hole_delay: _Delay = 0.0
    first: Literal["near_end", "far_end"] = "near_end"
    apex: Annotated[float, QuantityIn("m", 0.0, 2000.0)] | None = None
    holes: Annotated[str, Field(min_length=1)] | None = None
    columns: Annotated[dict[str, str], BeforeValidator(_read_columns)] = Field(default_factory=dict)
    blocks: Literal["grid", "nearest_hole"] = "grid"
    start: _Delay = 0.0
    scatter: Scatter | None = None
    hold_unfired: bool = True

    @model_validator(mode="before")
    @classmethod
    def _holes_are_a_pattern(cls, data: Any) -> Any:
        if isinstance(data, dict) and "holes" in data and "pattern" not in data:
            return data | {"pattern": "holes"}
        return data

    @model_validator(mode="after")
    def _fits_the_pattern(self) -> FiringPlan:
        written = self.model_fields_set - {"pattern", "start", "hold_unfired", "scatter"}
        faults = [
            f"{name}: means nothing to the pattern '{self.pattern}'"
            for name in sorted(written - set(_KNOWN[self.pattern]))
            # Kept for files of earlier versions.
            if not (name == "delay" and self.pattern == "none")
        ]
        if self.pattern == "holes" and self.holes is None:
            faults.append("holes: the name of a CSV file is needed")
        if faults:
            raise QuantityError("; ".join(faults))
        return self

    def block_delay(self, bench: Bench) -> FloatArray:
        """Nominal firing time [s] of each block, (rows * columns,); inf: never fired.

        A file of holes is read by whoever runs the bench.
        """
        rows, columns = block_shape(bench)
        if self.pattern == "echelon":
            far = self.first == "far_end"
            return echelon_delays(
                rows, columns, self.delay, self.start, row_interval=self.row_delay, from_far_end=far
            )
        if self.pattern == "row":
            return row_delays(rows, columns, self.delay, self.start, hole_interval=self.hole_delay)
        if self.pattern == "v":
            apex = None if self.apex is None else self.apex / bench.spacing - 0.5
            return v_delays(
                rows, columns, self.delay, self.start, row_interval=self.row_delay, apex=apex
            )
        return np.full(rows * columns, np.inf)


class Direction(Spec):
    """Direction of the throw.

    Attributes
    ----------
    normal_to : {"face", "firing_front"}
        What the rock moves away from at right angles: the free face of the bench, or the face that
        the holes fired before have left, where delays are equal.
    azimuth : float [rad]
        In plan from that normal, positive towards larger y.
    elevation : float [rad]
        Over the horizontal. A burden is thrown forwards, so what is steeper than -45 or 60 deg is
        taken for the dip of a hole and refused, as an azimuth that points backwards is for a
        bearing.
    """

    normal_to: Literal["face", "firing_front"] = "face"
    azimuth: Annotated[float, THROW_AZIMUTH] = 0.0
    elevation: Annotated[float, THROW_ELEVATION] = 0.0
