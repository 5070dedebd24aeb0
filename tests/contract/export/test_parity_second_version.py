"""Exports carry everything that version 2 of the network record added: band, domain and spread."""

import json
from dataclasses import replace

import numpy as np
import pytest
from toy_network import toy_network

from castblast.export.onnx.file import run_onnx_rows, to_onnx
from castblast.export.parity import check_parity
from castblast.export.targets import TARGETS
from castblast.network import (
    Layer,
    Network,
    evaluate_rows,
    member_spread,
    predict_rows,
)
from castblast.network.json_file import from_json, to_document, to_json

pytest.importorskip("onnxruntime", reason="ONNX files are run with onnxruntime")
WRITERS = {name: TARGETS[name].write for name in ("json", "onnx")}


@pytest.fixture(scope="module")
def network() -> Network:
    return toy_network()


@pytest.mark.parametrize("target", sorted(WRITERS))
def test_values_band_score_and_flag_agree(network: Network, target: str) -> None:
    report = check_parity(network, target, WRITERS[target](network))
    assert report.passed, report
    inside = predict_rows(network, network.golden.inputs, np.zeros(200, dtype=np.int64)).inside
    assert 20 < np.count_nonzero(inside) < 180


def test_json_keeps_every_entry(network: Network) -> None:
    assert to_document(from_json(to_json(network))) == to_document(network)


def test_spread_in_onnx(network: Network) -> None:
    """Relative standard deviation over network and members, as NumPy computes it."""
    onnxruntime = pytest.importorskip("onnxruntime")
    rows, index = network.golden.inputs, np.arange(200) % 2
    session = onnxruntime.InferenceSession(to_onnx(network), providers=["CPUExecutionProvider"])
    names = [f"{name}_spread" for name in network.output_names]
    found = np.stack(session.run(names, {"numeric": rows, "explosive": index}), axis=1)
    np.testing.assert_allclose(found, member_spread(network, rows, index), rtol=1e-11)
    answers = [evaluate_rows(network, rows, index)] + [
        evaluate_rows(replace(network, layers=layers), rows, index) for layers in network.members
    ]
    expected = np.std(answers, axis=0, ddof=1) / np.abs(answers[0])
    np.testing.assert_allclose(found, expected, rtol=1e-11)


@pytest.mark.parametrize("target", sorted(WRITERS))
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda n: replace(n, density=replace(n.density, threshold=6.001)), "density score"),
        (lambda n: replace(n, constraints=()), "domain flag differs"),
        (lambda n: replace(n, density=None), "density score"),
        (
            lambda n: replace(
                n, outputs=(replace(n.outputs[0], relative_band=0.011), n.outputs[1])
            ),
            "network band",
        ),
        (lambda n: replace(n, derived=(replace(n.derived[0], mean=2.0 + 1e-8),)), "deviates"),
    ],
)
def test_a_copy_that_lost_something_is_seen(network, target, change, message: str) -> None:
    report = check_parity(network, target, WRITERS[target](change(network)))
    assert not report.passed
    assert message in "\n".join(report.faults)


def test_a_row_that_cannot_be_logged_is_outside_everywhere(network: Network) -> None:
    rows = np.array([[10.0, 12.0, 2.0], [10.0, 5.0, -1.0], [np.nan, 5.0, 2.0]])
    index = np.zeros(3, dtype=np.int64)
    assert not predict_rows(network, rows, index).inside.any()
    assert not run_onnx_rows(to_onnx(network), rows, index).inside.any()


def test_a_file_of_version_1_opens(network: Network) -> None:
    document = to_document(replace(network, derived=(), density=None, members=(), layers=(
        Layer(network.layers[0].weights[1:], network.layers[0].biases, "silu"),
        *network.layers[1:],
    )))  # fmt: skip
    for key in ("derived", "density", "members"):
        del document[key]
    old = from_json(json.dumps(document | {"schema_version": 1}))
    assert old.schema_version == 2
    assert (old.derived, old.density, old.members) == ((), None, ())
    rows = old.golden.inputs
    assert np.isnan(predict_rows(old, rows, np.zeros(200, dtype=np.int64)).score).all()
