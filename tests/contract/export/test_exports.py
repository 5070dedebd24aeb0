"""Every target of the export, run in its own language, gives the answers of the network.

The network is random and holds everything that a record can: SiLU, a derived length, codes that
are no one-hot, rules, a joint density. The truth is `castblast.network`; a target whose tool is
not installed is skipped with the reason that users are told.
"""

import re
import zipfile
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from toy_network import toy_network

from castblast.bands import PRIORS, Prior
from castblast.export.parity import TOLERANCE, check_parity
from castblast.export.source.answers import NotVerifiedError, answers
from castblast.export.targets import TARGETS
from castblast.network import (
    Network,
    domain_violations,
    evaluate_rows,
    explosive_index,
)
from castblast.network.json_file import from_json, to_json
from castblast.stages.export import TARGET_NAMES

pytest.importorskip("onnxruntime", reason="ONNX files are run with onnxruntime")


#: Targets that answer any rows, each in a language of its own.
LANGUAGES = ("json", "onnx", "c", "js", "python")


def run(target: str, network: Network, rows, index):
    try:
        return TARGETS[target].run(network, TARGETS[target].write(network), rows, index)[0]
    except NotVerifiedError as reason:
        pytest.skip(str(reason))


def parity(target: str, network: Network, files=None):
    report = check_parity(network, target, files or TARGETS[target].write(network))
    if not report.verified:
        pytest.skip(report.remark)
    return report


def test_the_stage_names_every_target() -> None:
    assert tuple(TARGETS) == TARGET_NAMES


@pytest.mark.parametrize("target", TARGET_NAMES)
def test_golden_rows_agree(network: Network, target: str) -> None:
    """Values, bands, score, flag and the names of the inputs at fault, 200 rows in and out."""
    inside = answers(network, network.golden.inputs, np.zeros(200, dtype=np.int64)).inside
    assert 20 < np.count_nonzero(inside) < 180
    report = parity(target, network)
    assert report.rows == 200
    assert report.passed, report.faults
    assert report.largest <= TOLERANCE
    assert report.tool


@pytest.mark.parametrize("target", ["c", "js", "python"])
def test_every_activation(target: str) -> None:
    """Hidden layers of tanh, ReLU, logistic and SiLU in one network."""
    assert parity(target, toy_network(("tanh", "relu", "logistic", "silu"))).passed


@pytest.mark.parametrize("target", ["c", "js", "python"])
def test_a_network_with_nothing_optional(network: Network, target: str) -> None:
    """No rules, no derived columns, no density: the score is NaN, the box alone decides."""
    first, golden = network.layers[0], network.golden
    weights = np.delete(first.weights, 3, axis=0)
    bare = replace(
        network, derived=(), constraints=(), density=None, members=(),
        layers=(replace(first, weights=weights), *network.layers[1:]),
    )  # fmt: skip
    index = np.array([explosive_index(bare, name) for name in golden.explosives])
    outputs = evaluate_rows(bare, golden.inputs, index)
    bare = replace(bare, golden=replace(golden, outputs=outputs))
    assert parity(target, bare).passed
    found = run(target, bare, golden.inputs, index)
    assert np.isnan(found.score).all()


def awkward_rows(network: Network) -> np.ndarray:
    """A design inside, then each input in turn NaN, infinite, nought, negative, out of range."""
    inside = answers(network, network.golden.inputs, np.zeros(200, dtype=np.int64)).inside
    row = network.golden.inputs[inside][0]
    rows = [row]
    for i, column in enumerate(network.inputs):
        far = (0.5 * column.lower, 2.0 * column.upper)
        for value in (np.nan, np.inf, -np.inf, 0.0, -1.0, *far, column.lower, column.upper):
            rows.append(row.copy())
            rows[-1][i] = value
    return np.array(rows)


