"""Surrogate and physics side by side: burden velocity over the burden."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.ticker import LogLocator

from castblast.bands import BAND_TITLE
from castblast.report.style import CYCLE, in_style, new_figure, save_figure
from castblast.types import FloatArray


@dataclass(frozen=True)
class VelocityCurve:
    """Burden velocity over burden for one design.

    Attributes
    ----------
    label : str
    burden, velocity, lower, upper : array (n,) [m, m s-1, m s-1, m s-1]
        Answers of the surrogate and the ends of their prediction bands.
    simulated_burden, simulated_velocity : array (k,) [m, m s-1]
        The physics at a few burdens.
    """

    label: str
    burden: FloatArray
    velocity: FloatArray
    lower: FloatArray
    upper: FloatArray
    simulated_burden: FloatArray
    simulated_velocity: FloatArray


@in_style
def draw_velocity_curves(path: Path, title: str, curves: Sequence[VelocityCurve]) -> Path:
    """Draw lines with prediction bands for the surrogate and dots for the physics."""
    figure, axis = new_figure(width=7.0, height=4.0)
    for curve, colour in zip(curves, CYCLE, strict=False):
        axis.fill_between(
            curve.burden, curve.lower, curve.upper, color=colour, alpha=0.15, linewidth=0
        )
        axis.plot(curve.burden, curve.velocity, color=colour, label=curve.label)
        axis.plot(curve.simulated_burden, curve.simulated_velocity, "o", color=colour, markersize=4)
    axis.set_yscale("log")
    axis.yaxis.set_major_formatter("{x:g}")
    axis.yaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
    axis.yaxis.set_minor_formatter("{x:g}")
    axis.plot([], [], "o", color="#222222", markersize=4, label="physics")
    axis.fill_between([], [], [], color="#222222", alpha=0.15, linewidth=0, label=BAND_TITLE)
    axis.set(title=title, xlabel="burden [m]", ylabel="burden velocity [m/s]")
    axis.legend()
    return save_figure(figure, path)
