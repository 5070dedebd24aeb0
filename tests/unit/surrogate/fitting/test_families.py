"""Every family through `fit_spec`: parity of its network, its columns, users' own models."""

import pickle
import sys
from pathlib import Path

import numpy as np
import pytest

from castblast.dataset.file.schema import varying_inputs
from castblast.errors import DatasetError, SpecError
from castblast.network import domain_faults, evaluate
from castblast.specs.models.model import (
    PAPER_FEATURES,
    PAPER_TARGETS,
    CustomSpec,
    GaussianProcessSpec,
    GradientBoostingSpec,
    LevenbergSpec,
    ModelSpec,
    RidgeSpec,
    TorchSpec,
    read_model_spec,
    read_model_specs,
)
from castblast.surrogate.fitting import estimators
from castblast.surrogate.fitting.families.build import make_model
from castblast.surrogate.fitting.features import Table, read_table
from castblast.surrogate.fitting.training import Fit, fit_spec

LOGS = {"input_transform": "log", "target_transform": "log"}
STEMMING = {"stemming": {"coefficients": {"bench_height": 1.0, "charge_length": -1.0}}}
SMALL = {"hidden_layers": (5,), "start_iterations": 15, "max_iterations": 5, **LOGS}
SHORT = {"hidden_layers": (6,), "adam_epochs": 5, "max_iterations": 20, **LOGS}
EXPORTABLE: list[ModelSpec] = [
    LevenbergSpec(name="levenberg", derived=STEMMING, **SMALL),
    LevenbergSpec(name="own", per_explosive=True, **SMALL),
    LevenbergSpec(name="numbers", explosive_code="descriptors", **SMALL),
    RidgeSpec(name="mixed", linear_features=("burden",), derived=STEMMING, **LOGS),
]
TORCH: list[ModelSpec] = [
    TorchSpec(name="torch", derived=STEMMING, **SHORT),
    TorchSpec(name="torch_members", members=2, activation="tanh", **SHORT),
    TorchSpec(name="torch_own", per_explosive=True, **SHORT),
]
OTHERS: list[ModelSpec] = [
    GradientBoostingSpec(name="trees", max_iterations=40, **LOGS),
    GaussianProcessSpec(name="process", rows=150, tuning_rows=60, **LOGS),
    RidgeSpec(name="cubic", degree=3, **LOGS),
]


@pytest.fixture(scope="module")
def dataset(toy_dataset):
    """Toy rows, with a number for each explosive: the strength that the toy targets hold."""
    dataset = toy_dataset(500)
    names = dataset["explosive"].attrs["flag_meanings"].split()
    dataset["explosive_name"] = ("explosive_type", names)
    strength = np.array([1.0, 1.3, 1.1, 1.2])
    dataset["explosive_energy"] = ("explosive_type", strength, {"role": "descriptor"})
    return dataset


@pytest.fixture(scope="module")
def table(dataset) -> Table:
    return read_table(dataset, PAPER_FEATURES, PAPER_TARGETS)


def check_parity(fit: Fit) -> None:
    """The network gives what the estimator gives, on golden rows and on those of the table."""
    network, table = fit.network, fit.table
    assert network is not None
    columns = dict(zip(network.input_names, network.golden.inputs.T, strict=True))
    found = evaluate(network, columns, network.golden.explosives)
    for j, name in enumerate(network.output_names):
        np.testing.assert_allclose(found[name], network.golden.outputs[:, j], rtol=1e-12)
    values = {name: table.frame[name].to_numpy() for name in table.feature_names}
    found = evaluate(network, values, list(table.frame["explosive"]))
    for j, name in enumerate(table.target_names):
        np.testing.assert_allclose(found[name], fit.predicted[:, j], rtol=1e-12)
    assert np.isfinite(network.golden.outputs).all()


