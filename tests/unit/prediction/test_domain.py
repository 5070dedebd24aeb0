"""What `predict` says of the domain and of the spread of an ensemble."""

from dataclasses import replace

import numpy as np
import pytest

from castblast.network import Network
from castblast.prediction.answer import predict
from castblast.specs.models.model import PAPER_FEATURES, PAPER_TARGETS, RidgeSpec
from castblast.stages.predict import predict_design
from castblast.surrogate.fitting.features import read_table
from castblast.surrogate.fitting.training import fit_spec


@pytest.fixture(scope="module")
def model(toy_dataset) -> Network:
    table = read_table(toy_dataset(600), PAPER_FEATURES, PAPER_TARGETS)
    spec = RidgeSpec(name="ridge", input_transform="log", target_transform="log")
    return fit_spec(spec, table).network


def test_a_design_unusual_as_a_whole_keeps_its_band_and_is_called_so(model: Network) -> None:
    """A limit of the score moved below the design's own stands for a corner of the training box."""
    inside = predict({"burden": 3.0}, "anfo", model)
    assert 0.0 < inside["density_score"] < 1.0
    assert inside["domain"] == "inside"
    tight = replace(
        model.density, threshold=0.5 * model.density.threshold * inside["density_score"]
    )
    answer = predict({"burden": 3.0}, "anfo", replace(model, density=tight))
    assert answer["density_score"] == pytest.approx(2.0)
    assert (answer["domain"], answer["domain_kinds"]) == ("unusual", ["density"])
    assert not answer["in_domain"]
    assert answer["out_of_domain"]
    assert "score 2 where" in answer["domain_faults"][0]


def test_members_of_a_network_give_a_spread(model: Network) -> None:
    """Two members whose last bias is off by -1 and +1 scaled units in a log output of scale s.

    Values v exp(-s), v, v exp(s): a relative standard deviation known by hand.
    """
    last = model.layers[-1]
    members = tuple(
        (*model.layers[:-1], replace(last, biases=last.biases + step)) for step in (-1.0, 1.0)
    )
    answer = predict({"burden": 3.0}, "anfo", replace(model, members=members))
    for column in model.outputs:
        triple = {
            "log": np.exp(column.scale * np.array([-1.0, 0.0, 1.0])),
            "linear": 1.0 + column.scale / answer[column.name] * np.array([-1.0, 0.0, 1.0]),
        }[column.transform]
        assert answer["spread"][column.name] == pytest.approx(np.std(triple, ddof=1), rel=1e-9)
    assert "spread" not in predict({"burden": 3.0}, "anfo", model)


def test_people_read_the_verdict_and_its_reason(
    model: Network, tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Inside: the score; unusual: band and reason; outside: no band."""
    monkeypatch.setattr("castblast.stages.predict.load_network", lambda _: model)
    inside = predict_design({"burden": "3 m"}, "anfo")
    assert "density score 0." in inside.remarks[-1]
    far = predict_design({"burden": "9 m", "bench_height": "24 m"}, "anfo")
    assert far.rows[0][2] == "unknown: outside the training data"
    assert far.remarks[-1].startswith("outside the training data: burden = 9 m: trained on 1.")
    tight = replace(model.density, threshold=1e-3)
    model = replace(model, density=tight)
    odd = predict_design({"burden": "3 m"}, "anfo")
    assert odd.rows[0][2].endswith("(unusual design)")
    assert odd.remarks[-1].startswith("unusual among the training data: ")
