"""From the search space of a spec to the settings of a trial, and from those to a candidate."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from castblast.specs.loading import make_spec
from castblast.specs.models.model import ModelSpec
from castblast.specs.models.search import Choices, IntegerRange, LayerRange, SearchSpace


def suggest(trial: Any, space: SearchSpace) -> dict[str, Any]:
    """Ask a trial for a value of every field of the space.

    Parameters
    ----------
    trial
        Anything with the methods ``suggest_categorical``, ``suggest_int`` and ``suggest_float``.
    space : SearchSpace

    Returns
    -------
    dict of field to value
    """
    settings: dict[str, Any] = {}
    for name, entry in space.root.items():
        if isinstance(entry, Choices):
            settings[name] = json.loads(trial.suggest_categorical(name, _texts(entry)))
        elif isinstance(entry, LayerRange):
            depth = trial.suggest_int(f"{name}.depth", *entry.depth)
            width = trial.suggest_int(f"{name}.width", *entry.width, log=True)
            settings[name] = [width] * depth
        elif isinstance(entry, IntegerRange):
            settings[name] = trial.suggest_int(name, *entry.integers, log=entry.log)
        else:
            settings[name] = trial.suggest_float(name, *entry.range, log=entry.log)
    return settings


def own_parameters(spec: ModelSpec, space: SearchSpace) -> dict[str, Any] | None:
    """Parameters of a trial that stand for the spec as it is; None where it lies outside."""
    parameters: dict[str, Any] = {}
    content = spec.model_dump(mode="json")
    for name, entry in space.root.items():
        value = content[name]
        if isinstance(entry, Choices):
            if json.dumps(value) not in _texts(entry):
                return None
            parameters[name] = json.dumps(value)
        elif isinstance(entry, LayerRange):
            if not _is_inside(len(value), entry.depth) or len(set(value)) != 1:
                return None
            if not _is_inside(value[0], entry.width):
                return None
            parameters[f"{name}.depth"], parameters[f"{name}.width"] = len(value), value[0]
        else:
            bounds = entry.integers if isinstance(entry, IntegerRange) else entry.range
            if not isinstance(value, int | float) or not _is_inside(value, bounds):
                return None
            parameters[name] = value
    return parameters


def candidate(spec: ModelSpec, settings: Mapping[str, Any], name: str = "") -> ModelSpec:
    """Give the spec with some settings replaced, checked as if read from a file.

    Raises
    ------
    SpecError
        The family refuses the settings.
    """
    content = {**spec.model_dump(mode="json"), **settings, "name": name or spec.name}
    return make_spec(content, type(spec), spec.name, folder=getattr(spec, "folder", None))


def _texts(entry: Choices) -> list[str]:
    """Choices as texts, for a study knows no lists."""
    return [json.dumps(value) for value in entry.choices]


def _is_inside(value: float, bounds: tuple[float, float]) -> bool:
    return bounds[0] <= value <= bounds[1]
