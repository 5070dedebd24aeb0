"""Answer one design for people: values with units, bands, what lies outside the domain.

Imports NumPy and light modules only, so that the command line answers in well under a second.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from castblast.bands import BAND_HEADER, BAND_WORDS, show_band, show_value
from castblast.design.variables import VARIABLES
from castblast.names import as_words
from castblast.network import Network
from castblast.prediction.answer import domain_remarks, load_network, predict
from castblast.specs.case import parse_values
from castblast.stages.outcome import Outcome


def predict_design(
    values: Mapping[str, Any], explosive: str, network: str | Path | None = None
) -> Outcome:
    """Predict one design written with units, such as ``{"burden": "3 m"}``; see `predict`."""
    network = None if network is None else Path(network)
    model = load_network(network)
    document = predict(parse_values(values, "predict"), explosive, model)
    rows = [_row(model, name, document) for name in model.output_names]
    shown = ", ".join(f"{c.name} {c.show(document['inputs'][c.name])}" for c in model.inputs)
    remarks = [f"inputs: {shown}", BAND_WORDS]
    remarks += domain_remarks(document)
    score = document["density_score"]
    if score is not None and document["in_domain"]:
        remarks.append(f"inside the training data: density score {score:.2f}, the limit is 1")
    title = f"{document['explosive']}, {document['model']['name']}"
    return Outcome(document=document, title=title, header=BAND_HEADER, rows=rows, remarks=remarks)


def _row(model: Network, name: str, document: Mapping[str, Any]) -> tuple[str, str, str, str]:
    column = model.outputs[model.output_names.index(name)]
    low_high = show_band(name, document[name], column.relative_band)
    if document["domain"] == "outside":
        low_high = "unknown: outside the training data"
    elif document["domain"] == "unusual":
        low_high += " (unusual design)"
    value = show_value(name, document[name])
    return (as_words(name), value, low_high, VARIABLES[name].shown_unit)