@pytest.mark.parametrize("spec", EXPORTABLE + TORCH, ids=lambda spec: spec.name)
def test_network_is_the_estimator(spec: ModelSpec, table: Table) -> None:
    if spec in TORCH:
        pytest.importorskip("torch")
    fit = fit_spec(spec, table)
    check_parity(fit)
    assert fit.scores("test")["burden_velocity"].r2 > (0.9 if spec in TORCH else 0.95)
    assert fit.network.derived == () or fit.network.derived[0].name == "stemming"
    copy = pickle.loads(pickle.dumps(fit))
    np.testing.assert_array_equal(copy.estimator.predict(table.frame), fit.predicted)


@pytest.mark.parametrize("spec", OTHERS, ids=lambda spec: spec.name)
def test_other_families_fit_but_are_not_exported(spec: ModelSpec, table: Table) -> None:
    fit = fit_spec(spec, table)
    assert fit.network is None
    assert fit.scores("test")["burden_velocity"].r2 > 0.9
    again = fit_spec(spec, table)
    np.testing.assert_array_equal(fit.predicted, again.predicted)


def test_near_field_outputs_do_not_know_the_bench(table: Table) -> None:
    """Nothing on the bench can change what happened before the burden moved."""
    network = fit_spec(EXPORTABLE[0], table).network
    inside = {name: float(table.frame[name].iloc[0]) for name in table.feature_names}
    other = inside | {"burden": 2.0, "bench_height": 20.0, "charge_length": 10.0}
    before, after = (evaluate(network, values, "anfo") for values in (inside, other))
    for name in PAPER_TARGETS:
        assert (before[name] == after[name]) == (name != "burden_velocity")


def test_all_takes_what_the_dataset_varies(dataset, table: Table) -> None:
    """Held inputs are no features, and derived columns that need one fall away."""
    assert "poisson_ratio" not in varying_inputs(dataset)
    all_table = read_table(dataset, ("all",), PAPER_TARGETS)
    spec = RidgeSpec(
        name="every", features="all", linear_features=("burden", "dilation_angle"),
        derived={**STEMMING, "held": {"coefficients": {"ucs": 1.0, "tensile_strength": 9.0}}},
        **LOGS,
    )  # fmt: skip
    fit = fit_spec(spec, all_table)
    assert set(PAPER_FEATURES) < set(fit.spec.features) == set(varying_inputs(dataset))
    assert fit.spec.linear_features == ("burden",)
    assert set(fit.spec.derived) == {"stemming"}
    assert fit_spec(spec, all_table).spec == fit.spec


def test_a_derived_column_that_reaches_zero_is_told(table: Table) -> None:
    spec = RidgeSpec(
        name="short",
        derived={"gap": {"coefficients": {"charge_length": 1.0, "bench_height": -0.7}}},
    )
    with pytest.raises(DatasetError, match=r"gap: \d+ rows are not above 0"):
        fit_spec(spec, table)


def test_descriptors_reach_an_explosive_without_training_rows(table: Table) -> None:
    """Targets are powers of one number of the explosive: three known ones tell of the fourth."""
    unseen = "heavy_anfo"
    kinds = table.frame["explosive"].to_numpy(dtype=str)
    keep = (kinds != unseen) | (table.split == "test")
    spec = RidgeSpec(name="numbers", explosive_code="descriptors", **LOGS)
    errors = {}
    for code in ("descriptors", "one_hot"):
        part = table.__class__(
            **{
                **{name: getattr(table, name) for name in table.__dataclass_fields__},
                "frame": table.frame[keep],
                "targets": table.targets[keep],
                "sample": table.sample[keep],
                "split": table.split[keep],
            }
        )
        fit = fit_spec(spec.model_copy(update={"explosive_code": code}), part)
        rows = np.flatnonzero(part.frame["explosive"].to_numpy(dtype=str) == unseen)
        j = part.target_names.index("expanded_hole_radius")
        truth = part.targets[rows, j]
        errors[code] = float(np.quantile(np.abs(fit.predicted[rows, j] / truth - 1.0), 0.95))
    assert errors["descriptors"] < 0.02
    assert errors["one_hot"] > 2.0 * errors["descriptors"]


