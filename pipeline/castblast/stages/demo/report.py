"""The report of a demo: what was computed, how good it is, and what is left out."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from castblast.names import as_words
from castblast.version import __version__
from castblast.bands import BAND_SENTENCE, BAND_TITLE, show_band, show_value
from castblast.report.html import Picture, Section, Table, write_report
from castblast.stages.datasets.dataset import describe_dataset
from castblast.api.muckpile.document import metric_rows
from castblast.design.variables import VARIABLES

_LEAD = (
    "From explosive, rock and bench to burden velocity and muckpile, at a small size. Made by "
    f"castblast {__version__}."
)

LEFT_OUT = (
    "Fracturing between equilibrium and burden motion is not simulated; gas storage in radial "
    "cracks stands for it.",
    "The burden model was checked against the published system, whose level its parameters were "
    "chosen to give; it is neither calibrated on your blasts nor validated. The prediction band, a "
    "factor 1.8 either way on velocity, is a prior.",
    "Rock strength does not depend on the loading rate (a factor is offered as calibration).",
    "More energetic explosives are not credited with more heave than ANFO: in rate-independent "
    "rock they spend the difference on crushing.",
    "The network band says how well the surrogate repeats the physics model, not how well the "
    "model repeats a blast; that is the prediction band.",
    "Fragments are balls with rolling resistance; their sizes are prescribed, not predicted.",
    "The demo's dataset and muckpile are small: see the recipes paper and full, and the benches, "
    "for the real sizes.",
)


def write_demo_report(out: Path) -> Path:
    """Gather the results of the steps under `out` into ``report.html``."""
    sections = [
        _muckpile(out / "muckpile"),
        _dataset(out / "dataset" / "data.nc"),
        _surrogate(out / "models"),
        _prediction(out / "prediction"),
        Section("What is left out", points=LEFT_OUT),
    ]
    return write_report(out / "report.html", "castblast demo", _LEAD, sections)


def _read(path: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return document


def _dataset(path: Path) -> Section:
    description = describe_dataset(path)
    return Section(
        "Dataset: near field and burden motion over a Latin hypercube",
        paragraphs=description.lines,
        tables=[Table(description.header, description.rows, "Rows of the training split")],
    )


def _surrogate(folder: Path) -> Section:
    comparison = _read(folder / "comparison.json")
    targets, paper = comparison["targets"], comparison["paper"]
    header = ["model", *(f"{VARIABLES[name].name.replace('_', ' ')}" for name in targets)]
    rows = [
        [
            entry["name"] + (" (chosen)" if entry["name"] == comparison["chosen"] else ""),
            *(
                f"{entry['targets'][name]['r2']:.5f}; "
                f"{entry['targets'][name]['relative_error_95']:.2%}"
                for name in targets
            ),
        ]
        for entry in comparison["league"]
    ]
    mark = f"{paper['r2']:.4f}; {paper['relative_error_95']:.1%}"
    rows.append(
        [
            f"published ({paper['runs']:,} runs)",
            *(mark if name == paper["target"] else "not given" for name in targets),
        ]
    )
    caption = (
        "R² and 95th-percentile relative error on "
        f"{comparison['test_rows']:,} held-out test rows"
    )
    figures = [
        Picture(path, f"Learning curve, error histogram, predicted against simulated: {name}")
        for name in (entry["name"] for entry in comparison["league"])
        if (path := folder / name / "figure_2.png").is_file()
    ]
    best = comparison["league"][0]["name"]
    parity = folder.parent / "fits" / best / "parity.png"
    return Section(
        "Surrogate: league table and the paper's Figure 2",
        paragraphs=[f"Chosen: {comparison['chosen']} ({comparison['rule']})."],
        tables=[Table(header, rows, caption)],
        pictures=[*figures, Picture(parity, f"All targets of {best}")],
    )


def _prediction(folder: Path) -> Section:
    document = _read(folder / "comparison.json")
    rows = []
    for name, predicted in document["predicted"].items():
        variable, simulated = VARIABLES[name], document["simulated"][name]
        band = document["network_band"][name]["relative"]
        rows.append(
            (
                as_words(name),
                f"{show_value(name, predicted)} {variable.shown_unit}",
                f"{show_band(name, predicted, band)} {variable.shown_unit}",
                f"{show_value(name, simulated)} {variable.shown_unit}",
                f"± {band:.1%}",
                f"{predicted / simulated - 1.0:+.2%}",
            )
        )
    inputs = ", ".join(f"{n} {VARIABLES[n].show(v)}" for n, v in document["inputs"].items())
    return Section(
        "Prediction against physics",
        paragraphs=[f"Design: {document['explosive']}, {inputs}.", BAND_SENTENCE],
        tables=[
            Table(
                ("quantity", "surrogate", BAND_TITLE, "physics", "network band", "deviation"), rows
            )
        ],
        pictures=[
            Picture(folder / "velocity.png", "Burden velocity over burden"),
            Picture(folder / "simulation.png", "The simulated blast"),
        ],
    )


def _thrown_at(metrics: Mapping[str, Any]) -> str:
    """Velocity with its band: the demo throws the bench with the answer of its own network."""
    speed = metrics["initial_velocity"]
    return f"{show_value('burden_velocity', speed)} ({show_band('burden_velocity', speed)})"


def _muckpile(folder: Path) -> Section:
    metrics = _read(folder / "metrics.json")
    title = (
        f"{metrics['balls']:,} balls of mean radius {metrics['mean_radius']:.2f} m, thrown at "
        f"{_thrown_at(metrics)} m/s, at rest after {metrics['simulated_time']:.1f} s."
    )
    captions = {
        "section": "Cross-section, balls coloured by block",
        "sections": "Cross-sections along the bench, after",
        "plan": "Plan view, before and after",
        "view": "Bench and muckpile from above and aside",
        "movement": "Movement vectors of the blocks; ellipses are one standard deviation",
        "profiles": "Surface of the muckpile and its scatter along the bench",
        "energy": "Energy over time",
    }
    pictures = [
        Picture(path, captions.get(path.stem, as_words(path.stem)))
        for path in sorted(folder.glob("*.png"), key=lambda p: list(captions).index(p.stem)
                           if p.stem in captions else len(captions))
    ]  # fmt: skip
    return Section(
        "Muckpile",
        paragraphs=[title],
        tables=[Table(("quantity", "value", "unit"), metric_rows(metrics))],
        pictures=pictures,
    )
