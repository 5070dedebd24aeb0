"""YAML files turned into frozen, checked specs, with one clear line for every fault.

A spec is a pydantic model that forbids unknown keys and cannot be changed. Every fault of a file
is reported at once, as ``file: field: value: what is wrong, what is allowed``.
"""

from __future__ import annotations

import hashlib
import json
import re
import types
import typing
from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from castblast.errors import SpecError, nearest_name

M = TypeVar("M", bound=BaseModel)
_LONGEST_VALUE = 60


class Spec(BaseModel):
    """Base of all specs: frozen, no unknown keys, hashed by content.

    Attributes
    ----------
    elsewhere : mapping of str to str
        What a field is called in other codes and books, for the hint to an unknown key.
    """

    elsewhere: ClassVar[Mapping[str, str]] = {}

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    def sha256(self) -> str:
        """SHA-256 (hex) of the content in SI units, whatever the layout of the file."""
        content = json.dumps(
            self.model_dump(mode="json"), sort_keys=True, separators=(",", ":"), allow_nan=False
        )
        return hashlib.sha256(content.encode()).hexdigest()


class _Loader(yaml.SafeLoader):
    """Safe YAML loader that refuses duplicate keys and reads ``1e8`` as a number."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[Any] = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, Hashable) and key in seen:
                problem = f"the key '{key}' is given twice"
                raise yaml.constructor.ConstructorError(None, None, problem, key_node.start_mark)
            if isinstance(key, Hashable):
                seen.add(key)
        return super().construct_mapping(node, deep)


# YAML 1.1 takes a number for text where the mantissa has no point or the exponent no sign.
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(?:\d+\.?\d*|\.\d+)[eE][-+]?\d+$"),
    list("-+0123456789."),
)


def read_yaml(path: Path) -> dict[str, Any]:
    """Read a YAML file that holds a mapping.

    Raises
    ------
    SpecError
        One line: the file is missing, a folder, unreadable, not UTF-8, empty, broken (with its
        line), has a key twice, or is not a mapping.
    """
    return parse_yaml(read_text(path), str(path))


def read_text(path: Path) -> str:
    """Read a text file that a person named.

    Raises
    ------
    SpecError
        One line: the file is missing, a folder, unreadable or not UTF-8.
    """
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise SpecError(f"{path}: no such file{nearest_file(path)}") from None
    except IsADirectoryError:
        raise SpecError(f"{path}: is a folder; a YAML file is needed") from None
    except UnicodeDecodeError:
        raise SpecError(f"{path}: is not a text file in UTF-8") from None
    except OSError as fault:
        raise SpecError(f"{path}: cannot be read: {fault.strerror}") from None


def parse_yaml(text: str, where: str) -> dict[str, Any]:
    """Read a mapping from YAML text; `where` names its origin in messages.

    Raises
    ------
    SpecError
        One line: empty, broken (with its line), has a key twice, or is not a mapping.
    """
    try:
        content = yaml.load(text, Loader=_Loader)
    except yaml.YAMLError as fault:
        raise SpecError(_broken(where, fault)) from None
    except RecursionError:
        raise SpecError(f"{where}: nested too deeply") from None
    if content is None:
        raise SpecError(f"{where}: is empty")
    if not isinstance(content, dict):
        kind = "a list" if isinstance(content, list) else "a single value"
        raise SpecError(f"{where}: holds {kind}; lines of the form 'key: value' are needed")
    odd = [key for key in content if not isinstance(key, str)]
    if odd:
        raise SpecError(f"{where}: the key {odd[0]!r} is not a name")
    return content


def load_spec(path: Path, model: type[M]) -> M:
    """Read a YAML file into a spec; file names in it are relative to its folder.

    Raises
    ------
    SpecError
        As `read_yaml`, or one line per faulty field.
    """
    return make_spec(read_yaml(path), model, str(path), folder=path.parent)


def make_spec(
    content: Mapping[str, Any], model: type[M], where: str, folder: Path | None = None
) -> M:
    """Check a mapping against a spec; `where` names its origin in messages.

    Raises
    ------
    SpecError
        One line per faulty field.
    """
    try:
        return model.model_validate(content, context={"folder": folder or Path()})
    except ValidationError as fault:
        lines = dict.fromkeys(f"{where}: {line}" for line in _fault_lines(fault, model))
        raise SpecError("\n".join(lines)) from None


def nearest_file(path: Path) -> str:
    """Return a hint at the file of that folder whose name is nearest, or an empty string."""
    try:
        names = [entry.name for entry in path.parent.iterdir() if entry.suffix == path.suffix]
    except OSError:
        return f": the folder {path.parent} does not exist"
    return nearest_name(path.name, names)


def _broken(where: str, fault: yaml.YAMLError) -> str:
    mark = getattr(fault, "problem_mark", None) or getattr(fault, "context_mark", None)
    problem = getattr(fault, "problem", None) or getattr(fault, "reason", None) or "not YAML"
    place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
    return f"{where}: {place}{problem}"


def _fault_lines(fault: ValidationError, model: type[BaseModel]) -> list[str]:
    lines = []
    for error in fault.errors(include_url=False):
        place = tuple(part for part in error["loc"] if _is_written(part))
        field = _field_path(place)
        what = _describe(error["type"], error["msg"], error.get("ctx", {}), place, model)
        shown = "" if error["type"] in ("missing", "extra_forbidden") else _show(error["input"])
        lines.append(": ".join(part for part in (field, shown, what) if part))
    return lines


def _is_written(part: int | str) -> bool:
    """Leave out the names of validators that pydantic adds to a path."""
    return isinstance(part, int) or not re.search(r"[\[\](]", part)


def _field_path(place: tuple[int | str, ...]) -> str:
    path = ""
    for part in place:
        path += f"[{part}]" if isinstance(part, int) else f".{part}" if path else part
    return path


def _show(value: object) -> str:
    if isinstance(value, Mapping):
        return ""
    text = str(value).replace("\n", " ")
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 3] + "..."


def _describe(
    kind: str, message: str, context: dict[str, Any], place: tuple[int | str, ...], model: Any
) -> str:
    """Say in words what pydantic found."""
    if kind == "missing":
        return "is missing"
    if kind == "extra_forbidden":
        names = _names_at(model, place[:-1])
        meant = _meant(str(place[-1]), _models_at(model, place[:-1]))
        hint = f", did you mean '{meant}'?" if meant else nearest_name(str(place[-1]), names)
        return "unknown key" + (hint or f"; known keys: {', '.join(sorted(names))}")
    if kind in ("literal_error", "enum"):
        expected = str(context.get("expected", ""))
        return f"allowed: {expected}"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        names = _names_at(model, place)
        keys = f": {', '.join(sorted(names))}" if names else ""
        return f"a group of keys is needed{keys}"
    if kind in ("value_error", "assertion_error"):
        return str(context.get("error", message))
    return message[:1].lower() + message[1:]


def _meant(key: str, models: list[type[BaseModel]]) -> str:
    """Field that a key is called elsewhere; empty: none."""
    for model in models:
        if issubclass(model, Spec):
            for name, field in model.elsewhere.items():
                if name.lower() == key.lower():
                    return field
    return ""


def _names_at(model: Any, place: tuple[int | str, ...]) -> set[str]:
    """Field names of every model that the annotation at `place` allows."""
    return {name for candidate in _models_at(model, place) for name in candidate.model_fields}


def _models_at(model: Any, place: tuple[int | str, ...]) -> list[type[BaseModel]]:
    """Every model that the annotation at `place` allows."""
    found = _models(model)
    for part in place:
        if isinstance(part, int) or not any(part in outer.model_fields for outer in found):
            continue  # an entry of a list, or the key of a mapping of models
        found = [
            inner
            for outer in found
            if part in outer.model_fields
            for inner in _models(outer.model_fields[part].annotation)
        ]
    return found


def _models(annotation: Any) -> list[type[BaseModel]]:
    """Pydantic models inside an annotation such as ``list[A] | B | None``."""
    if isinstance(annotation, type) and not isinstance(annotation, types.GenericAlias):
        return [annotation] if issubclass(annotation, BaseModel) else []
    return [model for part in typing.get_args(annotation) for model in _models(part)]
