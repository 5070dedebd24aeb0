"""Chains of dense layers put together: side by side, averaged, or one for each explosive.

Whatever is put together is again one plain chain of dense layers, so that every export can carry
it. All chains that are joined have the same depth and the same activation at each depth.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from castblast.network import Activation, Layer
from castblast.types import FloatArray

Chain: TypeAlias = tuple[Layer, ...]

#: Added to what enters a node of an explosive that is not asked for: tanh is then -1 and silu,
#: relu and logistic are 0, beside anything they are added to. A power of two adds no rounding.
_SHUT = 128.0


def embed(chain: Chain, columns: Sequence[int], width: int) -> Chain:
    """Give a chain that takes `width` columns and looks at some of them only."""
    first = chain[0]
    weights = np.zeros((width, first.weights.shape[1]))
    weights[list(columns)] = first.weights
    return (Layer(weights, first.biases, first.activation), *chain[1:])


def side_by_side(chains: Sequence[Chain]) -> Chain:
    """Chains of the same inputs as one chain that gives the outputs of all, in order."""
    return tuple(
        Layer(
            np.hstack([layer.weights for layer in level]) if depth == 0 else _diagonal(level),
            np.concatenate([layer.biases for layer in level]),
            level[0].activation,
        )
        for depth, level in enumerate(_levels(chains))
    )


def mean_of(chains: Sequence[Chain]) -> Chain:
    """Chains of the same inputs and outputs as one chain that gives their mean."""
    joined = side_by_side(chains)
    last, count = joined[-1], len(chains)
    outputs = chains[0][-1].weights.shape[1]
    weights = last.weights.reshape(len(last.weights), count, outputs).mean(axis=1)
    biases = last.biases.reshape(count, outputs).mean(axis=0)
    return (*joined[:-1], Layer(weights, biases, last.activation))


def one_for_each(chains: Sequence[Chain]) -> Chain:
    """One chain for each category as one chain that takes a one-hot code as its last columns.

    Every node of the last hidden layer is shut unless its own category is asked for. The code
    reaches that layer through nodes that are shut or open with it. Shut tanh nodes give -1; what
    they add to the outputs is constant for each category and taken off again.

    Parameters
    ----------
    chains : sequence of chains, one for each category
        Of the columns without the code; with one hidden layer at least.
    """
    if len(chains[0]) == 1:
        message = "a chain without a hidden layer cannot be shut"
        raise ValueError(message)
    categories, hidden = len(chains), len(chains[0]) - 1
    joined = [*side_by_side(chains)]
    names = np.repeat(
        np.arange(categories), [chain[hidden - 1].weights.shape[1] for chain in chains]
    )
    other = (names[None, :] != np.arange(categories)[:, None]).astype(np.float64)
    carried = np.eye(categories)  # code -> what stands for it in front of the layer at hand
    offset = np.zeros(categories)
    layers: list[Layer] = []
    for depth, layer in enumerate(joined[:-1]):
        activation = layer.activation
        low, high = _ends(activation)
        weights = _stack(layer.weights, np.zeros((categories, layer.weights.shape[1])))
        biases = layer.biases
        if depth == hidden - 1:
            weights[-categories:] -= _SHUT * (carried @ other)
            biases = biases - _SHUT * (offset @ other)
        # The code goes on: one node for each category, at `high` if it is the one, else at `low`.
        push = _SHUT * np.eye(categories)
        middle = -0.5 * _SHUT
        code_weights = np.vstack([np.zeros((len(layer.weights), categories)), carried @ push])
        layers.append(
            Layer(
                np.hstack([weights, code_weights]),
                np.concatenate([biases, offset @ push + middle]),
                activation,
            )
        )
        carried = np.eye(categories) / (high - low)
        offset = np.full(categories, -low / (high - low))
    last = joined[-1]
    width = last.weights.shape[0]
    outputs = last.weights.shape[1] // categories
    summed = last.weights.reshape(width, categories, outputs).sum(axis=1)
    biases = last.biases.reshape(categories, outputs)
    low, _ = _ends(layers[-1].activation)
    shut = low * (other @ summed) if low else 0.0
    of_code = biases - shut
    layers.append(Layer(np.vstack([summed, carried @ of_code]), offset @ of_code, last.activation))
    return tuple(layers)


def _ends(activation: Activation) -> tuple[float, float]:
    """Values of a shut node and of an open node of a code, which takes half of `_SHUT`."""
    if activation == "tanh":
        return -1.0, 1.0
    return (0.0, 1.0) if activation == "logistic" else (0.0, 0.5 * _SHUT)


def _levels(chains: Sequence[Chain]) -> list[tuple[Layer, ...]]:
    levels = list(zip(*chains, strict=True))
    if any(len({layer.activation for layer in level}) > 1 for level in levels):
        message = "chains of different activations cannot be joined"
        raise ValueError(message)
    return levels


def _diagonal(level: Sequence[Layer]) -> FloatArray:
    rows = sum(layer.weights.shape[0] for layer in level)
    columns = sum(layer.weights.shape[1] for layer in level)
    joined = np.zeros((rows, columns))
    i = j = 0
    for layer in level:
        a, b = layer.weights.shape
        joined[i : i + a, j : j + b] = layer.weights
        i, j = i + a, j + b
    return joined


def _stack(above: FloatArray, below: FloatArray) -> FloatArray:
    return np.vstack([above, below])
