"""Studies: what a trial tries depends on its predecessors alone, whatever happened to the process.

The specs are tiny; one fit takes some hundredths of a second.
"""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from castblast.cli import main
from castblast.errors import SpecError
from castblast.specs.models.model import PAPER_FEATURES, PAPER_TARGETS, read_model_spec
from castblast.stages.training.tune import tune as tune_stage
from castblast.surrogate.fitting.features import read_table
from castblast.surrogate.searching import tuning

SPEC = """
kind: mlp
description: tiny
hidden_layers: [5]
max_iterations: 25
target_transform: log
search:
  hidden_layers: {depth: [1, 2], width: [3, 9]}
  activation: {choices: [tanh, relu]}
  penalty: {range: [1e-8, 1e-2], log: true}
  refinements: {integers: [0, 1]}
"""
TRIALS = 13  # three beyond the random start of the sampler

#: A process that dies in its fourth trial, hard, while the trial runs.
DYING = """
import os, sys
from pathlib import Path
from castblast.surrogate.searching import tuning
from castblast.stages.training.tune import tune
fit, calls = tuning.fit_spec, []
def dying(*arguments, **options):
    calls.append(1)
    if len(calls) == 4:
        print("in the fourth trial", flush=True)
        import time
        time.sleep(60)
    return fit(*arguments, **options)
tuning.fit_spec = dying
tune(Path(sys.argv[1]), Path(sys.argv[2]), trials=13, out=Path(sys.argv[3]))
"""


