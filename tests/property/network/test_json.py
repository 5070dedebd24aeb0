"""For any network: JSON keeps every bit, rows are independent, the domain has one meaning."""

import json

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from castblast.network import (
    Constraint,
    GoldenRows,
    InputColumn,
    Layer,
    Network,
    OutputColumn,
    domain_violations,
    evaluate_rows,
    in_domain,
)
from castblast.network.json_file import from_json, to_json

NUMBER = st.floats(-1e3, 1e3, allow_subnormal=False)
POSITIVE = st.floats(1e-3, 1e3)
TRANSFORM = st.sampled_from(["linear", "log"])


@st.composite
def networks(draw: st.DrawFn) -> Network:
    names = ["burden", "ucs", "hole_diameter"][: draw(st.integers(1, 3))]
    targets = ["burden_velocity", "equilibrium_pressure"][: draw(st.integers(1, 2))]
    explosives = ("a", "b", "c")[: draw(st.integers(1, 3))]
    codes = draw(arrays(np.float64, (len(explosives), draw(st.integers(0, 3))), elements=NUMBER))
    sizes = [len(names) + codes.shape[1], *draw(st.lists(st.integers(1, 5), max_size=2))]
    layers = [
        Layer(
            draw(arrays(np.float64, (a, b), elements=st.floats(-3, 3))),
            draw(arrays(np.float64, b, elements=NUMBER)),
            draw(st.sampled_from(["tanh", "relu", "logistic", "identity"])),
        )
        for a, b in zip(sizes, [*sizes[1:], len(targets)], strict=True)
    ]
    inputs = []
    for name in names:
        low, high = sorted((draw(POSITIVE), draw(POSITIVE)))
        inputs.append(
            InputColumn(name, "1", draw(TRANSFORM), draw(NUMBER), draw(POSITIVE), low, high)
        )
    return Network(
        inputs=tuple(inputs),
        explosives=explosives,
        codes=codes,
        layers=tuple(layers),
        outputs=tuple(
            OutputColumn(t, "1", "linear", draw(NUMBER), draw(POSITIVE), 0.1) for t in targets
        ),
        constraints=(Constraint("r", dict.fromkeys(names, draw(NUMBER)), draw(NUMBER)),),
        golden=GoldenRows(np.ones((1, len(names))), ("a",), np.ones((1, len(targets)))),
        provenance={"dataset": {"name": "x"}, "numbers": [1, 0.1, None]},
    )


def rows_of(network: Network, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows within the box, and a factor 1.5 around it."""
    rng = np.random.default_rng(seed)
    lower = np.array([column.lower for column in network.inputs])
    upper = np.array([column.upper for column in network.inputs])
    numeric = lower / 1.5 + (1.5 * upper - lower / 1.5) * rng.random((20, len(lower)))
    return numeric, rng.integers(0, len(network.explosives), 20)


@given(networks(), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_json_round_trip_keeps_every_bit(network: Network, seed: int) -> None:
    text = to_json(network)
    again = from_json(text)
    assert to_json(again) == text
    assert json.loads(text)["provenance"] == network.provenance
    numeric, index = rows_of(network, seed)
    np.testing.assert_array_equal(
        evaluate_rows(again, numeric, index), evaluate_rows(network, numeric, index)
    )


@given(networks(), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_rows_do_not_see_each_other(network: Network, seed: int) -> None:
    """A batch gives what its rows give alone, up to the order of sums in the matrix product."""
    numeric, index = rows_of(network, seed)
    batch = evaluate_rows(network, numeric, index)
    alone = np.concatenate(
        [evaluate_rows(network, numeric[i : i + 1], index[i : i + 1]) for i in range(len(index))]
    )
    np.testing.assert_allclose(batch, alone, rtol=1e-9, atol=1e-6)


@given(networks(), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_domain_of_a_row_and_of_many_agree(network: Network, seed: int) -> None:
    numeric, _ = rows_of(network, seed)
    one_by_one = [
        not domain_violations(network, dict(zip(network.input_names, row, strict=True)))
        for row in numeric.tolist()
    ]
    np.testing.assert_array_equal(in_domain(network, numeric), one_by_one)
