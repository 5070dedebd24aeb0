"""Answer at once from a network: values, bands, and what lies outside its domain.

Imports NumPy and light modules only, so that the command line answers in well under a second.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from castblast.bands import band_document
from castblast.design.rule import require_possible
from castblast.disk.resources import SHIPPED_NETWORKS, is_bare_name, resource
from castblast.network import Network, RowPredictions, member_spread
from castblast.network.json_file import read_network
from castblast.prediction.columns import (
    ColumnPredictions,
    explosive_position,
    network_designs,
    predict_columns,
    row_violations,
)
from castblast.types import FloatArray, IntArray


def load_network(path: str | Path | None = None) -> Network:
    """Read a network from a file, or one that comes with castblast by its name.

    Parameters
    ----------
    path : path, optional
        A file, or one of `SHIPPED_NETWORKS`; default: the first of these.

    Raises
    ------
    SpecError
        Missing or unusable file.
    """
    name = "full" if path is None else str(path)
    shipped = is_bare_name(name) and name in SHIPPED_NETWORKS
    return read_network(resource(SHIPPED_NETWORKS[name]) if shipped else Path(name))


def predict(
    values: Mapping[str, float], explosive: str, network: Path | Network | None = None
) -> dict[str, Any]:
    """Predict one design.

    Parameters
    ----------
    values : mapping of input name to float [SI]
        What is missing takes the defaults of `castblast.design.variables`; the charge fills what
        the stemming leaves, 0.7 burden unless given.
    explosive : str
        As people write it; see `castblast.specs.catalogue.resolve_explosive`.
    network : path or Network, optional

    Returns
    -------
    dict
        Every output by name [SI]; ``prediction_band`` (lower and upper end per output) and
        ``prediction_basis``, see `castblast.bands`; ``network_band`` (lower, upper and relative
        half-width of the 95 % band of the network alone), ``spread`` of its members if there are
        any, ``display``, ``inputs`` used. Then
        ``in_domain``; ``domain``: inside, unusual (only the joint density objects) or outside;
        ``out_of_domain`` (names), ``domain_faults`` and ``domain_kinds`` (one each);
        ``density_score``, at most 1 inside, None where the network has none.

    Raises
    ------
    SpecError
        Unknown names or explosive, and whatever `castblast.design.rule` refuses; a charge that the
        network cannot see.
    """
    model = network if isinstance(network, Network) else load_network(network)
    index = np.array([explosive_position(model, explosive)], dtype=np.int64)
    answers = predict_columns(values, index, model)
    require_possible(answers.designs.faults)
    return next(answer_document(answers, index, model))


def answer_document(
    answers: ColumnPredictions, explosive: IntArray, network: Network
) -> Iterator[dict[str, Any]]:
    """Make the document of every row, see `predict`; rows that are refused have no meaning."""
    names = list(answers.designs.inputs)
    numeric = np.stack(list(answers.designs.inputs.values()), axis=1)
    spread = member_spread(network, numeric, explosive) if network.members else None
    relative = {c.name: c.relative_band for c in network.outputs}
    identity = _identity(network)
    for k in range(len(explosive)):
        outputs = dict(zip(network.output_names, answers.rows.values[k].tolist(), strict=True))
        inside = answers.domain[k] == "inside"
        violations = [] if inside else row_violations(answers, k, network)
        score = float(answers.rows.score[k])
        yield {
            "explosive": network.explosives[explosive[k]],
            **outputs,
            **band_document(outputs, relative),
            "network_band": _network_band(network, answers.rows, k),
            **({} if spread is None else {"spread": _named(network, spread[k])}),
            "display": {c.name: c.show(outputs[c.name]) for c in network.outputs},
            "inputs": dict(zip(names, numeric[k].tolist(), strict=True)),
            "in_domain": not violations,
            "domain": str(answers.domain[k]),
            "out_of_domain": list(dict.fromkeys(n for v in violations for n in v.inputs)),
            "domain_faults": [violation.message for violation in violations],
            "domain_kinds": [violation.kind for violation in violations],
            "density_score": score if math.isfinite(score) else None,
            "model": identity,
        }


def _network_band(network: Network, rows: RowPredictions, row: int) -> dict[str, dict[str, float]]:
    """Ends of the 95 % bands of the network about one row."""
    return {
        column.name: {
            "lower": float(rows.network.lower[row, j]),
            "upper": float(rows.network.upper[row, j]),
            "relative": column.relative_band,
        }
        for j, column in enumerate(network.outputs)
    }


def _named(network: Network, values: FloatArray) -> dict[str, float]:
    """Values of the outputs by their names."""
    return dict(zip(network.output_names, values.tolist(), strict=True))


def domain_remarks(document: Mapping[str, Any]) -> list[str]:
    """Lines about an answer that is not inside the training data, one for each reason."""
    lead = "unusual among" if document["domain"] == "unusual" else "outside"
    return [f"{lead} the training data: {line}" for line in document["domain_faults"]]


def complete_inputs(values: Mapping[str, float], network: Network) -> dict[str, float]:
    """Fill in what a network needs from what is given and the defaults.

    Raises
    ------
    SpecError
        All faults at once: unknown names, implausible values, impossible designs, or a charge
        that the network cannot see.
    """
    designs = network_designs(values, 1, network)
    require_possible(designs.faults)
    return {name: float(column[0]) for name, column in designs.inputs.items()}


def _identity(network: Network) -> dict[str, Any]:
    """Name of the model and of the data it comes from."""
    spec = network.provenance.get("spec", {})
    dataset = network.provenance.get("dataset", {})
    return {
        "name": spec.get("name", "network") if isinstance(spec, Mapping) else "network",
        "dataset": f"{dataset.get('name', '?')} {dataset.get('dataset_version', '')}".strip(),
        "content_sha256": dataset.get("content_sha256"),
    }
