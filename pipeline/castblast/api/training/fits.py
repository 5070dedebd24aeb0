"""Fit several specs on one table, some at a time, and keep what is finished.

Each fit has a folder of its own. All files in it are a function of rows and spec: no times, no
paths. The fitted estimator itself is kept in the cache of the user, see
`castblast.surrogate.fitting.fit_store`.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castblast.cores import available_cores
from castblast.disk.files import write_csv, write_json, write_text
from castblast.disk.plain import json_text
from castblast.disk.reading import read_json, read_text
from castblast.errors import SpecError
from castblast.extras import missing_libraries, missing_line, require
from castblast.jobs import Job, run_jobs
from castblast.progress import ProgressCallback, part, silent

if TYPE_CHECKING:
    from castblast.report.models.surrogate_figures import HeldOutRows
    from castblast.specs.models.model import ModelSpec
    from castblast.surrogate.fitting.features import Table
    from castblast.surrogate.fitting.training import Fit

#: Scores of a fit, and its spec.
FIT_FILE = "fit.json"
_DATASET = "dataset.txt"
#: Extras without which nothing is fitted, scored and drawn.
_ALWAYS = ("data", "simulate", "train", "plot")


def require_training(
    purpose: str, specs: Sequence[ModelSpec], *extras: str, tracking: bool = False
) -> None:
    """Refuse to begin where a library is missing that would be needed after minutes of fitting.

    Parameters
    ----------
    purpose : str
        The verb.
    specs : sequence of ModelSpec
    *extras : str
        What the verb needs besides what all fits need.
    tracking : bool
        A record is to be kept in MLflow.

    Raises
    ------
    MissingLibraryError
    """
    record = ("track",) if tracking else ()
    require(*_ALWAYS, *extras, *record, purpose=purpose)
    for spec in specs:
        require(*spec.needs, purpose=f"{spec.name}: kind {spec.kind}")


def without_missing(specs: Sequence[ModelSpec], remarks: list[str]) -> list[ModelSpec]:
    """Give the specs whose libraries are installed; what is left out goes to `remarks`.

    Raises
    ------
    MissingLibraryError
        None is left.
    """
    left_out = {spec.name: missing_libraries(*spec.needs) for spec in specs}
    able = [spec for spec in specs if not left_out[spec.name]]
    if not able:
        require_training("castblast compare", specs)
    kinds = {spec.name: spec.kind for spec in specs}
    remarks += [
        f"left out: {missing_line(missing, f'{name}: kind {kinds[name]}')}"
        for name, missing in left_out.items()
        if missing
    ]
    return able


def fit_all(
    specs: Sequence[ModelSpec],
    table: Table,
    folder: Path,
    *,
    workers: int | None = None,
    progress: ProgressCallback = silent,
) -> list[Fit]:
    """Give a fit of every spec, in order; those kept in `folder` are not made again.

    Parameters
    ----------
    specs : sequence of ModelSpec
    table : Table
        Holds the features and targets of all specs.
    folder : path
        Every fit goes to ``folder/<name>`` as soon as it is finished.
    workers : int, optional
        Fits at a time, each in a process; None: the cores there are. Changes no number.
    progress : callable
    """
    from castblast.surrogate.fitting.fit_store import fit_key, load_fit, unpacked

    keys = [fit_key(spec, table) for spec in specs]
    places = [folder / spec.name for spec in specs]
    fits = [load_fit(place, key) for place, key in zip(places, keys, strict=True)]
    for place, kept in zip(places, fits, strict=True):
        if kept is not None and not _is_written(place, kept):
            _write_files(place, kept)
    missing = [number for number, fit in enumerate(fits) if fit is None]
    if min(len(missing), workers or available_cores()) <= 1:
        for done, number in enumerate(missing):
            step = part(progress, done / len(missing), (done + 1) / len(missing))
            fits[number] = _fit_and_keep(specs[number], table, places[number], keys[number], step)
    else:
        jobs = [
            Job(
                f"fit {specs[n].name}",
                _fit_elsewhere,
                (
                    specs[n],
                    table.select(specs[n].features, specs[n].targets),
                    places[n],
                    keys[n],
                ),
            )
            for n in missing
        ]
        results = run_jobs(jobs, workers, progress)
        for number, content in zip(missing, results, strict=True):
            fit = (
                load_fit(places[number], keys[number])
                if content is None
                else unpacked(content, specs[number])
            )
            # One that cannot be packed is made once more, here.
            fits[number] = fit or _fit_and_keep(
                specs[number], table, places[number], keys[number], silent
            )
    progress(1.0, f"{len(specs)} fits, {len(specs) - len(missing)} of them kept from earlier")
    return [fit for fit in fits if fit is not None]


def note_dataset(folder: Path, dataset: Path) -> None:
    """Remember where the dataset of a folder of fits lies, seen from there."""
    write_text(folder / _DATASET, Path(os.path.relpath(dataset, folder)).as_posix() + "\n")


def kept_fits(folder: Path) -> tuple[Path, list[ModelSpec]]:
    """Dataset and specs of a folder of fits.

    A fit that is kept on this machine has its spec as it was given; one that came from elsewhere
    has that of its JSON file, with all features named.

    Raises
    ------
    SpecError
        There are none, or a damaged one.
    """
    from castblast.surrogate.fitting.fit_store import kept_spec

    note = folder / _DATASET
    files = sorted(folder.glob(f"*/{FIT_FILE}"))
    found = [kept_spec(path.parent) or _spec_of(path) for path in files]
    if not note.is_file() or not found:
        message = f"{folder}: holds no fits of castblast train; give the dataset instead"
        raise SpecError(message)
    place = read_text(note).strip()
    if not place.isprintable():
        message = f"{note}: holds no path of a dataset; give the dataset instead"
        raise SpecError(message)
    dataset = os.path.normpath(folder / place)
    return Path(dataset), found


def _spec_of(path: Path) -> ModelSpec:
    """Spec in the document of a fit."""
    from castblast.specs.models.model import make_model_spec

    document = read_json(path)
    content = document.get("spec") if isinstance(document, dict) else None
    if content is None:
        message = f"{path}: holds no spec of a model; run castblast train again"
        raise SpecError(message)
    return make_model_spec(content, f"{path}: spec", path.parent)


def _fit_and_keep(
    spec: ModelSpec, table: Table, place: Path, key: dict[str, str], progress: ProgressCallback
) -> Fit:
    from castblast.surrogate.fitting.fit_store import save_kept
    from castblast.surrogate.fitting.training import fit_spec

    fit = fit_spec(spec, table, progress)
    _write_files(place, fit)
    save_kept(place, fit, key, spec)
    return fit


def _fit_elsewhere(spec: ModelSpec, table: Table, place: Path, key: dict[str, str]) -> bytes | None:
    """Fit in a process of its own; None where the result waits in the store, else the result."""
    from castblast.surrogate.fitting.fit_store import is_kept, packed

    fit = _fit_and_keep(spec, table, place, key, silent)
    return None if is_kept(place) else packed(fit) or b""


def _is_written(folder: Path, fit: Fit) -> bool:
    """Whether the files of a fit lie in its folder."""
    names = {"test_rows.csv", "parity.png", *(["network.json"] if fit.network is not None else [])}
    try:
        written = (folder / FIT_FILE).read_text(encoding="utf-8")
    except (OSError, ValueError):
        return False
    return written == json_text(fit.to_document()) and all((folder / n).is_file() for n in names)


def _write_files(folder: Path, fit: Fit) -> None:
    """Network, scores, test rows and their picture."""
    from castblast.network.json_file import to_json
    from castblast.report.models.surrogate_figures import draw_parity

    rows, table = fit.table.rows("test"), fit.table
    columns: dict[str, Any] = {"sample": table.sample[rows]}
    for j, name in enumerate(table.target_names):
        columns[f"{name}_simulated"] = table.targets[rows, j]
        columns[f"{name}_predicted"] = fit.predicted[rows, j]
    write_csv(folder / "test_rows.csv", columns)
    draw_parity(folder / "parity.png", fit_title(fit), held_out(fit))
    if fit.network is not None:
        write_text(folder / "network.json", to_json(fit.network))
    else:
        (folder / "network.json").unlink(missing_ok=True)
    write_json(folder / FIT_FILE, fit.to_document())


def fit_files(folder: Path) -> list[Path]:
    """Files of a fit that mean the same elsewhere."""
    # Earlier versions kept a pickle here; it is never opened.
    return sorted(path for path in folder.iterdir() if path.is_file() and path.suffix != ".pickle")


def fit_title(fit: Fit) -> str:
    """Name and description of a fit, and its rows on a second line."""
    what = f" ({fit.spec.description})" if fit.spec.description else ""
    train, test = len(fit.table.rows("train")), len(fit.table.rows("test"))
    return f"{fit.spec.name}{what}\n{train:,} training rows, {test:,} held-out test rows"


def held_out(fit: Fit) -> HeldOutRows:
    """Test rows of a fit as the pictures take them."""
    from castblast.report.models.surrogate_figures import HeldOutRows

    rows, table = fit.table.rows("test"), fit.table
    document = fit.to_document()
    return HeldOutRows(
        truth={name: table.targets[rows, j] for j, name in enumerate(table.target_names)},
        predicted={name: fit.predicted[rows, j] for j, name in enumerate(table.target_names)},
        explosive=table.frame["explosive"].to_numpy(dtype=str)[rows],
        scores=document["scores"]["test"],
        by_explosive=document["test_by_explosive"],
    )
