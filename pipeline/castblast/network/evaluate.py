"""Values of a network: for rows of numbers, for named inputs, with band and domain."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from castblast.bands import prediction_factor
from castblast.errors import SpecError, nearest_name
from castblast.network.domain import density_score, in_domain, scale_columns
from castblast.network.parts import Layer
from castblast.network.record import Network, Shell
from castblast.types import BoolArray, FloatArray, IntArray


def _logistic(x: FloatArray) -> FloatArray:
    # Two forms, so that neither overflows.
    small = np.exp(-np.abs(x))
    result: FloatArray = np.where(x >= 0.0, 1.0, small) / (1.0 + small)
    return result


_ACTIVATIONS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "identity": lambda x: x,
    "tanh": np.tanh,
    "relu": lambda x: np.maximum(x, 0.0),
    "logistic": _logistic,
    "silu": lambda x: x * _logistic(x),
}


#: Turns SI inputs (n, k) and positions of explosives (n,) into outputs (n, m) in SI.
Evaluate: TypeAlias = Callable[[FloatArray, IntArray], FloatArray]


class Bounds(NamedTuple):
    """Ends of a band of n rows, (n, m) [SI]."""

    lower: FloatArray
    upper: FloatArray


class RowPredictions(NamedTuple):
    """Answers for n rows.

    Attributes
    ----------
    values : (n, m) [SI]
    prediction : Bounds
        Where the blast is expected, see `castblast.bands`; NaN for outputs without a prior.
    network : Bounds
        Where the physics model is expected: the 95 % band of the network. Both bands are meant for
        rows inside the domain.
    score : (n,)
        Joint density score, at most 1 inside; NaN if the network has none.
    inside : (n,) bool
        Box, rules and density together.
    """

    values: FloatArray
    prediction: Bounds
    network: Bounds
    score: FloatArray
    inside: BoolArray


def explosive_index(shell: Shell, name: str) -> int:
    """Position of an explosive in the codes.

    Raises
    ------
    SpecError
        The network was not trained on it; the message lists those it knows.
    """
    if name not in shell.explosives:
        hint = nearest_name(name, shell.explosives)
        known = ", ".join(shell.explosives)
        message = f"explosive '{name}': this network does not know it{hint} (it knows {known})"
        raise SpecError(message)
    return shell.explosives.index(name)


def scaled_inputs(shell: Shell, numeric: FloatArray, index: IntArray) -> FloatArray:
    """What enters the first layer: scaled inputs, scaled derived columns, codes; (n, k + d + c)."""
    parts = [scale_columns(numeric, shell.inputs)]
    if shell.derived:
        with np.errstate(invalid="ignore"):
            combined = numeric @ derived_matrix(shell)
        parts.append(scale_columns(combined, shell.derived))
    return np.concatenate([*parts, shell.codes[index]], axis=1)


def derived_matrix(shell: Shell) -> FloatArray:
    """Coefficients (k, d): numeric inputs @ matrix = derived columns, both SI."""
    return np.array(
        [
            [column.coefficients.get(name, 0.0) for column in shell.derived]
            for name in shell.input_names
        ],
        dtype=np.float64,
    )


def evaluate_rows(network: Network, numeric: FloatArray, index: IntArray) -> FloatArray:
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
    return _run(network, network.layers, scaled_inputs(network, numeric, index))


def run_layers(layers: Sequence[Layer], x: FloatArray) -> FloatArray:
    """Rows (n, k) that are scaled already through a chain of layers."""
    with np.errstate(invalid="ignore", over="ignore"):
        for layer in layers:
            x = _ACTIVATIONS[layer.activation](x @ layer.weights + layer.biases)
    return x


def _run(network: Network, layers: Sequence[Layer], x: FloatArray) -> FloatArray:
    """Scaled rows through a chain of layers to outputs in SI."""
    x = run_layers(layers, x)
    with np.errstate(invalid="ignore", over="ignore"):
        x = x * np.array([c.scale for c in network.outputs])
        x = x + np.array([c.mean for c in network.outputs])
        logged = np.array([column.transform == "log" for column in network.outputs])
        x[:, logged] = np.exp(x[:, logged])
    return x


def member_spread(network: Network, numeric: FloatArray, index: IntArray) -> FloatArray:
    """Relative standard deviation over the network and its members, (n, m).

    Of the outputs of all, over the absolute value of the network itself; NaN without members.
    """
    x = scaled_inputs(network, numeric, index)
    chains = (network.layers, *network.members)
    answers = np.stack([_run(network, layers, x) for layers in chains])
    if not network.members:
        return np.full(answers.shape[1:], np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.std(answers, axis=0, ddof=1) / np.abs(answers[0]))


def predict_rows(network: Network, numeric: FloatArray, index: IntArray) -> RowPredictions:
    """Evaluate rows of SI inputs with bands and domain; parameters as `evaluate_rows`."""
    return answer_rows(network, numeric, evaluate_rows(network, numeric, index))


def answer_rows(shell: Shell, numeric: FloatArray, values: FloatArray) -> RowPredictions:
    """Bands and domain about the outputs (n, m) of a model of any shape for rows (n, k); SI."""
    score = density_score(shell, numeric)
    return RowPredictions(
        values=values,
        prediction=prediction_bounds(shell, values),
        network=network_bounds(shell, values),
        score=score,
        inside=in_domain(shell, numeric, score),
    )


def network_bounds(shell: Shell, values: FloatArray) -> Bounds:
    """Ends of the 95 % bands of a network about its outputs (n, m) in SI."""
    half = np.abs(values) * np.array([column.relative_band for column in shell.outputs])
    with np.errstate(invalid="ignore"):
        return Bounds(values - half, values + half)


def prediction_bounds(shell: Shell, values: FloatArray) -> Bounds:
    """Ends of the prediction bands about outputs (n, m) in SI, the error of the network included.

    NaN for outputs without a prior; values below zero have their ends in order.
    """
    less, more = (np.array(factors) for factors in zip(*prediction_factors(shell), strict=True))
    with np.errstate(over="ignore", invalid="ignore"):
        lower, upper = values * less, values * more
        if (values < 0.0).any():
            lower, upper = np.minimum(lower, upper), np.maximum(lower, upper)
    return Bounds(lower, upper)


def prediction_factors(shell: Shell) -> list[tuple[float, float]]:
    """Ends of the prediction band over the value, for each output of a network."""
    factors = [prediction_factor(c.name, c.relative_band) for c in shell.outputs]
    return [(1.0 / factor, factor) for factor in factors]


def evaluate(
    network: Network, values: Mapping[str, ArrayLike], explosive: str | Sequence[str]
) -> dict[str, FloatArray]:
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
