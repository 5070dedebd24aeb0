"""A comparison as one page for people, in the order in which they ask."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castblast.design.variables import VARIABLES
from castblast.names import as_words
from castblast.report.html import Picture, Section, Table, write_report
from castblast.surrogate.fitting.metrics import show_r_squared, show_share
from castblast.version import __version__

if TYPE_CHECKING:
    from castblast.surrogate.judging.comparison import ComparisonDocument

Document = Mapping[str, Any]
#: Broken rules named per model; the picture shows all.
_REASONS = 3
_CAPTIONS = {
    "league": "95 % relative error per model and target, bars are 95 % intervals, dashed the marks",
    "gate": "Which model breaks which rule of physics",
    "figure_2": "Learning curve, error histogram, predicted against simulated: {folder}",
    "learning_law": "Power law through the learning curve of the chosen model",
    "shifts": "Error on kinds of rows never shown, beside the fit that saw such rows",
    "strata": "Error of the chosen model over every input, in bins of equal count",
    "error_maps": "Where the chosen model errs: 95 % relative error over pairs of inputs",
    "sobol": "Sobol indices of the chosen model; markers: the simulator's own",
}


def write_page(path: Path, document: ComparisonDocument, files: Sequence[Path]) -> Path:
    """Render a comparison; the same document and pictures give the same page.

    Parameters
    ----------
    path : path
    document : mapping
        As in ``comparison.json``.
    files : sequence of path
        Those already written; the pictures among them are shown.
    """
    pictures = [file for file in files if file.suffix == ".png"]
    source = document["dataset"]
    sections = [
        _league(document, pictures),
        _marks(document),
        _gate(document, pictures),
        _learning(document, pictures),
        _shifts(document, pictures),
        _strata(document, pictures),
        _worst(document),
        _sobol(document, pictures),
        Section("What this says and what it does not", points=_LIMITS),
    ]
    lead = (
        f"Models of dataset {source.get('name', '(unnamed)')} "
        f"{source.get('dataset_version', '')} (content "
        f"{source.get('content_sha256', 'unknown')[:12]}), judged on {document['test_rows']:,} "
        f"held-out test rows. Made by castblast {__version__}."
    )
    shown = [section for section in sections if section is not None]
    return write_report(path, "castblast: comparison of models", lead, shown)


_LIMITS = (
    "Errors are relative to the simulated value: they say how well a model repeats the "
    "simulations, not how well these are a blast.",
    "The choice is made on validation rows; test rows are only reported.",
    "Two models that the test rows cannot tell apart are named as such: the order between them "
    "is luck.",
    "What the models cost is in timings.html: no two measurements of time are the same.",
)


def write_costs(path: Path, document: ComparisonDocument, costs: Document) -> Path:
    """Render what the models cost, on a page of its own as it never comes out the same twice.

    Parameters
    ----------
    path : path
    document : mapping
        As in ``comparison.json``.
    costs : mapping
        From `surrogate.judging.timing.timings`.
    """
    kinds = ("fit_seconds", "row", "batch", "network_row", "network_batch")
    rows = [
        [entry["name"], *(_number(costs.get(entry["name"], {}).get(kind)) for kind in kinds)]
        for entry in document["league"]
    ]
    header = ("model", "fit [s]", "one row [µs]", "batch, a row [µs]",
              "exported, one row [µs]", "exported, batch, a row [µs]")  # fmt: skip
    table = Table(header, rows, "On one thread of the machine that made this page")
    lead = "Times to fit each model of the comparison and to ask it."
    return write_report(
        path, "castblast: what the models cost", lead, [Section("Times", tables=[table])]
    )


def _league(document: ComparisonDocument, pictures: Sequence[Path]) -> Section:
    targets = document["targets"]
    errors, squares = [], []
    for entry in document["league"]:
        name = entry["name"] + (" (chosen)" if entry["name"] == document["chosen"] else "")
        figures = [entry["targets"][target] for target in targets]
        gate = {True: "passed", False: "failed", None: "not asked"}[entry["gate_passed"]]
        first = "no" if entry["distinguishable_from_first"] else "yes"
        export = "yes" if entry["exportable"] else "no"
        errors.append([name, gate, export, first, *map(_error, figures)])
        weights = "-" if entry["parameters"] is None else f"{entry['parameters']:,}"
        squares.append([name, weights, *(show_r_squared(figure["r2"]) for figure in figures)])
    words = [as_words(name) for name in targets]
    paper = document["paper"]
    caption = (
        f"95 % relative error (95 % interval, bootstrap over test rows), best validation error "
        f"first. Published for {as_words(paper['target'])}: 95 % within "
        f"{paper['relative_error_95']:.1%}, R² {paper['r2']}, from {paper['runs']:,} runs."
    )
    tables = [
        Table(("model", "gate", "export", "level with the first", *words), errors, caption),
        Table(("model", "weights", *words), squares, "R², cut to five places"),
    ]
    chosen = document["chosen"] or "none: no model that can be exported passes the gate"
    paragraphs = [f"Chosen: {chosen} ({document['rule']})."]
    if document["gap"] > 1.0:
        paragraphs.append(
            f"Its validation error is {document['gap']:.2f} times that of "
            f"{document['best_overall']}, the best overall."
        )
    paragraphs.append(_extent(document["extent"]))
    shown = _pictures(pictures, "league")
    return Section("League table", paragraphs, tables, shown, document["remarks"])


def _extent(extent: Document) -> str:
    if extent["name"] == "full":
        return "Extent: full."
    rows = f"at most {extent['train_rows']:,} training rows; " if extent["train_rows"] else ""
    shifts = "" if extent["shifts"] else "no tests beyond random splits; "
    specs = "specs fitted in their quick form; " if extent["quick_specs"] else ""
    return (
        f"Extent: {extent['name']}: {rows}{specs}{shifts}physics asked at "
        f"{extent['probe_points']:,} points. A full comparison says more."
    )


def _error(entry: Document) -> str:
    low, high = (show_share(value) for value in entry["relative_error_95_interval"])
    return f"{show_share(entry['relative_error_95'])} ({low.removesuffix('%')}\u2011{high})"


def _marks(document: ComparisonDocument) -> Section:
    rows = []
    for entry in document["league"]:
        for target in document["targets"]:
            figures = entry["targets"][target]
            mark = figures["mark"]
            if entry["name"] in (document["chosen"], document["best_overall"]):
                rows.append(
                    [
                        entry["name"],
                        as_words(target),
                        f"{mark['r2']:g}",
                        show_r_squared(figures["r2"]),
                        show_share(mark["relative_error_95"]),
                        show_share(figures["relative_error_95"]),
                        "met" if mark["met"] else "missed",
                        _number(mark["error_over_mark"]),
                        _number(mark["variance_left_over_mark"]),
                    ]
                )
    header = [
        "model", "target", "R² asked", "R²", "95 % asked", "95 %", "mark",
        "error over mark", "variance left over mark",
    ]  # fmt: skip
    caption = "Marks on test rows; 1 or less in the last two columns is met"
    return Section("Marks", tables=[Table(header, rows, caption)])


def _gate(document: ComparisonDocument, pictures: Sequence[Path]) -> Section | None:
    if not document["gate"]:
        return None
    points = [
        f"{name}: {_reasons(gate['reasons'])}"
        for name, gate in document["gate"].items()
        if not gate["passed"]
    ]
    first = document["chosen"] or document["best_exportable"]
    rows = [
        [
            as_words(check["name"]),
            check["says"],
            f"{check['asked']:,}" if check["asked"] else check.get("not_asked", ""),
            f"{check['broken']:,}" if check["asked"] else "",
        ]
        for check in document["gate"][first]["checks"]
    ]
    table = Table(("rule", "means", "asked", "broken"), rows, f"Asked of {first}")
    return Section(
        "Physics gate",
        ["What every answer must obey, all over the joint domain of the dataset. A rule that the "
         "simulator itself breaks is not asked. A model that fails is not chosen."],
        [table],
        _pictures(pictures, "gate"),
        points,
    )  # fmt: skip


def _reasons(reasons: Sequence[str]) -> str:
    left = len(reasons) - _REASONS
    more = f"; and {left} more" if left > 0 else ""
    return "; ".join(as_words(reason) for reason in reasons[:_REASONS]) + more


def _learning(document: ComparisonDocument, pictures: Sequence[Path]) -> Section:
    rows = []
    for name, report in document["learning"].items():
        for target, entry in report.items():
            needed = entry["runs_for_mark"]
            rows.append(
                [
                    name,
                    as_words(target),
                    show_share(entry["mark"]),
                    "-" if entry["reached_at"] is None else f"{entry['reached_at']:,.0f}",
                    "-" if needed is None else f"{needed:,.0f}",
                    entry["advice"],
                ]
            )
    met = [
        f"{name}: the published figures are "
        + (f"met from {rows:,} training rows on" if rows else "not met with the rows there are")
        for name, rows in document["paper_met_from"].items()
    ]
    header = ("model", "target", "mark, 95 %", "met from rows", "law says rows", "advice")
    return Section(
        "How many runs are enough?",
        ["A power law through the learning curve on test rows; nothing is promised where it does "
         "not describe the points."],
        [Table(header, rows)],
        _pictures(pictures, "learning_law") + _pictures(pictures, "figure_2"),
        met,
    )  # fmt: skip


def _shifts(document: ComparisonDocument, pictures: Sequence[Path]) -> Section | None:
    if not document["shifts"]:
        return None
    rows = []
    for name, shifts in document["shifts"].items():
        for test in shifts["tests"]:
            cells = (
                [test["not_run"], "", "", ""]
                if "not_run" in test
                else [
                    f"{test['judged_rows']:,}",
                    show_share(test["error"]),
                    show_share(test["error_when_seen"]),
                    _number(test["ratio"]),
                ]
            )
            rows.append([name, test["kind"], test["says"], *cells])
    header = ("model", "kind", "never shown", "judged rows", "95 % unseen", "95 % seen", "ratio")
    return Section(
        "Beyond random splits",
        ["The spec, in its quick form, is fitted without one kind of rows and judged on test rows "
         "of that kind, beside a fit that saw such rows. Errors are geometric means over the "
         "targets."],
        [Table(header, rows)],
        _pictures(pictures, "shifts"),
    )  # fmt: skip


def _strata(document: ComparisonDocument, pictures: Sequence[Path]) -> Section:
    targets = document["targets"]
    rows = [
        [as_words(kind), *(show_share(scores[name]["relative_error_95"]) for name in targets)]
        for kind, scores in document["strata"]["by_explosive"].items()
    ]
    table = Table(("explosive", *map(as_words, targets)), rows, "95 % relative error, test rows")
    shown = _pictures(pictures, "strata") + _pictures(pictures, "error_maps")
    return Section("Where the chosen model errs", tables=[table], pictures=shown)


def _worst(document: ComparisonDocument) -> Section:
    rows = [
        [
            f"{case['sample']}",
            as_words(case["explosive"]),
            as_words(case["target"]),
            "-" if case["relative_error"] is None else f"{case['relative_error']:+.2%}",
            "inside" if case["in_domain"] else "outside",
            f"{as_words(case['edge']['input'])} at {case['edge']['place']:.0%}",
            ", ".join(f"{as_words(n)} {VARIABLES[n].show(v)}" for n, v in case["inputs"].items()),
        ]
        for case in document["worst_cases"]
    ]
    header = ("sample", "explosive", "target", "error", "training domain", "nearest end", "inputs")
    return Section("The ten worst test rows", tables=[Table(header, rows)])


def _sobol(document: ComparisonDocument, pictures: Sequence[Path]) -> Section | None:
    sobol = document["sobol"]
    if not sobol:
        return None
    tables = []
    for target, inputs in sobol["indices"].items():
        checked = sobol["physics"]["targets"].get(target, {})
        rows = []
        for name, entry in inputs.items():
            pair = checked.get(name, {})
            rows.append(
                [
                    sobol["inputs"][name],
                    *(_index(entry, kind) for kind in ("first", "total")),
                    *(
                        _index(pair[who], "total") if pair else ""
                        for who in ("simulator", "surrogate")
                    ),
                ]
            )
        header = (
            "varied",
            "first order",
            "total",
            "total, simulator on few rows",
            "total, model on the same rows",
        )
        tables.append(Table(header, rows, as_words(target)))
    return Section(
        "Which inputs matter: Sobol indices",
        [f"{sobol['method']}, {sobol['rows']:,} base points; 95 % intervals in brackets."],
        tables,
        _pictures(pictures, "sobol"),
    )


def _index(entry: Document, kind: str) -> str:
    low, high = entry[f"{kind}_interval"]
    return f"{entry[kind]:.3f} ({low:.3f} to {high:.3f})"


def _pictures(pictures: Sequence[Path], stem: str) -> list[Picture]:
    return [
        Picture(path, _CAPTIONS[stem].format(folder=path.parent.name))
        for path in pictures
        if path.stem == stem
    ]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
