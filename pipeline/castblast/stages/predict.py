"""Answer at once from the chosen network: values, 95 % bands, and what lies outside its domain.

Imports NumPy and light modules only, so that the command line answers in well under a second.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from castblast.errors import SpecError, nearest_name
from castblast.export.json_file import read_network
from castblast.network import DomainViolation, Network, domain_violations, evaluate
from castblast.resources import resource
from castblast.variables import INPUT_NAMES, STEMMING_RATIO, VARIABLES

#: The network that comes with castblast.
CHOSEN_NETWORK = "models/chosen/network.json"


@dataclass(frozen=True)
class Prediction:
    """One answer: a document in SI units and the same for people."""

    document: dict[str, Any]
    title: str
    rows: list[tuple[str, str, str, str]]
    remarks: list[str]


def load_network(path: Path | None = None) -> Network:
    """Read a network; without a path the one that comes with castblast.

    Raises
    ------
    SpecError
        Missing or unusable file.
    """
    return read_network(resource(CHOSEN_NETWORK) if path is None else path)


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
        ``display``, ``inputs`` used, ``in_domain``, ``out_of_domain`` (names) and
        ``domain_faults`` (one line each).

    Raises
    ------
    SpecError
        Unknown names or explosive, values that are not plausible, no room for a charge.
    """
    model = network if isinstance(network, Network) else load_network(network)
    inputs = complete_inputs(values, model)
    violations = domain_violations(model, inputs) + _unused(values, inputs, model)
    outputs = {name: float(v) for name, v in evaluate(model, inputs, explosive).items()}
    bands = {}
    for column in model.outputs:
        value, half = outputs[column.name], column.relative_band
        low, high = sorted((value * (1.0 - half), value * (1.0 + half)))
        bands[column.name] = {"lower": low, "upper": high, "relative": half}
    return {
        "explosive": explosive,
        **outputs,
        "bands": bands,
        "display": {column.name: column.show(outputs[column.name]) for column in model.outputs},
        "inputs": inputs,
        "in_domain": not violations,
        "out_of_domain": list(dict.fromkeys(n for v in violations for n in v.inputs)),
        "domain_faults": [violation.message for violation in violations],
        "model": _identity(model),
    }


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
    remarks += [f"outside the training data: {line}" for line in document["domain_faults"]]
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
    if not document["in_domain"]:
        low_high = "unknown: outside the training data"
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
        violations.append(DomainViolation((name,), message))
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
