"""What a copy of a network answers, in whatever language it was written."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from castblast.network import Bounds, Network, offending_inputs, predict_rows
from castblast.types import BoolArray, FloatArray, IntArray


class NotVerifiedError(Exception):
    """A copy cannot be run here; the message says what is missing."""


class Answers(NamedTuple):
    """Answers of a copy for n rows.

    Attributes
    ----------
    values : (n, m) [SI]
    prediction : Bounds
        Ends of the prediction bands (`castblast.bands`), NaN where no prior is stated.
    network : Bounds
        Ends of the 95 % bands of the network.
    score : (n,)
        Joint density score, NaN if the network has none.
    inside : (n,) bool
        Box, rules and density together.
    offending : (n, k) bool
        Inputs that take part in what is broken.
    """

    values: FloatArray
    prediction: Bounds
    network: Bounds
    score: FloatArray
    inside: BoolArray
    offending: BoolArray


def answers(network: Network, numeric: FloatArray, index: IntArray) -> Answers:
    """Answer rows with the network itself: what every copy is held against."""
    return Answers(*predict_rows(network, numeric, index), offending_inputs(network, numeric))


def parse_answers(text: str, inputs: int) -> Answers:
    """Read the lines that self-tests print.

    Values; lower and upper ends of the prediction bands, then of the network bands; score; domain;
    flags.
    """
    table = np.array([line.split() for line in text.splitlines()], dtype=np.float64)
    m = (table.shape[1] - inputs - 2) // 5
    values, *ends = (table[:, j * m : (j + 1) * m] for j in range(5))
    score, domain, flags = table[:, 5 * m], table[:, 5 * m + 1], table[:, 5 * m + 2 :]
    bands = Bounds(*ends[:2]), Bounds(*ends[2:])
    return Answers(values, *bands, score, domain == 0.0, flags != 0.0)


def row_lines(numeric: FloatArray, index: IntArray) -> str:
    """Write rows as self-tests read them: position of the explosive, then the inputs."""
    words = {"nan": "NaN", "inf": "Infinity", "-inf": "-Infinity"}
    lines = []
    for kind, row in zip(index.tolist(), numeric.tolist(), strict=True):
        texts = (repr(value) for value in row)
        lines.append(" ".join([str(kind), *(words.get(text, text) for text in texts)]))
    return "\n".join(lines) + "\n"
