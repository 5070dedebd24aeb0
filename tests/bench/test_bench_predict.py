"""Speed of the shipped network: one design and a batch, against scikit-learn in the same run."""

import numpy as np
import pytest
from sklearn.neural_network import MLPRegressor

from castblast.network import evaluate
from castblast.prediction.answer import complete_inputs, load_network

NETWORK = load_network()
DESIGN = complete_inputs({}, NETWORK)
BATCH = {
    column.name: np.random.default_rng(1).uniform(column.lower, column.upper, 100_000)
    for column in NETWORK.inputs
}


@pytest.mark.benchmark(group="one design")
def test_network_single(benchmark) -> None:
    benchmark(evaluate, NETWORK, DESIGN, "anfo")


@pytest.mark.benchmark(group="one design")
def test_sklearn_single(benchmark) -> None:
    """A scikit-learn network of the reference's size, for the ratio."""
    rows = np.random.default_rng(0).normal(size=(200, 10))
    model = MLPRegressor(hidden_layer_sizes=(7, 7, 7), activation="tanh", max_iter=20)
    model.fit(rows, rows[:, :4])
    benchmark(model.predict, rows[:1])


@pytest.mark.benchmark(group="100,000 designs")
def test_network_batch(benchmark) -> None:
    benchmark(evaluate, NETWORK, BATCH, "anfo")
