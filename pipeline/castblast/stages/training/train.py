"""Fit surrogates on a dataset; each goes to a folder of its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from castblast.api.training.fits import (
    fit_all,
    fit_files,
    note_dataset,
    require_training,
)
from castblast.disk.files import require_writable
from castblast.disk.resources import resource
from castblast.progress import ProgressCallback, silent
from castblast.specs.models.model import read_model_specs, refuse_code
from castblast.stages.outcome import Outcome
from castblast.surrogate.fitting.metrics import show_r_squared, show_share

if TYPE_CHECKING:
    from castblast.surrogate.fitting.training import Fit

#: Where the lab book of runs is kept.
RUNS_FOLDER = Path("runs")


def train(
    dataset: str | Path,
    specs: Sequence[str | Path],
    out: str | Path | None = None,
    *,
    workers: int | None = 1,
    tracking: bool = False,
    runs: str | Path = RUNS_FOLDER,
    allow_code: bool = False,
    progress: ProgressCallback = silent,
) -> Outcome:
    """Fit every spec and score it on held-out rows; existing fits are kept.

    Parameters
    ----------
    dataset : path
        NetCDF written by `castblast generate`.
    specs : sequence of path
        Model specs (YAML); none: the reference.
    out : path, optional
        One folder per fit goes here; default ``fits`` beside the dataset.
    workers : int, optional
        Fits at a time; None: the cores there are.
    tracking : bool
        Keep a record in MLflow under `runs`; changes no result.
    allow_code : bool
        Run the Python code that specs of kind ``custom`` name.
    progress : callable

    Raises
    ------
    MissingLibraryError
        A library that training, one of the specs or the record needs is not installed.
    SpecError
        An unusable spec, or one that runs code of its own.
    DatasetError
        An unusable dataset: damaged, missing columns, too few rows.
    """
    dataset = Path(dataset)
    spec_files = [Path(path) for path in specs]
    out = None if out is None else Path(out)
    runs = Path(runs)
    chosen = read_model_specs(spec_files or [resource("models/specs/reference_mlp.yaml")])
    refuse_code(chosen, allowed=allow_code)
    require_training("castblast train", chosen, tracking=tracking)
    from castblast.dataset.file.store import open_dataset
    from castblast.surrogate.fitting.rows import read_rows

    table = read_rows(open_dataset(dataset), chosen, dataset)
    out = dataset.parent / "fits" if out is None else out
    require_writable(out)
    if tracking:
        require_writable(runs)
    note_dataset(out, dataset)
    fits = fit_all(chosen, table, out, workers=workers, progress=progress)
    if tracking:
        from castblast.surrogate.keeping.tracking import MlflowTracker

        files = {fit.spec.name: fit_files(out / fit.spec.name) for fit in fits}
        MlflowTracker(runs).record_fits(fits, files)
    return _outcome(fits, out)


def _outcome(fits: Sequence[Fit], out: Path) -> Outcome:
    targets = list(dict.fromkeys(name for fit in fits for name in fit.table.target_names))
    header = ["model", "rows", *(f"{name.replace('_', ' ')}: R², 95 %" for name in targets)]
    rows = []
    for fit in fits:
        scores = fit.scores("test")
        cells = [
            f"{show_r_squared(scores[name].r2)}, {show_share(scores[name].relative_error_95)}"
            if name in scores
            else ""
            for name in targets
        ]
        rows.append([fit.spec.name, f"{len(fit.table.rows('train')):,}", *cells])
    title = f"{len(fits[0].table.rows('test')):,} held-out test rows"
    document = {
        "out": str(out),
        "fits": {fit.spec.name: fit.to_document() for fit in fits},
        "seconds": {fit.spec.name: fit.seconds for fit in fits},
    }
    lines = [f"wrote {out}", f"next: castblast compare, which ranks what lies in {out}"]
    return Outcome(document=document, title=title, header=header, rows=rows, lines=lines)
