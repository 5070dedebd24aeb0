"""Networks in torch: maps that are known, folding, seeds, and what is put back afterwards."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from castblast.network import run_layers  # noqa: E402
from castblast.surrogate.fitting.families.torch_mlp import (  # noqa: E402
    Schedule,
    TorchMlp,
    TorchRegressor,
    dense_chain,
    determined,
    train_module,
)

ROWS = np.random.default_rng(0).standard_normal((200, 3))
ROWS.flags.writeable = False


@pytest.mark.parametrize("tolerance", [1e-10, 0.0])
@pytest.mark.parametrize("seed", [0, 1, 43, 47, 371])
def test_a_linear_layer_reaches_least_squares(seed: int, tolerance: float) -> None:
    """L-BFGS on one dense layer ends at the optimum of linear least squares, and knows it.

    From the last three starts, or if no slope is asked for, the loss stands still at its rounding
    floor before the slope has come down to the tolerance: it went round there until the limit.
    """
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((200, 3))
    noisy = rows @ rng.standard_normal((3, 2)) + 0.1 * rng.standard_normal((200, 2))
    exact, *_ = np.linalg.lstsq(np.column_stack([rows, np.ones(200)]), noisy, rcond=None)
    with determined(seed):
        module = torch.nn.Sequential(torch.nn.Linear(3, 2, dtype=torch.float64))
    schedule = Schedule(adam_epochs=2, max_iterations=200, tolerance=tolerance)
    training = train_module(module, rows, noisy, schedule, seed=0)
    (layer,) = dense_chain(module) or ()
    assert training.converged
    assert training.iterations < 50
    np.testing.assert_allclose(np.vstack([layer.weights, layer.biases]), exact, atol=1e-8)


@pytest.mark.parametrize("activation", ["tanh", "silu", "relu", "logistic"])
def test_layers_are_the_module(activation) -> None:
    """The chain of a trained module gives what the module gives."""
    model = TorchMlp((5, 4), activation, adam_epochs=3, max_iterations=20)
    targets = np.stack([np.sin(ROWS[:, 0]), ROWS[:, 1] ** 2], axis=1)
    kind = {"tanh": torch.nn.Tanh, "silu": torch.nn.SiLU, "relu": torch.nn.ReLU}
    hidden = kind.get(activation, torch.nn.Sigmoid)()
    module = torch.nn.Sequential(torch.nn.Linear(3, 5), hidden, torch.nn.Linear(5, 2))
    trained = TorchRegressor(module, Schedule(adam_epochs=3, max_iterations=20))
    trained.fit(ROWS, targets)
    direct = trained.module_(torch.tensor(ROWS)).detach().numpy()
    np.testing.assert_allclose(run_layers(trained.layers_, ROWS), direct, rtol=1e-12, atol=1e-14)
    assert np.mean((model.fit(ROWS, targets).predict(ROWS) - targets) ** 2) < np.var(targets)


def test_members_are_averaged_exactly() -> None:
    target = np.sin(ROWS[:, :1])
    quick = {"hidden_layers": (4,), "adam_epochs": 2, "max_iterations": 10}
    both = TorchMlp(**quick, members=2).fit(ROWS, target).predict(ROWS)
    single = [
        TorchMlp(**quick, random_state=seed).fit(ROWS, target).predict(ROWS) for seed in (0, 1000)
    ]
    np.testing.assert_allclose(both, np.mean(single, axis=0), rtol=1e-12, atol=1e-14)


def test_networks_per_category_know_their_rows_only() -> None:
    """Other rows of category 1 change nothing for category 0."""
    code = np.eye(2)[np.arange(200) % 2]
    target = np.sin(ROWS[:, :1])
    model = TorchMlp((4,), adam_epochs=2, max_iterations=10, categories=2)
    first = model.fit(np.hstack([ROWS, code]), target).predict(np.hstack([ROWS, code]))
    target[1::2] = 5.0
    second = model.fit(np.hstack([ROWS, code]), target).predict(np.hstack([ROWS, code]))
    np.testing.assert_array_equal(first[::2], second[::2])
    assert np.abs(first[1::2] - second[1::2]).max() > 1.0


def test_seed_decides_and_global_state_is_put_back() -> None:
    torch.manual_seed(7)
    expected = torch.rand(3)
    torch.manual_seed(7)
    threads = torch.get_num_threads()
    fits = [
        TorchMlp((4,), adam_epochs=2, max_iterations=5, random_state=s).fit(ROWS, ROWS[:, 0])
        for s in (0, 0, 1)
    ]
    answers = [fit.predict(ROWS) for fit in fits]
    np.testing.assert_array_equal(answers[0], answers[1])
    assert np.abs(answers[0] - answers[2]).max() > 0.0
    assert torch.get_num_threads() == threads
    assert not torch.are_deterministic_algorithms_enabled()
    assert torch.equal(torch.rand(3), expected)


def test_a_watch_sees_the_network_grow_and_may_end_it() -> None:
    errors = []

    def watch(predict) -> None:
        errors.append(float(np.mean((predict(ROWS) - ROWS[:, :1]) ** 2)))
        if len(errors) == 3:
            raise StopIteration

    with pytest.raises(StopIteration):
        TorchMlp((4,), adam_epochs=10, max_iterations=200, watch=watch).fit(ROWS, ROWS[:, :1])
    assert len(errors) == 3
    assert errors[2] < errors[0]


def test_what_is_no_plain_chain_has_no_layers() -> None:
    odd = torch.nn.Sequential(torch.nn.Linear(3, 4), torch.nn.Softplus(), torch.nn.Linear(4, 1))
    assert dense_chain(odd) is None
    assert dense_chain(torch.nn.Linear(3, 1)) is None
    assert dense_chain(torch.nn.Sequential(torch.nn.Tanh())) is None
