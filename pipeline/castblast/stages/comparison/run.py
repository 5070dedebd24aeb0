"""The whole comparison of models on one dataset: fits, gate, league, curves, shifts, indices.

What takes long is kept in the cache of the user (`castblast.surrogate.fitting.kept`), so that a
comparison which was stopped goes on and a second one only writes. ``comparison.json``, page and
pictures are a function of dataset, specs and code; times are in ``timings.json`` and
``timings.html``.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from castblast.api.training.fits import (
    fit_all,
    fit_files,
    kept_fits,
    note_dataset,
    require_training,
    without_missing,
)
from castblast.api.training.found import Extent
from castblast.api.training.judging import FULL, judge
from castblast.disk.files import require_writable
from castblast.disk.resources import resource
from castblast.errors import SpecError
from castblast.progress import ProgressCallback, part, silent
from castblast.specs.models.model import read_model_specs, refuse_code
from castblast.stages.outcome import Outcome
from castblast.stages.training.train import RUNS_FOLDER

if TYPE_CHECKING:
    from castblast.specs.models.model import ModelSpec


def compare(
    dataset: str | Path,
    specs: Sequence[str | Path] = (),
    out: str | Path | None = None,
    *,
    fits: str | Path | None = None,
    extent: Extent = FULL,
    workers: int | None = 1,
    tracking: bool = False,
    runs: str | Path = RUNS_FOLDER,
    allow_code: bool = False,
    progress: ProgressCallback = silent,
) -> Outcome:
    """Fit what is not fitted yet, judge all models and choose one.

    A model whose library is not installed is left out, and a remark names the extra.

    Parameters
    ----------
    dataset : path
        NetCDF written by `castblast generate`, or a folder of fits made from one.
    specs : sequence of path
        Model specs (YAML) or folders of them; none: those of the folder of fits, or all that come
        with castblast.
    out : path, optional
        Folder for ``comparison.json``, ``metrics.json``, ``league.csv``, ``report.html`` and
        pictures; default ``comparison`` beside the dataset.
    fits : path, optional
        Folder of the fits; default ``fits`` beside the dataset.
    extent : Extent
    workers : int, optional
        Fits and parts at a time; None: the cores there are. Changes no number.
    tracking : bool
        Keep a record in MLflow under `runs`; changes no result.
    allow_code : bool
        Run the Python code that specs of kind ``custom`` name.
    progress : callable

    Raises
    ------
    MissingLibraryError
        A library that every comparison, or every one of the models, needs is not installed.
    SpecError
        An unusable spec; no model that can be exported and passes the gate.
    DatasetError
        An unusable dataset.
    """
    dataset = Path(dataset)
    spec_files = [Path(path) for path in specs]
    out = None if out is None else Path(out)
    fits = None if fits is None else Path(fits)
    runs = Path(runs)
    started = time.perf_counter()
    dataset, wanted, fits = _sources(dataset, spec_files, fits, extent)
    refuse_code(wanted, allowed=allow_code)
    require_training("castblast compare", (), tracking=tracking)
    remarks: list[str] = []
    wanted = without_missing(wanted, remarks)
    from castblast.api.training.document import comparison_document, write_comparison
    from castblast.dataset.file.store import open_dataset
    from castblast.stages.comparison.shown import outcome
    from castblast.surrogate.fitting.rows import read_rows

    table = read_rows(open_dataset(dataset), wanted, dataset)
    if extent.train_rows is not None:
        table = table.with_train_rows(extent.train_rows)
    out = dataset.parent / f"comparison{extent.suffix}" if out is None else out
    for folder in (fits, out, runs) if tracking else (fits, out):
        require_writable(folder)
    note_dataset(fits, dataset)
    made = fit_all(wanted, table, fits, workers=workers, progress=part(progress, 0.0, 0.5))
    judging = part(progress, 0.5, 0.95)
    found = judge(made, table, dataset, fits, extent, remarks, workers, judging)
    progress(0.95, "writing the report")
    document = comparison_document(found)
    files = write_comparison(out, found, document, time.perf_counter() - started)
    if tracking:
        from castblast.surrogate.keeping.tracking import MlflowTracker

        kept = {fit.spec.name: fit_files(fits / fit.spec.name) for fit in made}
        MlflowTracker(runs).record_comparison(made, found.league, {**kept, "": files}, found.curves)
    progress(1.0, f"chosen: {found.league['chosen'] or 'none'}")
    return outcome(found, document, out)


def _sources(
    dataset: Path, specs: Sequence[Path], fits: Path | None, extent: Extent
) -> tuple[Path, list[ModelSpec], Path]:
    """Dataset, specs and folder of fits; a folder in place of a dataset is one of fits."""
    if dataset.is_dir():
        fits = dataset if fits is None else fits
        dataset, wanted = kept_fits(dataset)
        wanted = _read_specs(specs) if specs else wanted
    else:
        wanted = _read_specs(specs)
        fits = dataset.parent / f"fits{extent.suffix}" if fits is None else fits
    return dataset, [spec.quick() if extent.quick_specs else spec for spec in wanted], fits


def _read_specs(given: Sequence[Path]) -> list[ModelSpec]:
    """Read specs from files and folders; none given: the shipped ones."""
    paths: list[Path] = []
    for path in given or [resource("models/specs")]:
        inside = sorted(path.glob("*.yaml")) if path.is_dir() else [path]
        if not inside:
            message = f"{path}: holds no model spec (*.yaml)"
            raise SpecError(message)
        paths += inside
    return read_model_specs(paths)
