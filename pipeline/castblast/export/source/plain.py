"""A network as the writers of source code need it: positions for names, one layout for all.

Every language gets the same numbers in the same order, so that copies can differ only in how they
compute. Texts are plain ASCII: sources are read by compilers and interpreters of any age.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np

from castblast.bands import BASIS
from castblast.design.rule import resolve_design
from castblast.design.variables import VARIABLES
from castblast.network import (
    BLAME,
    Column,
    Layer,
    Network,
    density_score,
    explosive_index,
    in_domain,
    prediction_factors,
)
from castblast.network.json_file import pretty
from castblast.types import FloatArray

#: Files of one export: name to contents.
Files = dict[str, bytes]
_NOT_IN_COMMENTS = re.compile(r"[^A-Za-z0-9 _.,:;+/()%#=^-]")
_TEMPLATES = Path(__file__).parents[1] / "templates"


def compact(network: Network) -> dict[str, Any]:
    """Give a network as plain values with names replaced by positions.

    Weights are (n_in, n_out); derived coefficients run over all inputs; rules are pairs of
    position and coefficient in the order in which they are summed; golden explosives are
    positions. Members are left out: they give no value.
    """
    names = network.input_names
    golden, density = network.golden, network.density
    example = dict(zip(names, example_row(network), strict=True))
    return {
        "model": identity(network),
        "inputs": [
            _column(c) | {"lower": c.lower, "upper": c.upper, "example": example[c.name]}
            for c in network.inputs
        ],
        "derived": [
            _column(c) | {"coefficients": [float(c.coefficients.get(name, 0.0)) for name in names]}
            for c in network.derived
        ],
        "explosives": list(network.explosives),
        "codes": network.codes.tolist(),
        "layers": [_layer(layer) for layer in network.layers],
        "outputs": _outputs(network),
        "basis": BASIS,
        "rules": [
            {
                "label": rule.label,
                "terms": [[names.index(name), float(c)] for name, c in rule.coefficients.items()],
                "lower": float(rule.lower),
            }
            for rule in network.constraints
        ],
        "density": None
        if density is None
        else {
            "centres": density.centres.tolist(),
            "whitening": density.whitening.tolist(),
            "offsets": density.offsets.tolist(),
            "threshold": float(density.threshold),
            "level": float(density.level),
            "blame": BLAME,
        },
        "golden": {
            "explosives": [explosive_index(network, name) for name in golden.explosives],
            "inputs": golden.inputs.tolist(),
            "outputs": golden.outputs.tolist(),
        },
    }


def identity(network: Network) -> dict[str, str]:
    """Name of the model, of its data and of the version that made it, for headers."""
    spec = network.provenance.get("spec", {})
    dataset = network.provenance.get("dataset", {})
    return {
        "name": str(spec.get("name", "network")),
        "dataset": f"{dataset.get('name', '?')} {dataset.get('dataset_version', '')}".strip(),
        "content_sha256": str(dataset.get("content_sha256", "")),
        "castblast_version": str(network.provenance.get("castblast_version", "")),
    }


def _column(column: Column) -> dict[str, Any]:
    variable = VARIABLES.get(column.name)
    return {
        "name": column.name,
        "unit": column.unit,
        # What follows a semicolon tells how specs complete a value: copies complete none.
        "title": variable.long_name.split(";")[0] if variable else column.name.replace("_", " "),
        "shown_unit": variable.file_unit if variable else column.unit,
        "shown_factor": variable.display_factor if variable else 1.0,
        "log": column.transform == "log",
        "mean": float(column.mean),
        "scale": float(column.scale),
    }


def _outputs(network: Network) -> list[dict[str, Any]]:
    """Columns with their bands: relative half-width of the network, ends over value of a blast."""
    return [
        _column(column)
        | {
            "network_band": column.relative_band,
            # No number of JSON stands for "not stated".
            "prediction_band": None if isnan(ends[0]) else list(ends),
        }
        for column, ends in zip(network.outputs, prediction_factors(network), strict=True)
    ]


def _layer(layer: Layer) -> dict[str, Any]:
    return {
        "activation": layer.activation,
        "weights": layer.weights.tolist(),
        "biases": layer.biases.tolist(),
    }


def example_row(network: Network) -> list[float]:
    """Give one design for usage examples: the usual one, or the least unusual golden row."""
    usual = np.array([_usual_values(network)])
    if in_domain(network, usual)[0]:
        return [float(value) for value in usual[0]]
    rows: FloatArray = network.golden.inputs
    rows = rows[in_domain(network, rows)] if len(rows) else rows
    if not len(rows):
        return [0.5 * (column.lower + column.upper) for column in network.inputs]
    chosen = 0 if network.density is None else int(density_score(network, rows).argmin())
    return [float(value) for value in rows[chosen]]


def _usual_values(network: Network) -> list[float]:
    """Defaults of the variables, completed by the rule of a design."""
    full = resolve_design({})
    middle = {c.name: 0.5 * (c.lower + c.upper) for c in network.inputs}
    return [full.get(name, middle[name]) for name in network.input_names]


def render(template: str, **values: Any) -> bytes:
    """Fill a template of `export/templates` and give it as ASCII bytes with Unix line ends."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    environment.filters |= {
        "number": _number,
        "braces": _braces,
        "quoted": quoted,
        "c_literal": c_literal,
        "comment": comment,
        "identifier": identifier,
        "data": data,
    }
    text = environment.get_template(template).render(**values)
    return text.encode("ascii", "backslashreplace")


def _number(value: float) -> str:
    """Shortest text that reads back to the same float64, in C, JavaScript and Python alike."""
    return repr(float(value))


def _braces(values: Sequence[Any], indent: str = "  ") -> str:
    """C initialiser of nested lists of numbers; lines of at most 100 characters."""
    if isinstance(values[0], list):
        return "{\n" + ",\n".join(indent + _braces(row, indent + "  ") for row in values) + "}"
    lines, line = [], ""
    for text in (repr(value) for value in values):
        if line and len(indent) + len(line) + len(text) > 96:
            lines.append(line.rstrip())
            line = ""
        line += f"{text}, "
    lines.append(line.rstrip(", "))
    return "{" + f"\n{indent} ".join(lines) + "}"


def quoted(text: str) -> str:
    """Text as a literal of JavaScript or Python, ASCII; no part of it can end a script of HTML."""
    return json.dumps(text).replace("<", "\\u003c")


def c_literal(text: str) -> str:
    """Text as a string literal of C99, ASCII; bytes beyond it are those of UTF-8."""
    parts = []
    for byte in text.encode("utf-8", "replace"):
        letter = chr(byte)
        plain = letter.isascii() and letter.isprintable() and letter not in '"\\?'
        # Octal: three digits at most, so that a digit after it is none of it. A question mark
        # would begin a trigraph.
        parts.append(letter if plain else f"\\{byte:03o}")
    return '"' + "".join(parts) + '"'


def data(value: Any) -> str:
    """Plain values as a literal of JavaScript, or within single quotes of Python's JSON reader.

    JSON, in which neither an apostrophe nor the beginning of a tag of HTML stands as it is.
    """
    return pretty(value).replace("'", "\\u0027").replace("<", "\\u003c")


def comment(text: str) -> str:
    """Text inside a comment or a docstring, whatever the language.

    Only signs stay that end no comment, string or line anywhere: no quotation marks, stars,
    backslashes, brackets or line ends.
    """
    return _NOT_IN_COMMENTS.sub("_", text)


def identifier(name: str) -> str:
    """Name as part of an identifier, upper case."""
    return re.sub(r"[^A-Za-z0-9]", "_", name).upper()
