"""Is an export the same function as the fitted estimator? Run it on the golden rows and say.

The golden rows of a network carry the answers of the estimator itself and reach into the corners
of the training box, so a wrong transform, a swapped column or a lost digit shows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from castblast.export.json_file import from_json
from castblast.export.onnx_file import run_onnx
from castblast.network import Floats, Network, evaluate_rows, explosive_index

#: Largest relative deviation allowed for a float64 export.
TOLERANCE = 1e-12


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
        Bound on `relative`.
    remark : str
        Why the export was not run, if it was not.
    """

    target: str
    rows: int
    absolute: Mapping[str, float]
    relative: Mapping[str, float]
    tolerance: float = TOLERANCE
    remark: str = ""

    @property
    def verified(self) -> bool:
        """Whether the export was run at all."""
        return self.rows > 0

    @property
    def passed(self) -> bool:
        """Whether it was run and every deviation is within the tolerance; NaN is not."""
        return self.verified and all(value <= self.tolerance for value in self.relative.values())

    def to_document(self) -> dict[str, Any]:
        """Give the report as plain JSON values."""
        return {
            "passed": self.passed,
            "verified": self.verified,
            "golden_rows": self.rows,
            "tolerance": self.tolerance,
            "absolute": dict(self.absolute),
            "relative": dict(self.relative),
            **({"remark": self.remark} if self.remark else {}),
        }


Runner = Callable[[bytes, Floats, NDArray[np.int64]], Floats | None]


def _run_json(contents: bytes, numeric: Floats, index: NDArray[np.int64]) -> Floats:
    return evaluate_rows(from_json(contents.decode()), numeric, index)


#: How each export is run: file contents and rows in, outputs out; None if that cannot be done here.
RUNNERS: dict[str, tuple[Runner, str]] = {
    "json": (_run_json, ""),
    "onnx": (run_onnx, ""),
}


def check_parity(network: Network, target: str, contents: bytes) -> ParityReport:
    """Run an exported file on the golden rows of its network.

    Parameters
    ----------
    network : Network
        What was exported; its golden rows are the truth.
    target : str
        A key of `RUNNERS`.
    contents : bytes
        The exported file.
    """
    runner, remark = RUNNERS[target]
    golden = network.golden
    index = np.array([explosive_index(network, name) for name in golden.explosives], dtype=np.int64)
    found = runner(contents, golden.inputs, index)
    if found is None:
        return ParityReport(target, 0, {}, {}, remark=remark)
    return compare_outputs(network, target, found)


def compare_outputs(network: Network, target: str, found: Floats) -> ParityReport:
    """Hold outputs (n, m) of the golden rows against the stored answers."""
    truth = network.golden.outputs
    deviation = np.abs(found - truth)
    spread = np.std(truth, axis=0)
    relative = deviation / np.maximum(np.abs(truth), spread)
    names = network.output_names
    return ParityReport(
        target,
        len(truth),
        dict(zip(names, deviation.max(axis=0).tolist(), strict=True)),
        dict(zip(names, relative.max(axis=0).tolist(), strict=True)),
    )
