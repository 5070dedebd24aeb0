"""Physics gate: what every answer of a surrogate must obey, asked all over the joint domain.

Two parts. `physics_probe` runs the simulator once per dataset and records which way its burden
velocity moves with each input; `check_physics` asks a surrogate the same and more. A surrogate is
only asked what the physics of this code does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from castblast.progress import ProgressCallback, silent
from castblast.surrogate.domain import Domain
from castblast.surrogate.training import Fit


@dataclass(frozen=True, eq=False)
class Probe:
    """What the gate knows of a domain; made once per dataset by `physics_probe`."""

    def to_document(self) -> dict[str, Any]:
        """Counts and quantiles of the true response per direction; plain JSON values."""
        raise NotImplementedError


def physics_probe(
    domain: Domain,
    points: int = 1024,
    dense: int = 8192,
    seed: int = 0,
    progress: ProgressCallback = silent,
) -> Probe:
    """Run the simulator on pairs of points and draw the dense grid (1.3 ms a run, 20 runs a point).

    Parameters
    ----------
    points : int
        Points where the true response is simulated; 128 does for ``--quick``.
    dense : int
        Points where a surrogate is asked.
    """
    raise NotImplementedError


def check_physics(fit: Fit, probe: Probe) -> dict[str, Any]:
    """Ask one fit.

    Returns
    -------
    dict
        Plain JSON values: ``passed`` (bool), ``reasons`` (list of str, empty if passed), ``checks``
        (list with name, kind, asked, broken, share, worst spot with its inputs).
    """
    raise NotImplementedError
