"""Is an export the same function as the fitted estimator? Run it on the golden rows and say.

The golden rows of a network carry the answers of the estimator itself and reach into the corners
of the training box, so a wrong transform, a swapped column or a lost digit shows. The ends of the
band, the density score and the domain flag of a copy are held against those of `predict_rows`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from castblast.errors import CheckError
from castblast.export.onnx.file import run_onnx_rows
from castblast.export.source.answers import Answers, NotVerifiedError
from castblast.export.source.plain import Files
from castblast.export.targets import TARGETS
from castblast.network import (
    Bounds,
    Network,
    Shell,
    density_score,
    explosive_index,
    in_domain,
    network_bounds,
    offending_inputs,
    prediction_bounds,
)
from castblast.types import FloatArray, IntArray

#: Largest relative deviation allowed for a float64 export.
TOLERANCE = 1e-12
#: The same for the density score: its sums of squares lose a few digits between tied inputs.
SCORE_TOLERANCE = 1e-9


@dataclass(frozen=True)
class ParityReport:
    """Deviation of one export from the fitted estimator.

    Attributes
    ----------
    target : str
        Name of the export.
    rows : int
        Golden rows compared; 0 if the export could not be run here.
    absolute, relative : mapping of output name to float
        Largest deviations. The relative one is over the larger of the value and the standard
        deviation of the golden answers: near a zero of the output only rounding is left.
    tolerance : float
        Bound on `relative` and both bands.
    remark : str
        Why the export was not run, if it was not.
    band, prediction_band : float
        Largest deviation of the ends of the network bands and of the prediction bands, relative as
        above; an end that should be unknown and is not, or the other way round, counts as infinite.
    score : float
        Largest deviation of the density score, over the larger of the score and 1.
    flags : int
        Rows whose domain flag differs.
    names : int
        Rows in which other inputs are named as offending.
    tool : str
        What it was run with.
    """

    target: str
    rows: int
    absolute: Mapping[str, float]
    relative: Mapping[str, float]
    tolerance: float = TOLERANCE
    remark: str = ""
    band: float = 0.0
    prediction_band: float = 0.0
    score: float = 0.0
    flags: int = 0
    names: int = 0
    tool: str = ""

    @property
    def verified(self) -> bool:
        """Whether the export was run at all."""
        return self.rows > 0

    @property
    def passed(self) -> bool:
        """Whether it was run and every deviation is within the tolerance; NaN is not."""
        return self.verified and not self.faults

    @property
    def faults(self) -> list[str]:
        """Every deviation beyond its bound, one line each; NaN is beyond."""
        bounds = {name: (value, self.tolerance) for name, value in self.relative.items()}
        bounds["network band"] = (self.band, self.tolerance)
        bounds["prediction band"] = (self.prediction_band, self.tolerance)
        bounds["density score"] = (self.score, SCORE_TOLERANCE)
        lines = [
            f"{name} deviates by {value:.3g} relative, allowed is {bound:g}"
            for name, (value, bound) in bounds.items()
            if not value <= bound
        ]
        if self.flags:
            lines.append(f"the domain flag differs in {self.flags} of {self.rows} rows")
        if self.names:
            lines.append(f"other inputs are named in {self.names} of {self.rows} rows")
        return lines

    @property
    def largest(self) -> float:
        """Largest relative deviation of values and bands; NaN if not run."""
        if not self.verified:
            return float("nan")
        return max(self.band, self.prediction_band, *self.relative.values())

    def to_document(self) -> dict[str, Any]:
        """Give the report as plain JSON values."""
        return {
            "status": ("passed" if self.passed else "failed") if self.verified else self.remark,
            "passed": self.passed,
            "verified": self.verified,
            "golden_rows": self.rows,
            "tolerance": self.tolerance,
            "absolute": dict(self.absolute),
            "relative": dict(self.relative),
            "band": self.band,
            "prediction_band": self.prediction_band,
            "density_score": self.score,
            "flags_that_differ": self.flags,
            "names_that_differ": self.names,
            "tool": self.tool,
        }


def check_parity(network: Network, target: str, files: Files) -> ParityReport:
    """Run exported files on the golden rows of their network.

    Parameters
    ----------
    network : Network
        What was exported; its golden rows are the truth.
    target : str
        A key of `TARGETS`.
    files : mapping of name to bytes
        What the writer of the target gave.

    Raises
    ------
    CheckError
        A file does not compile or run at all.
    """
    try:
        found, tool = TARGETS[target].run(network, files, *_golden_rows(network))
    except NotVerifiedError as reason:
        return ParityReport(target, 0, {}, {}, remark=f"not verified: {reason}")
    return replace(compare_outputs(network, target, found), tool=tool)


def verify(network: Network, target: str, files: Files) -> ParityReport:
    """Run exported files as `check_parity` does, and refuse those that disagree.

    What cannot be run here, for want of a compiler say, comes back with a remark.

    Raises
    ------
    CheckError
        The files do not run, or do not give the answers of the fitted estimator; a line each.
    """
    try:
        report = check_parity(network, target, files)
    except CheckError as fault:
        message = f"{target}: {fault}"
        raise CheckError(message) from fault
    if report.verified and report.faults:
        raise CheckError("\n".join(f"{target}: {line}" for line in report.faults))
    return report


def check_wrapped_parity(shell: Shell, model: bytes) -> ParityReport:
    """Run an ONNX file of a model of any shape on the golden rows of its shell.

    Raises
    ------
    CheckError
        The file does not run.
    """
    found = run_onnx_rows(model, *_golden_rows(shell))
    return replace(compare_outputs(shell, "onnx", found), tool="ONNX")


def _golden_rows(shell: Shell) -> tuple[FloatArray, IntArray]:
    golden = shell.golden
    index = [explosive_index(shell, name) for name in golden.explosives]
    return golden.inputs, np.array(index, dtype=np.int64)


def compare_outputs(shell: Shell, target: str, found: Answers) -> ParityReport:
    """Hold the answers for the golden rows against the stored ones and their band and domain."""
    truth, names = shell.golden.outputs, shell.output_names
    deviation = np.abs(found.values - truth)
    size = np.maximum(np.abs(truth), np.std(truth, axis=0))
    score = density_score(shell, shell.golden.inputs)
    drift = np.abs(found.score - score) / np.maximum(score, 1.0)
    inside = in_domain(shell, shell.golden.inputs)
    offending = offending_inputs(shell, shell.golden.inputs)
    return ParityReport(
        target,
        len(truth),
        dict(zip(names, deviation.max(axis=0).tolist(), strict=True)),
        dict(zip(names, (deviation / size).max(axis=0).tolist(), strict=True)),
        band=_band_deviation(found.network, network_bounds(shell, truth), size),
        prediction_band=_band_deviation(found.prediction, prediction_bounds(shell, truth), size),
        score=0.0 if shell.density is None else float(drift.max()),
        flags=int(np.count_nonzero(found.inside != inside)),
        names=int(np.count_nonzero(np.any(found.offending != offending, axis=1))),
    )


def _band_deviation(found: Bounds, truth: Bounds, size: FloatArray) -> float:
    """Largest deviation of both ends, over the larger of end and size of the output.

    Infinite where only one side is unknown.
    """
    largest = 0.0
    for end, true in zip(found, truth, strict=True):
        unknown = np.isnan(true)
        if (np.isnan(end) != unknown).any():
            return float("inf")
        deviation = np.abs(end - true) / np.fmax(np.abs(true), size)
        largest = max(largest, float(np.max(deviation, where=~unknown, initial=0.0)))
    return largest
