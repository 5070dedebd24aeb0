"""What a copy of a network answers, in whatever language it was written."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from castblast.network import Floats, Network, offending_inputs, predict_rows


class NotVerifiedError(Exception):
    """A copy cannot be run here; the message says what is missing."""


class Answers(NamedTuple):
    """Answers of a copy for n rows.

    Attributes
    ----------
    values, lower, upper : (n, m) [SI]
        Prediction and ends of its 95 % band.
    score : (n,)
        Joint density score, NaN if the network has none.
    inside : (n,) bool
        Box, rules and density together.
    offending : (n, k) bool
        Inputs that take part in what is broken.
    """

    values: Floats
    lower: Floats
    upper: Floats
    score: Floats
    inside: NDArray[np.bool_]
    offending: NDArray[np.bool_]


def answers(network: Network, numeric: Floats, index: NDArray[np.int64]) -> Answers:
    """Answer rows with the network itself: what every copy is held against."""
    row = predict_rows(network, numeric, index)
    offending = offending_inputs(network, numeric)
    return Answers(row.values, *row.network, row.score, row.inside, offending)


def parse_answers(text: str, inputs: int) -> Answers:
    """Read the lines that self-tests print: values, lower, upper, score, domain, flags."""
    table = np.array([line.split() for line in text.splitlines()], dtype=np.float64)
    outputs = (table.shape[1] - inputs - 2) // 3
    values, lower, upper = (table[:, j * outputs : (j + 1) * outputs] for j in range(3))
    score, domain = table[:, 3 * outputs], table[:, 3 * outputs + 1]
    return Answers(values, lower, upper, score, domain == 0.0, table[:, 3 * outputs + 2 :] != 0.0)


def row_lines(numeric: Floats, index: NDArray[np.int64]) -> str:
    """Write rows as self-tests read them: position of the explosive, then the inputs."""
    words = {"nan": "NaN", "inf": "Infinity", "-inf": "-Infinity"}
    lines = []
    for kind, row in zip(index.tolist(), numeric.tolist(), strict=True):
        texts = (repr(value) for value in row)
        lines.append(" ".join([str(kind), *(words.get(text, text) for text in texts)]))
    return "\n".join(lines) + "\n"
