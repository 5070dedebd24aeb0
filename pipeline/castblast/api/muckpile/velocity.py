"""The velocity that a bench is thrown with, for documents and people: predicted or as given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from castblast.bands import BAND_WORDS, band_document, show_band, show_value
from castblast.prediction.answer import domain_remarks

_NAME = "burden_velocity"


def describe_velocity(speed: float, prediction: Mapping[str, Any] | None) -> dict[str, Any]:
    """Document of the velocity of a bench.

    Parameters
    ----------
    speed : float [m s-1]
        Mean over the blocks that are fired.
    prediction : mapping, optional
        What the surrogate said; None: the velocity was given.

    Returns
    -------
    dict
        ``initial_velocity`` [m s-1]; ``velocity_source``: surrogate or given;
        ``prediction_band`` [m s-1] and ``prediction_basis`` as `castblast.bands` gives them, no
        band where the velocity was given.
    """
    if prediction is None:
        return {"initial_velocity": speed, "velocity_source": "given", **band_document({})}
    network = prediction["network_band"][_NAME]["relative"]
    band = band_document({_NAME: speed}, {_NAME: network})
    return {"initial_velocity": speed, "velocity_source": "surrogate", **band}


def velocity_words(document: Mapping[str, Any]) -> str:
    """Velocity of a described run with its band: ``"9.73 (5.5 to 17)"``, or as given.

    Runs of versions before this one say nothing of the source: their velocity stands alone.
    """
    speed = document["initial_velocity"]
    source = document.get("velocity_source")
    if source == "surrogate":
        return f"{show_value(_NAME, speed)} ({show_band(_NAME, speed)})"
    return f"{speed:.3g}, as given" if source == "given" else f"{speed:.3g}"


def velocity_remarks(prediction: Mapping[str, Any] | None) -> list[str]:
    """Lines about a predicted velocity: what its band is, and whether it left the training data."""
    if prediction is None:
        return []
    return [BAND_WORDS, *domain_remarks(prediction)]
