"""`Network` to JSON and back: the interchange form that every other export starts from.

FloatArray are written with `repr`, the shortest text that reads back to the same bits, so a round
trip is exact. Keys come in a fixed order and no time, host or path is added: equal networks give
equal bytes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import numpy as np

from castblast.disk.plain import as_plain
from castblast.disk.reading import parse_json, read_text
from castblast.errors import SpecError
from castblast.names import shortened
from castblast.network import (
    SCHEMA_VERSION,
    Column,
    Constraint,
    DensityScore,
    DerivedColumn,
    GoldenRows,
    InputColumn,
    Layer,
    Network,
    OutputColumn,
)
from castblast.types import FloatArray

_FORMAT = "castblast network"
#: Most bytes of a network.json; a million weights have less.
_LARGEST = 1 << 27
#: Layouts that are read; one of version 1 has no derived columns, density or members.
_READABLE = (1, SCHEMA_VERSION)


def to_document(network: Network) -> dict[str, Any]:
    """Give a network as plain dictionaries, lists, texts and numbers."""
    return {
        "format": _FORMAT,
        "schema_version": network.schema_version,
        "provenance": dict(network.provenance),
        "inputs": [_plain(column) for column in network.inputs],
        "derived": [_plain(column) for column in network.derived],
        "explosives": list(network.explosives),
        "explosive_codes": network.codes.tolist(),
        "layers": _chain(network.layers),
        "members": [_chain(member) for member in network.members],
        "outputs": [_plain(column) for column in network.outputs],
        "constraints": [_plain(rule) for rule in network.constraints],
        "density": None if network.density is None else _plain(network.density),
        "golden": {
            "inputs": network.golden.inputs.tolist(),
            "explosives": list(network.golden.explosives),
            "outputs": network.golden.outputs.tolist(),
        },
    }


def _chain(layers: Sequence[Layer]) -> list[dict[str, Any]]:
    return [
        {
            "activation": layer.activation,
            "weights": layer.weights.tolist(),
            "biases": layer.biases.tolist(),
        }
        for layer in layers
    ]


def _plain(record: Column | Constraint | DensityScore) -> dict[str, Any]:
    return {entry.name: as_plain(getattr(record, entry.name)) for entry in fields(record)}


def to_json(network: Network) -> str:
    """Write a network as JSON text; one line per row of numbers.

    Raises
    ------
    ValueError
        A number is not finite (a `Network` with finite golden rows has none).
    """
    return pretty(to_document(network)) + "\n"


def pretty(value: Any, indent: str = "") -> str:
    """JSON with flat lists on one line: reviewable in a diff, and half as long."""
    inner = indent + "  "
    if isinstance(value, dict) and value:
        lines = [f"{inner}{json.dumps(key)}: {pretty(item, inner)}" for key, item in value.items()]
        return "{\n" + ",\n".join(lines) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(item, list | dict) for item in value):
        return "[\n" + ",\n".join(inner + pretty(item, inner) for item in value) + f"\n{indent}]"
    return json.dumps(value, allow_nan=False)


def from_document(document: Mapping[str, Any]) -> Network:
    """Rebuild a network from `to_document`.

    Raises
    ------
    SpecError
        Another format or schema version, a missing or unusable entry.
    """
    if document.get("format") != _FORMAT:
        message = f"not a network of castblast (format {shortened(document.get('format'))})"
        raise SpecError(message)
    if document.get("schema_version") not in _READABLE:
        found = shortened(document.get("schema_version"))
        message = f"schema version {found}, this one reads {' and '.join(map(str, _READABLE))}"
        raise SpecError(message)
    try:
        return _build(document)
    except KeyError as fault:
        message = f"entry {shortened(fault)} is missing"
        raise SpecError(message) from None
    except (TypeError, ValueError, AttributeError, OverflowError) as fault:
        message = f"unusable entry ({shortened(fault, 150)})"
        raise SpecError(message) from None


def _build(document: Mapping[str, Any]) -> Network:
    golden = _group(document["golden"], "golden")
    return Network(
        inputs=_records(InputColumn, document["inputs"], "inputs"),
        explosives=_texts(document["explosives"], "explosives"),
        codes=_floats(document["explosive_codes"], "explosive_codes"),
        layers=_read_chain(document["layers"], "layers"),
        outputs=_records(OutputColumn, document["outputs"], "outputs"),
        constraints=_records(Constraint, document["constraints"], "constraints"),
        golden=GoldenRows(
            _floats(golden["inputs"], "golden.inputs"),
            _texts(golden["explosives"], "golden.explosives"),
            _floats(golden["outputs"], "golden.outputs"),
        ),
        provenance=_group(document["provenance"], "provenance"),
        **(_second_version(document) if document["schema_version"] > 1 else {}),
    )


def _second_version(document: Mapping[str, Any]) -> dict[str, Any]:
    """Read the entries that version 1 did not have."""
    density = document["density"]
    if density is not None:
        density = _group(density, "density")
        names = ("centres", "whitening", "offsets")
        arrays = {key: _floats(density[key], f"density.{key}") for key in names}
        density = _record(DensityScore, {**density, **arrays}, "density")
    members = _list(document["members"], "members")
    return {
        "derived": _records(DerivedColumn, document["derived"], "derived"),
        "density": density,
        "members": tuple(_read_chain(one, f"members[{i}]") for i, one in enumerate(members)),
    }


def _read_chain(layers: object, where: str) -> tuple[Layer, ...]:
    chain = []
    for number, layer in enumerate(_list(layers, where)):
        place = f"{where}[{number}]"
        entry = _group(layer, place)
        weights = _floats(entry["weights"], f"{place}.weights")
        biases = _floats(entry["biases"], f"{place}.biases")
        activation: Any = entry["activation"]
        if not isinstance(activation, str):
            _refuse(f"{place}.activation", "a text is needed")
        chain.append(Layer(weights, biases, activation))  # type: ignore[arg-type]
    return tuple(chain)


_Record = TypeVar("_Record")


def _records(kind: type[_Record], entries: object, where: str) -> tuple[_Record, ...]:
    return tuple(
        _record(kind, entry, f"{where}[{i}]") for i, entry in enumerate(_list(entries, where))
    )


def _record(kind: type[_Record], entry: object, where: str) -> _Record:
    """A record from a group with just its entries."""
    group = _group(entry, where)
    known = fields(kind)  # type: ignore[arg-type]
    missing = [f.name for f in known if f.default is MISSING and f.name not in group]
    unknown = sorted(set(group) - {f.name for f in known})
    if missing or unknown:
        what = f"'{missing[0]}' is missing" if missing else f"'{shortened(unknown[0])}' is unknown"
        _refuse(where, what)
    return kind(**group)


def _group(value: object, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        _refuse(where, "a group of entries is needed")
    return value


def _list(value: object, where: str) -> list[Any]:
    if not isinstance(value, list):
        _refuse(where, "a list is needed")
    return value


def _texts(value: object, where: str) -> tuple[str, ...]:
    if not all(isinstance(entry, str) for entry in _list(value, where)):
        _refuse(where, "a list of texts is needed")
    return tuple(_list(value, where))


def _floats(nested: object, where: str) -> FloatArray:
    """Lists of numbers as an array; texts of numbers are none."""
    needed = "lists of numbers, all of one length, are needed"
    try:
        array = np.array(_list(nested, where))
    except (ValueError, OverflowError):
        _refuse(where, needed)
    if array.dtype.kind not in "iuf":
        _refuse(where, needed)
    return np.asarray(array, dtype=np.float64)


def _refuse(where: str, what: str) -> NoReturn:
    message = f"{where}: {what}"
    raise ValueError(message)


def from_json(text: str) -> Network:
    """Rebuild a network from its JSON text; raises `SpecError` as `from_document`."""
    document = parse_json(text)
    if not isinstance(document, dict):
        message = "not a network of castblast (no JSON object)"
        raise SpecError(message)
    return from_document(document)


def read_network(path: Path) -> Network:
    """Read a ``network.json``.

    Raises
    ------
    SpecError
        The file is missing, unreadable or no usable network; the message names it.
    """
    text = read_text(path, "network.json", _LARGEST)
    try:
        return from_json(text)
    except SpecError as fault:
        lines = "\n".join(f"{path}: {line}" for line in str(fault).splitlines())
        raise SpecError(lines) from None
