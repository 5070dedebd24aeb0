"""Files of a comparison: the document, pictures, one page for people, lines for the screen."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castblast.api.training.fits import fit_title, held_out
from castblast.api.training.page import write_costs, write_page
from castblast.disk.files import write_csv, write_json, write_text

if TYPE_CHECKING:
    from castblast.api.training.found import Comparison
    from castblast.surrogate.fitting.training import Fit
    from castblast.surrogate.judging.comparison import ComparisonDocument

#: Target shown first, where it is there.
HEADLINE = "burden_velocity"


def write_comparison(
    out: Path, found: Comparison, document: ComparisonDocument, seconds: float
) -> list[Path]:
    """Write everything into a folder; the files, times last.

    Parameters
    ----------
    out : path
    found : Comparison
    document : dict
        From `comparison_document`.
    seconds : float
        Wall time of the whole comparison so far.
    """
    from castblast.network.json_file import to_json
    from castblast.surrogate.judging.timing import timings

    files = [write_json(out / "comparison.json", document), *write_figures(out, found)]
    files += draw_comparison(out, found, document)
    network = out / "network.json"
    if found.league["chosen"] and found.chosen.network is not None:
        files.append(write_text(network, to_json(found.chosen.network)))
    else:
        network.unlink(missing_ok=True)
    files.append(write_page(out / "report.html", document, files))
    costs = timings(found.fits)
    files.append(write_costs(out / "timings.html", document, costs))
    times = {"models": costs, "parts": dict(found.times), "comparison_seconds": seconds}
    files.append(write_json(out / "timings.json", times))
    return files


def write_figures(out: Path, found: Comparison) -> list[Path]:
    """Write the errors at first sight, as DVC shows them: ``metrics.json`` and ``league.csv``.

    Like ``comparison.json`` they hold no times: the same bytes every time.
    """
    from castblast.surrogate.judging.champion import champion_figures, percent

    league = found.league
    metrics = {"champion": league["chosen"] or "none", **champion_figures(found.fits, league)}
    columns: dict[str, Any] = {"model": [entry["name"] for entry in league["league"]]}
    for key in ("valid_error", "test_error"):
        errors = [percent(entry[key]) for entry in league["league"]]
        columns[f"{key}_percent"] = [math.nan if error is None else error for error in errors]
    return [
        write_json(out / "metrics.json", metrics),
        write_csv(out / "league.csv", columns),
    ]


def draw_comparison(out: Path, found: Comparison, document: ComparisonDocument) -> list[Path]:
    """Write learning curves and pictures into a folder."""
    files = []
    for fit in found.fits:
        if fit.spec.name in found.curves:
            files += _write_curve(out / fit.spec.name, fit, found.curves[fit.spec.name])
    return [*files, *_draw(out, found, document)]


def comparison_document(found: Comparison) -> ComparisonDocument:
    """Everything found out as plain JSON values; no times, no paths."""
    from castblast.surrogate.judging.comparison import mark_of
    from castblast.surrogate.judging.learning import learning_report
    from castblast.surrogate.judging.strata import strata, worst_cases

    marks = {name: mark_of(name).relative_error_95 for name in found.league["targets"]}
    return {
        **found.league,
        "extent": found.extent.stated(),
        "remarks": list(found.remarks),
        "gate": dict(found.gates),
        "paper_met_from": {
            name: paper_met_from(curve, found.league["paper"])
            for name, curve in found.curves.items()
        },
        "learning": {name: learning_report(curve, marks) for name, curve in found.curves.items()},
        "shifts": dict(found.shifts),
        "strata": strata(found.chosen),
        "worst_cases": worst_cases(found.chosen),
        "sobol": found.sobol,
    }


def paper_met_from(curve: Sequence[Any], paper: Mapping[str, Any]) -> int | None:
    """Fewest training rows from which on all points meet the published figures on test rows."""
    met_from = None
    for point in reversed(curve):
        score = point.test.get(paper["target"])
        if score is None or not (
            score.r2 >= paper["r2"] and score.relative_error_95 <= paper["relative_error_95"]
        ):
            break
        met_from = point.rows
    return met_from


def _write_curve(folder: Path, fit: Fit, curve: Sequence[Any]) -> list[Path]:
    """Learning curve as a table and the paper's Figure 2."""
    from castblast.report.models.surrogate_figures import LearningLine, draw_figure_two
    from castblast.surrogate.judging.comparison import PAPER_MARKS

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
    headline = HEADLINE if HEADLINE in fit.table.target_names else fit.table.target_names[0]
    picture = draw_figure_two(
        folder / "figure_2.png",
        fit_title(fit),
        lines,
        held_out(fit),
        target=headline,
        marks=PAPER_MARKS,
    )
    return [write_csv(folder / "learning_curve.csv", columns), picture]


def _draw(out: Path, found: Comparison, document: ComparisonDocument) -> list[Path]:
    """Pictures of the league, of the gate, and of all that is asked of the chosen model."""
    from castblast.report.models.error_figures import draw_error_maps, draw_shifts, draw_strata
    from castblast.report.models.inquiry_figures import draw_learning_laws, draw_sobol
    from castblast.report.models.league_figures import draw_gate, draw_league
    from castblast.surrogate.judging.strata import error_maps

    name = found.chosen.spec.name
    files = [
        draw_league(out / "league.png", document),
        draw_strata(out / "strata.png", f"{name}: error by input", document["strata"]),
    ]
    targets = found.chosen.table.target_names
    headline = HEADLINE if HEADLINE in targets else targets[0]
    maps = error_maps(found.chosen, headline)
    if maps:
        title = f"{name}: where {headline.replace('_', ' ')} errs"
        files.append(draw_error_maps(out / "error_maps.png", title, maps))
    if found.gates:
        files.append(draw_gate(out / "gate.png", found.gates))
    if found.shifts:
        files.append(draw_shifts(out / "shifts.png", document["shifts"]))
    if document["sobol"] is not None:
        title = f"{name}: Sobol indices over the domain"
        files.append(draw_sobol(out / "sobol.png", title, document["sobol"]))
    if name in document["learning"]:
        title = f"{name}: power law through the learning curve"
        law = draw_learning_laws(out / "learning_law.png", title, document["learning"][name])
        files.append(law)
    return files
