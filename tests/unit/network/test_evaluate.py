"""The network record against arithmetic done by hand."""

from dataclasses import replace

import numpy as np
import pytest

from castblast.errors import SpecError
from castblast.network import (
    Activation,
    Constraint,
    GoldenRows,
    InputColumn,
    Layer,
    Network,
    OutputColumn,
    domain_faults,
    domain_violations,
    evaluate,
    evaluate_rows,
    in_domain,
)


def make_network(*layers: Layer, transform: str = "log") -> Network:
    """Two inputs, two explosives, one output; unit scaling."""
    scaling = {"transform": transform, "mean": 0.0, "scale": 1.0}
    return Network(
        inputs=(
            InputColumn("burden", "m", lower=1.0, upper=5.0, **scaling),
            InputColumn("bench_height", "m", lower=5.0, upper=20.0, **scaling),
        ),
        explosives=("anfo", "heavy_anfo"),
        codes=np.eye(2),
        layers=layers,
        outputs=(OutputColumn("burden_velocity", "m s-1", relative_band=0.02, **scaling),),
        constraints=(
            Constraint("bench at least 2 burdens", {"bench_height": 1, "burden": -2}, 0.0),
        ),
        golden=GoldenRows(np.empty((0, 2)), (), np.empty((0, 1))),
    )


def power_law() -> Network:
    """12 burden**-0.8 bench_height**0.3, times 1.5 for heavy ANFO: one linear layer on logs."""
    weights = np.array([[-0.8], [0.3], [0.0], [np.log(1.5)]])
    return make_network(Layer(weights, np.log([12.0]), "identity"))


def test_linear_layer_on_logs_is_a_power_law() -> None:
    """exp(sum of exponents times logs) is the product of powers, for every broadcast row."""
    burden, height = np.array([[2.0], [4.0]]), np.array([8.0, 10.0, 12.0])
    values = {"burden": burden, "bench_height": height}
    found = evaluate(power_law(), values, "heavy_anfo")["burden_velocity"]
    assert found.shape == (2, 3)
    np.testing.assert_allclose(found, 1.5 * 12.0 * burden**-0.8 * height**0.3, rtol=1e-14)


def test_numbers_in_numbers_out_and_one_explosive_per_row() -> None:
    network = power_law()
    one = evaluate(network, {"burden": 3.0, "bench_height": 10.0}, "anfo")["burden_velocity"]
    assert one.shape == ()
    both = evaluate(network, {"burden": 3.0, "bench_height": 10.0}, ["heavy_anfo", "anfo"])
    np.testing.assert_allclose(both["burden_velocity"], [1.5 * one, one], rtol=1e-14)


@pytest.mark.parametrize(
    ("activation", "node"),
    [
        ("tanh", np.tanh),
        ("relu", lambda z: max(z, 0.0)),
        ("logistic", lambda z: 1 / (1 + np.exp(-z))),
    ],
)
@pytest.mark.parametrize("burden", [1.2, 4.5])
def test_hidden_layer_by_hand(activation: Activation, node, burden: float) -> None:
    """The answer is 2 f(0.7 (b - 3)/1.5 - 0.1 h + 0.4 [anfo]) + 5 with scaled burden."""
    hidden = Layer(np.array([[0.7], [-0.1], [0.4], [0.0]]), np.zeros(1), activation)
    plain = make_network(
        hidden, Layer(np.array([[2.0]]), np.zeros(1), "identity"), transform="linear"
    )
    network = replace(
        plain,
        inputs=(replace(plain.inputs[0], mean=3.0, scale=1.5), plain.inputs[1]),
        outputs=(replace(plain.outputs[0], mean=5.0),),
    )
    found = evaluate(network, {"burden": burden, "bench_height": 9.0}, "anfo")
    expected = 2.0 * node(0.7 * (burden - 3.0) / 1.5 - 0.1 * 9.0 + 0.4) + 5.0
    assert found["burden_velocity"] == pytest.approx(expected, rel=1e-14)


def test_a_value_that_cannot_be_logged_gives_no_number() -> None:
    rows = evaluate_rows(power_law(), np.array([[-1.0, 8.0]]), np.array([0]))
    assert np.isnan(rows).all()


def test_logistic_does_not_overflow() -> None:
    layer = Layer(np.array([[1.0], [0.0], [0.0], [0.0]]), np.zeros(1), "logistic")
    network = make_network(layer, transform="linear")
    rows = evaluate_rows(network, np.array([[-1e4, 0.0], [1e4, 0.0]]), np.array([0, 0]))
    np.testing.assert_array_equal(rows[:, 0], [0.0, 1.0])


def test_all_faults_of_the_inputs_at_once() -> None:
    with pytest.raises(SpecError) as fault:
        evaluate(power_law(), {"burdn": 3.0}, "anfo")
    message = str(fault.value)
    assert "burden: missing" in message
    assert "bench_height: missing" in message
    assert "burdn: no input of this network, did you mean 'burden'?" in message


def test_unknown_explosive_names_the_nearest() -> None:
    with pytest.raises(SpecError, match=r"'hevy_anfo'.*did you mean 'heavy_anfo'\?.*anfo, heavy"):
        evaluate(power_law(), {"burden": 3.0, "bench_height": 9.0}, "hevy_anfo")


def test_domain_names_the_inputs_with_values_and_ranges() -> None:
    network = power_law()
    assert domain_faults(network, {"burden": 3.0, "bench_height": 9.0}) == []
    (box,) = domain_violations(network, {"burden": 0.5, "bench_height": 9.0})
    assert box.inputs == ("burden",)
    assert box.message == "burden = 0.5 m: trained on 1 m to 5 m"
    (rule,) = domain_violations(network, {"burden": 5.0, "bench_height": 9.0})
    assert rule.inputs == ("bench_height", "burden")
    assert "trained on bench at least 2 burdens" in rule.message
    assert len(domain_violations(network, {"burden": np.nan, "bench_height": 9.0})) == 2


def test_domain_of_rows_agrees_with_its_ends_included() -> None:
    rows = np.array([[1.0, 5.0], [5.0, 20.0], [5.0, 9.9], [3.0, np.nan], [0.99, 9.0]])
    np.testing.assert_array_equal(in_domain(power_law(), rows), [True, True, False, False, False])


def test_an_unusable_network_is_refused_with_every_reason() -> None:
    good = power_law()
    layers = (Layer(np.full((4, 2), np.nan), np.zeros(3), "softmax"),)  # type: ignore[arg-type]
    inputs = (replace(good.inputs[0], lower=9.0), replace(good.inputs[1], scale=0.0))
    with pytest.raises(SpecError) as fault:
        replace(good, layers=layers, inputs=inputs)
    for part in (
        "unknown activation 'softmax'",
        "(3,) biases for 2 nodes",
        "gives 2 values for 1 outputs",
        "must be finite",
        "burden: domain 9.0 to 5.0",
        "bench_height: mean and scale",
    ):
        assert part in str(fault.value)


def test_layers_that_do_not_fit_are_refused() -> None:
    layer = Layer(np.zeros((3, 1)), np.zeros(1), "identity")
    with pytest.raises(SpecError, match=r"weights \(3, 1\) do not take 4 values"):
        make_network(layer)
