"""Chains of dense layers put together are the function that they are said to be."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest

from castblast.network import Activation, Layer, run_layers
from castblast.surrogate.fitting.families.chains import (
    Chain,
    embed,
    mean_of,
    one_for_each,
    side_by_side,
)

ACTIVATIONS = ("tanh", "silu", "relu", "logistic")


def random_chain(sizes: Sequence[int], activation: Activation, seed: int) -> Chain:
    rng = np.random.default_rng(seed)
    last = len(sizes) - 2
    return tuple(
        Layer(
            rng.standard_normal((a, b)),
            rng.standard_normal(b),
            "identity" if depth == last else activation,
        )
        for depth, (a, b) in enumerate(pairwise(sizes))
    )


ROWS = np.random.default_rng(1).standard_normal((40, 4))


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_side_by_side_gives_the_outputs_of_all(activation: Activation) -> None:
    chains = [random_chain([4, 5, 3, 1], activation, 0), random_chain([4, 2, 6, 2], activation, 1)]
    expected = np.hstack([run_layers(chain, ROWS) for chain in chains])
    np.testing.assert_allclose(run_layers(side_by_side(chains), ROWS), expected, rtol=1e-13)


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_the_mean_of_networks_is_one_network(activation: Activation) -> None:
    chains = [random_chain([4, 5, 3, 2], activation, seed) for seed in range(3)]
    expected = np.mean([run_layers(chain, ROWS) for chain in chains], axis=0)
    found = run_layers(mean_of(chains), ROWS)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("activation", ACTIVATIONS)
@pytest.mark.parametrize("hidden", [[5], [5, 4], [3, 4, 5]])
def test_a_network_for_each_category_is_one_network(
    activation: Activation, hidden: list[int]
) -> None:
    """Only the nodes of the category that the one-hot code names speak."""
    chains = [random_chain([4, *hidden, 2], activation, seed) for seed in range(3)]
    kinds = np.arange(len(ROWS)) % 3
    found = run_layers(one_for_each(chains), np.hstack([ROWS, np.eye(3)[kinds]]))
    every = np.stack([run_layers(chain, ROWS) for chain in chains])
    expected = every[kinds, np.arange(len(ROWS))]
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)


def test_a_chain_without_hidden_layer_cannot_be_shut() -> None:
    with pytest.raises(ValueError, match="hidden layer"):
        one_for_each([random_chain([4, 2], "tanh", seed) for seed in range(2)])


def test_chains_of_different_activations_are_not_joined() -> None:
    with pytest.raises(ValueError, match="different activations"):
        side_by_side([random_chain([4, 3, 1], "tanh", 0), random_chain([4, 3, 1], "silu", 0)])


def test_an_embedded_chain_ignores_the_other_columns() -> None:
    chain = random_chain([2, 3, 1], "tanh", 0)
    wide = embed(chain, [3, 1], 4)
    np.testing.assert_array_equal(run_layers(wide, ROWS), run_layers(chain, ROWS[:, [3, 1]]))
    moved = ROWS + np.array([5.0, 0.0, -2.0, 0.0])
    np.testing.assert_array_equal(run_layers(wide, moved), run_layers(wide, ROWS))
