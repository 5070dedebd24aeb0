"""Pictures of a surrogate: the paper's Figure 2 redrawn from our own run, and all targets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import floor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from castblast.design.variables import VARIABLES
from castblast.names import as_words
from castblast.report.style import (
    BLUE,
    CYCLE,
    GREY,
    in_style,
    new_figure,
    plain_log_ticks,
    save_figure,
)
from castblast.types import FloatArray

_MARK = {"color": "#222222", "linestyle": "--", "linewidth": 1.0}
_PLATE = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}
_OTHER_TARGETS = (("s", "-"), ("^", "--"), ("D", "-."), ("v", ":"))


@dataclass(frozen=True)
class LearningLine:
    """95 % relative error of one target against the number of training rows.

    Attributes
    ----------
    target : str
    rows : sequence of int
    train, test : sequence of float
        Fractions, not percent.
    """

    target: str
    rows: Sequence[int]
    train: Sequence[float]
    test: Sequence[float]


@dataclass(frozen=True)
class HeldOutRows:
    """What a model said about the rows it never saw.

    Attributes
    ----------
    truth, predicted : mapping of target name to (n,) [SI]
    explosive : (n,) of str
    scores : mapping of target name to mapping
        ``r2`` and ``relative_error_95`` (fraction) on these rows.
    by_explosive : mapping of explosive to such a mapping
    """

    truth: Mapping[str, FloatArray]
    predicted: Mapping[str, FloatArray]
    explosive: NDArray[np.str_]
    scores: Mapping[str, Mapping[str, float]]
    by_explosive: Mapping[str, Mapping[str, Mapping[str, float]]]

    def errors(self, target: str) -> FloatArray:
        """Relative errors in percent, signed."""
        truth = self.truth[target]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(100.0 * (self.predicted[target] - truth) / np.abs(truth))


@in_style
def draw_figure_two(
    path: Path,
    title: str,
    lines: Sequence[LearningLine],
    rows: HeldOutRows,
    *,
    target: str = "burden_velocity",
    marks: Mapping[str, float],
) -> Path:
    """Draw learning curve, error histogram, predicted against actual, error by explosive.

    Parameters
    ----------
    path : path
        Picture to write (PNG or SVG).
    title : str
        Name of the model.
    lines : sequence of LearningLine
        One per target.
    rows : HeldOutRows
    target : str
        The target of the histogram and of predicted against actual.
    marks : mapping
        Published ``relative_error_95`` (fraction), ``r2`` and ``runs``.
    """
    figure, axes = new_figure(2, 2, width=9.4, height=7.6)
    _draw_learning(axes[0, 0], lines, target, marks)
    _draw_histogram(axes[0, 1], rows, target, marks)
    _draw_parity(axes[1, 0], rows, target, "c) ")
    _draw_by_explosive(axes[1, 1], rows, marks)
    figure.suptitle(title, fontsize=11)
    return save_figure(figure, path)


@in_style
def draw_parity(path: Path, title: str, rows: HeldOutRows) -> Path:
    """Draw predicted against actual for every target on the test rows."""
    targets = list(rows.truth)
    figure, axes = new_figure(
        (len(targets) + 1) // 2, 2, width=9.0, height=4.0 * ((len(targets) + 1) // 2), squeeze=False
    )
    for axis, target in zip(axes.ravel(), targets, strict=False):
        _draw_parity(axis, rows, target)
    for axis in axes.ravel()[len(targets) :]:
        axis.set_visible(False)
    figure.suptitle(title, fontsize=11)
    return save_figure(figure, path)


def _draw_learning(
    axis: Any, lines: Sequence[LearningLine], target: str, marks: Mapping[str, float]
) -> None:
    main = next(line for line in lines if line.target == target)
    others = [line for line in lines if line is not main]
    axis.loglog(main.rows, _percent(main.test), "o-", color=BLUE, linewidth=2.2, zorder=4,
                label=as_words(target))  # fmt: skip
    axis.loglog(main.rows, _percent(main.train), ":", color=BLUE, linewidth=1.2, zorder=4,
                label=f"{as_words(target)}, training rows")  # fmt: skip
    for line, (marker, dash) in zip(others, _OTHER_TARGETS, strict=False):
        axis.loglog(line.rows, _percent(line.test), color=GREY, marker=marker, markersize=3.5,
                    linestyle=dash, linewidth=1.0, label=as_words(line.target))  # fmt: skip
    mark = 100.0 * marks["relative_error_95"]
    axis.plot(marks["runs"], mark, "*", markersize=11, color="#222222", linestyle="none", zorder=5,
              label=f"{as_words(target)}, as published: {mark:g} %")  # fmt: skip
    axis.set(
        title="a) Learning curve, test rows",
        xlabel="training rows",
        ylabel="95 % of relative errors below [%]",
    )
    sizes = sorted({*main.rows, int(marks["runs"])})
    apart = [a for a, b in pairwise(sizes) if b / a > 1.45] + [sizes[-1]]
    axis.set_xticks(apart, [f"{size:,}" for size in apart])
    axis.minorticks_off()
    plain_log_ticks(axis.yaxis)
    axis.legend(fontsize=7, loc="lower left", bbox_to_anchor=(0.0, 0.0))
    low, high = axis.get_ylim()
    axis.set_ylim(low / (high / low) ** 0.6, high)  # room for the legend


def _percent(fractions: Sequence[float]) -> FloatArray:
    return 100.0 * np.asarray(fractions, dtype=np.float64)


def _draw_histogram(axis: Any, rows: HeldOutRows, target: str, marks: Mapping[str, float]) -> None:
    errors = rows.errors(target)
    mark = 100.0 * marks["relative_error_95"]
    reach = max(1.6 * mark, 150.0 * rows.scores[target]["relative_error_95"])
    inside = float(np.mean(np.abs(errors) <= mark))
    clipped = np.clip(errors, -reach, reach)
    bins = min(60, max(20, 2 * round(len(errors) ** 0.5)))
    axis.hist(clipped, bins=np.linspace(-reach, reach, bins + 1), color=BLUE)
    for side in (-mark, mark):
        axis.axvline(side, **_MARK)
    axis.text(
        0.98, 0.96, f"{inside:.1%} of {len(errors):,} rows\nwithin ±{mark:g} %",
        transform=axis.transAxes, ha="right", va="top", fontsize=8, bbox=_PLATE,
    )  # fmt: skip
    axis.set(
        title=f"b) Error of {as_words(target)}, test rows",
        xlabel="relative error [%]; what lies beyond is in the outer bins",
        ylabel="rows",
    )


def _draw_parity(axis: Any, rows: HeldOutRows, target: str, letter: str = "") -> None:
    variable = VARIABLES[target]
    # R² is cut, not rounded: a model that misses is never shown as 1.
    truth = rows.truth[target] * variable.display_factor
    predicted = rows.predicted[target] * variable.display_factor
    ends = [float(min(truth.min(), predicted.min())), float(max(truth.max(), predicted.max()))]
    axis.plot(ends, ends, color=GREY, linewidth=0.8, zorder=1)
    for kind, colour in zip(np.unique(rows.explosive), CYCLE, strict=False):
        own = rows.explosive == kind
        axis.scatter(truth[own], predicted[own], s=5, linewidths=0, alpha=0.6, color=colour,
                     label=as_words(str(kind)), rasterized=True)  # fmt: skip
    r2, error = (rows.scores[target][name] for name in ("r2", "relative_error_95"))
    shown = "-" if r2 is None else f"{floor(r2 * 1e5) / 1e5:.5f}"
    axis.text(
        0.98, 0.04, f"R² {shown}\n95 % within {error:.2%}",
        transform=axis.transAxes, ha="right", va="bottom", fontsize=8,
    )  # fmt: skip
    axis.set(
        title=f"{letter}{as_words(target)[0].upper()}{as_words(target)[1:]}",
        xlabel=f"simulated [{variable.shown_unit}]",
        ylabel=f"predicted [{variable.shown_unit}]",
        aspect="equal",
    )
    axis.legend(loc="upper left", markerscale=3, fontsize=7)


def _draw_by_explosive(axis: Any, rows: HeldOutRows, marks: Mapping[str, float]) -> None:
    kinds, targets = sorted(rows.by_explosive), list(rows.truth)
    height = 0.8 / len(kinds)
    for k, (kind, colour) in enumerate(zip(kinds, CYCLE, strict=False)):
        values = [100.0 * rows.by_explosive[kind][name]["relative_error_95"] for name in targets]
        places = np.arange(len(targets)) + (k - (len(kinds) - 1) / 2) * height
        axis.barh(places, values, height=0.9 * height, color=colour)
    axis.axvline(100.0 * marks["relative_error_95"], **_MARK)
    axis.set_yticks(range(len(targets)), [as_words(t).replace(" ", "\n", 1) for t in targets])
    axis.invert_yaxis()
    axis.grid(visible=False, axis="y")
    axis.set(
        title="d) By target and explosive, test rows",
        xlabel="95 % of relative errors below [%]; colours as in c)",
    )
