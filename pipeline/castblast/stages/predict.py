"""Answer at once from the chosen network: values, 95 % bands, and what lies outside its domain.

Imports NumPy and light modules only, so that the command line answers in well under a second.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from castblast.errors import SpecError, nearest_name
from castblast.export.json_file import read_network
from castblast.network import (
    DomainViolation,
    Floats,
    Network,
    RowPredictions,
    domain_violations,
    explosive_index,
    member_spread,
    predict_rows,
)
from castblast.resources import resource
from castblast.variables import INPUT_NAMES, STEMMING_RATIO, VARIABLES

#: Green, amber, red: in the domain; every value and rule kept but unusual together; beyond them.
Domain = Literal["inside", "unusual", "outside"]
#: Networks that come with castblast by the recipe of their dataset; the first is taken by default.
SHIPPED_NETWORKS = {
    "full": "models/chosen/network.json",
    "paper": "models/chosen/paper/network.json",
}


@dataclass(frozen=True)
class Prediction:
    """One answer: a document in SI units and the same for people."""

    document: dict[str, Any]
    title: str
    rows: list[tuple[str, str, str, str]]
    remarks: list[str]


def load_network(path: Path | None = None) -> Network:
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
    if name not in SHIPPED_NETWORKS or Path(name).exists():
        return read_network(Path(name))
    return read_network(resource(SHIPPED_NETWORKS[name]))


def predict(
    values: Mapping[str, float], explosive: str, network: Path | Network | None = None
) -> dict[str, Any]:
    """Predict one design.

    Parameters
    ----------
    values : mapping of input name to float [SI]
        What is missing takes the defaults of `castblast.variables`; the charge fills what the
        stemming leaves, 0.7 burden unless given.
    explosive : str
    network : path or Network, optional

    Returns
    -------
    dict
        Every output by name [SI]; ``bands`` (lower, upper and relative half-width per output),
        ``spread`` of the members if there are any, ``display``, ``inputs`` used. Then
        ``in_domain``; ``domain``: inside, unusual (only the joint density objects) or outside;
        ``out_of_domain`` (names), ``domain_faults`` and ``domain_kinds`` (one each);
        ``density_score``, at most 1 inside, None where the network has none.

    Raises
    ------
    SpecError
        Unknown names or explosive, values that are not plausible, no room for a charge.
    """
    model = network if isinstance(network, Network) else load_network(network)
    inputs = complete_inputs(values, model)
    violations = domain_violations(model, inputs) + _unused(values, inputs, model)
    numeric = np.array([[inputs[name] for name in model.input_names]])
    index = np.array([explosive_index(model, explosive)], dtype=np.int64)
    row = predict_rows(model, numeric, index)
    outputs = dict(zip(model.output_names, row.values[0].tolist(), strict=True))
    score = float(row.score[0])
    return {
        "explosive": explosive,
        **outputs,
        "bands": _bands(model, row),
        **_spread(model, numeric, index),
        "display": {column.name: column.show(outputs[column.name]) for column in model.outputs},
        "inputs": inputs,
        "in_domain": not violations,
        "domain": _verdict(violations),
        "out_of_domain": list(dict.fromkeys(n for v in violations for n in v.inputs)),
        "domain_faults": [violation.message for violation in violations],
        "domain_kinds": [violation.kind for violation in violations],
        "density_score": score if math.isfinite(score) else None,
        "model": _identity(model),
    }


def _bands(model: Network, row: RowPredictions) -> dict[str, dict[str, float]]:
    """Ends of the 95 % bands of one row."""
    return {
        column.name: {
            "lower": float(row.lower[0, j]),
            "upper": float(row.upper[0, j]),
            "relative": column.relative_band,
        }
        for j, column in enumerate(model.outputs)
    }


def _spread(model: Network, numeric: Floats, index: NDArray[np.int64]) -> dict[str, Any]:
    """Relative spread of the members of an ensemble, if the network has any."""
    if not model.members:
        return {}
    spread = member_spread(model, numeric, index)[0]
    return {"spread": dict(zip(model.output_names, spread.tolist(), strict=True))}


def _verdict(violations: Sequence[DomainViolation]) -> Domain:
    """Inside; unusual where only the joint density objects; else outside."""
    if not violations:
        return "inside"
    return "unusual" if {violation.kind for violation in violations} == {"density"} else "outside"


def predict_design(
    values: Mapping[str, Any], explosive: str, network: Path | None = None
) -> Prediction:
    """Predict one design written with units, such as ``{"burden": "3 m"}``; see `predict`."""
    from castblast.specs.case import parse_values

    model = load_network(network)
    document = predict(parse_values(values, "predict"), explosive, model)
    rows = [_row(model, name, document) for name in model.output_names]
    shown = ", ".join(f"{c.name} {c.show(document['inputs'][c.name])}" for c in model.inputs)
    remarks = [f"inputs: {shown}"]
    lead = "unusual among" if document["domain"] == "unusual" else "outside"
    remarks += [f"{lead} the training data: {line}" for line in document["domain_faults"]]
    score = document["density_score"]
    if score is not None and document["in_domain"]:
        remarks.append(f"inside the training data: density score {score:.2f}, the limit is 1")
    return Prediction(document, f"{explosive}, {document['model']['name']}", rows, remarks)


def _row(model: Network, name: str, document: Mapping[str, Any]) -> tuple[str, str, str, str]:
    column = model.outputs[model.output_names.index(name)]
    variable = VARIABLES[name]
    band = document["bands"][name]
    low, high = (band[side] * variable.display_factor for side in ("lower", "upper"))
    value = document[name] * variable.display_factor
    # One figure more than the band resolves.
    digits = max(3, min(6, 1 - math.floor(math.log10(max(column.relative_band, 1e-6))) + 1))
    low_high = f"{low:.{digits}g} to {high:.{digits}g}"
    if document["domain"] == "outside":
        low_high = "unknown: outside the training data"
    elif document["domain"] == "unusual":
        low_high += " (unusual design)"
    return (name.replace("_", " "), f"{value:.{digits}g}", low_high, variable.shown_unit)


def complete_inputs(values: Mapping[str, float], network: Network) -> dict[str, float]:
    """Fill in what a network needs from what is given and the defaults.

    Raises
    ------
    SpecError
        All faults at once: unknown names, implausible values, no room for a charge.
    """
    faults = [
        f"{name}: no such input{nearest_name(name, INPUT_NAMES)}"
        for name in values
        if name not in INPUT_NAMES
    ]
    for name, value in values.items():
        if name in INPUT_NAMES and not _plausible(name, value):
            variable = VARIABLES[name]
            allowed = f"{variable.show(variable.lower)} to {variable.show(variable.upper)}"
            faults.append(f"{name}: {variable.show(value)} is implausible; allowed: {allowed}")
    if faults:
        raise SpecError("\n".join(faults))
    full: dict[str, float] = {n: v.default for n, v in VARIABLES.items() if v.default is not None}
    full.update({name: float(value) for name, value in values.items()})
    if "charge_length" not in full:
        full.setdefault("stemming_length", STEMMING_RATIO * full["burden"])
        full["charge_length"] = full["bench_height"] - full["stemming_length"]
    full.setdefault("stemming_length", full["bench_height"] - full["charge_length"])
    full.setdefault("spacing", full["burden"])
    full.setdefault("charge_diameter", full["hole_diameter"])
    _require_room(full)
    missing = [name for name in network.input_names if name not in full]
    if missing:
        raise SpecError("\n".join(f"{name}: must be given, it has no default" for name in missing))
    return {name: full[name] for name in network.input_names}


def _plausible(name: str, value: float) -> bool:
    # The same rounding margin as for values with units: 60 deg must pass a bound of 60 deg.
    variable = VARIABLES[name]
    margin = 1e-12 * max(abs(variable.lower), abs(variable.upper))
    return variable.lower - margin <= value <= variable.upper + margin


def _require_room(full: Mapping[str, float]) -> None:
    """Refuse a bench that cannot hold stemming and charge."""
    shown = {n: VARIABLES[n].show(full[n]) for n in ("bench_height", "charge_length",
                                                     "stemming_length")}  # fmt: skip
    if full["charge_length"] < VARIABLES["charge_length"].lower:
        message = (
            f"bench_height {shown['bench_height']} leaves no room for a charge above a "
            f"stemming_length of {shown['stemming_length']}"
        )
        raise SpecError(message)
    if full["charge_length"] > full["bench_height"]:
        message = (
            f"charge_length {shown['charge_length']} does not fit a bench_height of "
            f"{shown['bench_height']}"
        )
        raise SpecError(message)


def _unused(
    values: Mapping[str, float], inputs: Mapping[str, float], network: Network
) -> list[DomainViolation]:
    """Given inputs that the network cannot see and that differ from what it was trained at."""
    violations = []
    held = {n: v.default for n, v in VARIABLES.items() if v.default is not None}
    held |= network.provenance.get("held_inputs", {})
    tied = {"spacing": "burden", "charge_diameter": "hole_diameter"}
    for name, value in values.items():
        if name in inputs:
            continue
        if name == "stemming_length" and {"bench_height", "charge_length"} <= set(inputs):
            expected: float | None = inputs["bench_height"] - inputs["charge_length"]
        elif tied.get(name) in inputs:
            expected = inputs[tied[name]]
        else:
            expected = held.get(name)
        if expected is not None and math.isclose(value, expected, rel_tol=1e-9, abs_tol=1e-12):
            continue
        variable = VARIABLES[name]
        trained = "" if expected is None else f", trained at {variable.show(expected)}"
        message = f"{name} = {variable.show(value)}: has no effect in this network{trained}"
        violations.append(DomainViolation((name,), message, "unseen"))
    return violations


def _identity(network: Network) -> dict[str, Any]:
    """Name of the model and of the data it comes from."""
    spec = network.provenance.get("spec", {})
    dataset = network.provenance.get("dataset", {})
    return {
        "name": spec.get("name", "network") if isinstance(spec, Mapping) else "network",
        "dataset": f"{dataset.get('name', '?')} {dataset.get('dataset_version', '')}".strip(),
        "content_sha256": dataset.get("content_sha256"),
    }
