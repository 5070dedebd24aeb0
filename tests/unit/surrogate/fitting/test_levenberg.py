"""Levenberg-Marquardt for small networks: problems whose least squares are known."""

import numpy as np
import pytest

from castblast.errors import SpecError
from castblast.network import Activation, run_layers
from castblast.specs.models.model import LevenbergSpec
from castblast.surrogate.fitting.families.build import seen_columns
from castblast.surrogate.fitting.families.dense_models import LevenbergMlp
from castblast.surrogate.fitting.families.levenberg import _Net, fit_dense

ROWS = np.random.default_rng(0).standard_normal((300, 3))
ROWS.flags.writeable = False


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers of one test: the same whatever ran before it."""
    return np.random.default_rng(1)


def test_without_hidden_layer_it_is_linear_least_squares(rng: np.random.Generator) -> None:
    """A line and noise: the optimum is that of the normal equations, reached in a few steps."""
    noisy = ROWS @ np.array([1.0, -2.0, 0.5]) + 0.3 + 0.1 * rng.standard_normal(300)
    exact, *_ = np.linalg.lstsq(np.column_stack([ROWS, np.ones(300)]), noisy, rcond=None)
    result = fit_dense(ROWS, noisy, (), "tanh", penalty=0.0, max_steps=30, tolerance=0.0, seed=0)
    np.testing.assert_allclose(result.weights, exact, atol=1e-10)


def test_with_a_penalty_it_is_ridge_regression() -> None:
    """The penalty takes weights and bias alike: (X'X + p I) w = X'y with a column of ones."""
    target = ROWS @ np.array([1.0, -2.0, 0.5]) + 0.3
    design = np.column_stack([ROWS, np.ones(300)])
    exact = np.linalg.solve(design.T @ design + 7.0 * np.eye(4), design.T @ target)
    result = fit_dense(ROWS, target, (), "tanh", penalty=7.0, max_steps=30, tolerance=0.0, seed=0)
    np.testing.assert_allclose(result.weights, exact, atol=1e-9)


@pytest.mark.parametrize("activation", ["tanh", "logistic", "silu"])
def test_normal_equations_are_those_of_finite_differences(activation: Activation) -> None:
    """J'r is half the gradient of the sum of squares; J'J of the residuals' differences."""
    target = np.sin(ROWS[:, 0])
    net = _Net((3, 4, 3, 1), activation, ROWS, target)
    weights = net.start(np.random.default_rng(5))
    matrix, gradient, square = net.normal_equations(weights)
    assert square == pytest.approx(net.square(weights), rel=1e-13)
    step = 1e-6
    columns = []
    for k in range(len(weights)):
        move = np.zeros_like(weights)
        move[k] = step
        ends = [run_layers(net.layers(weights + s * move), ROWS)[:, 0] for s in (1, -1)]
        columns.append((ends[0] - ends[1]) / (2.0 * step))
    jacobian = np.stack(columns, axis=1)
    residual = run_layers(net.layers(weights), ROWS)[:, 0] - target
    np.testing.assert_allclose(gradient, jacobian.T @ residual, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(matrix, jacobian.T @ jacobian, rtol=1e-6, atol=1e-6)


def test_a_network_finds_the_network_that_made_the_rows(rng: np.random.Generator) -> None:
    """Rows of a network of three tanh nodes have a fit without residual."""
    hidden = np.tanh(ROWS @ rng.standard_normal((3, 3)) + rng.standard_normal(3))
    target = hidden @ np.array([1.0, -1.5, 0.7]) + 0.2
    model = LevenbergMlp((3,), start_iterations=300, max_iterations=1, tolerance=0.0)
    assert np.abs(model.fit(ROWS, target).predict(ROWS) - target).max() < 1e-9
    assert np.ndim(model.predict(ROWS)) == 1


def test_columns_that_a_target_must_not_see_have_no_influence() -> None:
    targets = np.stack([np.sin(ROWS[:, 0]), ROWS[:, 1] * ROWS[:, 2]], axis=1)
    model = LevenbergMlp((6,), start_iterations=30, max_iterations=1, columns=[[0], [0, 1, 2]])
    model.fit(ROWS, targets)
    moved = ROWS + np.array([0.0, 1.0, -3.0])
    np.testing.assert_array_equal(model.predict(moved)[:, 0], model.predict(ROWS)[:, 0])
    assert np.abs(model.predict(moved)[:, 1] - model.predict(ROWS)[:, 1]).max() > 0.1


def test_a_start_on_few_rows_ends_where_all_rows_say(rng: np.random.Generator) -> None:
    """The last steps take all rows: the result is stationary for these."""
    target = np.sin(ROWS[:, 0]) + 0.1 * rng.standard_normal(300)
    model = LevenbergMlp(
        (4,), start_rows=100, start_iterations=60, max_iterations=300, penalty=1e-2, tolerance=0.0
    )
    model.fit(ROWS, target)
    net = _Net((3, 4, 1), "tanh", ROWS, target)
    weights = np.concatenate([p.ravel() for e in model.layers_ for p in (e.weights, e.biases)])
    _, gradient, square = net.normal_equations(weights)
    assert np.abs(gradient + 1e-2 * weights).max() < 1e-4 * square


def test_same_seed_same_weights_other_seed_others() -> None:
    target = np.sin(ROWS[:, 0])
    fits = [
        LevenbergMlp((4,), start_iterations=10, max_iterations=1, random_state=seed)
        .fit(ROWS, target)
        .predict(ROWS)
        for seed in (0, 0, 1)
    ]
    np.testing.assert_array_equal(fits[0], fits[1])
    assert np.abs(fits[0] - fits[2]).max() > 0.0


def test_the_near_field_sees_rock_and_hole_only() -> None:
    """A derived column is of the near field only if all of its inputs are."""
    spec = LevenbergSpec(
        name="one",
        features=("ucs", "burden", "hole_diameter", "bench_height", "tensile_strength"),
        linear_features=("tensile_strength",),
        derived={
            "mean_burden": {"coefficients": {"burden": 1.0, "bench_height": 0.25}},
            "share": {"coefficients": {"ucs": 1.0, "tensile_strength": 10.0}},
        },
    )
    assert seen_columns(spec, "equilibrium_pressure", codes=2) == [0, 2, 4, 6, 7, 8]
    assert seen_columns(spec, "burden_velocity", codes=2) == list(range(9))
    free = spec.model_copy(update={"use_physics": False})
    assert seen_columns(free, "equilibrium_pressure", codes=2) == list(range(9))


def test_networks_per_explosive_need_names() -> None:
    with pytest.raises((SpecError, ValueError), match="one_hot"):
        LevenbergSpec(name="one", per_explosive=True, explosive_code="descriptors")