def test_descriptors_need_numbers(toy_dataset) -> None:
    table = read_table(toy_dataset(400), PAPER_FEATURES, PAPER_TARGETS)
    with pytest.raises(DatasetError, match="explosive 'anfo': the dataset has no descriptors"):
        fit_spec(RidgeSpec(name="numbers", explosive_code="descriptors"), table)


def test_validation_error_is_reported_and_may_end_the_fit(table: Table) -> None:
    pytest.importorskip("torch")
    reported: list[float] = []

    def report(error: float) -> None:
        reported.append(error)
        if len(reported) == 2:
            raise StopIteration

    spec = TorchSpec(name="watched", hidden_layers=(4,), adam_epochs=10, max_iterations=100, **LOGS)
    with pytest.raises(StopIteration):
        fit_spec(spec, table, report=report)
    assert len(reported) == 2
    assert all(0.0 < error < np.inf for error in reported)


def test_without_torch_its_family_says_what_to_install(
    table: Table, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.delitem(
        sys.modules, "castblast.surrogate.fitting.families.torch_mlp", raising=False
    )
    with pytest.raises(SpecError, match=r"torch: kind torch_mlp needs PyTorch: pip install"):
        make_model(TORCH[0], table, seed=0)


def test_quick_specs_are_specs(repository: Path) -> None:
    specs = read_model_specs(sorted((repository / "models" / "specs").glob("*.yaml")))
    for spec in specs:
        quick = spec.quick()
        assert type(spec).model_validate(quick.model_dump()).sha256() == quick.sha256()
        assert quick.name == spec.name
    assert {spec.kind for spec in specs} >= {
        "mlp", "levenberg", "torch_mlp", "gradient_boosting", "gaussian_process", "ridge",
    }  # fmt: skip


FACTORIES = """
from sklearn.linear_model import LinearRegression
from sklearn.neighbors import KNeighborsRegressor
from sklearn.neural_network import MLPRegressor

def linear():
    return LinearRegression()

def neighbours(n_neighbors):
    return KNeighborsRegressor(n_neighbors)

def network(seed):
    return MLPRegressor(
        hidden_layer_sizes=(5,), activation="tanh", solver="lbfgs", max_iter=100, random_state=seed)

class Mean:
    "No scikit-learn class, and no chain of layers for all that it has coefficients."
    def fit(self, x, y):
        self.coef_, self.intercept_ = y.T @ x / len(x), 0.0
        self.mean = y.mean(axis=0)
    def predict(self, x):
        return self.mean + 0.0 * x[:, :1]

class Wrong(Mean):
    def predict(self, x):
        return self.mean

class Broken(Mean):
    def fit(self, x, y):
        raise ValueError("no rows for me")

def deep(inputs, outputs, nodes):
    import torch
    return torch.nn.Sequential(
        torch.nn.Linear(inputs, nodes), torch.nn.SiLU(), torch.nn.Linear(nodes, outputs))

def odd(inputs, outputs):
    import torch
    return torch.nn.Sequential(
        torch.nn.Linear(inputs, 4), torch.nn.Softplus(), torch.nn.Linear(4, outputs))

number = 3
def fails(): raise RuntimeError("out of luck")
def nothing(): return None
"""


@pytest.fixture(scope="module")
def own(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("own")
    (folder / "my_models.py").write_text(FACTORIES)
    return folder


def custom(folder: Path, function: str, **more: object) -> CustomSpec:
    path = folder / "mine.yaml"
    lines = [f"kind: custom\nfactory: {function}\ninput_transform: log\ntarget_transform: log\n"]
    lines += [f"{key}: {value}\n" for key, value in more.items()]
    path.write_text("".join(lines))
    spec = read_model_spec(path)
    assert isinstance(spec, CustomSpec)
    return spec


@pytest.mark.parametrize(
    ("function", "more", "exportable"),
    [
        ("my_models:linear", {}, True),
        ("my_models:network", {}, True),
        ("my_models:neighbours", {"options": "{n_neighbors: 3}"}, False),
        ("my_models:Mean", {}, False),
    ],
)
def test_a_factory_beside_the_file_needs_no_change_here(
    own: Path, table: Table, function: str, more: dict, exportable: bool
) -> None:
    fit = fit_spec(custom(own, function, **more), table)
    assert (fit.network is not None) is exportable
    if exportable:
        check_parity(fit)


def test_two_folders_may_have_modules_of_one_name(tmp_path: Path, table: Table) -> None:
    fits = []
    for share in (0.0, 1.0):
        folder = tmp_path / str(share)
        folder.mkdir()
        (folder / "namesake.py").write_text(
            "from sklearn.linear_model import Ridge\n"
            f"def model(): return Ridge(alpha=1e-6 + 1e6 * {share})\n"
        )
        fits.append(fit_spec(custom(folder, "namesake:model"), table))
    errors = [fit.restart.valid_error for fit in fits]
    assert errors[0] < 0.2 < errors[1]
    assert not [entry for entry in sys.path if str(tmp_path) in entry]


@pytest.mark.parametrize(("function", "exportable"), [("deep", True), ("odd", False)])
def test_a_torch_module_is_trained(
    own: Path, table: Table, function: str, exportable: bool
) -> None:
    pytest.importorskip("torch")
    options = "{nodes: 6}" if function == "deep" else "{}"
    spec = custom(
        own, f"my_models:{function}", options=options,
        training="{adam_epochs: 5, max_iterations: 40}",
    )  # fmt: skip
    fit = fit_spec(spec, table)
    assert (fit.network is not None) is exportable
    assert fit.scores("test")["burden_velocity"].r2 > 0.9
    if exportable:
        check_parity(fit)
    again = estimators.predict(fit_spec(spec, table).estimator, table.frame)
    np.testing.assert_array_equal(again, fit.predicted)


@pytest.mark.parametrize(
    ("function", "more", "message"),
    [
        ("my_modls:linear", {}, "factory: my_modls:linear: no such module"),
        ("my_models:linaer", {}, r"no 'linaer' there, did you mean 'linear'\?"),
        ("my_models:number", {}, "is a int, a function is needed"),
        ("my_models:nothing", {}, "gives a NoneType without fit and predict"),
        ("my_models:fails", {}, "fails with options {}: out of luck"),
        ("my_models:linear", {"options": "{depth: 3}"}, "unexpected keyword argument 'depth'"),
        ("my_models:Wrong", {}, r"shape \(4,\) for 3 rows, \(3, 4\) is needed"),
        ("my_models:Broken", {}, "cannot be fitted: no rows for me"),
    ],
)
def test_faults_of_a_factory_are_told(
    own: Path, table: Table, function: str, more: dict, message: str
) -> None:
    with pytest.raises(SpecError, match=message):
        fit_spec(custom(own, function, **more), table)


def test_golden_rows_leave_out_what_cannot_be_logged(table: Table) -> None:
    """Corners of the box with a charge longer than the bench have no stemming to speak of."""
    network = fit_spec(EXPORTABLE[0], table).network
    height, charge = (
        network.golden.inputs[:, network.input_names.index(name)]
        for name in ("bench_height", "charge_length")
    )
    assert (height > charge).all()
    assert len(network.golden.inputs) == 200
    upper = [column.upper for column in network.inputs]
    assert np.any(network.golden.inputs == upper, axis=0).all()
    row = dict(zip(network.input_names, network.golden.inputs[0], strict=True))
    assert isinstance(domain_faults(network, row), list)
