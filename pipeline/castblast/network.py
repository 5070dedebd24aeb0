"""A fitted surrogate as plain numbers: the one record that every export and `predict` reads.

A `Network` is a scaled feed-forward map from numeric inputs and one named explosive to named
outputs, together with what is needed to use it honestly elsewhere: units, the domain of its
training rows, a 95 % error band per output, golden rows to test a copy against, and where it came
from. It knows no training library; NumPy alone evaluates it.

The map: each numeric input is logged if its column says so, then standardised; the code of the
explosive (one-hot, or any other row of numbers) is appended; dense layers follow; each output is
un-standardised and, if its column says so, exponentiated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from castblast.errors import SpecError, nearest_name
from castblast.variables import VARIABLES

Floats: TypeAlias = NDArray[np.float64]
Transform = Literal["linear", "log"]
Activation = Literal["identity", "tanh", "relu", "logistic"]

#: Written into every file; a reader refuses another major layout.
SCHEMA_VERSION = 1


def _logistic(x: Floats) -> Floats:
    # Two forms, so that neither overflows.
    small = np.exp(-np.abs(x))
    result: Floats = np.where(x >= 0.0, 1.0, small) / (1.0 + small)
    return result


_ACTIVATIONS: dict[str, Callable[[Floats], Floats]] = {
    "identity": lambda x: x,
    "tanh": np.tanh,
    "relu": lambda x: np.maximum(x, 0.0),
    "logistic": _logistic,
}


@dataclass(frozen=True)
class Column:
    """One numeric column and its scaling.

    Attributes
    ----------
    name : str
        Name in `castblast.variables`.
    unit : str
        SI unit.
    transform : {"linear", "log"}
        Applied before the scaling; "log" is the natural logarithm of the SI value.
    mean, scale : float
        Scaled value = (transformed value - mean) / scale; `scale` is positive.
    """

    name: str
    unit: str
    transform: Transform
    mean: float
    scale: float

    def show(self, value: float) -> str:
        """Format an SI value of this column in the unit that people use."""
        if self.name in VARIABLES:
            return VARIABLES[self.name].show(value)
        return f"{value:.6g} {self.unit}".removesuffix(" 1")


@dataclass(frozen=True)
class InputColumn(Column):
    """A numeric input; `lower` and `upper` are its least and greatest training value (SI)."""

    lower: float
    upper: float


@dataclass(frozen=True)
class OutputColumn(Column):
    """An output; 95 % of truths lie within `relative_band` of the prediction, relative to it."""

    relative_band: float


@dataclass(frozen=True, eq=False)
class Layer:
    """Dense layer: activation(x @ weights + biases), weights (n_in, n_out), biases (n_out,)."""

    weights: Floats
    biases: Floats
    activation: Activation


@dataclass(frozen=True)
class Constraint:
    """Linear rule of the domain on SI inputs: sum(coefficient * input) >= lower.

    `label` says it in words; `unit` is the unit of the sum.
    """

    label: str
    coefficients: Mapping[str, float]
    lower: float
    unit: str = "1"

    def margin(self, row: Mapping[str, Any]) -> Any:
        """Sum less its lower bound; negative where the rule is broken. Broadcasts."""
        return sum(c * row[name] for name, c in self.coefficients.items()) - self.lower


@dataclass(frozen=True, eq=False)
class GoldenRows:
    """Rows with the answers of the fitted estimator itself, to test every copy against.

    Attributes
    ----------
    inputs : (n, k) SI
    explosives : (n,) names
    outputs : (n, m) SI
    """

    inputs: Floats
    explosives: tuple[str, ...]
    outputs: Floats


class DomainViolation(NamedTuple):
    """One reason why a row lies outside the training domain."""

    inputs: tuple[str, ...]
    message: str


@dataclass(frozen=True, eq=False)
class Network:
    """Scaled feed-forward surrogate with its units, domain, error band and provenance.

    Attributes
    ----------
    inputs : tuple of InputColumn, k of them
    explosives : tuple of str
        Names the network knows, in the order of `codes`.
    codes : (len(explosives), c)
        What enters the first layer for each explosive; the identity matrix is one-hot.
    layers : tuple of Layer
        The first takes k + c values, the last gives one per output.
    outputs : tuple of OutputColumn
    constraints : tuple of Constraint
        Rules of the domain beside the box of the inputs.
    golden : GoldenRows
    provenance : mapping
        Dataset, recipe, spec, scores and version; plain JSON values.
    schema_version : int
    """

    inputs: tuple[InputColumn, ...]
    explosives: tuple[str, ...]
    codes: Floats
    layers: tuple[Layer, ...]
    outputs: tuple[OutputColumn, ...]
    constraints: tuple[Constraint, ...]
    golden: GoldenRows
    provenance: Mapping[str, Any] = field(default_factory=dict)
    schema_version: int = SCHEMA_VERSION

    def __post_init__(self) -> None:
        faults = _faults(self)
        if faults:
            raise SpecError("\n".join(f"network: {fault}" for fault in faults))

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the numeric inputs, in order."""
        return tuple(column.name for column in self.inputs)

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs, in order."""
        return tuple(column.name for column in self.outputs)

    @property
    def parameter_count(self) -> int:
        """Number of weights and biases."""
        return sum(layer.weights.size + layer.biases.size for layer in self.layers)


def _faults(network: Network) -> list[str]:
    """Everything that makes a network unusable."""
    faults = []
    columns: tuple[Column, ...] = network.inputs + network.outputs
    if network.schema_version != SCHEMA_VERSION:
        faults.append(f"schema version {network.schema_version}, this one reads {SCHEMA_VERSION}")
    if not (network.inputs and network.outputs and network.layers and network.explosives):
        faults.append("needs at least one input, output, layer and explosive")
    names = [column.name for column in columns]
    if len(set(names)) != len(names) or len(set(network.explosives)) != len(network.explosives):
        faults.append("a name appears twice")
    for column in columns:
        if column.transform not in get_args(Transform):
            faults.append(f"{column.name}: unknown transform '{column.transform}'")
        if not (np.isfinite(column.mean) and np.isfinite(column.scale) and column.scale > 0.0):
            faults.append(f"{column.name}: mean and scale must be finite, scale above 0")
    for entry in network.inputs:
        least = 0.0 if entry.transform == "log" else -np.inf
        if not least < entry.lower <= entry.upper < np.inf:
            faults.append(f"{entry.name}: domain {entry.lower!r} to {entry.upper!r} is no range")
    faults += [
        f"{column.name}: the error band must be finite and not negative"
        for column in network.outputs
        if not 0.0 <= column.relative_band < np.inf
    ]
    faults += [
        f"rule '{rule.label}': no input '{name}'"
        for rule in network.constraints
        for name in rule.coefficients
        if name not in network.input_names
    ]
    return faults + _shape_faults(network)


def _shape_faults(network: Network) -> list[str]:
    faults = []
    if network.codes.ndim != 2 or len(network.codes) != len(network.explosives):
        faults.append("one row of codes per explosive is needed")
        return faults
    width = len(network.inputs) + network.codes.shape[1]
    for number, layer in enumerate(network.layers, 1):
        if layer.activation not in _ACTIVATIONS:
            faults.append(f"layer {number}: unknown activation '{layer.activation}'")
        if layer.weights.ndim != 2 or layer.weights.shape[0] != width:
            shape = layer.weights.shape
            return [*faults, f"layer {number}: weights {shape} do not take {width} values"]
        width = layer.weights.shape[1]
        if layer.biases.shape != (width,):
            faults.append(f"layer {number}: {layer.biases.shape} biases for {width} nodes")
        if not (np.isfinite(layer.weights).all() and np.isfinite(layer.biases).all()):
            faults.append(f"layer {number}: weights and biases must be finite")
    if width != len(network.outputs):
        faults.append(f"the last layer gives {width} values for {len(network.outputs)} outputs")
    rows, golden = len(network.golden.explosives), network.golden
    if golden.inputs.shape != (rows, len(network.inputs)) or (
        golden.outputs.shape != (rows, len(network.outputs))
    ):
        faults.append("golden rows do not have the shape of the inputs and outputs")
    if not set(golden.explosives) <= set(network.explosives):
        faults.append("golden rows name an unknown explosive")
    return faults


def explosive_index(network: Network, name: str) -> int:
    """Position of an explosive in the codes.

    Raises
    ------
    SpecError
        The network was not trained on it; the message lists those it knows.
    """
    if name not in network.explosives:
        hint = nearest_name(name, network.explosives)
        known = ", ".join(network.explosives)
        message = f"explosive '{name}': this network does not know it{hint} (it knows {known})"
        raise SpecError(message)
    return network.explosives.index(name)


def evaluate_rows(network: Network, numeric: Floats, index: NDArray[np.int64]) -> Floats:
    """Evaluate rows of SI inputs.

    Parameters
    ----------
    numeric : (n, k) float64, SI, columns as `network.inputs`
        A value of 0 or below in a log column gives NaN or 0, never an exception.
    index : (n,) int64
        Position of each row's explosive.

    Returns
    -------
    (n, m) float64, SI, columns as `network.outputs`
    """
    logged = np.array([column.transform == "log" for column in network.inputs])
    mean = np.array([column.mean for column in network.inputs])
    scale = np.array([column.scale for column in network.inputs])
    x: Floats = numeric.astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        x[:, logged] = np.log(x[:, logged])
        x = np.concatenate([(x - mean) / scale, network.codes[index]], axis=1)
        for layer in network.layers:
            x = _ACTIVATIONS[layer.activation](x @ layer.weights + layer.biases)
        x = x * np.array([c.scale for c in network.outputs])
        x = x + np.array([c.mean for c in network.outputs])
        logged = np.array([column.transform == "log" for column in network.outputs])
        x[:, logged] = np.exp(x[:, logged])
    return x


def evaluate(
    network: Network, values: Mapping[str, ArrayLike], explosive: str | Sequence[str]
) -> dict[str, Floats]:
    """Evaluate a network on named SI inputs.

    Parameters
    ----------
    network : Network
    values : mapping of input name to number or array [SI]
        Exactly the inputs of the network; arrays broadcast against each other.
    explosive : str or sequence of str
        One name for all rows, or one per row (values then broadcast to that many rows).

    Returns
    -------
    dict of output name to array [SI]
        Each of the broadcast shape (0-d for plain numbers).

    Raises
    ------
    SpecError
        A missing or unknown input, or an explosive the network does not know; all at once.
    """
    names = network.input_names
    faults = [f"{name}: missing, this network needs it" for name in names if name not in values]
    faults += [f"{name}: no input of this network{nearest_name(name, names)}"
               for name in values if name not in names]  # fmt: skip
    if faults:
        raise SpecError("\n".join(faults))
    if isinstance(explosive, str):
        index = np.asarray(explosive_index(network, explosive))
    else:
        index = np.array([explosive_index(network, name) for name in explosive], dtype=np.int64)
    arrays = [np.asarray(values[name], dtype=np.float64) for name in names]
    *columns, index = np.broadcast_arrays(*arrays, index)
    numeric = np.stack([column.ravel() for column in columns], axis=1)
    result = evaluate_rows(network, numeric, index.ravel())
    return {name: result[:, j].reshape(index.shape) for j, name in enumerate(network.output_names)}


def in_domain(network: Network, numeric: Floats) -> NDArray[np.bool_]:
    """Tell for each row of SI inputs (n, k) whether it lies in the domain; NaN does not."""
    lower = np.array([column.lower for column in network.inputs])
    upper = np.array([column.upper for column in network.inputs])
    inside: NDArray[np.bool_] = np.all((numeric >= lower) & (numeric <= upper), axis=1)
    row = dict(zip(network.input_names, numeric.T, strict=True))
    for rule in network.constraints:
        inside &= rule.margin(row) >= 0.0
    return inside


def domain_violations(network: Network, row: Mapping[str, float]) -> list[DomainViolation]:
    """Give every reason why one row of SI inputs lies outside the training domain.

    Returns
    -------
    list of DomainViolation
        The inputs at fault and a line with value and range in display units; empty if inside.
    """
    violations = []
    for column in network.inputs:
        value = float(row[column.name])
        if not column.lower <= value <= column.upper:
            trained = f"{column.show(column.lower)} to {column.show(column.upper)}"
            message = f"{column.name} = {column.show(value)}: trained on {trained}"
            violations.append(DomainViolation((column.name,), message))
    shown = {column.name: column.show(float(row[column.name])) for column in network.inputs}
    for rule in network.constraints:
        # Written so that NaN breaks the rule, as in `in_domain`.
        if not rule.margin(row) >= 0.0:
            values = ", ".join(f"{name} = {shown[name]}" for name in rule.coefficients)
            message = f"{values}: trained on {rule.label}"
            violations.append(DomainViolation(tuple(rule.coefficients), message))
    return violations


def domain_faults(network: Network, row: Mapping[str, float]) -> list[str]:
    """Messages of `domain_violations`."""
    return [violation.message for violation in domain_violations(network, row)]
