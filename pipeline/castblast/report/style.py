"""One look for all pictures, and the one way to save them.

Figures are made without pyplot, so that nothing global changes and no display is needed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter, LogFormatterMathtext

from castblast.design.variables import VARIABLES
from castblast.disk.files import write_with
from castblast.names import as_words

#: Colours that stay apart for colour-blind readers (Okabe & Ito 2008).
BLUE, ORANGE, GREEN, RED, PURPLE, SKY, YELLOW, GREY = (
    "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#F0E442", "#7F7F7F",
)  # fmt: skip
CYCLE = (BLUE, ORANGE, GREEN, RED, PURPLE, SKY)

_STYLE: Any = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#E5E5E5",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.linewidth": 1.6,
    # A dollar sign in a name is a dollar sign.
    "text.parse_math": False,
    "figure.facecolor": "white",
}

#: Decorator of drawing functions: titles and legends take the style when they are made.
in_style = rc_context(_STYLE)


class ShownFigure(Figure):
    """A figure that a notebook shows by itself: IPython asks for `_repr_png_`."""

    def _repr_png_(self) -> bytes:
        return figure_png(self)


def figure_png(figure: Figure, dpi: int = 100) -> bytes:
    """Picture of a figure as the bytes of a PNG."""
    from io import BytesIO

    content = BytesIO()
    with rc_context(_STYLE):
        figure.savefig(content, dpi=dpi, format="png", metadata={"Software": None})
    return content.getvalue()


def new_figure(
    rows: int = 1, columns: int = 1, *, width: float = 9.0, height: float = 3.2, **options: Any
) -> tuple[Figure, Any]:
    """Make a figure of `rows` x `columns` axes; `width` and `height` in inches.

    Returns the figure and an array of axes (a single axes object for one).
    """
    with rc_context(_STYLE):
        figure = ShownFigure(figsize=(width, height), layout="constrained")
        axes = figure.subplots(rows, columns, **options)
    return figure, axes


def save_figure(figure: Figure, path: Path, *, dpi: int = 150) -> Path:
    """Write a PNG (or SVG, by suffix) whole or not at all, without a date in it."""
    metadata = {"Date": None} if path.suffix == ".svg" else {"Software": None}
    finished(figure)
    with rc_context(_STYLE):
        return write_with(path, lambda name: figure.savefig(name, dpi=dpi, metadata=metadata))


def finished(figure: Figure) -> Figure:
    """Make a drawn figure ready to be saved or shown; gives the same figure back."""
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            _without_math(axis)
    return figure


class _PlainPowers(LogFormatter):
    """Ticks of a logarithmic axis as plain numbers, where matplotlib would label them."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return f"{x:g}" if super().__call__(x, pos) else ""


def _without_math(axis: Any) -> None:
    """Replace formatters that write powers of ten as formulas, which are not parsed here."""
    if isinstance(axis.get_major_formatter(), LogFormatterMathtext):
        axis.set_major_formatter(_PlainPowers())
    if isinstance(axis.get_minor_formatter(), LogFormatterMathtext):
        axis.set_minor_formatter(_PlainPowers())


def with_unit(name: str) -> str:
    """Name of a variable as words, with the unit for people unless it has none."""
    unit = VARIABLES[name].shown_unit
    return as_words(name) if unit == "1" else f"{as_words(name)} [{unit}]"


def plain_log_ticks(axis: Any) -> None:
    """Ticks of a logarithmic axis at 1, 2 and 5 of every decade, as plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
