"""Search the settings of a spec: a study that can be stopped, and the best spec it found."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from castblast.api.training.fits import require_training
from castblast.disk.files import require_writable, write_json, write_text
from castblast.progress import ProgressCallback, silent
from castblast.specs.models.model import read_model_spec, refuse_code
from castblast.stages.outcome import Outcome
from castblast.stages.training.train import RUNS_FOLDER
from castblast.surrogate.fitting.metrics import show_share

if TYPE_CHECKING:
    from castblast.specs.models.model import ModelSpec
    from castblast.surrogate.searching.tuning import StudyResult

_SHOWN = 5


def tune(
    dataset: str | Path,
    spec: str | Path,
    *,
    trials: int | None = None,
    timeout: float | None = None,
    study: str | Path | None = None,
    out: str | Path | None = None,
    seed: int = 0,
    tracking: bool = False,
    runs: str | Path = RUNS_FOLDER,
    allow_code: bool = False,
    progress: ProgressCallback = silent,
) -> Outcome:
    """Search the space that a spec declares under ``search``.

    Parameters
    ----------
    dataset : path
        NetCDF written by `castblast generate`.
    spec : path
        Model spec (YAML) with a block ``search``.
    trials : int, optional
        Finished trials in total; a study that was stopped goes on up to it.
    timeout : float, optional
        No trial starts later than this [s] after the call.
    study : path, optional
        Journal of the study; default ``<out>/study.journal``.
    out : path, optional
        Folder for ``study.json``, ``<name>_tuned.yaml`` and ``importance.png``; default
        ``studies/<name>`` beside the dataset.
    seed : int
        Of the sampler.
    tracking : bool
        Keep a record in MLflow under `runs`; changes no result.
    allow_code : bool
        Run the Python code that specs of kind ``custom`` name.
    progress : callable

    Raises
    ------
    MissingLibraryError
        A library that the study, the spec or the record needs is not installed.
    SpecError
        An unusable spec, search space or budget; a journal of another study.
    DatasetError
        An unusable dataset.
    """
    dataset = Path(dataset)
    spec = Path(spec)
    study = None if study is None else Path(study)
    out = None if out is None else Path(out)
    runs = Path(runs)
    wanted = read_model_spec(spec)
    refuse_code([wanted], allowed=allow_code)
    require_training("castblast tune", [wanted], "tune", tracking=tracking)
    from castblast.dataset.file.store import open_dataset
    from castblast.surrogate.fitting.rows import read_rows
    from castblast.surrogate.searching import tuning

    tuning.check_study(wanted, trials, timeout)
    table = read_rows(open_dataset(dataset), [wanted], dataset)
    folder = dataset.parent / "studies" / wanted.name if out is None else out
    require_writable(folder)
    if tracking:
        require_writable(runs)
    journal = folder / "study.journal" if study is None else study
    result = tuning.tune(
        wanted, table, journal, trials=trials, timeout=timeout, seed=seed, progress=progress
    )
    files = _write(folder, result, table.source.get("name", str(dataset)))
    if tracking:
        from castblast.surrogate.keeping.tracking import MlflowTracker

        MlflowTracker(runs).record_study(result, table, files)
    return _outcome(result, folder, journal)


def _write(folder: Path, result: StudyResult, dataset: str) -> list[Path]:
    """Write all trials, the best spec and the picture."""
    from castblast.report.models.tuning_figures import draw_study

    picture = draw_study(
        folder / "importance.png",
        f"{result.identity['spec']}: {len(result.trials)} trials on {dataset}",
        [(trial.number, trial.error, trial.state) for trial in result.trials],
        result.importance,
    )
    document = write_json(folder / "study.json", study_document(result))
    return [document, write_text(folder / f"{result.spec.name}.yaml", spec_text(result)), picture]


def study_document(result: StudyResult) -> dict[str, Any]:
    """Everything worth keeping of a study as plain JSON values; no times, no paths."""
    return {
        "study": dict(result.identity),
        "objective": "geometric mean over the targets of the 95 % relative error, validation rows",
        "best": result.best.number,
        "best_error": result.best.error,
        "spec": result.spec.model_dump(mode="json"),
        "importance": dict(result.importance),
        "trials": [
            {
                "number": trial.number,
                "state": trial.state,
                "error": trial.error,
                "parameters": trial.parameters,
                "settings": dict(trial.settings),
                "remark": trial.remark,
            }
            for trial in result.trials
        ],
    }


def spec_text(result: StudyResult) -> str:
    """Best settings as a file for ``models/specs``, with where they come from."""
    import yaml

    identity = result.identity
    finished = sum(trial.error is not None for trial in result.trials)
    head = (
        f"# Found by a study of {len(result.trials)} trials ({finished} finished) on dataset "
        f"{identity['dataset'] or '(unnamed)'},\n"
        f"# content {identity['dataset_sha256'][:12]}, from spec {identity['spec']} "
        f"({identity['spec_sha256'][:12]}), seed {identity['seed']}; trial {result.best.number}.\n"
    )
    content = _content(result.spec)
    return head + yaml.safe_dump(
        content, sort_keys=False, default_flow_style=None, allow_unicode=True, width=99
    )


def _content(spec: ModelSpec) -> dict[str, Any]:
    content = spec.model_dump(mode="json")
    del content["name"]  # the file's
    description = content.pop("description")
    tuned = f"{description}, tuned" if description else "tuned"
    return {"kind": content.pop("kind"), "description": tuned, **content}


def _outcome(result: StudyResult, folder: Path, journal: Path) -> Outcome:
    finished = sorted(
        (trial for trial in result.trials if trial.error is not None),
        key=lambda trial: (trial.error, trial.number),
    )
    header = ["trial", "95 % within", "parameters", "settings"]
    rows = [
        [
            f"{trial.number}{' *' if trial.number == result.best.number else ''}",
            show_share(trial.error),
            "" if trial.parameters is None else f"{trial.parameters:,}",
            ", ".join(f"{name} {_show(value)}" for name, value in trial.settings.items()),
        ]
        for trial in finished[:_SHOWN]
    ]
    counts = {
        state: sum(trial.state == state for trial in result.trials)
        for state in ("complete", "pruned", "failed")
    }
    counts["interrupted and tried again"] = result.interrupted
    told = ", ".join(f"{count} {state}" for state, count in counts.items() if count)
    lines = [f"* best, the smallest of those within 1 % of the lowest error; trials: {told}"]
    remarks = list(dict.fromkeys(trial.remark for trial in result.trials if trial.remark))
    lines += [f"failed: {remark}" for remark in remarks[:3]]
    lines += [
        f"wrote {folder / f'{result.spec.name}.yaml'}",
        f"run the same command with more --trials to resume from {journal}",
    ]
    document = {**study_document(result), "out": str(folder), "journal": str(journal)}
    return Outcome(
        document=document,
        title="Best trials, validation rows",
        header=header,
        rows=rows,
        lines=lines,
    )


def _show(value: Any) -> str:
    if isinstance(value, list):
        return "x".join(map(str, value))
    return f"{value:.3g}" if isinstance(value, float) else str(value)
