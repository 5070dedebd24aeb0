"""Every exportable family times every export: the file run elsewhere gives scikit-learn's answers.

The bound is 1e-12 relative on the golden rows, which reach into the corners of the training box.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from toy_network import toy_network

from castblast.bands import BASIS, PRIORS
from castblast.errors import CheckError
from castblast.export.onnx.file import OPSET, run_onnx_rows, to_onnx
from castblast.export.parity import TOLERANCE, check_parity
from castblast.export.targets import TARGETS
from castblast.network import Network, evaluate_rows, explosive_index, member_spread
from castblast.network.json_file import to_json
from castblast.prediction.answer import load_network
from castblast.specs.models.model import PAPER_FEATURES, PAPER_TARGETS, MlpSpec, RidgeSpec
from castblast.stages.export import export
from castblast.surrogate.fitting import estimators
from castblast.surrogate.fitting.features import read_table
from castblast.surrogate.fitting.training import fit_spec

pytest.importorskip("onnxruntime", reason="ONNX files are run with onnxruntime")

SPECS = [
    MlpSpec(
        name=f"{activation}_{inputs}_{targets}",
        activation=activation,
        input_transform=inputs,
        target_transform=targets,
        max_iterations=60,
    )
    for activation in ("tanh", "relu", "logistic")
    for inputs in ("linear", "log")
    for targets in ("linear", "log")
] + [RidgeSpec(name="ridge"), RidgeSpec(name="ridge_log", target_transform="log")]
WRITERS = {name: TARGETS[name].write for name in ("json", "onnx")}


@pytest.fixture(scope="module")
def table(toy_dataset):
    return read_table(toy_dataset(600), PAPER_FEATURES, PAPER_TARGETS)


@pytest.fixture(scope="module")
def network(table) -> Network:
    return fit_spec(SPECS[3], table).network


@pytest.mark.parametrize("spec", SPECS, ids=lambda spec: spec.name)
def test_exports_agree_with_scikit_learn(spec, table) -> None:
    fit = fit_spec(spec, table)
    for target, write in WRITERS.items():
        report = check_parity(fit.network, target, write(fit.network))
        assert report.rows == 200
        assert report.passed, report
        assert max(report.relative.values()) <= TOLERANCE


def test_golden_rows_hold_the_corners_and_answers_of_the_estimator(table) -> None:
    fit = fit_spec(SPECS[0], table)
    golden, inputs = fit.network.golden, fit.network.inputs
    ends = np.array([[column.lower, column.upper] for column in inputs])
    at_ends = np.all((golden.inputs == ends[:, 0]) | (golden.inputs == ends[:, 1]), axis=1)
    assert len(np.unique(golden.inputs[at_ends], axis=0)) == 2 ** len(inputs)
    frame = table.frame.head(0).reindex(range(200))
    for j, column in enumerate(inputs):
        frame[column.name] = golden.inputs[:, j]
    frame["explosive"] = list(golden.explosives)
    np.testing.assert_array_equal(estimators.predict(fit.estimator, frame), golden.outputs)
    assert set(golden.explosives) == set(fit.network.explosives)


def test_mixed_transforms_agree(network: Network) -> None:
    """Log and linear columns in one network, as scikit-learn specs here never make them."""
    inputs = tuple(
        replace(column, transform="linear", mean=column.lower, scale=column.upper - column.lower)
        if j % 2
        else column
        for j, column in enumerate(network.inputs)
    )
    outputs = tuple(
        replace(column, transform="linear") if j % 2 else column
        for j, column in enumerate(network.outputs)
    )
    mixed = replace(network, inputs=inputs, outputs=outputs)
    golden = mixed.golden
    index = np.array([explosive_index(mixed, name) for name in golden.explosives])
    mixed = replace(
        mixed, golden=replace(golden, outputs=evaluate_rows(mixed, golden.inputs, index))
    )
    assert check_parity(mixed, "onnx", WRITERS["onnx"](mixed)).passed


@pytest.mark.parametrize("target", sorted(WRITERS))
def test_a_lost_digit_is_seen(network: Network, target: str) -> None:
    """One weight of the last layer off by 1e-10 relative must not pass."""
    last = network.layers[-1]
    weights = last.weights.copy()
    weights[0] *= 1.0 + 1e-10
    wrong = replace(network, layers=(*network.layers[:-1], replace(last, weights=weights)))
    assert not check_parity(network, target, WRITERS[target](wrong)).passed


def test_swapped_columns_are_seen(network: Network) -> None:
    swapped = replace(network, inputs=(network.inputs[1], network.inputs[0], *network.inputs[2:]))
    assert not check_parity(network, "json", WRITERS["json"](swapped)).passed


def test_onnx_is_float64_old_enough_and_takes_any_batch(network: Network) -> None:
    onnx = pytest.importorskip("onnx")
    content = to_onnx(network)
    assert content == to_onnx(network)
    model = onnx.load_from_string(content)
    assert [entry.version for entry in model.opset_import] == [OPSET] == [13]
    assert model.ir_version <= 8
    assert not any(tensor.data_type == onnx.TensorProto.FLOAT for tensor in model.graph.initializer)
    names = list(network.output_names)
    ends = [
        f"{name}_{kind}_{end}"
        for kind in ("prediction", "network") for end in ("lower", "upper") for name in names
    ]  # fmt: skip
    found = [entry.name for entry in model.graph.output]
    assert found == [*names, *ends, "domain_score", "in_domain", "offending"]
    for rows in (1, 3):
        numeric, index = network.golden.inputs[:rows], np.zeros(rows, dtype=np.int64)
        np.testing.assert_allclose(
            run_onnx_rows(content, numeric, index).values,
            evaluate_rows(network, numeric, index),
            rtol=1e-12,
        )
    metadata = {entry.key: json.loads(entry.value) for entry in model.metadata_props}
    assert metadata["inputs"] == list(network.input_names)
    assert metadata["input_upper"] == [column.upper for column in network.inputs]
    assert metadata["relative_band"] == [column.relative_band for column in network.outputs]
    assert metadata["prediction_sd_of_ln"] == [PRIORS[name].sd for name in names]
    assert metadata["prediction_basis"] == BASIS


def test_spread_in_onnx() -> None:
    """Relative standard deviation over network and members, as NumPy computes it."""
    onnxruntime = pytest.importorskip("onnxruntime")
    network = toy_network()
    rows, index = network.golden.inputs, np.arange(200) % 2
    session = onnxruntime.InferenceSession(to_onnx(network), providers=["CPUExecutionProvider"])
    names = [f"{name}_spread" for name in network.output_names]
    found = np.stack(session.run(names, {"numeric": rows, "explosive": index}), axis=1)
    np.testing.assert_allclose(found, member_spread(network, rows, index), rtol=1e-11)
    answers = [
        evaluate_rows(replace(network, layers=layers), rows, index)
        for layers in (network.layers, *network.members)
    ]
    expected = np.std(answers, axis=0, ddof=1) / np.abs(answers[0])
    np.testing.assert_allclose(found, expected, rtol=1e-11)


def test_an_export_that_disagrees_is_not_written(network: Network, tmp_path: Path) -> None:
    """Golden answers off by 1e-9: exit code 4, deviation named, no file left."""
    golden = replace(network.golden, outputs=network.golden.outputs * (1.0 + 1e-9))
    source = tmp_path / "network.json"
    source.write_text(to_json(replace(network, golden=golden)))
    with pytest.raises(CheckError, match="onnx: burden_velocity deviates by 1e-09") as fault:
        export(source, tmp_path / "out")
    assert fault.value.exit_code == 4
    assert not (tmp_path / "out").exists()


def test_reference_evaluator_agrees_with_onnxruntime(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where onnxruntime is missing the file is still proved, by the evaluator of ONNX itself."""
    network = load_network()
    model, golden = to_onnx(network), network.golden
    index = np.array([explosive_index(network, name) for name in golden.explosives])
    fast = run_onnx_rows(model, golden.inputs, index).values
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    np.testing.assert_allclose(run_onnx_rows(model, golden.inputs, index).values, fast, rtol=1e-12)
