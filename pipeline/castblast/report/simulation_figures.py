"""Pictures of one simulated blast: gas pressure, hole, burden motion and the energy ledger."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

from matplotlib.figure import Figure

from castblast.bands import BAND_TITLE, BASIS, prediction_band, show_band, show_value
from castblast.report.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    RED,
    SKY,
    finished,
    in_style,
    new_figure,
    save_figure,
)
from castblast.types import FloatArray


class NearFieldHistory(Protocol):
    """The histories of a near-field run that are drawn."""

    @property
    def history_time(self) -> FloatArray: ...  # noqa: D102
    @property
    def history_pressure(self) -> FloatArray: ...  # noqa: D102
    @property
    def history_radius(self) -> FloatArray: ...  # noqa: D102


class BurdenHistory(Protocol):
    """The histories of a burden-motion run that are drawn."""

    @property
    def history_time(self) -> FloatArray: ...  # noqa: D102
    @property
    def history_pressure(self) -> FloatArray: ...  # noqa: D102
    @property
    def history_velocity(self) -> FloatArray: ...  # noqa: D102
    @property
    def history_displacement(self) -> FloatArray: ...  # noqa: D102


_LEDGER = (
    ("plastic_work", "shear yield", BLUE),
    ("tensile_work", "tensile yield", SKY),
    ("elastic_energy", "elastic", GREEN),
    ("kinetic_energy", "kinetic", ORANGE),
    ("viscous_work", "viscosity", PURPLE),
    ("boundary_work", "radiated", GREY),
)


def draw_simulation(
    path: Path, document: Mapping[str, Any], near: NearFieldHistory, burden: BurdenHistory
) -> Path:
    """Draw `simulation_figure` into a file (PNG or SVG)."""
    return save_figure(simulation_figure(document, near, burden), path)


@in_style
def simulation_figure(
    document: Mapping[str, Any], near: NearFieldHistory, burden: BurdenHistory
) -> Figure:
    """Draw the four panels of one blast.

    Parameters
    ----------
    document : mapping
        Outputs of the run in SI units, by the names of `castblast.design.variables`.
    near, burden
        Objects with the history arrays, each of shape (n,).
    """
    figure, axes = new_figure(2, 2, width=9.0, height=5.8)
    _draw_pressure(axes[0, 0], document, near)
    _draw_hole(axes[0, 1], document, near)
    _draw_burden(axes[1, 0], document, burden)
    _draw_ledger(axes[1, 1], document)
    pressure, speed = (
        f"{show_value(name, document[name])} {unit} ({show_band(name, document[name])})"
        for name, unit in (("equilibrium_pressure", "MPa"), ("burden_velocity", "m/s"))
    )
    figure.suptitle(
        f"{document['explosive']}: {pressure} at rest, burden velocity {speed}\n"
        f"in brackets the prediction band, {BASIS}",
        fontsize=11,
    )
    return finished(figure)


def _draw_pressure(axis: Any, document: Mapping[str, Any], near: NearFieldHistory) -> None:
    axis.semilogy(near.history_time * 1e3, near.history_pressure * 1e-6, color=BLUE)
    level = document["equilibrium_pressure"] * 1e-6
    axis.axhline(level, color=GREY, linestyle=":", linewidth=1.0)
    axis.annotate(f"equilibrium {level:.0f} MPa", (0.98, level), xycoords=("axes fraction", "data"),
                  ha="right", va="bottom", fontsize=8, color=GREY)  # fmt: skip
    axis.set(title="Gas pressure in the hole", xlabel="time [ms]", ylabel="pressure [MPa]")
    positive = near.history_pressure[near.history_pressure > 0]
    axis.set_ylim(bottom=0.5 * level, top=2 * float(positive.max()) * 1e-6)


def _draw_hole(axis: Any, document: Mapping[str, Any], near: NearFieldHistory) -> None:
    axis.plot(near.history_time * 1e3, near.history_radius * 1e3, color=RED)
    axis.axhline(document["expanded_hole_radius"] * 1e3, color=GREY, linestyle=":", linewidth=1.0)
    axis.set(title="Hole radius", xlabel="time [ms]", ylabel="radius [mm]")


def _draw_burden(axis: Any, document: Mapping[str, Any], burden: BurdenHistory) -> None:
    time = burden.history_time * 1e3
    axis.plot(time, burden.history_velocity, color=BLUE, label="velocity")
    ends = prediction_band("burden_velocity", document["burden_velocity"])
    last = float(time[-1])
    axis.plot([last, last], ends, "_-", color=BLUE, linewidth=1.0, label=BAND_TITLE)
    axis.set(title="Burden motion", xlabel="time [ms]", ylabel="velocity [m/s]")
    other = axis.twinx()
    other.grid(visible=False)
    other.spines["right"].set_visible(True)
    other.semilogy(time, burden.history_pressure * 1e-6, color=ORANGE, label="gas pressure")
    other.set_ylabel("pressure [MPa]")
    lines = axis.get_lines() + other.get_lines()
    axis.legend(lines, [line.get_label() for line in lines], loc="upper center")


def _draw_ledger(axis: Any, document: Mapping[str, Any]) -> None:
    total = document["gas_work"]
    shares = [(label, document[name] / total * 100.0, colour) for name, label, colour in _LEDGER]
    # A negative share is the rounding of a ledger that has nothing to book there.
    shares = [(label, max(share, 0.0), colour) for label, share, colour in shares]
    shares.sort(key=lambda item: item[1])
    bars = axis.barh([s[0] for s in shares], [s[1] for s in shares], color=[s[2] for s in shares])
    axis.bar_label(bars, fmt="%.1f %%", padding=3, fontsize=8)
    axis.set_xlim(right=max(s[1] for s in shares) * 1.2)
    axis.grid(visible=False, axis="y")
    axis.set(
        title=f"Where {total * 1e-6:.1f} MJ/m of gas work goes",
        xlabel="share of the gas work [%]",
    )
