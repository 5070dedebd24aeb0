"""Comparisons that are stopped, repeated and shared out; the lab book read without its library."""

import csv
import json
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from castblast.api.training.judging import DEMO
from castblast.cli import main
from castblast.errors import SimulationError
from castblast.jobs import Job, run_jobs
from castblast.stages.comparison.run import compare
from castblast.stages.training.runs import list_runs
from castblast.stages.training.train import train
from castblast.surrogate.fitting import kept, training

SPECS = {
    "first": "kind: mlp\nmax_iterations: 40\nhidden_layers: [5]\ntarget_transform: log\n",
    "second": "kind: ridge\ninput_transform: log\ntarget_transform: log\n",
    "third": "kind: ridge\ndegree: 2\ninput_transform: log\ntarget_transform: log\n",
}
EXTENT = replace(DEMO, curve_sizes=(150,))
#: Files that hold times, or say where the dataset lies; pictures are not drawn here.
_NOT_SAME = (".png", "timings.json", "timings.html", "dataset.txt")


@pytest.fixture(scope="module", autouse=True)
def _no_pictures() -> Iterator[None]:
    """Drawing takes most of the time of a small comparison, and is tested elsewhere."""

    def write(figure: object, path: Path, **options: object) -> None:
        Path(path).write_bytes(b"picture")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.figure.Figure.savefig", write)
        yield


@pytest.fixture(scope="module")
def source(toy_dataset, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Path]]:
    folder = tmp_path_factory.mktemp("toy")
    toy_dataset(400).to_netcdf(folder / "toy.nc")
    for name, text in SPECS.items():
        (folder / f"{name}.yaml").write_text(text)
    return folder / "toy.nc", [folder / f"{name}.yaml" for name in SPECS]


