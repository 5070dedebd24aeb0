"""Which settings of a model spec a study may change, and between which bounds.

The block ``search:`` of a file in ``models/specs/`` names fields of its own family; no code knows
them. A candidate is the spec with some fields replaced, read again as if it had been written so.

search:
  hidden_layers: {depth: [1, 3], width: [8, 64]}   # equally wide layers
  activation: {choices: [tanh, relu]}
  penalty: {range: [1e-9, 1e-3], log: true}
  refinements: {integers: [0, 2]}
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any, Self, TypeAlias

from pydantic import ConfigDict, Field, RootModel, ValidationError, field_validator, model_validator

from castblast.errors import nearest_name
from castblast.identity import document_hash
from castblast.specs.loading import Spec

#: Fields that make another question of a spec, not another answer.
_FIXED = ("name", "description", "kind", "features", "targets", "search")


class Choices(Spec):
    """One of some values, in no order; a value may be a list."""

    choices: tuple[Any, ...] = Field(min_length=2)

    @field_validator("choices")
    @classmethod
    def _distinct(cls, values: tuple[Any, ...]) -> tuple[Any, ...]:
        if len({json.dumps(value) for value in values}) < len(values):
            message = "a choice is given twice"
            raise ValueError(message)
        return values


class IntegerRange(Spec):
    """A whole number between two bounds, both included."""

    integers: tuple[int, int]
    log: bool = False

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        _check_range("integers", self.integers, self.log)
        return self


class FloatRange(Spec):
    """A number between two bounds."""

    range: tuple[float, float]
    log: bool = False

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        _check_range("range", self.range, self.log)
        return self


class LayerRange(Spec):
    """Equally wide layers: how many, and how many nodes in each (on a logarithmic scale)."""

    depth: tuple[int, int]
    width: tuple[int, int]

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        for name, bounds in (("depth", self.depth), ("width", self.width)):
            if not 1 <= bounds[0] <= bounds[1]:
                message = f"{name}: two whole numbers from 1 on are needed, the smaller first"
                raise ValueError(message)
        return self


Range: TypeAlias = Choices | IntegerRange | FloatRange | LayerRange


def _check_range(name: str, bounds: tuple[float, float], log: bool) -> None:
    if not bounds[0] < bounds[1]:
        message = f"{name}: the first bound must be below the second"
        raise ValueError(message)
    if log and bounds[0] <= 0:
        message = f"{name}: a logarithmic range starts above 0"
        raise ValueError(message)


_KINDS: Mapping[str, type[Spec]] = {
    "choices": Choices,
    "integers": IntegerRange,
    "range": FloatRange,
    "depth": LayerRange,
}


class SearchSpace(RootModel[dict[str, Range]]):
    """Fields of a spec and what a study may set them to."""

    model_config = ConfigDict(frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _by_key(cls, content: Any) -> Any:
        """Choose the range by its key, so that a fault is told of that kind alone."""
        if not isinstance(content, Mapping):
            message = "field: range pairs are needed, such as 'activation: {choices: [tanh, relu]}'"
            raise ValueError(message)  # noqa: TRY004 - pydantic turns it into a fault of the file
        faults, ranges = [], {}
        for name, value in content.items():
            try:
                ranges[name] = _read_range(value)
            except ValidationError as fault:
                faults += [
                    f"{name}: {'.'.join(map(str, entry['loc'])) or 'range'}: "
                    f"{entry['msg'].removeprefix('Value error, ')}"
                    for entry in fault.errors()
                ]
            except ValueError as fault:
                faults.append(f"{name}: {fault}")
        if faults:
            raise ValueError("; ".join(faults))
        return ranges

    def sha256(self) -> str:
        """SHA-256 (hex) of the space, whatever the order of its fields."""
        return document_hash(self.model_dump(mode="json"))


def _read_range(value: Any) -> Spec:
    if isinstance(value, Spec):
        return value
    keys = value.keys() if isinstance(value, Mapping) else ()
    for key, kind in _KINDS.items():
        if key in keys:
            return kind.model_validate(value)
    message = f"a range is needed: one of {', '.join(_KINDS)} (with width)"
    raise ValueError(message)


def search_faults(space: SearchSpace, fields: Iterable[str], where: str) -> list[str]:
    """Tell what is wrong with a space: it is empty, or names what the family does not have."""
    allowed = [name for name in fields if name not in _FIXED]
    faults = [
        f"{where}: search.{name}: cannot be searched{nearest_name(name, allowed)} "
        f"(fields of this family: {', '.join(allowed)})"
        for name in space.root
        if name not in allowed
    ]
    if not space.root:
        faults.append(f"{where}: search: names no field, so there is nothing to tune")
    return faults
