"""Compare, train, export and predict as stages: files in, the same files out every time."""

import csv
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from castblast.api.training.judging import DEMO
from castblast.design.variables import STEMMING_RATIO
from castblast.errors import DatasetError
from castblast.prediction.answer import predict
from castblast.stages.comparison.run import compare
from castblast.stages.export import export
from castblast.stages.outcome import Outcome
from castblast.stages.predict_table import predict_csv
from castblast.stages.training.train import train

MODELS = {
    "first": "kind: mlp\nmax_iterations: 80\ntarget_transform: log\ndescription: short\n",
    "second": "kind: ridge\ninput_transform: log\ntarget_transform: log\npenalty: 0\n",
}


@pytest.fixture(scope="module")
def source(toy_dataset, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Path]]:
    """A dataset file and two model specs."""
    folder = tmp_path_factory.mktemp("toy")
    toy_dataset(600).to_netcdf(folder / "toy.nc")
    for name, text in MODELS.items():
        (folder / f"{name}.yaml").write_text(text)
    return folder / "toy.nc", [folder / f"{name}.yaml" for name in MODELS]


@pytest.fixture(scope="module")
def fits(source, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("models")
    _compare(source, out)
    return out / "fits"


@pytest.fixture(scope="module")
def comparison(fits: Path) -> Path:
    return fits.parent / "comparison"


@pytest.fixture(scope="module")
def network(comparison: Path) -> Path:
    export(comparison, comparison.parent / "chosen", parity=comparison.parent / "parity.json")
    return comparison.parent / "chosen" / "network.json"


def _compare(source, out: Path, **options: Any) -> Outcome:
    return compare(
        *source, out / "comparison", fits=out / "fits", extent=DEMO, workers=1, **options
    )


def _bytes(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_fits_leave_scores_tables_and_pictures(fits: Path) -> None:
    files = ("fit.json", "network.json", "parity.png", "test_rows.csv")
    expected = {f"{name}/{file}" for name in MODELS for file in files}
    assert expected <= set(_bytes(fits))


def test_a_comparison_leaves_league_curves_and_page(comparison: Path) -> None:
    league = json.loads((comparison / "comparison.json").read_text())
    assert league["paper"]["relative_error_95"] == 0.025
    assert {entry["name"] for entry in league["league"]} == set(MODELS)
    assert league["remarks"], "a dataset without a recipe has no physics gate: that must be said"
    chosen = league["chosen"]
    assert (comparison / chosen / "figure_2.png").read_bytes().startswith(b"\x89PNG")
    assert len(league["worst_cases"]) == 10
    page = (comparison / "report.html").read_text(encoding="utf-8")
    for name in MODELS:
        assert name in page
    assert "fit_seconds" in (comparison / "timings.json").read_text()
    assert "fit [s]" in (comparison / "timings.html").read_text(encoding="utf-8")
    assert "[s]" not in page, "what is hashed holds no time"


def test_export_finds_the_chosen_fit(fits: Path, comparison: Path, network: Path) -> None:
    chosen = json.loads((comparison / "comparison.json").read_text())["chosen"]
    assert network.read_bytes() == (fits / chosen / "network.json").read_bytes()
    parity = json.loads((fits.parent / "parity.json").read_text())
    assert parity["json"]["passed"]
    assert parity["onnx"]["passed"]


def test_prediction_of_a_plain_design(network: Path) -> None:
    """Defaults fill in, the charge fills what a stemming of 0.7 burden leaves."""
    answer = predict({"burden": 3.0, "bench_height": 12.0}, "anfo", network)
    assert answer["inputs"]["charge_length"] == pytest.approx(12.0 - STEMMING_RATIO * 3.0)
    assert answer["inputs"]["ucs"] == 1e8
    assert answer["in_domain"]
    band = answer["network_band"]["burden_velocity"]
    assert band["lower"] < answer["burden_velocity"] < band["upper"]
    assert band["upper"] == pytest.approx(answer["burden_velocity"] * (1.0 + band["relative"]))
    assert answer["display"]["equilibrium_pressure"].endswith("MPa")
    shorter = predict({"bench_height": 12.0, "stemming_length": 3.0}, "anfo", network)
    assert shorter["inputs"]["charge_length"] == 9.0
    assert json.loads(json.dumps(answer)) == answer


def test_prediction_is_near_the_formula_it_was_trained_on(network: Path) -> None:
    """12 (d / 0.15) B^-0.8 (L_c / H)^0.5 s (1 + 0.1 tanh(B / 3 - 1)), s = 1.2 for heavy ANFO."""
    design = {"burden": 2.5, "bench_height": 15.0, "charge_length": 13.0, "hole_diameter": 0.2}
    answer = predict(design, "heavy_anfo", network)
    truth = 12 * (0.2 / 0.15) * 2.5**-0.8 * (13 / 15) ** 0.5 * 1.2
    truth *= 1 + 0.1 * np.tanh(2.5 / 3 - 1)
    band = answer["network_band"]["burden_velocity"]
    assert band["lower"] < truth < band["upper"]


def test_inputs_outside_the_training_data_are_named(network: Path) -> None:
    answer = predict({"burden": 8.0, "bench_height": 20.0}, "anfo", network)
    assert not answer["in_domain"]
    assert answer["out_of_domain"] == ["burden"]
    assert answer["domain_faults"][0].startswith("burden = 8 m: trained on 1.")
    joint = predict({"burden": 2.0, "bench_height": 20.0, "charge_length": 12.0}, "anfo", network)
    assert joint["out_of_domain"] == ["bench_height", "charge_length", "burden"]
    assert (answer["domain"], answer["domain_kinds"]) == ("outside", ["box"])
    assert joint["domain_kinds"] == ["rule"]


def test_inputs_that_the_network_cannot_see_are_named(network: Path) -> None:
    """A value that changes nothing must not look as if it had been heeded; its default may."""
    held = predict({"poisson_ratio": 0.25, "spacing": 3.0, "burden": 3.0}, "anfo", network)
    assert held["in_domain"]
    answer = predict({"poisson_ratio": 0.3, "spacing": 4.0}, "anfo", network)
    assert answer["out_of_domain"] == ["poisson_ratio", "spacing"]
    assert "has no effect in this network, trained at 0.25" in answer["domain_faults"][0]
    assert answer["domain_kinds"] == ["unseen", "unseen"]


def test_csv_of_designs(network: Path, tmp_path: Path) -> None:
    path = tmp_path / "designs.csv"
    path.write_text("explosive,burden [m],ucs [MPa]\nanfo,3,80\nheavy_anfo,8,\n")
    table = predict_csv(path, network)
    assert table.rows[0]["burden_velocity"] == pytest.approx(
        predict({"burden": 3.0, "ucs": 8e7}, "anfo", network)["burden_velocity"], rel=1e-12
    )
    lines = table.text.splitlines()
    assert len(lines) == 3
    first = next(csv.DictReader(io.StringIO(table.text)))
    band = table.rows[0]["prediction_band"]["burden_velocity"]
    assert float(first["burden_velocity_prediction_lower [m s-1]"]) == pytest.approx(
        band["lower"], rel=1e-3
    )
    band = table.rows[0]["prediction_band"]["equilibrium_pressure"]
    assert float(first["equilibrium_pressure_prediction_upper [MPa]"]) == pytest.approx(
        band["upper"] * 1e-6, rel=1e-3
    )
    score = table.rows[0]["density_score"]
    assert lines[1].split(",")[-4:] == ["yes", "", "inside", f"{score:.4g}"]
    assert lines[2].split(",")[-4:-1] == ["no", "burden", "outside"]


def test_bad_datasets_are_refused(source, toy_dataset, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="no such file"):
        train(tmp_path / "none.nc", source[1], tmp_path / "out")
    toy_dataset(600).drop_vars("ucs").to_netcdf(tmp_path / "bad.nc")
    with pytest.raises(DatasetError, match=r"bad\.nc: ucs: the dataset has no such variable"):
        train(tmp_path / "bad.nc", source[1], tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("bend", "line"), [(0.0, "met from 250 training"), (3.0, "not met with")])
def test_the_rows_that_meet_the_paper_are_named(
    source, toy_dataset, tmp_path: Path, bend: float, line: str
) -> None:
    """A power law is met by the power-law model from the first point on; a bent one never."""
    toy_dataset(600, bend=bend).to_netcdf(tmp_path / "bent.nc")
    outcome = _compare((tmp_path / "bent.nc", [source[1][1]]), tmp_path)
    assert any(f"second: the published figures are {line}" in entry for entry in outcome.lines)
    assert outcome.rows[-1][0].startswith("paper")
