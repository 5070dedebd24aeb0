"""Pictures of a comparison: the league table and the physics gate."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from castblast.names import as_words
from castblast.report.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    RED,
    in_style,
    new_figure,
    plain_log_ticks,
    save_figure,
)

Document = Mapping[str, Any]
_MARK = {"color": "#222222", "linestyle": "--", "linewidth": 1.0}
_LIGHT = "#EDEDED"


@in_style
def draw_league(path: Path, comparison: Document) -> Path:
    """Draw the league table: 95 % relative error of every model and target with its interval.

    Parameters
    ----------
    path : path
        Picture to write (PNG or SVG).
    comparison : mapping
        Document of `surrogate.judging.comparison.compare`.
    """
    league, targets = comparison["league"], comparison["targets"]
    height = 1.5 + 0.34 * len(league)
    figure, axes = new_figure(
        1, len(targets), width=2.6 + 2.1 * len(targets), height=height, sharey=True, squeeze=False
    )
    for axis, target in zip(axes[0], targets, strict=True):
        _draw_target(axis, comparison, target)
    labels = [_label(entry, comparison) for entry in league]
    axes[0, 0].set_yticks(range(len(league)), labels)
    axes[0, 0].set_ylim(len(league) - 0.5, -0.5)
    for tick, entry in zip(axes[0, 0].get_yticklabels(), league, strict=True):
        tick.set_fontweight("bold" if entry["name"] == comparison["chosen"] else "normal")
        tick.set_color(RED if entry["gate_passed"] is False else "black")
    figure.supxlabel("95 % of relative errors below [%], test rows, with 95 % interval; "
                     "dashed: mark to be reached, dotted: as published", fontsize=8)  # fmt: skip
    figure.suptitle(_league_title(comparison), fontsize=11)
    return save_figure(figure, path)


def _league_title(comparison: Document) -> str:
    name = comparison["dataset"].get("name", "")
    chosen = comparison["chosen"]
    text = f"chosen: {chosen}" if chosen else "none passes the physics gate"
    return f"League table, dataset {name}, {comparison['test_rows']:,} test rows; {text}"


def _label(entry: Document, comparison: Document) -> str:
    notes = []
    if entry["gate_passed"] is False:
        notes.append("fails the gate")
    if not entry["exportable"]:
        notes.append("no export")
    if comparison["chosen"] in entry["not_distinguishable_from"]:
        notes.append("≈ chosen")
    name: str = entry["name"]
    return name + (f"\n({', '.join(notes)})" if notes else "")


def _draw_target(axis: Any, comparison: Document, target: str) -> None:
    for place, entry in enumerate(comparison["league"]):
        figures = entry["targets"][target]
        error = figures["relative_error_95"]
        if error is None:
            continue
        low, high = figures["relative_error_95_interval"]
        ends = [error if low is None else low, error if high is None else high]
        colour = _colour(entry, comparison)
        axis.plot(100.0 * np.array(ends), [place, place], color=colour, linewidth=2.0, alpha=0.5)
        marker = "o" if entry["exportable"] else "s"
        axis.plot(100.0 * error, place, marker, color=colour, markersize=6,
                  markerfacecolor=colour if figures["mark"]["met"] else "white")  # fmt: skip
    mark = comparison["league"][0]["targets"][target]["mark"]["relative_error_95"]
    axis.axvline(100.0 * mark, **_MARK)
    if target == comparison["paper"]["target"]:
        published = 100.0 * comparison["paper"]["relative_error_95"]
        axis.axvline(published, **{**_MARK, "linestyle": ":"})
    axis.set_xscale("log")
    plain_log_ticks(axis.xaxis)
    axis.set_title(as_words(target), fontsize=9)


def _colour(entry: Document, comparison: Document) -> str:
    if entry["gate_passed"] is False:
        return RED
    if entry["name"] == comparison["chosen"]:
        return BLUE
    return GREY


@in_style
def draw_gate(path: Path, gates: Mapping[str, Document]) -> Path:
    """Draw which model breaks which rule of physics, and how often.

    Parameters
    ----------
    path : path
    gates : mapping of model name to mapping
        Documents of `surrogate.judging.gate.check_physics`, of models with the same targets or not.
    """
    names = list(gates)
    checks = list(dict.fromkeys(c["name"] for gate in gates.values() for c in gate["checks"]))
    figure, axis = new_figure(width=4.2 + 0.62 * len(names), height=1.6 + 0.24 * len(checks))
    for column, name in enumerate(names):
        by_name = {check["name"]: check for check in gates[name]["checks"]}
        for row, rule in enumerate(checks):
            _draw_cell(axis, column, row, by_name.get(rule))
    axis.set_xlim(-0.5, len(names) - 0.5)
    axis.set_ylim(len(checks) - 0.5, -0.5)
    axis.set_yticks(range(len(checks)), [as_words(check) for check in checks], fontsize=8)
    axis.set_xticks(range(len(names)), names, rotation=40, ha="right", fontsize=8)
    for tick, name in zip(axis.get_xticklabels(), names, strict=True):
        tick.set_color("black" if gates[name]["passed"] else RED)
    axis.grid(visible=False)
    axis.tick_params(length=0)
    for spine in axis.spines.values():
        spine.set_visible(False)
    figure.suptitle("Physics gate: share of wrong answers; grey: not asked", fontsize=11)
    return save_figure(figure, path)


def _draw_cell(axis: Any, column: int, row: int, check: Document | None) -> None:
    from matplotlib.patches import Rectangle

    asked = check is not None and check["asked"] > 0
    broken = check["broken"] / check["asked"] if check is not None and asked else 0.0
    colour = _LIGHT if not asked else GREEN if not broken else ORANGE if broken < 0.01 else RED
    axis.add_patch(Rectangle((column - 0.46, row - 0.44), 0.92, 0.88, color=colour, linewidth=0))
    text = ""
    if asked:
        text = f"{broken:.2%}" if broken else "✓"
    axis.text(column, row, text, ha="center", va="center", fontsize=7,
              color="white" if colour in (GREEN, RED) else "black")  # fmt: skip
