"""Pictures of what a model makes of its inputs, and of what more runs would give."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from castblast.names import as_words
from castblast.report.style import (
    BLUE,
    GREY,
    ORANGE,
    RED,
    in_style,
    new_figure,
    plain_log_ticks,
    save_figure,
)
from castblast.types import FloatArray

Document = Mapping[str, Any]
_MARK = {"color": "#222222", "linestyle": "--", "linewidth": 1.0}


@in_style
def draw_sobol(path: Path, title: str, report: Document) -> Path:
    """Draw first-order and total Sobol indices per target, the simulator's own as markers.

    Parameters
    ----------
    report : mapping
        Document of `surrogate.judging.sensitivity.sobol_report`.
    """
    targets, inputs = report["targets"], report["inputs"]
    columns = min(2, len(targets))
    lines = -(-len(targets) // columns)
    figure, axes = new_figure(
        lines, columns, width=4.6 * columns, height=lines * (1.1 + 0.24 * len(inputs)) + 0.5,
        sharey=True, sharex=True, squeeze=False,
    )  # fmt: skip
    headline = targets[-1] if "burden_velocity" not in targets else "burden_velocity"
    order = sorted(inputs, key=lambda name: -report["indices"][headline][name]["total"])
    for axis, target in zip(axes.ravel(), targets, strict=False):
        _draw_indices(axis, report, target, order)
    for axis in axes.ravel()[len(targets) :]:
        axis.set_visible(False)
    axes[0, 0].set_yticks(range(len(order)), [inputs[name] for name in order])
    for axis in axes[:, 0]:
        axis.tick_params(axis="y", labelsize=8)
    axes[0, 0].set_ylim(len(order) - 0.4, -0.6)
    handles, labels = axes.ravel()[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    figure.suptitle(title, fontsize=11)
    return save_figure(figure, path)


def _draw_indices(axis: Any, report: Document, target: str, order: Sequence[str]) -> None:
    physics = report["physics"]["targets"].get(target, {})
    for kind, shift, colour, words_ in (
        ("first", -0.19, BLUE, "first order"),
        ("total", 0.19, ORANGE, "total"),
    ):
        entries = [report["indices"][target][name] for name in order]
        values = np.array([entry[kind] for entry in entries])
        ends = np.array([entry[f"{kind}_interval"] for entry in entries])
        places = np.arange(len(order)) + shift
        axis.barh(places, values, height=0.36, color=colour, label=words_)
        axis.hlines(places, ends[:, 0], ends[:, 1], color="#444444", linewidth=0.9)
        checked = [(k, physics[name]) for k, name in enumerate(order) if name in physics]
        for model, size, face in (("simulator", 6.0, "black"), ("surrogate", 2.5, "white")):
            if not checked:
                continue
            axis.plot(
                [entry[model][kind] for _, entry in checked],
                [k + shift for k, _ in checked],
                "D", markersize=size, color=face, markeredgecolor="black", markeredgewidth=0.6,
                linestyle="none",
                label=f"{model}, {report['physics']['rows']:,} rows" if kind == "total" else None,
            )  # fmt: skip
    axis.set_title(as_words(target), fontsize=9)
    axis.axvline(0.0, color=GREY, linewidth=0.6)
    axis.grid(visible=False, axis="y")


@in_style
def draw_learning_laws(path: Path, title: str, report: Document) -> Path:
    """Draw learning curves with the power law through them, its interval and the marks.

    Parameters
    ----------
    report : mapping of target to mapping
        Document of `surrogate.judging.learning.learning_report`.
    """
    columns = min(2, len(report))
    lines = -(-len(report) // columns)
    figure, axes = new_figure(
        lines, columns, width=4.6 * columns, height=3.1 * lines + 0.4, squeeze=False
    )
    for axis, (target, entry) in zip(axes.ravel(), report.items(), strict=False):
        _draw_law(axis, target, entry)
    for axis in axes.ravel()[len(report) :]:
        axis.set_visible(False)
    figure.suptitle(title, fontsize=11)
    return save_figure(figure, path)


def _draw_law(axis: Any, target: str, entry: Document) -> None:
    rows = np.array(entry["rows"], dtype=np.float64)
    law = entry["law"]
    needed = entry["runs_for_mark"]
    if law is not None:
        ahead = np.geomspace(rows.min(), max(10.0 * rows.max(), 1.2 * (needed or 0.0)), 200)
        error = law["floor"] + law["scale"] * ahead ** -law["exponent"]
        if entry["band"]:
            axis.fill_between(
                entry["band"]["rows"],
                *(_percents(entry["band"][k]) for k in ("lower", "upper")),
                color=BLUE,
                alpha=0.15,
                linewidth=0,
            )
        dash = "-" if entry["trusted"] else ":"
        axis.loglog(ahead, 100.0 * error, dash, color=BLUE, linewidth=1.2,
                    label=_formula(law, entry["trusted"]))  # fmt: skip
    axis.loglog(rows, _percents(entry["error"]), "o", color=BLUE, label="test rows")
    axis.axhline(100.0 * entry["mark"], **_MARK)
    axis.text(0.99, 100.0 * entry["mark"], f"mark {100 * entry['mark']:g} %", fontsize=7,
              ha="right", va="bottom", transform=axis.get_yaxis_transform())  # fmt: skip
    if needed is not None:
        axis.plot(needed, 100.0 * entry["mark"], "*", color=RED, markersize=11,
                  label=f"{needed:,} runs needed")  # fmt: skip
    axis.set(title=as_words(target), xlabel="training rows", ylabel="95 % of errors below [%]")
    plain_log_ticks(axis.yaxis)
    axis.legend(fontsize=7)


def _formula(law: Document, trusted: bool) -> str:
    floor = 100.0 * law["floor"]
    constant = f"{floor:.2g} % + " if floor > 1e-4 else ""
    doubt = "" if trusted else ", not trusted"
    return f"{constant}c / n^{law['exponent']:.2f}{doubt}"


def _percents(values: Sequence[float]) -> FloatArray:
    return 100.0 * np.asarray(values, dtype=np.float64)
