"""A bench file with what the command line sets instead."""

from __future__ import annotations

from typing import Any

from castblast.errors import SpecError, nearest_name
from castblast.muckpile.balls.state import PRECISIONS
from castblast.specs.bench.balls.spec import MOST_BALLS
from castblast.specs.bench.bench import BenchSpec
from castblast.specs.quantity import parse_quantity

_MAX_VELOCITY = 100.0
_FEWEST_BALLS = 10


def with_options(spec: BenchSpec, balls: int | None, velocity: str | float | None) -> BenchSpec:
    """Bench spec with what the command line sets instead of the file."""
    update: dict[str, Any] = {}
    if balls is not None:
        if spec.balls.file is not None:
            message = f"--balls: {spec.name} takes its balls from {spec.balls.file}"
            raise SpecError(message)
        made: dict[str, Any] = {"count": balls, "mean_radius": None}
        if spec.balls.fragments is not None:
            made["fragments"] = spec.balls.fragments.model_copy(update={"smallest": None})
        update["balls"] = spec.balls.model_copy(update=made)
        if not _FEWEST_BALLS <= balls <= MOST_BALLS:
            limits = f"{_FEWEST_BALLS} to {MOST_BALLS:,}"
            message = f"--balls: {balls:,}: allowed: {limits}"
            raise SpecError(message, field="balls", value=balls, allowed=limits)
    if velocity is not None:
        if isinstance(velocity, str):
            velocity = parse_quantity(velocity, "m s-1", "--velocity")
        if not 0.0 <= velocity <= _MAX_VELOCITY:
            message = (
                f"--velocity: {velocity:g} m/s: implausible; allowed: 0 to {_MAX_VELOCITY:g} m/s"
            )
            limits = f"0 to {_MAX_VELOCITY:g} m/s"
            raise SpecError(message, field="velocity", value=velocity, allowed=limits)
        if spec.firing.pattern == "none":
            message = f"--velocity: {spec.name} is not fired (firing.pattern: none)"
            raise SpecError(message)
        update |= {"velocity": velocity, "surrogate": None}
    return spec.model_copy(update=update)


def with_precision(spec: BenchSpec, precision: str | None) -> BenchSpec:
    """Bench spec with the precision that the command line asks for, if any."""
    if precision is None:
        return spec
    if precision not in PRECISIONS:
        hint = nearest_name(precision, PRECISIONS)
        raise SpecError(f"--precision: {precision}: must be one of {', '.join(PRECISIONS)}{hint}")
    numerics = spec.numerics.model_copy(update={"precision": precision})
    return spec.model_copy(update={"numerics": numerics})