@pytest.fixture(scope="module")
def folder(toy_dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("study")
    toy_dataset(400).to_netcdf(made / "toy.nc")
    (made / "tiny.yaml").write_text(SPEC)
    return made


@pytest.fixture(scope="module")
def table(toy_dataset):
    return read_table(toy_dataset(400), PAPER_FEATURES, PAPER_TARGETS)


@pytest.fixture(scope="module")
def spec(folder: Path):
    return read_model_spec(folder / "tiny.yaml")


@pytest.fixture(scope="module")
def whole(folder: Path):
    """A study in one go, by the stage: outcome and folder."""
    outcome = tune_stage(folder / "toy.nc", folder / "tiny.yaml", trials=TRIALS, out=folder / "a")
    return outcome, folder / "a"


def _finished(document: dict) -> list[tuple]:
    return [
        (trial["error"], trial["settings"])
        for trial in document["trials"]
        if trial["state"] == "complete"
    ]


def test_a_study_in_parts_is_the_study_in_one_go(whole, spec, table, tmp_path: Path) -> None:
    for trials in (3, 11, TRIALS):
        parts = tuning.tune(spec, table, tmp_path / "parts.journal", trials=trials)
        assert len(parts.trials) == trials
    found = [(trial.error, trial.settings) for trial in parts.trials]
    assert found == _finished(whole[0].document)
    again = tuning.tune(spec, table, tmp_path / "parts.journal", trials=5)
    assert len(again.trials) == TRIALS, "earlier trials count: nothing is left to do"


def test_a_killed_study_goes_on(whole, folder: Path, tmp_path: Path) -> None:
    """SIGKILL in a running trial: its settings are tried again, and no byte tells of the kill."""
    arguments = [folder / "toy.nc", folder / "tiny.yaml", tmp_path]
    process = subprocess.Popen(
        [sys.executable, "-c", DYING, *map(str, arguments)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline().startswith("in the fourth")
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    journal = tmp_path / "study.journal"
    with journal.open("ab") as stream:  # what a kill in the middle of a write leaves
        stream.write(b'{"op_code":5,"worker')
    (tmp_path / "study.journal.lock").touch()
    begun = time.monotonic()
    outcome = tune_stage(folder / "toy.nc", folder / "tiny.yaml", trials=TRIALS, out=tmp_path)
    assert time.monotonic() - begun < 20, "the lock of the dead process was waited for"
    assert any("1 interrupted and tried again" in line for line in outcome.lines)
    for name in ("study.json", "tiny_tuned.yaml", "importance.png"):
        assert (tmp_path / name).read_bytes() == (whole[1] / name).read_bytes(), name


@pytest.mark.parametrize("place", ["before it begins", "in its fit"])
def test_a_study_killed_in_its_first_trial_still_begins_with_the_spec_itself(
    spec, table, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    """Its own settings were put in the queue by then, and stood in the journal as tried."""
    import optuna

    inside = spec.model_copy(update={"penalty": 1e-6})

    def die(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        if place == "in its fit":
            patch.setattr(tuning, "fit_spec", die)
        else:
            patch.setattr(optuna.study.Study, "ask", die)
        with pytest.raises(KeyboardInterrupt):
            tuning.tune(inside, table, tmp_path / "killed.journal", trials=3)
    found = tuning.tune(inside, table, tmp_path / "killed.journal", trials=3)
    whole = tuning.tune(inside, table, tmp_path / "whole.journal", trials=3)
    assert found.trials[0].settings["penalty"] == 1e-6
    assert found.trials == whole.trials
    assert found.interrupted == (1 if place == "in its fit" else 0)


def test_the_best_spec_is_a_complete_spec(whole, spec, table) -> None:
    """The file that a study writes gives the error that the study found, and no space is lost."""
    outcome, out = whole
    tuned = read_model_spec(out / "tiny_tuned.yaml")
    assert tuned.description == "tiny, tuned"
    document = json.loads((out / "study.json").read_text())
    assert document["best_error"] == outcome.document["best_error"]
    errors = [error for error, _ in _finished(document)]
    assert min(errors) <= document["best_error"] <= tuning.TIE * min(errors)
    fit = tuning.fit_spec(tuned, table)
    assert fit.restart.valid_error == pytest.approx(document["best_error"], rel=1e-9)
    assert sum(document["importance"].values()) == pytest.approx(1.0)
    assert (out / "importance.png").read_bytes().startswith(b"\x89PNG")


def test_the_parent_run_shows_the_best_trial(folder: Path, tmp_path: Path) -> None:
    """Its error in percent as in the study, no test error, and a description that says so."""
    mlflow = pytest.importorskip("mlflow")
    outcome = tune_stage(
        folder / "toy.nc", folder / "tiny.yaml", trials=2, out=tmp_path / "study", tracking=True,
        runs=tmp_path / "runs",
    )  # fmt: skip
    client = mlflow.MlflowClient(f"sqlite:///{tmp_path / 'runs' / 'mlflow.db'}")
    (experiment,) = [e for e in client.search_experiments() if e.name == "toy/1"]
    runs = client.search_runs([experiment.experiment_id])
    (parent,) = [run for run in runs if run.data.tags["stage"] == "tune"]
    assert parent.data.tags["champion"] == "tiny_tuned"
    error = outcome.document["best_error"]
    assert parent.data.metrics["valid_error_percent"] == pytest.approx(100 * error, rel=1e-12)
    assert not any("test" in name for name in parent.data.metrics)
    note = parent.data.tags["mlflow.note.content"]
    for said in ("**Best: `tiny_tuned`**", f"validation error {error:.2%}", "2 trials of `tiny`",
                 "test rows are not used"):  # fmt: skip
        assert said in note, note


def test_the_first_trial_is_the_spec_itself(whole, spec) -> None:
    """Its penalty of 0 lies outside the space, so nothing stands for it; inside, it is trial 0."""
    assert whole[0].document["trials"][0]["settings"] != {"hidden_layers": [5]}
    inside = spec.model_copy(update={"penalty": 1e-6})
    parameters = tuning.own_parameters(inside, inside.search)
    assert parameters == {
        "hidden_layers.depth": 1, "hidden_layers.width": 5, "activation": '"tanh"',
        "penalty": 1e-6, "refinements": 0,
    }  # fmt: skip


def test_a_smaller_model_wins_a_tie() -> None:
    """Errors within 1 % are level; among them the size decides, then the error."""

    def record(number: int, error: float | None, parameters: int | None):
        state = "failed" if error is None else "complete"
        return tuning.TrialRecord(number, state, error, parameters, {})

    records = [
        record(0, 0.0100, 900), record(1, 0.01005, 300), record(2, 0.01008, 300),
        record(3, 0.0200, 10), record(4, None, 1), record(5, 0.01001, None),
    ]  # fmt: skip
    best = tuning.best_trial(records)
    assert best is not None
    assert best.number == 1
    assert tuning.best_trial([record(0, None, 1)]) is None


def test_fits_that_lag_behind_are_stopped(monkeypatch, spec, table, tmp_path: Path) -> None:
    """Reports of a fit that stays above the median of its forerunners end its trial early."""
    real, reports = tuning.fit_spec, []

    def reporting(candidate, rows, report):
        error = 1.0 if candidate.activation == "relu" else 0.5
        reports.append(0)
        for _ in range(20):
            reports[-1] += 1
            report(error)
        return real(candidate, rows)

    monkeypatch.setattr(tuning, "fit_spec", reporting)
    result = tuning.tune(spec, table, tmp_path / "pruned.journal", trials=12)
    pruned = [trial for trial in result.trials if trial.state == "pruned"]
    assert pruned
    assert all(trial.settings["activation"] == "relu" for trial in pruned)
    assert all(reports[trial.number] < 20 for trial in pruned)
    assert result.best.state == "complete"


def test_a_fit_that_cannot_be_made_is_a_failed_trial(
    monkeypatch, spec, table, tmp_path: Path
) -> None:
    real = tuning.fit_spec

    def failing(candidate, rows, report):
        if candidate.activation == "relu":
            raise SpecError("no relu here")
        return real(candidate, rows)

    monkeypatch.setattr(tuning, "fit_spec", failing)
    result = tuning.tune(spec, table, tmp_path / "failed.journal", trials=6)
    failed = [trial for trial in result.trials if trial.state == "failed"]
    assert failed
    assert {trial.remark for trial in failed} == {"no relu here"}
    assert len(result.trials) == 6


def test_a_journal_of_another_study_is_refused(whole, spec, table, toy_dataset) -> None:
    journal = whole[1] / "study.journal"
    before = journal.read_bytes()
    other = read_table(toy_dataset(400, seed=1), PAPER_FEATURES, PAPER_TARGETS)
    with pytest.raises(SpecError, match=r"holds another study .*rows sha256.*another --study"):
        tuning.tune(spec, other, journal, trials=20)
    changed = spec.model_copy(update={"max_iterations": 30})
    with pytest.raises(SpecError, match=r"holds another study .*spec sha256"):
        tuning.tune(changed, table, journal, trials=20)
    with pytest.raises(SpecError, match=r"holds another study \(seed 0 there, 1 here\)"):
        tuning.tune(spec, table, journal, trials=20, seed=1)
    assert journal.read_bytes() == before


@pytest.mark.parametrize(
    "content", [b"hello", b"hello\nworld\n", b'{"a": 1}\n', b'{"op_code":0,"study', b"\x00\x01\n"]
)
def test_a_damaged_journal_is_named(content: bytes, spec, table, tmp_path: Path) -> None:
    journal = tmp_path / "damaged.journal"
    journal.write_bytes(content)
    if content.startswith(b'{"op_code"'):  # nothing but half a record: an empty study
        assert len(tuning.tune(spec, table, journal, trials=1).trials) == 1
        return
    with pytest.raises(SpecError, match=r"damaged\.journal: is not a study journal"):
        tuning.tune(spec, table, journal, trials=1)


def test_two_processes_do_not_share_a_study(spec, table, tmp_path: Path) -> None:
    from castblast.surrogate.searching.study_file import hold_study

    with (
        hold_study(tmp_path / "held.journal"),
        pytest.raises(SpecError, match="another process is at work"),
    ):
        tuning.tune(spec, table, tmp_path / "held.journal", trials=1)


@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        (("", ""), ("--trials", "0"), ("trials: 0",)),
        (("", ""), (), ("number of trials", "timeout")),
        (("", ""), ("--timeout", "-1"), ("timeout: -1 s",)),
        ((SPEC[SPEC.index("search:") :], ""), ("--trials", "3"), ("no block 'search'",)),
        ((SPEC[SPEC.index("search:") :], "search: {}"), ("--trials", "3"), ("names no field",)),
        (("  penalty:", "  penalti:"), ("--trials", "3"), ("penalti", "did you mean 'penalty'")),
        (("[1e-8, 1e-2]", "[1, 0.1]"), ("--trials", "3"), ("penalty", "below the second")),
        (("[1e-8,", "[0,"), ("--trials", "3"), ("penalty", "above 0")),
        (("range:", "rang:"), ("--trials", "3"), ("penalty", "range is needed")),
        (("kind: mlp", "kind: mpl"), ("--trials", "3"), ("mpl", "did you mean 'mlp'")),
    ],
)
def test_bad_studies_are_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], change, options, words
) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(SPEC.replace(*change) if change[0] else SPEC)
    files = [str(folder / "toy.nc"), str(path), "--out", str(tmp_path / "out")]
    code = main(["tune", *files, *options])
    said = capsys.readouterr().err
    assert code == 2, said
    assert "Traceback" not in said
    for word in words:
        assert word in said, said
    assert not (tmp_path / "out").exists()
