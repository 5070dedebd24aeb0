"""Fits whose answer is known, and what a fit must never look at."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from castblast.errors import DatasetError, SpecError
from castblast.network import domain_violations, evaluate
from castblast.network.json_file import to_json
from castblast.specs.models.model import (
    PAPER_FEATURES,
    PAPER_TARGETS,
    CustomSpec,
    MlpSpec,
    RidgeSpec,
    read_model_spec,
    read_model_specs,
)
from castblast.surrogate.fitting.features import read_table
from castblast.surrogate.fitting.metrics import summary_error
from castblast.surrogate.fitting.training import fit_spec, learning_curve
from castblast.surrogate.judging.comparison import compare

QUICK = MlpSpec(name="quick", max_iterations=150, restarts=2, target_transform="log")
POWER_LAW = RidgeSpec(name="power_law", input_transform="log", target_transform="log", penalty=0.0)


@pytest.fixture(scope="module")
def table(toy_dataset):
    return read_table(toy_dataset(600), PAPER_FEATURES, PAPER_TARGETS)


@pytest.fixture(scope="module")
def fit(table):
    return fit_spec(QUICK, table)


def test_a_power_law_is_found_exactly(toy_dataset) -> None:
    """Targets that are products of powers: linear regression on logs recovers every exponent.

    Velocity = 12 (d / 0.15 m) B^-0.8 (L_c / H)^0.5 s(explosive), so with unscaled columns the
    weights are 1, -0.8, 0.5 and -0.5, and the test rows are met to rounding.
    """
    table = read_table(toy_dataset(600, bend=0.0), PAPER_FEATURES, PAPER_TARGETS)
    fit = fit_spec(POWER_LAW, table)
    for figures in fit.scores("test").values():
        assert figures.r2 == pytest.approx(1.0, abs=1e-12)
        assert figures.relative_error_95 < 1e-10
    network = fit.network
    assert network is not None
    scale = np.array([column.scale for column in network.inputs])
    j = network.output_names.index("burden_velocity")
    exponents = network.layers[0].weights[:6, j] / scale * network.outputs[j].scale
    expected = {"hole_diameter": 1.0, "burden": -0.8, "charge_length": 0.5, "bench_height": -0.5}
    for name, exponent in zip(network.input_names, exponents, strict=True):
        assert exponent == pytest.approx(expected.get(name, 0.0), abs=1e-9)


def test_training_rows_lie_in_the_domain(fit, table) -> None:
    """All of them in the ranges and rules; by the joint density up to a per cent may be unusual."""
    train = table.frame.iloc[table.rows("train")][list(table.feature_names)]
    rows = train.to_dict("records")
    faults = [fault for row in rows for fault in domain_violations(fit.network, row)]
    assert {fault.kind for fault in faults} <= {"density"}
    assert len(faults) <= 0.02 * len(rows)


def test_same_spec_same_bytes(fit, table) -> None:
    assert to_json(fit_spec(QUICK, table).network) == to_json(fit.network)


def test_test_and_calibration_rows_do_not_steer_the_fit(toy_dataset, fit) -> None:
    """Ruined test targets change nothing of the fit; ruined calibration rows only its band."""
    for split, band_moves in ((3, False), (2, True)):
        dataset = toy_dataset(600)
        ruined = np.flatnonzero(dataset["split"] == split)
        for name in PAPER_TARGETS:
            dataset[name][ruined] = dataset[name][ruined] * 3.0
        other = fit_spec(QUICK, read_table(dataset, PAPER_FEATURES, PAPER_TARGETS))
        for mine, theirs in zip(fit.network.layers, other.network.layers, strict=True):
            np.testing.assert_array_equal(mine.weights, theirs.weights)
        assert other.chosen == fit.chosen
        assert bool(np.any(other.band != fit.band)) is band_moves


def test_the_best_start_on_validation_rows_is_kept(fit) -> None:
    assert len(fit.restarts) == 2
    assert fit.restart.valid_error == min(restart.valid_error for restart in fit.restarts)
    assert {restart.seed for restart in fit.restarts} == {0, 1}


def test_restarts_are_chosen_on_validation_rows_never_on_training_rows(table, tmp_path) -> None:
    """The restart that knows its training rows by heart and errs on all others is not kept."""
    (tmp_path / "two_starts.py").write_text(
        "from sklearn.linear_model import LinearRegression\n"
        "from sklearn.neighbors import KNeighborsRegressor\n"
        "def make(seed):\n"
        "    return LinearRegression() if seed else KNeighborsRegressor(1)\n"
    )
    logs = {"input_transform": "log", "target_transform": "log"}
    spec = CustomSpec(name="two", factory="two_starts:make", folder=tmp_path, restarts=2, **logs)
    by_heart, straight = (
        fit_spec(spec.model_copy(update={"seed": seed, "restarts": 1}), table) for seed in (0, 1)
    )
    errors = {
        split: [summary_error(fit.scores(split)) for fit in (by_heart, straight)]
        for split in ("train", "valid")
    }
    assert errors["train"][0] < 1e-9 < errors["train"][1]
    assert errors["valid"][0] > 2.0 * errors["valid"][1]
    assert fit_spec(spec, table).restart.seed == 1


def test_reaching_the_iteration_limit_is_recorded_not_shown(table) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit = fit_spec(MlpSpec(name="short", max_iterations=5), table)
    assert not fit.restart.converged
    assert fit.restart.iterations == 5
    assert fit_spec(POWER_LAW, table).restart.converged


def test_a_log_model_refuses_a_target_of_zero(toy_dataset) -> None:
    dataset = toy_dataset(600)
    dataset["burden_velocity"][5] = 0.0
    with pytest.raises(DatasetError, match=r"burden_velocity: 1 rows .*sample 5: 0 m"):
        fit_spec(POWER_LAW, read_table(dataset, PAPER_FEATURES, PAPER_TARGETS))


def test_learning_curve_grows_and_ends_with_the_fit(table) -> None:
    curve = learning_curve(fit_spec(POWER_LAW, table), table, sizes=(120, 100, 10_000))
    assert [point.rows for point in curve] == [100, 120, len(table.rows("train"))]
    assert curve[-1].test == fit_spec(POWER_LAW, table).scores("test")


def test_a_single_target_trains_and_exports(table) -> None:
    for spec in (QUICK, POWER_LAW):
        one = spec.model_copy(update={"targets": ("burden_velocity",)})
        fit = fit_spec(one, table)
        assert fit.network.output_names == ("burden_velocity",)


def test_the_best_exportable_is_chosen_and_the_gap_stated(table, fit) -> None:
    """A cubic in logs beats power law and unfinished network, but cannot be exported."""
    cubic = fit_spec(POWER_LAW.model_copy(update={"name": "cubic", "degree": 3}), table)
    plain = fit_spec(POWER_LAW, table)
    assert cubic.network is None
    league = compare([plain, cubic, fit])
    best = min((plain, fit), key=lambda one: one.restart.valid_error)
    assert league["best_overall"] == "cubic"
    assert league["chosen"] == best.spec.name
    assert league["gap"] == best.restart.valid_error / cubic.restart.valid_error > 1.0
    names = [entry["name"] for entry in league["league"]]
    assert names[0] == "cubic"
    assert not league["league"][0]["distinguishable_from_first"]
    assert league["league"][-1]["distinguishable_from_first"]
    for entry in league["league"]:
        for figures in entry["targets"].values():
            low, high = figures["relative_error_95_interval"]
            assert low <= figures["relative_error_95"] <= high


def test_shipped_specs_are_read(repository: Path) -> None:
    specs = read_model_specs(sorted((repository / "models" / "specs").glob("*.yaml")))
    by_name = {spec.name: spec for spec in specs}
    reference = by_name["reference_mlp"]
    assert reference.hidden_layers == (7, 7, 7)
    assert reference.activation == "tanh"
    assert (reference.input_transform, reference.target_transform) == ("linear", "linear")
    assert len({spec.sha256() for spec in specs}) == len(specs)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("kind: mpl\n", r"kind: mpl: unknown, did you mean 'mlp'\?"),
        ("hidden_layers: [3]\n", "kind: is missing"),
        ("kind: mlp\nhiden_layers: [3]\n", r"hiden_layers: .*did you mean 'hidden_layers'\?"),
        ("kind: ridge\nhidden_layers: [3]\n", "hidden_layers: unknown key"),
        ("kind: mlp\nfeatures: [burdn]\n", r"unknown variable 'burdn', did you mean 'burden'\?"),
        ("kind: mlp\ntargets: [ucs]\n", "targets: unknown variable 'ucs'"),
        ("kind: mlp\nfeatures: [ucs, ucs]\n", "given twice: ucs"),
        ("kind: mlp\nactivation: step\n", "activation: step"),
        ("kind: levenberg\nactivation: relu\n", "activation: relu"),
        ("kind: custom\nfactory: linear\n", "factory: linear"),
        ("kind: custom\nfactory: a:b\ntraining: {epochs: 3}\n", "training"),
        ("kind: ridge\nfeatures: al\n", "features"),
        ("kind: ridge\nderived: {x: {coefficients: {ucs: 1, burden: 1}}}\n", "different units"),
        ("kind: ridge\nderived: {x: {coefficients: {uc: 1}}}\n", "did you mean 'ucs'"),
        ("kind: ridge\nderived: {x: {coefficients: {spacing: 1}}}\n", "is not a feature"),
        ("kind: ridge\nderived: {ucs: {coefficients: {ucs: 1}}}\n", "name of a variable"),
        ("kind: ridge\nlinear_features: [spacing]\n", "linear_features: unknown"),
    ],
)
def test_bad_specs_are_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(SpecError, match=message) as fault:
        read_model_spec(path)
    assert str(path) in str(fault.value)


def test_faults_of_all_specs_at_once(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("kind: mpl\n")
    with pytest.raises(SpecError) as fault:
        read_model_specs([tmp_path / "a.yaml", tmp_path / "b.yaml"])
    assert "a.yaml: kind" in str(fault.value)
    assert "b.yaml: no such file" in str(fault.value)


def test_refinement_goes_on_where_the_solver_stopped(table) -> None:
    """Rounds with enlarged targets lower the training loss and leave a plain network behind."""
    spec = QUICK.model_copy(update={"max_iterations": 1500, "restarts": 1})
    plain = fit_spec(spec, table)
    refined = fit_spec(spec.model_copy(update={"refinements": 1}), table)
    assert refined.restart.iterations > plain.restart.iterations
    train = table.rows("train")
    losses = [
        np.mean((np.log(fit.predicted[train] / table.targets[train])) ** 2)
        for fit in (plain, refined)
    ]
    assert losses[1] < losses[0]
    found = evaluate(
        refined.network,
        {name: table.frame[name].to_numpy() for name in table.feature_names},
        list(table.frame["explosive"]),
    )
    np.testing.assert_allclose(
        found["burden_velocity"],
        refined.predicted[:, table.target_names.index("burden_velocity")],
        rtol=1e-12,
    )
