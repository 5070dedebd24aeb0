"""YAML files turned into frozen, checked specs, with one clear line for every fault.

A spec is a pydantic model that forbids unknown keys and cannot be changed. Every fault of a file
is reported at once, as ``file: field: value: what is wrong, what is allowed``.
"""

from __future__ import annotations

import re
import types
import typing
from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar

import yaml
from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError

from castblast.disk.reading import nearest_file as nearest_file
from castblast.disk.reading import read_text as read_text
from castblast.errors import SpecError, nearest_name
from castblast.identity import document_hash
from castblast.names import check_label, check_name, shortened

M = TypeVar("M", bound=BaseModel)


#: Field of a name that becomes a file or a folder, and of a name for people.
Name = Annotated[str, AfterValidator(check_name)]
Label = Annotated[str, AfterValidator(check_label)]


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
        content = self.model_dump(mode="json")
        return document_hash(content, separators=(",", ":"), allow_nan=False)


#: Most bytes of a YAML file, and most values in it with every alias written out.
_LARGEST_YAML = 1 << 20
_MOST_VALUES = 500_000
#: Longest number; an integer of thousands of digits takes Python minutes to read.
_LONGEST_NUMBER = 400
#: Brackets within brackets; PyYAML takes time in proportion to the depth for every sign.
_DEEPEST = 40
#: Control characters and halves of pairs; a name of a file or a message cannot hold them.
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff]")


class _Loader(yaml.SafeLoader):
    """Safe YAML loader of plain values.

    It refuses duplicate keys, reads ``1e8`` as a number and a date as text, knows no tags beside
    those of plain values, and refuses aliases that stand for more than a file could hold.
    """

    def fetch_flow_collection_start(self, token: Any) -> None:
        """Open a bracket."""
        if self.flow_level >= _DEEPEST:
            raise yaml.scanner.ScannerError(None, None, "nested too deeply", self.get_mark())
        super().fetch_flow_collection_start(token)

    def get_single_data(self) -> Any:
        """Look at the whole document before anything is made of it."""
        node = self.get_single_node()
        if node is None:
            return None
        _check_nodes(node, {}, set())
        return self.construct_document(node)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[Any] = set()
        for key_node, _ in node.value:
            if key_node.tag.endswith(":merge"):
                continue
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, Hashable) and key in seen:
                problem = f"the key '{key}' is given twice"
                raise yaml.constructor.ConstructorError(None, None, problem, key_node.start_mark)
            if isinstance(key, Hashable):
                seen.add(key)
        return super().construct_mapping(node, deep)

    def construct_number(self, node: yaml.ScalarNode) -> int | float:
        """Make an integer or a float, which a tag of the file may have called one."""
        if len(node.value) <= _LONGEST_NUMBER:
            try:
                if node.tag.endswith("int"):
                    return int(self.construct_yaml_int(node))
                return float(self.construct_yaml_float(node))
            except (ValueError, OverflowError, IndexError):
                pass
        problem = f"'{shortened(node.value)}' is not a usable number"
        raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark)


def _check_nodes(node: yaml.Node, known: dict[int, int], above: set[int]) -> int:
    """Count the values of a node with its aliases written out; `above` holds what it is part of."""
    if id(node) in known:
        return known[id(node)]
    problem = ""
    count = 1
    if isinstance(node, yaml.ScalarNode):
        odd = _CONTROL.search(node.value)
        problem = f"the character {odd[0]!r} is not allowed" if odd else ""
    elif id(node) in above:
        problem = "an alias stands for what it is part of"
    else:
        above.add(id(node))
        for part in node.value:
            for inner in part if isinstance(part, tuple) else (part,):
                count += _check_nodes(inner, known, above)
        above.discard(id(node))
        if count > _MOST_VALUES:
            problem = f"holds more than {_MOST_VALUES:,} values once its aliases are written out"
    if problem:
        raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark)
    known[id(node)] = count
    return count


_PLAIN_TAGS = ("null", "bool", "int", "float", "str", "seq", "map", "merge", "value")
# Dates stay text: nothing here takes one, and YAML makes one of every version like 2024-01-01.
_Loader.yaml_implicit_resolvers = {
    first: [(tag, form) for tag, form in forms if not tag.endswith(":timestamp")]
    for first, forms in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_Loader.yaml_constructors = {
    tag: maker
    for tag, maker in yaml.SafeLoader.yaml_constructors.items()
    if tag is None or tag.split(":")[-1] in _PLAIN_TAGS
}
for _kind in ("int", "float"):
    _Loader.add_constructor(f"tag:yaml.org,2002:{_kind}", _Loader.construct_number)
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
    return parse_yaml(read_yaml_text(path), str(path))


def read_yaml_text(path: Path) -> str:
    """Read the text of a YAML file that a person named.

    Raises
    ------
    SpecError
        One line: the file is missing, a folder, unreadable, too large or not UTF-8.
    """
    return read_text(path, "YAML file", _LARGEST_YAML)


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
    except (ValueError, LookupError, AttributeError, TypeError):
        # PyYAML lets some of these out of a value that carries a tag of its own.
        raise SpecError(f"{where}: holds a value that cannot be read as its tag says") from None
    if content is None:
        raise SpecError(f"{where}: is empty")
    if not isinstance(content, dict):
        kind = "a list" if isinstance(content, list) else "a single value"
        raise SpecError(f"{where}: holds {kind}; lines of the form 'key: value' are needed")
    odd = [key for key in content if not isinstance(key, str)]
    if odd:
        raise SpecError(f"{where}: the key {shortened(odd[0])} is not a name")
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


def _broken(where: str, fault: yaml.YAMLError) -> str:
    mark = getattr(fault, "problem_mark", None) or getattr(fault, "context_mark", None)
    problem = getattr(fault, "problem", None) or getattr(fault, "reason", None) or "not YAML"
    place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
    return f"{where}: {place}{problem}"


def _fault_lines(fault: ValidationError, model: type[BaseModel]) -> list[str]:
    lines = []
    for error in fault.errors(include_url=False):
        # An unknown key may look like the name of a validator, and is named all the same.
        own = len(error["loc"]) - 1 if error["type"] == "extra_forbidden" else -1
        loc = enumerate(error["loc"])
        place = tuple(part for i, part in loc if i == own or _is_written(part))
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
        if isinstance(part, int):
            path += f"[{shortened(part)}]"
        else:
            path += f".{shortened(part)}" if path else shortened(part) or "''"
    return path


def _show(value: object) -> str:
    return "" if isinstance(value, Mapping) else shortened(value)


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