@pytest.fixture(scope="module")
def whole(source, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A comparison in one go, with its lab book."""
    out = tmp_path_factory.mktemp("whole")
    _compare(source, out, workers=1, tracking=True, runs=out / "runs")
    return out


def _compare(source, out: Path, **options):
    return compare(*source, out / "comparison", fits=out / "fits", extent=EXTENT, **options)


def _same(out: Path) -> dict[str, bytes]:
    return {
        path.relative_to(out).as_posix(): path.read_bytes()
        for folder in ("comparison", "fits")
        for path in sorted((out / folder).rglob("*"))
        if path.is_file() and not path.name.endswith(_NOT_SAME)
    }


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[str]]:
    """Count fits by name; the one given by number raises what a Ctrl-C raises."""

    def start(stop_at: int | None = None) -> list[str]:
        names: list[str] = []

        def counting(spec, table, *arguments, **options):
            names.append(spec.name)
            if len(names) == stop_at:
                raise KeyboardInterrupt
            return real(spec, table, *arguments, **options)

        monkeypatch.setattr(training, "fit_spec", counting)
        return names

    real = training.fit_spec
    return start


def test_a_stopped_comparison_goes_on(source, whole: Path, counted, tmp_path: Path) -> None:
    """Stopped in its second fit and again in a curve: nothing finished is made again."""
    counted(stop_at=2)
    with pytest.raises(KeyboardInterrupt):
        _compare(source, tmp_path, workers=1)
    assert (tmp_path / "fits" / "first" / "fit.json").is_file()
    names = counted(stop_at=3)
    with pytest.raises(KeyboardInterrupt):
        _compare(source, tmp_path, workers=1)
    assert names[:2] == ["second", "third"]
    chosen = names[2]
    names = counted()
    _compare(source, tmp_path, workers=1)
    assert names == [chosen], "only the learning curve was left"
    assert _same(tmp_path) == _same(whole)
    names = counted()
    _compare(source, tmp_path, workers=1)
    assert names == [], "a finished comparison only writes"


def test_a_changed_spec_alone_is_fitted_again(source, counted, toy_dataset, tmp_path: Path) -> None:
    """What changes a fit makes it anew: its spec, its rows. A search block does not."""
    dataset, specs = source
    own = [tmp_path / path.name for path in specs[1:]]
    for path in own:
        path.write_text(SPECS[path.stem])
    fits = tmp_path / "fits"
    names = counted()
    train(dataset, own, fits)
    assert names == ["second", "third"]
    own[0].write_text(SPECS["second"] + "search:\n  penalty: {range: [1e-9, 1], log: true}\n")
    own[1].write_text(SPECS["third"] + "penalty: 1e-3\n")
    names = counted()
    train(dataset, own, fits)
    assert names == ["third"]
    toy_dataset(400, seed=1).to_netcdf(tmp_path / "other.nc")
    names = counted()
    train(tmp_path / "other.nc", own, fits)
    assert names == ["second", "third"]


def test_a_damaged_store_is_made_again(source, counted, tmp_path: Path) -> None:
    dataset, specs = source
    fits = tmp_path / "fits"
    train(dataset, specs[1:2], fits)
    entry = kept._entry(fits / "second")
    assert entry is not None
    entry.write_bytes(entry.read_bytes()[:-100])
    names = counted()
    train(dataset, specs[1:2], fits)
    assert names == ["second"]


@pytest.mark.skipif(os.name == "nt", reason="POSIX modes")
def test_without_a_cache_each_fit_is_still_made_once(
    source, counted, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No private folder for the store: the fits come back from their processes."""
    (tmp_path / "blocked").write_text("")
    monkeypatch.setenv("CASTBLAST_CACHE_DIR", str(tmp_path / "blocked"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    (tmp_path / f"castblast-{os.geteuid()}-kept").mkdir()
    (tmp_path / f"castblast-{os.geteuid()}-kept").chmod(0o777)
    assert not kept.keep(tmp_path / "any", b"thing")
    dataset, specs = source
    names = counted()
    outcome = train(dataset, specs[1:], tmp_path / "fits", workers=2)
    assert [row[0] for row in outcome.rows] == ["second", "third"]
    assert names == [], "made by the processes, not once more here"
    assert (tmp_path / "fits" / "third" / "fit.json").is_file()
    train(dataset, specs[1:2], tmp_path / "fits")
    assert names == ["second"], "nothing is kept"


def test_a_folder_of_fits_is_compared_as_it_stands(source, whole: Path, counted) -> None:
    """The fits know their specs and where their dataset lies."""
    names = counted()
    outcome = compare(whole / "fits", out=whole / "again", extent=EXTENT, workers=1)
    assert names == []
    assert {entry["name"] for entry in outcome.document["league"]} == set(SPECS)
    again = (whole / "again" / "comparison.json").read_bytes()
    assert again == (whole / "comparison" / "comparison.json").read_bytes()


def test_unwritable_folders_are_named_first(
    source, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A file stands where a folder should be: as good as a folder without permission."""
    (tmp_path / "blocked").write_text("")
    blocked = str(tmp_path / "blocked" / "inside")
    first = [str(source[0]), str(source[1][1])]
    out = str(tmp_path / "out")
    for arguments in (
        ["compare", *first, "--out", blocked],
        ["compare", *first, "--out", out, "--fits", blocked],
        ["compare", *first, "--out", out, "--fits", str(tmp_path / "fits"), "--runs", blocked],
        ["train", *first, "--out", blocked],
        ["train", *first, "--out", out, "--runs", blocked],
    ):
        assert main(arguments) == 2
        assert "blocked" in capsys.readouterr().err
    assert not list(tmp_path.rglob("fit.json"))


def test_two_at_a_time_give_the_same_bytes(source, whole: Path, tmp_path: Path) -> None:
    """With the lab book, which only observes, and without it."""
    _compare(source, tmp_path, workers=2)
    assert _same(tmp_path) == _same(whole)


def test_jobs_end_with_the_first_fault() -> None:
    """The fault comes through, and the long job beside it is not waited for."""
    begun = time.monotonic()
    with pytest.raises(ZeroDivisionError):
        run_jobs([Job("long", time.sleep, (60,)), Job("bad", divmod, (1, 0))], workers=2)
    assert time.monotonic() - begun < 30


def test_a_process_that_dies_is_said() -> None:
    jobs = [Job("fit a", os._exit, (1,)), Job("fit b", time.sleep, (600,))]
    with pytest.raises(SimulationError, match=r"a process died on one of: fit a, fit b"):
        run_jobs(jobs, workers=2)


def test_results_come_in_the_order_of_the_jobs() -> None:
    kept: list[object] = []
    jobs = [Job(str(n), divmod, (n, 2), kept.append) for n in range(4)]
    assert run_jobs(jobs, workers=1) == [(0, 0), (0, 1), (1, 0), (1, 1)]
    assert len(kept) == 4


def _book(whole: Path) -> tuple[Any, dict[str, Any]]:
    """Client of MLflow for the lab book of the comparison, and its runs by their id."""
    mlflow = pytest.importorskip("mlflow")
    uri = f"sqlite:///{whole / 'runs' / 'mlflow.db'}"
    assert mlflow.get_tracking_uri() != uri, "the book is not left open"
    client = mlflow.MlflowClient(uri, registry_uri=uri)
    (experiment,) = [e for e in client.search_experiments() if e.name == "toy/1"]
    runs = client.search_runs([experiment.experiment_id])
    return client, {run.info.run_id: run for run in runs}


def test_the_book_holds_fits_with_their_data_and_the_champion(whole: Path) -> None:
    """One run per fit under a parent, the dataset with each, the chosen model as champion."""
    client, runs = _book(whole)
    fitted = [run for run in runs.values() if "spec.sha256" in run.data.tags]
    assert len(fitted) == len(runs) - 1 == 3
    for run in fitted:
        assert "test_p95_rel_err_burden_velocity" in run.data.metrics
        assert run.inputs.dataset_inputs[0].dataset.name == "toy"
    champion = client.get_model_version_by_alias("castblast_toy", "champion")
    chosen = json.loads((whole / "comparison" / "comparison.json").read_text())["chosen"]
    assert f"/{chosen}/" in client.get_run(champion.run_id).info.run_name
    (model,) = (whole / "runs" / "artifacts").glob(f"models/{champion.source.split('/')[-1]}")
    signature = (model / "artifacts" / "MLmodel").read_text()
    assert "signature:" in signature
    assert "burden_velocity" in signature


def test_the_parent_run_shows_the_champion_and_its_errors(whole: Path) -> None:
    """Name, errors in percent as in the league, and a description that says both."""
    _, runs = _book(whole)
    (parent,) = [run for run in runs.values() if run.data.tags["stage"] == "compare"]
    league = json.loads((whole / "comparison" / "comparison.json").read_text())
    chosen = next(entry for entry in league["league"] if entry["name"] == league["chosen"])
    assert parent.data.tags["champion"] == league["chosen"]
    for key in ("valid_error", "test_error"):
        assert parent.data.metrics[f"{key}_percent"] == pytest.approx(100 * chosen[key], rel=1e-12)
    note = parent.data.tags["mlflow.note.content"]
    for said in (
        f"Champion: `{league['chosen']}`", f"test error {chosen['test_error']:.2%}",
        f"validation error {chosen['valid_error']:.2%}", "dataset `toy` 1.", " test rows; 3 models",
        "ranked by validation rows",
    ):  # fmt: skip
        assert said in note, note
    assert f"{league['test_rows']} test rows" in note


def test_metrics_for_dvc_are_flat_and_those_of_the_league(whole: Path) -> None:
    """One number per key and no times; the table of errors has the order of the league."""
    metrics = json.loads((whole / "comparison" / "metrics.json").read_text())
    league = json.loads((whole / "comparison" / "comparison.json").read_text())
    assert metrics.pop("champion") == league["chosen"]
    assert all(isinstance(value, int | float) for value in metrics.values())
    assert not any("seconds" in key for key in metrics)
    assert metrics["rows_test"] == league["test_rows"]
    chosen = next(entry for entry in league["league"] if entry["name"] == league["chosen"])
    for target, figures in chosen["targets"].items():
        p95 = metrics[f"test_p95_percent_{target}"]
        assert p95 == pytest.approx(100 * figures["relative_error_95"], rel=1e-12)
        assert 0.0 < metrics[f"test_median_percent_{target}"] < p95
    with (whole / "comparison" / "league.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["model"] for row in rows] == [entry["name"] for entry in league["league"]]
    for row, entry in zip(rows, league["league"], strict=True):
        for key in ("valid_error", "test_error"):
            assert float(row[f"{key}_percent"]) == pytest.approx(100 * entry[key], rel=1e-12)


def test_runs_are_listed(whole: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The list agrees with what MLflow itself says of its store."""
    _, stored = _book(whole)
    assert main(["runs", str(whole / "runs"), "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["runs"]
    assert {entry["run_id"] for entry in listed} == set(stored)
    for entry in listed:
        run = stored[entry["run_id"]]
        assert entry["metrics"] == run.data.metrics
        assert entry["name"] == run.info.run_name
        assert entry["status"] == run.info.status.lower()
        assert entry["tags"].items() <= run.data.tags.items()
    assert [entry["parent_id"] for entry in listed] == ["", *[listed[0]["run_id"]] * 3]
    assert listed[0]["tags"]["stage"] == "compare"


def test_runs_are_sorted_by_a_metric(whole: Path) -> None:
    ranked = list_runs(whole / "runs", sort="valid_error", limit=2).document["runs"]
    errors = [entry["metrics"]["valid_error"] for entry in ranked]
    assert len(errors) == 2
    assert errors == sorted(errors)
    ranked = list_runs(whole / "runs", sort="test_r2_burden_velocity", stage="fit")
    squares = [entry["metrics"]["test_r2_burden_velocity"] for entry in ranked.document["runs"]]
    assert squares == sorted(squares, reverse=True)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("none",), ("mlflow.db", "no record of runs")),
        (("runs", "--experiment", "toy/2"), ("toy/2", "did you mean 'toy/1'")),
        (("runs", "--stage", "fits"), ("fits", "did you mean 'fit'")),
        (("runs", "--sort", "valid_eror"), ("did you mean 'valid_error'",)),
        (("broken",), ("mlflow.db", "cannot be read")),
        (("other",), ("mlflow.db", "not a store of MLflow")),
    ],
)
def test_lists_that_cannot_be_made(
    whole: Path, capsys: pytest.CaptureFixture[str], arguments, words
) -> None:
    import sqlite3

    for name in ("broken", "other"):
        (whole / name).mkdir(exist_ok=True)
    (whole / "broken" / "mlflow.db").write_bytes(b"no database at all, but long enough to try")
    with sqlite3.connect(whole / "other" / "mlflow.db") as base:
        base.execute("CREATE TABLE IF NOT EXISTS runs (run_uuid TEXT)")
    assert main(["runs", str(whole / arguments[0]), *arguments[1:]]) == 2
    said = capsys.readouterr().err
    for word in words:
        assert word in said, said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("toy.nc", "none.yaml"), ("none.yaml", "no such file")),
        (("toy.nc", "bad.yaml"), ("bad.yaml", "mpl", "did you mean 'mlp'")),
        (("toy.nc", "target.yaml"), ("powder_factor", "no such variable")),
        (("toy.nc", "empty"), ("empty", "holds no model spec")),
        (("empty",), ("empty", "holds no fits")),
        (("toy.nc", "first.yaml", "first.yaml"), ("'first' is taken",)),
    ],
)
def test_bad_comparisons_are_refused(
    source, capsys: pytest.CaptureFixture[str], tmp_path: Path, arguments, words
) -> None:
    folder = source[0].parent
    (folder / "bad.yaml").write_text("kind: mpl\n")
    (folder / "target.yaml").write_text("kind: ridge\ntargets: [powder_factor]\n")
    (folder / "empty").mkdir(exist_ok=True)
    paths = [str(folder / name) for name in arguments]
    assert main(["compare", *paths, "--out", str(tmp_path / "out"), "--no-tracking"]) == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said
    for word in words:
        assert word in said, said
    assert not (tmp_path / "out").exists()
