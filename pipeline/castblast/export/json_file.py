"""`Network` to JSON and back: the interchange form that every other export starts from.

Floats are written with `repr`, the shortest text that reads back to the same bits, so a round
trip is exact. Keys come in a fixed order and no time, host or path is added: equal networks give
equal bytes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from castblast.errors import SpecError
from castblast.network import (
    SCHEMA_VERSION,
    Column,
    Constraint,
    DensityScore,
    DerivedColumn,
    Floats,
    GoldenRows,
    InputColumn,
    Layer,
    Network,
    OutputColumn,
)

_FORMAT = "castblast network"
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
    values = {entry.name: getattr(record, entry.name) for entry in fields(record)}
    for key, value in values.items():
        if isinstance(value, Mapping):
            values[key] = dict(value)
        elif isinstance(value, np.ndarray):
            values[key] = value.tolist()
    return values


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
        message = f"not a network of castblast (format {document.get('format')!r})"
        raise SpecError(message)
    if document.get("schema_version") not in _READABLE:
        found = document.get("schema_version")
        message = f"schema version {found!r}, this one reads {' and '.join(map(str, _READABLE))}"
        raise SpecError(message)
    try:
        return _build(document)
    except KeyError as fault:
        message = f"entry {fault} is missing"
        raise SpecError(message) from None
    except (TypeError, ValueError, AttributeError) as fault:
        message = f"unusable entry ({fault})"
        raise SpecError(message) from None


def _build(document: Mapping[str, Any]) -> Network:
    golden = document["golden"]
    return Network(
        inputs=tuple(InputColumn(**entry) for entry in document["inputs"]),
        explosives=tuple(document["explosives"]),
        codes=_floats(document["explosive_codes"]),
        layers=_read_chain(document["layers"]),
        outputs=tuple(OutputColumn(**entry) for entry in document["outputs"]),
        constraints=tuple(Constraint(**entry) for entry in document["constraints"]),
        golden=GoldenRows(
            _floats(golden["inputs"]), tuple(golden["explosives"]), _floats(golden["outputs"])
        ),
        provenance=document["provenance"],
        **(_second_version(document) if document["schema_version"] > 1 else {}),
    )


def _second_version(document: Mapping[str, Any]) -> dict[str, Any]:
    """Read the entries that version 1 did not have."""
    density = document["density"]
    if density is not None:
        arrays = {key: _floats(density[key]) for key in ("centres", "whitening", "offsets")}
        density = DensityScore(**{**density, **arrays})
    return {
        "derived": tuple(DerivedColumn(**entry) for entry in document["derived"]),
        "density": density,
        "members": tuple(_read_chain(member) for member in document["members"]),
    }


def _read_chain(layers: Sequence[Mapping[str, Any]]) -> tuple[Layer, ...]:
    return tuple(
        Layer(_floats(entry["weights"]), _floats(entry["biases"]), entry["activation"])
        for entry in layers
    )


def _floats(nested: list[Any]) -> Floats:
    return np.array(nested, dtype=np.float64)


def from_json(text: str) -> Network:
    """Rebuild a network from its JSON text; raises `SpecError` as `from_document`."""
    try:
        document = json.loads(text)
    except json.JSONDecodeError as fault:
        message = f"line {fault.lineno}: not JSON ({fault.msg})"
        raise SpecError(message) from None
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
    try:
        return from_json(path.read_text(encoding="utf-8"))
    except SpecError as fault:
        lines = "\n".join(f"{path}: {line}" for line in str(fault).splitlines())
        raise SpecError(lines) from None
    except FileNotFoundError:
        message = f"{path}: no such file"
        raise SpecError(message) from None
    except UnicodeDecodeError:
        message = f"{path}: not a text file"
        raise SpecError(message) from None
    except OSError as fault:
        message = f"{path}: cannot be read ({fault.strerror})"
        raise SpecError(message) from None