@pytest.mark.parametrize("target", LANGUAGES)
def test_inputs_at_fault_are_the_same_in_every_language(network: Network, target: str) -> None:
    """NaN, infinities, zeros and values out of range: same flag, same names, no crash."""
    rows = np.concatenate([awkward_rows(network), network.golden.inputs])
    index = np.arange(len(rows)) % 2
    truth, found = answers(network, rows, index), run(target, network, rows, index)
    np.testing.assert_array_equal(found.inside, truth.inside)
    np.testing.assert_array_equal(found.offending, truth.offending)
    finite = np.isfinite(rows).all(axis=1) & (rows > 0.0).all(axis=1)
    finite &= rows[:, 0] > rows[:, 1]  # a stemming that has a logarithm
    np.testing.assert_allclose(found.values[finite], truth.values[finite], rtol=1e-11)
    assert not found.inside[np.isnan(rows).any(axis=1) | ~(rows[:, 0] > rows[:, 1])].any()
    kinds = {tuple(v.kind for v in domain_violations(network, dict(zip(network.input_names, row,
             strict=True)))) for row in rows[finite]}  # fmt: skip
    assert {(), ("box",), ("rule",), ("density",)} <= kinds


def test_names_at_fault_are_those_of_the_messages(network: Network) -> None:
    """The truth itself: the array of flags says what `domain_violations` says row by row."""
    rows = np.concatenate([awkward_rows(network), network.golden.inputs])
    flags = answers(network, rows, np.zeros(len(rows), dtype=np.int64)).offending
    for row, flag in zip(rows, flags, strict=True):
        with np.errstate(invalid="ignore"):
            faults = domain_violations(network, dict(zip(network.input_names, row, strict=True)))
        named = {name for fault in faults for name in fault.inputs}
        assert {n for n, f in zip(network.input_names, flag, strict=True) if f} == named


@pytest.mark.parametrize("target", TARGET_NAMES)
def test_equal_networks_give_equal_bytes(network: Network, target: str) -> None:
    again = from_json(to_json(network))
    assert TARGETS[target].write(network) == TARGETS[target].write(again)


def test_a_workbook_tells_no_time(network: Network) -> None:
    content = TARGETS["excel"].write(network)["model.xlsx"]
    with zipfile.ZipFile(BytesIO(content)) as book:
        assert {entry.date_time for entry in book.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        stamps = re.findall(rb"<dcterms:\w+[^>]*>([^<]*)", book.read("docProps/core.xml"))
    assert set(stamps) == {b"2020-01-01T00:00:00Z"}


@pytest.mark.parametrize("target", LANGUAGES)
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda n: replace(n, density=replace(n.density, threshold=6.001)), "density score"),
        (lambda n: replace(n, density=None), "density score"),
        (lambda n: replace(n, constraints=()), "domain flag differs"),
        (lambda n: replace(n, outputs=(replace(n.outputs[0], relative_band=0.011), n.outputs[1])),
         "network band"),
    ],
    ids=["threshold", "no density", "no rule", "band"],
)  # fmt: skip
def test_a_copy_that_lost_something_is_seen(network: Network, target, change, message) -> None:
    report = parity(target, network, TARGETS[target].write(change(network)))
    assert message in "\n".join(report.faults)


@pytest.mark.parametrize("target", ["json", "onnx"])
def test_a_derived_column_scaled_otherwise_is_seen(network: Network, target: str) -> None:
    other = replace(network, derived=(replace(network.derived[0], mean=2.0 + 1e-8),))
    assert "deviates" in str(parity(target, network, TARGETS[target].write(other)).faults)


@pytest.mark.parametrize("target", ["onnx", "c", "js", "python", "excel", "web"])
def test_a_copy_with_another_prior_is_seen(network: Network, target: str, monkeypatch) -> None:
    """The file of another prior: its velocities carry another band, and nothing else differs."""
    with monkeypatch.context() as changed:
        changed.setitem(PRIORS, "burden_velocity", Prior(0.36, "another"))
        files = TARGETS[target].write(network)
    report = parity(target, network, files)
    assert [line.split(" deviates")[0] for line in report.faults] == ["prediction band"]


@pytest.mark.parametrize("target", TARGET_NAMES)
def test_a_quantity_without_a_prior_has_no_prediction_band(network: Network, target: str) -> None:
    """Work of the gas: value and network band in every language, ends of the other one unknown."""
    first, second = network.outputs
    other = replace(network, outputs=(first, replace(second, name="gas_work", unit="J m-1")))
    report = parity(target, other)
    assert report.passed, report.faults
    golden = other.golden
    index = np.array([explosive_index(other, name) for name in golden.explosives])
    found = run(target, other, golden.inputs, index)
    assert np.isnan(found.prediction.lower[:, 1]).all()
    assert np.isfinite(found.prediction.lower[:, 0]).all()
    assert np.isfinite(found.network.upper).all()
