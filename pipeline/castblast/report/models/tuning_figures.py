"""Picture of a study: how the error fell, and which settings it depends on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from castblast.report.style import (
    BLUE,
    GREY,
    ORANGE,
    in_style,
    new_figure,
    plain_log_ticks,
    save_figure,
)


@in_style
def draw_study(
    path: Path,
    title: str,
    trials: Sequence[tuple[int, float | None, str]],
    importance: Mapping[str, float],
) -> Path:
    """Draw the error of every trial with the lowest so far, and the importance of each setting.

    Parameters
    ----------
    path : path
        Picture to write (PNG or SVG).
    title : str
    trials : sequence of (number, error, state)
        Error as a fraction; None for trials that were not finished.
    importance : mapping of setting to float
        Shares that sum to 1; may be empty.
    """
    figure, axes = new_figure(1, 2, width=9.4, height=3.4)
    _draw_history(axes[0], trials)
    _draw_importance(axes[1], importance)
    figure.suptitle(title, fontsize=11)
    return save_figure(figure, path)


def _draw_history(axis: Any, trials: Sequence[tuple[int, float | None, str]]) -> None:
    finished = [(number, 100.0 * error) for number, error, _ in trials if error is not None]
    stopped = [number for number, error, state in trials if error is None and state == "pruned"]
    numbers, errors = (np.array(column) for column in zip(*finished, strict=True))
    axis.semilogy(numbers, errors, "o", color=GREY, markersize=4, label="trial")
    last = max(number for number, _, _ in trials)
    lowest = np.minimum.accumulate(errors)
    axis.step(
        [*numbers, last], [*lowest, lowest[-1]], where="post", color=BLUE, label="lowest so far"
    )
    if stopped:
        top = np.full(len(stopped), errors.max())
        axis.plot(stopped, top, "x", color=ORANGE, markersize=5, label="stopped early")
    axis.set(
        title="Error of the trials, validation rows",
        xlabel="trial",
        ylabel="95 % of relative errors below [%]\n(geometric mean of the targets)",
    )
    plain_log_ticks(axis.yaxis)
    axis.legend()


def _draw_importance(axis: Any, importance: Mapping[str, float]) -> None:
    axis.set(title="Importance of the settings", xlabel="share of the spread of the error [%]")
    if not importance:
        axis.text(
            0.5, 0.5, "too few finished trials", transform=axis.transAxes, ha="center", color=GREY
        )
        axis.set(xticks=[], yticks=[])
        return
    names = sorted(importance, key=lambda name: importance[name])
    axis.barh(
        [name.replace("_", " ").replace(".", ": ") for name in names],
        [100.0 * importance[name] for name in names],
        color=BLUE,
    )
    axis.grid(visible=False, axis="y")
