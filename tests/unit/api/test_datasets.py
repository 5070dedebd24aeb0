"""Datasets, fits and comparisons from Python: in memory, by path, and to the same bits."""

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import xarray as xr

import castblast as cb
from castblast.api.datasets import decoded, encoded
from castblast.dataset.file.schema import varying_inputs
from castblast.dataset.file.store import open_dataset as open_stored
from castblast.errors import DatasetError, SpecError
from castblast.specs.models.model import make_model_spec, read_model_spec
from castblast.surrogate.fitting.rows import read_rows
from castblast.surrogate.fitting.training import fit_spec

ROWS = 900


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("data")


@pytest.fixture(scope="module")
def dataset(folder: Path) -> xr.Dataset:
    return cb.generate("quickstart", out=str(folder), size=ROWS, workers=1)


def test_a_dataset_is_the_file_that_was_written(dataset: xr.Dataset, folder: Path) -> None:
    path = folder / "data.nc"
    stored = open_stored(path)
    for given in (path, str(path)):
        with cb.open_dataset(given) as opened:
            assert opened.identical(dataset)
    assert np.array_equal(dataset.burden_velocity, stored.burden_velocity)
    assert encoded(dataset).load().identical(stored)
    assert decoded(stored).identical(dataset.load())
    assert set(dataset.coords) == {"sample", "explosive", "split"}
    assert dataset.burden_velocity.attrs["units"] == "m s-1"
    assert set(dataset.split.values) == {"train", "valid", "calibration", "test"}


