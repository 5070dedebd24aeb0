"""Train surrogates on a dataset, compare them, and draw the paper's Figure 2 from the result.

Everything written here except the lab book is a function of dataset and specs alone: no times, no
paths, so that a second run gives the same bytes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import floor
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castblast.files import write_csv, write_text
from castblast.progress import ProgressCallback, silent
from castblast.resources import resource

if TYPE_CHECKING:
    from castblast.report.surrogate_figures import HeldOutRows
    from castblast.specs.model import ModelSpec
    from castblast.surrogate.features import Table
    from castblast.surrogate.training import Fit, LearningPoint

#: Where the lab book of runs is kept.
RUNS_FOLDER = Path("runs")
_HEADLINE = "burden_velocity"


@dataclass(frozen=True)
class TrainOutcome:
    """What training found: a document (the league table) and the same for people."""

    document: dict[str, Any]
    title: str
    header: list[str]
    rows: list[list[str]]
    lines: list[str] = field(default_factory=list)


def train(
    dataset: Path,
    specs: Sequence[Path],
    out: Path | None = None,
    *,
    tracking: bool = False,
    runs: Path = RUNS_FOLDER,
    progress: ProgressCallback = silent,
) -> TrainOutcome:
    """Fit every spec, compare on test rows, draw.

    Parameters
    ----------
    dataset : path
        NetCDF written by `castblast generate`.
    specs : sequence of path
        Model specs (YAML); none: the reference. The first and the
        chosen one get a learning curve.
    out : path, optional
        Folder for ``comparison.json`` and one folder per fit; default ``fits`` beside the
        dataset.
    tracking : bool
        Keep a record in MLflow under `runs`; changes no result.

    Raises
    ------
    SpecError
        An unusable spec.
    DatasetError
        An unusable dataset: damaged, missing columns, too few rows.
    """
    from castblast.dataset.store import open_dataset, require_writable
    from castblast.specs.model import read_model_specs
    from castblast.surrogate.comparison import compare
    from castblast.surrogate.tracking import MlflowTracker, NullTracker
    from castblast.surrogate.training import fit_spec, learning_curve

    chosen_specs = read_model_specs(list(specs) or [resource("models/specs/reference_mlp.yaml")])
    table = _read(open_dataset(dataset), chosen_specs, dataset)
    out = dataset.parent / "fits" if out is None else out
    require_writable(out)
    parts = len(chosen_specs) + 1
    fits = [
        fit_spec(spec, table, _part(progress, number, parts))
        for number, spec in enumerate(chosen_specs)
    ]
    comparison = compare(fits)
    curves = {
        fit.spec.name: learning_curve(fit, table, progress=_part(progress, parts - 1, parts))
        for number, fit in enumerate(fits)
        if number == 0 or fit.spec.name == comparison["chosen"]
    }
    files = [_write_json(out / "comparison.json", comparison)]
    for fit in fits:
        files += _write_fit(out / fit.spec.name, fit)
        if fit.spec.name in curves:
            files += _write_curve(out / fit.spec.name, fit, curves[fit.spec.name])
    tracker = MlflowTracker(runs) if tracking else NullTracker()
    tracker.record(fits, comparison, files)
    progress(1.0, "trained")
    return _outcome(comparison, out, curves)


def _read(dataset: Any, specs: Sequence[ModelSpec], path: Path) -> Table:
    """Read every column that one of the specs asks for."""
    from castblast.errors import DatasetError
    from castblast.surrogate.features import read_table

    features = dict.fromkeys(name for spec in specs for name in spec.features)
    targets = dict.fromkeys(name for spec in specs for name in spec.targets)
    try:
        return read_table(dataset, tuple(features), tuple(targets))
    except DatasetError as fault:
        lines = "\n".join(f"{path}: {line}" for line in str(fault).splitlines())
        raise DatasetError(lines) from None


def _part(progress: ProgressCallback, number: int, parts: int) -> ProgressCallback:
    """Callback for part `number` of `parts`."""
    return lambda share, line: progress((number + share) / parts, line)


def _write_json(path: Path, document: dict[str, Any]) -> Path:
    return write_text(path, json.dumps(document, indent=2, allow_nan=False) + "\n")


def _write_fit(folder: Path, fit: Fit) -> list[Path]:
    """Network, scores, test rows and their picture."""
    from castblast.export.json_file import to_json
    from castblast.report.surrogate_figures import draw_parity

    rows, table = fit.table.rows("test"), fit.table
    columns: dict[str, Any] = {"sample": table.sample[rows]}
    for j, name in enumerate(table.target_names):
        columns[f"{name}_simulated"] = table.targets[rows, j]
        columns[f"{name}_predicted"] = fit.predicted[rows, j]
    files = [
        _write_json(folder / "fit.json", fit.to_document()),
        write_csv(folder / "test_rows.csv", columns),
        draw_parity(folder / "parity.png", _title(fit), _held_out(fit)),
    ]
    if fit.network is not None:
        files.append(write_text(folder / "network.json", to_json(fit.network)))
    return files


def _write_curve(folder: Path, fit: Fit, curve: Sequence[LearningPoint]) -> list[Path]:
    """Learning curve as a table and the paper's Figure 2."""
    from castblast.report.surrogate_figures import LearningLine, draw_figure_two
    from castblast.surrogate.comparison import PAPER_MARKS

    sizes = [point.rows for point in curve]
    columns: dict[str, Any] = {"train_rows": sizes}
    lines = []
    for name in fit.table.target_names:
        train = [point.train[name].relative_error_95 for point in curve]
        test = [point.test[name].relative_error_95 for point in curve]
        columns[f"{name}_train_relative_error_95"] = train
        columns[f"{name}_test_relative_error_95"] = test
        columns[f"{name}_test_r2"] = [point.test[name].r2 for point in curve]
        lines.append(LearningLine(name, sizes, train, test))
    headline = _HEADLINE if _HEADLINE in fit.table.target_names else fit.table.target_names[0]
    picture = draw_figure_two(
        folder / "figure_2.png",
        _title(fit),
        lines,
        _held_out(fit),
        target=headline,
        marks=PAPER_MARKS,
    )
    return [write_csv(folder / "learning_curve.csv", columns), picture]


