"""Pictures of where a model errs: planes of inputs, single inputs, rows unlike those seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from castblast.design.variables import VARIABLES
from castblast.names import as_words
from castblast.report.style import (
    CYCLE,
    in_style,
    new_figure,
    plain_log_ticks,
    save_figure,
    with_unit,
)

Document = Mapping[str, Any]


@in_style
def draw_error_maps(path: Path, title: str, planes: Sequence[Document]) -> Path:
    """Draw the 95 % relative error over planes of two inputs, one colour scale for all.

    Parameters
    ----------
    planes : sequence of mapping
        Documents of `surrogate.judging.strata.error_maps`, at least one.
    """
    columns = min(3, len(planes))
    lines = -(-len(planes) // columns)
    figure, axes = new_figure(
        lines, columns, width=3.3 * columns + 0.9, height=2.8 * lines + 0.5, squeeze=False
    )
    errors = [100.0 * np.array(plane["error"], dtype=np.float64) for plane in planes]
    most = max((float(np.nanmax(e)) for e in errors if np.isfinite(e).any()), default=1.0)
    shades = [
        _draw_plane(axis, plane, error, most)
        for axis, plane, error in zip(axes.ravel(), planes, errors, strict=False)
    ]
    for axis in axes.ravel()[len(planes) :]:
        axis.set_visible(False)
    figure.colorbar(shades[0], ax=list(axes.ravel()), shrink=0.8, pad=0.02,
                    label="95 % of relative errors below [%]")  # fmt: skip
    figure.suptitle(title, fontsize=11)
    return save_figure(figure, path)


def _draw_plane(axis: Any, plane: Document, error: Any, most: float) -> Any:
    """Cells of equal size, as each holds as many values of its input; the ends are labelled."""
    shades = axis.pcolormesh(error.T, cmap="YlOrRd", vmin=0.0, vmax=most)
    for i, j in np.ndindex(*error.shape):
        if np.isfinite(error[i, j]):
            axis.text(i + 0.5, j + 0.5, f"{error[i, j]:.2g}", ha="center", va="center", fontsize=7,
                      color="white" if error[i, j] > 0.65 * most else "black")  # fmt: skip
    for side, name in ((axis.xaxis, plane["across"]), (axis.yaxis, plane["up"])):
        variable = VARIABLES[name]
        edges = plane["across_edges" if side is axis.xaxis else "up_edges"]
        shown = [f"{edge * variable.display_factor:.3g}" for edge in edges]
        side.set_ticks(range(len(edges)), shown, fontsize=7)
        side.set_label_text(with_unit(name))
    axis.grid(visible=False)
    return shades


@in_style
def draw_strata(path: Path, title: str, strata: Document) -> Path:
    """Draw the 95 % relative error of every target against every input, in bins of equal count.

    Parameters
    ----------
    strata : mapping
        Document of `surrogate.judging.strata.strata`.
    """
    inputs = strata["by_input"]
    columns = min(4, len(inputs))
    lines = -(-len(inputs) // columns)
    figure, axes = new_figure(
        lines, columns, width=2.5 * columns + 0.6, height=2.1 * lines + 0.8, sharey=True,
        squeeze=False,
    )  # fmt: skip
    for axis, (name, cells) in zip(axes.ravel(), inputs.items(), strict=False):
        variable = VARIABLES[name]
        middle = [0.5 * (c["lower"] + c["upper"]) * variable.display_factor for c in cells]
        for target, colour in zip(cells[0]["targets"], CYCLE, strict=False):
            errors = [_percent(c["targets"][target]["relative_error_95"]) for c in cells]
            axis.plot(middle, errors, "o-", markersize=2.5, linewidth=1.2, color=colour,
                      label=as_words(target))  # fmt: skip
        axis.set_xlabel(with_unit(name), fontsize=8)
        axis.set_yscale("log")
        plain_log_ticks(axis.yaxis)
    for axis in axes.ravel()[len(inputs) :]:
        axis.set_visible(False)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    figure.supylabel("95 % of relative errors below [%]", fontsize=9)
    figure.suptitle(title, fontsize=11)
    return save_figure(figure, path)


@in_style
def draw_shifts(path: Path, shifts: Mapping[str, Document]) -> Path:
    """Draw the error on rows unlike those trained on, beside that of the fit that saw such rows.

    Parameters
    ----------
    shifts : mapping of model name to mapping
        Documents of `surrogate.judging.shifts.shift_tests`.
    """
    tests = list(dict.fromkeys(t["says"] for doc in shifts.values() for t in doc["tests"]))
    figure, axis = new_figure(width=8.6, height=1.4 + 0.36 * len(tests))
    for k, ((name, document), colour) in enumerate(zip(shifts.items(), CYCLE, strict=False)):
        offset = (k - (len(shifts) - 1) / 2) * 0.7 / max(len(shifts), 1)
        label: str | None = name
        for test in document["tests"]:
            place = tests.index(test["says"]) + offset
            if test.get("error") is None:
                axis.text(0.01, place, f"{name}: {test['not_run']}", fontsize=6, va="center",
                          transform=axis.get_yaxis_transform(), color=colour)  # fmt: skip
                continue
            seen, unseen = 100.0 * test["error_when_seen"], 100.0 * test["error"]
            axis.plot([seen, unseen], [place, place], color=colour, linewidth=1.2)
            axis.plot(seen, place, "o", color=colour, markersize=4, markerfacecolor="white")
            axis.plot(unseen, place, "o", color=colour, markersize=5, label=label)
            label = None
    axis.set_xscale("log")
    plain_log_ticks(axis.xaxis)
    axis.set_yticks(range(len(tests)), tests, fontsize=8)
    axis.set_ylim(len(tests) - 0.4, -0.6)
    figure.suptitle("Rows unlike those trained on; open: such rows were seen, filled: not",
                    fontsize=11)  # fmt: skip
    axis.set_xlabel("geometric mean of the 95 % relative errors [%]")
    figure.legend(loc="outside lower center", ncols=3)
    return save_figure(figure, path)


def _percent(value: float | None) -> float:
    return float("nan") if value is None else 100.0 * value