def test_in_memory_it_is_the_same_and_leaves_no_file(
    dataset: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    seen: list[float] = []
    again = cb.generate(
        Path("quickstart"), size=ROWS, workers=2, progress=lambda share, _: seen.append(share)
    )
    assert again.identical(dataset.load())
    assert not list(tmp_path.iterdir())
    assert max(seen) == 1.0
    monkeypatch.undo()


def test_features_are_columns_whose_role_is_input_or_not_said(dataset: xr.Dataset) -> None:
    """A role that is no text, such as an array, is none."""
    marked = dataset.load().copy(deep=True)
    found = dataset.castblast.features
    assert {"burden", "ucs", "young_modulus"} < set(found)
    del marked["burden"].attrs["role"]
    marked["ucs"].attrs["role"] = np.array([1, 2])
    marked["young_modulus"].attrs["role"] = "derived"
    left = tuple(name for name in found if name not in ("ucs", "young_modulus"))
    assert marked.castblast.features == varying_inputs(marked) == left


def test_another_seed_gives_other_rows() -> None:
    first, second = (cb.generate("quickstart", size=20, seed=s, workers=1) for s in (1, 2))
    assert not np.array_equal(first.ucs, second.ucs)
    assert "seed: 1" in first.attrs["recipe"]


def test_a_training_table_is_what_models_are_fitted_on(dataset: xr.Dataset) -> None:
    x, y = dataset.castblast.training_table(split="train", one_hot=False)
    spec = read_model_spec(Path("ridge"))
    table = read_rows(encoded(dataset), [spec], "dataset")
    rows = table.rows("train")
    for name in table.feature_names:
        assert np.array_equal(x[name], table.frame[name].to_numpy()[rows])
    assert np.array_equal(x["explosive"].astype(str), table.frame["explosive"].to_numpy()[rows])
    for j, name in enumerate(table.target_names):
        assert np.array_equal(y[name], table.targets[rows, j])
    assert np.array_equal(x.index, table.sample[rows])
    assert y.attrs["units"]["burden_velocity"] == "m s-1"


def test_scikit_learn_and_torch_take_the_table(dataset: xr.Dataset) -> None:
    from sklearn.ensemble import ExtraTreesRegressor

    x, y = dataset.castblast.training_table("train")
    xt, yt = dataset.castblast.training_table("test")
    assert all(kind == np.float64 for kind in (*x.dtypes, *y.dtypes))
    assert set(x.filter(like="explosive_").sum(axis=1)) == {1.0}
    model = ExtraTreesRegressor(100, random_state=0).fit(x, y["burden_velocity"])
    assert model.score(xt, yt["burden_velocity"]) > 0.8
    torch = pytest.importorskip("torch")
    assert torch.tensor(x.to_numpy()).shape == x.shape
    everything, _ = dataset.castblast.training_table()
    assert len(everything) == int((dataset.status == "ok").sum())


def test_failed_rows_are_left_out(dataset: xr.Dataset) -> None:
    status = dataset.status.values.copy()
    status[:7] = "not_converged"
    part = dataset.assign(status=("sample", status))
    x, _ = part.castblast.training_table()
    assert len(x) == ROWS - 7
    assert 0 not in x.index


def test_what_is_not_in_a_dataset_is_named(dataset: xr.Dataset, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="did you mean 'train'") as caught:
        dataset.castblast.training_table("trian")
    assert caught.value.field == "split"
    with pytest.raises(DatasetError, match="did you mean 'burden'"):
        dataset.castblast.training_table(features=["burdn"])
    with pytest.raises(DatasetError, match="no such file"):
        cb.open_dataset(str(tmp_path / "none.nc"))
    odd = dataset.assign_coords(split=("sample", np.full(ROWS, "trian")))
    with pytest.raises(DatasetError, match="split: 'trian': one of train"):
        cb.fit(odd, "ridge")


def test_a_fit_is_that_of_the_command_line(dataset: xr.Dataset, folder: Path) -> None:
    spec = read_model_spec(Path("ridge"))
    table = read_rows(open_stored(folder / "data.nc"), [spec], "data.nc")
    truth = fit_spec(spec, table)
    for given in (dataset, folder / "data.nc", str(folder / "data.nc"), dataset.load()):
        model = cb.fit(given, "ridge")
        assert model.fitted is not None
        assert np.array_equal(model.fitted.predicted, truth.predicted)
    assert cb.fit(dataset, spec).name == "ridge"
    scores = truth.scores("test")
    for name, row in model.score(dataset).iterrows():
        assert row["relative_error_95"] == pytest.approx(scores[name].relative_error_95, rel=1e-9)
        assert row["rows"] == scores[name].rows


def test_a_spec_may_be_its_content(dataset: xr.Dataset) -> None:
    content = {"name": "square", "kind": "ridge", "degree": 2, "input_transform": "log"}
    made = cb.fit(dataset, content)
    assert made.name == "square"
    spec = make_model_spec(content, "square", Path())
    assert np.array_equal(made.fitted.predicted, cb.fit(dataset, spec).fitted.predicted)
    for change, words in (
        ({"name": None}, "name"),
        ({"kind": "rigde"}, "did you mean 'ridge'"),
        ({"degre": 2}, "did you mean 'degree'"),
    ):
        with pytest.raises(SpecError, match=words):
            cb.fit(dataset, {**content, **change})


def test_code_is_refused_in_words_of_python(dataset: xr.Dataset) -> None:
    spec = {"name": "mine", "kind": "custom", "factory": "my_models:make"}
    with pytest.raises(SpecError, match="in Python allow_code=True"):
        cb.fit(dataset, spec)


def test_two_specs_of_one_name_are_refused(dataset: xr.Dataset) -> None:
    with pytest.raises(SpecError, match="'ridge' is that of 2 specs") as caught:
        cb.compare(dataset, ["ridge", {"name": "ridge", "kind": "ridge", "degree": 2}])
    assert caught.value.field == "specs"


def test_a_seed_is_taken_or_refused(dataset: xr.Dataset) -> None:
    with pytest.raises(SpecError, match="seed: models of kind ridge have none"):
        cb.fit(dataset, "ridge", seed=3)
    quick = read_model_spec(Path("reference_mlp_log")).quick()
    first, second = (cb.fit(dataset, quick, seed=seed) for seed in (3, 4))
    assert first.fitted.restarts[0].seed == 3
    assert not np.array_equal(first.fitted.predicted, second.fitted.predicted)


def test_a_model_that_is_no_network_predicts_too(dataset: xr.Dataset, tmp_path: Path) -> None:
    model = cb.fit(dataset, read_model_spec(Path("gaussian_process")).quick())
    assert model.fitted is not None
    rows = model.fitted.table.rows("test")
    x, _ = dataset.castblast.training_table("test", one_hot=False)
    answer = model.predict(x)
    truth = model.fitted.predicted[rows]
    for j, name in enumerate(model.fitted.table.target_names):
        assert answer[name].to_numpy() == pytest.approx(truth[:, j], rel=1e-9)
    assert set(answer["domain"]) <= {"inside", "unusual"}
    odd = model.predict({"burden": [4.0, 4.0], "ucs": [8e7, 5e8]}, "anfo")
    assert odd["domain"].tolist()[1] == "outside"
    with pytest.raises(SpecError, match="not a chain of dense layers"):
        model.save(tmp_path)
    with pytest.raises(SpecError, match="not a chain of dense layers"):
        model.export(tmp_path / "model.onnx")


@pytest.mark.parametrize("suffix", [".json", ".onnx", ".js", ".py", ".c", ".html", ".xlsx"])
def test_an_export_by_suffix_is_verified(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = cb.load_model("paper")
    files = model.export(str(tmp_path / f"mine{suffix}"))
    assert (tmp_path / f"mine{suffix}") in files
    assert all(file.stat().st_size for file in files)
    if suffix == ".json":
        assert cb.load_model(files[0]).name == model.name


def test_an_export_that_disagrees_is_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dataclasses import replace

    from castblast.api.model import Model
    from castblast.errors import CheckError

    network = cb.load_model("paper").network
    golden = replace(network.golden, outputs=network.golden.outputs * 1.001)
    with pytest.raises(CheckError, match="largest relative deviation"):
        Model(replace(network, golden=golden)).export(tmp_path / "model.py")
    assert not list(tmp_path.iterdir())
    with pytest.raises(SpecError, match=r"did you mean '\.onnx'") as caught:
        Model(network).export(tmp_path / "model.onx")
    assert ".html" in caught.value.allowed


def test_a_comparison_in_memory(
    toy_dataset: Callable[..., xr.Dataset], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    found = cb.compare(toy_dataset(1200), ["ridge", "reference_mlp_log"], quick=True, workers=1)
    assert sorted(found.league.index) == ["reference_mlp_log", "ridge"]
    assert found.league["valid_error"].is_monotonic_increasing
    assert any("no physics gate" in line for line in found.remarks)
    assert found.gate.empty
    assert found.best.name == found.chosen == found.league.index[0]
    assert set(found.models) == set(found.league.index)
    text = " ".join(ElementTree.fromstring(found._repr_html_()).itertext())
    assert "held-out rows" in text
    assert "no statement about a blast" in text
    assert not list(tmp_path.iterdir())
    page = found.report("report.html").read_text()
    assert "data:image/png;base64" in page
    assert [file.name for file in tmp_path.iterdir()] == ["report.html"]
    monkeypatch.undo()