def _title(fit: Fit) -> str:
    what = f" ({fit.spec.description})" if fit.spec.description else ""
    train, test = len(fit.table.rows("train")), len(fit.table.rows("test"))
    return f"{fit.spec.name}{what}: {train:,} training rows, {test:,} test rows never trained on"


def _held_out(fit: Fit) -> HeldOutRows:
    from castblast.report.surrogate_figures import HeldOutRows

    rows, table = fit.table.rows("test"), fit.table
    document = fit.to_document()
    return HeldOutRows(
        truth={name: table.targets[rows, j] for j, name in enumerate(table.target_names)},
        predicted={name: fit.predicted[rows, j] for j, name in enumerate(table.target_names)},
        explosive=table.frame["explosive"].to_numpy(dtype=str)[rows],
        scores=document["scores"]["test"],
        by_explosive=document["test_by_explosive"],
    )


def _outcome(
    comparison: dict[str, Any], out: Path, curves: Mapping[str, Sequence[LearningPoint]]
) -> TrainOutcome:
    targets, paper = comparison["targets"], comparison["paper"]
    header = ["model", "rows", *(f"{name.replace('_', ' ')}: R², 95 %" for name in targets)]
    train_rows = f"{next(iter(curves.values()))[-1].rows:,}"
    rows = []
    for entry in comparison["league"]:
        cells = [
            f"{_r_squared(figures['r2'])}, {_share(figures['relative_error_95'])}"
            for figures in entry["targets"].values()
        ]
        mark = " *" if entry["name"] == comparison["chosen"] else ""
        rows.append([entry["name"] + mark, train_rows, *cells])
    mark = f"{paper['r2']:.4f}, {paper['relative_error_95']:.1%}"
    rows.append(
        ["paper", f"{paper['runs']:,}", *(mark if t == paper["target"] else "" for t in targets)]
    )
    lines = [f"* chosen: {comparison['rule']}", f"wrote {out}"]
    lines[1:1] = [line for name, curve in curves.items() for line in _matching(name, curve, paper)]
    title = f"{comparison['test_rows']:,} test rows never trained on"
    return TrainOutcome({**comparison, "out": str(out)}, title, header, rows, lines)


def _r_squared(value: float | None) -> str:
    # Cut, not rounded: a model that misses is never shown as 1.
    return "-" if value is None else f"{floor(value * 1e5) / 1e5:.5f}"


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.2%}"


def _matching(name: str, curve: Sequence[LearningPoint], paper: dict[str, Any]) -> list[str]:
    """Say from how many training rows on a model meets the published figures on test rows."""
    target = paper["target"]
    if target not in curve[-1].test:
        return []
    met = [
        point.test[target].r2 >= paper["r2"]
        and point.test[target].relative_error_95 <= paper["relative_error_95"]
        for point in curve
    ]
    if not met[-1]:
        return [f"{name}: the published figures are not met with {curve[-1].rows:,} training rows"]
    since = len(met) - 1
    while since > 0 and met[since - 1]:
        since -= 1
    return [f"{name}: the published figures are met from {curve[since].rows:,} training rows on"]
