"""Studies over the settings of a spec: the only module that imports Optuna.

The journal file keeps every trial, so a study that was stopped, or killed, goes on where it was.
The sampler starts anew for every trial, from the seed and the number of trials finished before:
what a trial tries depends on the seed and its predecessors alone, not on where a run was broken.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any, Literal

from castblast.errors import CastblastError, SpecError
from castblast.extras import require
from castblast.progress import ProgressCallback, silent
from castblast.specs.models.model import ModelSpec
from castblast.specs.models.search import SearchSpace, search_faults
from castblast.surrogate.fitting.features import Table
from castblast.surrogate.fitting.fit_store import table_hash
from castblast.surrogate.fitting.training import fit_spec
from castblast.surrogate.searching.study_file import hold_study
from castblast.surrogate.searching.tuning_space import candidate, own_parameters, suggest
from castblast.version import __version__

State = Literal["complete", "pruned", "failed"]
#: Errors this close to the lowest (ratio) count as equal; the smaller model is the better one.
TIE = 1.01
_STARTUP = 10
_STUDY = "castblast"


@dataclass(frozen=True)
class TrialRecord:
    """One trial that came to its end.

    Attributes
    ----------
    number : int
        Among those that did: one in which the process died was tried again and leaves no trace.
    state : {"complete", "pruned", "failed"}
        "failed": the settings could not be fitted.
    error : float or None
        Geometric mean over the targets of the 95 % relative error on validation rows.
    parameters : int or None
        Weights of the model where they can be counted.
    settings : mapping
        Field of the spec to its value.
    remark : str
        Why it failed.
    """

    number: int
    state: State
    error: float | None
    parameters: int | None
    settings: Mapping[str, Any]
    remark: str = ""


@dataclass(frozen=True)
class StudyResult:
    """A study as far as it went.

    Attributes
    ----------
    spec : ModelSpec
        The best settings as a complete spec, named ``<name>_tuned``.
    best : TrialRecord
    trials : tuple of TrialRecord
        By number.
    interrupted : int
        Trials in which the process died, each of which was tried again.
    importance : mapping of field to float
        Share of the field in the spread of the error (sums to 1); empty below four trials.
    identity : mapping
        What the study is about: hashes of dataset, rows and spec, seed.
    """

    spec: ModelSpec
    best: TrialRecord
    trials: tuple[TrialRecord, ...]
    interrupted: int
    importance: Mapping[str, float]
    identity: Mapping[str, str]


def tune(
    spec: ModelSpec,
    table: Table,
    journal: Path,
    *,
    trials: int | None = None,
    timeout: float | None = None,
    seed: int = 0,
    progress: ProgressCallback = silent,
) -> StudyResult:
    """Search the declared space of a spec with the tree-structured Parzen estimator.

    Parameters
    ----------
    spec : ModelSpec
        With a ``search`` block; its own settings are the first trial if they lie in the space.
    table : Table
        Holds at least the features and targets of the spec.
    journal : path
        File of the study; made if absent, continued if it is of the same study.
    trials : int, optional
        Finished trials in total, earlier ones included.
    timeout : float, optional
        No trial starts later than this [s] after the call. One of the two bounds is needed.
    seed : int
    progress : callable

    Raises
    ------
    SpecError
        No or an unusable search space, no budget, a journal that is damaged, in use or of another
        study, or not one trial that could be fitted.

    References
    ----------
    Bergstra, Bardenet, Bengio & Kegl (2011), Algorithms for hyper-parameter optimization, NIPS 24.
    """
    space = check_study(spec, trials, timeout)
    identity = _identity(spec, space, table, seed)
    with hold_study(journal), _quiet_optuna() as optuna:
        study = _open_study(optuna, journal, identity)
        _close_interrupted(optuna, study)
        _run_trials(optuna, study, _Search(spec, space, table, seed), trials, timeout, progress)
        return _result(optuna, study, spec, identity)


@dataclass(frozen=True)
class _Search:
    spec: ModelSpec
    space: SearchSpace
    table: Table
    seed: int


def check_study(spec: ModelSpec, trials: int | None, timeout: float | None) -> SearchSpace:
    """Give the search space of a spec, if a study of it can be run with this budget.

    Raises
    ------
    SpecError
        No or an unusable search space, no budget or an empty one; all faults at once.
    """
    faults = []
    if trials is None and timeout is None:
        faults.append("a study needs a bound: a number of trials, a timeout, or both")
    if trials is not None and trials < 1:
        faults.append(f"trials: {trials}: at least 1 is needed")
    if timeout is not None and not timeout > 0:
        faults.append(f"timeout: {timeout:g} s: must be above 0")
    space = spec.search
    if space is None:
        faults.append(f"{spec.name}: has no block 'search', so there is nothing to tune")
    else:
        faults += search_faults(space, type(spec).model_fields, spec.name)
    if faults:
        raise SpecError("\n".join(faults))
    assert space is not None
    return space


def _identity(spec: ModelSpec, space: SearchSpace, table: Table, seed: int) -> dict[str, str]:
    own = table.select(spec.features, spec.targets)
    return {
        "castblast_version": __version__,
        "dataset": table.source.get("name", ""),
        "dataset_sha256": table.source.get("content_sha256", ""),
        "rows_sha256": table_hash(own),
        "spec": spec.name,
        "spec_sha256": spec.sha256(),
        "search_sha256": space.sha256(),
        "seed": str(seed),
    }


@contextmanager
def _quiet_optuna() -> Iterator[Any]:
    """Optuna without chatter; its earlier level is put back."""
    require("tune", purpose="a study")
    import optuna

    level = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            yield optuna
    finally:
        optuna.logging.set_verbosity(level)


def _open_study(optuna: Any, journal: Path, identity: Mapping[str, str]) -> Any:
    """Open or make the study of the journal; a journal of another study is refused."""
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend, JournalFileOpenLock

    try:
        # The lock by symbolic link hangs for ever on a link that a killed process has left.
        backend = JournalFileBackend(str(journal), lock_obj=JournalFileOpenLock(str(journal)))
        storage = JournalStorage(backend)
        names = [entry.study_name for entry in optuna.get_all_study_summaries(storage)]
    except (
        ValueError, KeyError, TypeError, AttributeError, AssertionError, RecursionError,
    ) as fault:  # fmt: skip
        message = f"{journal}: is not a study journal, or is damaged ({type(fault).__name__})"
        raise SpecError(message) from None
    if not names:
        study = optuna.create_study(storage=storage, study_name=_STUDY, direction="minimize")
        study.set_user_attr("identity", dict(identity))
        return study
    study = optuna.load_study(storage=storage, study_name=names[0])
    stored = study.user_attrs.get("identity", {})
    if stored and stored != dict(identity):
        changed = [
            f"{key.replace('_', ' ')} {_short(stored.get(key, 'none'))} there, {_short(value)} here"
            for key, value in identity.items()
            if stored.get(key) != value
        ]
        message = f"{journal}: holds another study ({'; '.join(changed)}); give another --study"
        raise SpecError(message)
    if not stored:
        if study.trials:
            message = f"{journal}: holds a study that castblast did not make; give another --study"
            raise SpecError(message)
        study.set_user_attr("identity", dict(identity))
    return study


def _short(value: str) -> str:
    return value[:12] if len(value) == 64 else value


def _close_interrupted(optuna: Any, study: Any) -> None:
    """Trials that run while nobody holds the study are those of a process that died."""
    state = optuna.trial.TrialState
    for trial in study.get_trials(deepcopy=False, states=(state.RUNNING,)):
        study.tell(trial.number, state=state.FAIL)


def _run_trials(
    optuna: Any,
    study: Any,
    search: _Search,
    trials: int | None,
    timeout: float | None,
    progress: ProgressCallback,
) -> None:
    started = time.monotonic()
    done, lowest = _count_finished(study), None
    while trials is None or done < trials:
        spent = time.monotonic() - started
        if timeout is not None and spent >= timeout:
            break
        shares = (done / trials if trials else 0.0, spent / timeout if timeout else 0.0)
        of = f" of {trials}" if trials else ""
        best = f", best 95 % within {lowest:.3%}" if lowest is not None else ""
        progress(min(max(shares), 1.0), f"{search.spec.name}: trial {done + 1}{of}{best}")
        _run_trial(optuna, study, search, done)
        done += 1
        lowest = min(
            (trial.value for trial in study.get_trials(deepcopy=False) if _is_complete(trial)),
            default=None,
        )
    progress(1.0, f"{search.spec.name}: {done} trials")


def _count_finished(study: Any) -> int:
    """Trials that were told about, by their own process."""
    return sum(_state(trial) is not None for trial in study.trials)


def _state(trial: Any) -> State | None:
    """How a trial ended; None for one in which the process died, or that still waits."""
    if trial.state.name == "FAIL":
        return "failed" if "fault" in trial.user_attrs else None
    known: dict[str, State] = {"COMPLETE": "complete", "PRUNED": "pruned"}
    return known.get(trial.state.name)


def _is_complete(trial: Any) -> bool:
    return bool(trial.state.name == "COMPLETE")


def _run_trial(optuna: Any, study: Any, search: _Search, index: int) -> None:
    """Ask for settings, fit them, tell; a fit that cannot be made is a failed trial."""
    study.sampler = optuna.samplers.TPESampler(
        n_startup_trials=_STARTUP, multivariate=True, constant_liar=False,
        seed=(1_000_003 * search.seed + index) % 2**32,
    )  # fmt: skip
    study.pruner = optuna.pruners.MedianPruner(n_startup_trials=_STARTUP // 2, n_warmup_steps=3)
    if index == 0:
        _begin_with(optuna, study, own_parameters(search.spec, search.space))
    trial = study.ask()
    settings = suggest(trial, search.space)
    trial.set_user_attr("settings", settings)
    state = optuna.trial.TrialState
    try:
        tried = candidate(search.spec, settings)
        fit = fit_spec(tried, search.table, report=_reporter(optuna, trial))
    except optuna.TrialPruned:
        study.tell(trial, state=state.PRUNED)
        return
    except (CastblastError, ArithmeticError, ValueError) as fault:
        trial.set_user_attr("fault", str(fault).splitlines()[0] if str(fault) else "failed")
        study.tell(trial, state=state.FAIL)
        return
    trial.set_user_attr("parameters", fit.network.parameter_count if fit.network else None)
    if fit.restart.valid_error == float("inf"):
        trial.set_user_attr("fault", "the fit blew up: its error is not finite")
        study.tell(trial, state=state.FAIL)
    else:
        study.tell(trial, fit.restart.valid_error)


def _begin_with(optuna: Any, study: Any, own: Mapping[str, Any] | None) -> None:
    """Have the settings of the spec itself tried next, unless a killed process saw to that.

    One that was killed while it tried them has left a trial that failed: they are tried again.
    """
    waiting = study.get_trials(deepcopy=False, states=(optuna.trial.TrialState.WAITING,))
    if own is not None and not waiting:
        study.enqueue_trial(dict(own))


def _reporter(optuna: Any, trial: Any) -> Callable[[float], None]:
    """Callback for the validation error on the way; it stops a fit that lags behind."""
    steps = count()

    def report(error: float) -> None:
        trial.report(error, next(steps))
        if trial.should_prune():
            raise optuna.TrialPruned

    return report


def _result(optuna: Any, study: Any, spec: ModelSpec, identity: Mapping[str, str]) -> StudyResult:
    ended = [trial for trial in study.trials if _state(trial) is not None]
    records = tuple(_record(number, trial) for number, trial in enumerate(ended))
    best = best_trial(records)
    if best is None:
        remarks = [record.remark for record in records if record.remark]
        what = f"no trial could be fitted; the first error: {remarks[0]}" if remarks else "no trial"
        message = f"{spec.name}: {what}"
        raise SpecError(message)
    tuned = candidate(spec, best.settings, f"{spec.name}_tuned")
    dead = sum(trial.state.name == "FAIL" for trial in study.trials if _state(trial) is None)
    return StudyResult(tuned, best, records, dead, _importance(optuna, study), identity)


def _record(number: int, trial: Any) -> TrialRecord:
    state = _state(trial)
    assert state is not None
    attributes = trial.user_attrs
    return TrialRecord(
        number=number,
        state=state,
        error=trial.value if state == "complete" else None,
        parameters=attributes.get("parameters"),
        settings=attributes.get("settings", {}),
        remark=attributes.get("fault", ""),
    )


def best_trial(records: Sequence[TrialRecord]) -> TrialRecord | None:
    """Among the errors within `TIE` of the lowest the smallest model, then the lowest error."""
    finished = [record for record in records if record.error is not None]
    if not finished:
        return None
    lowest = min(record.error or 0.0 for record in finished)
    level = [record for record in finished if (record.error or 0.0) <= TIE * lowest]
    return min(
        level, key=lambda r: (float("inf") if r.parameters is None else r.parameters, r.error)
    )


def _importance(optuna: Any, study: Any) -> dict[str, float]:
    """Importance of each searched setting by PED-ANOVA (Watanabe et al. 2023)."""
    complete = [trial for trial in study.get_trials(deepcopy=False) if _is_complete(trial)]
    if len(complete) < _STARTUP // 2:
        return {}
    evaluator = optuna.importance.PedAnovaImportanceEvaluator()
    try:
        found = optuna.importance.get_param_importances(study, evaluator=evaluator)
    except (ValueError, RuntimeError):
        return {}  # all errors equal, or all settings
    return {name: float(share) for name, share in found.items()}
