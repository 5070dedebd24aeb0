"""What the model leaves open before a calibration, as a spread of its answers: for castblast.bands.

nice python pipeline/studies/prior_spread.py

Sobol draws of the parameters that nobody measures before a blast, about one quarry design of ANFO:
those of the burden motion, the factor of the loading rate on strength, dilation and tensile
strength. Prints median and standard deviation of the logarithm of every target, with all drawn and
with one group at a time.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.stats import norm, qmc

from castblast.blast.run import batch_values, run_blasts
from castblast.design.variables import VARIABLES
from castblast.errors import Status
from castblast.specs.explosive import load_explosive
from castblast.types import FloatArray

TARGETS = (
    "equilibrium_pressure", "expanded_hole_radius", "crushed_zone_radius", "plastic_zone_radius",
    "burden_velocity",
)  # fmt: skip
#: Median and standard deviation of the logarithm.
LOGNORMAL = {
    "burden": {
        "gas_front_velocity": (500.0, 0.8),
        "fracture_storage_ratio": (1.2, 0.6),
        "pressurised_width_ratio": (0.1, 0.6),
        "fracture_opening_ratio": (1.0, 0.5),
    },
    "rate": {"strength_rate_factor": (1.5, 0.35)},
}
#: Least and greatest: degrees of dilation, share of the compressive strength.
UNIFORM = {"rock": {"dilation_angle": (0.0, np.radians(10.0)), "tensile_strength": (0.0, 1e8 / 12)}}
DESIGN = {"hole_diameter": 0.102, "burden": 3.0}
DRAWS = 1024


def main() -> None:
    """Print the spread with every group, then group by group."""
    groups = [*LOGNORMAL, *UNIFORM]
    for chosen in (groups, *([group] for group in groups)):
        found = answers(drawn(chosen))
        print(", ".join(chosen))
        for name in TARGETS:
            logs = np.log(found[name])
            low, middle, high = np.exp(np.quantile(logs, (0.05, 0.5, 0.95)))
            print(
                f"  {name}: sd of ln {np.std(logs, ddof=1):.3f}; "
                f"5, 50, 95 %: {low:.4g}, {middle:.4g}, {high:.4g}"
            )


def drawn(groups: list[str]) -> dict[str, FloatArray]:
    """Columns of inputs: the design, and the parameters of the groups drawn."""
    normal = {k: v for group in groups for k, v in LOGNORMAL.get(group, {}).items()}
    even = {k: v for group in groups for k, v in UNIFORM.get(group, {}).items()}
    share = qmc.Sobol(len(normal) + len(even), seed=0).random(DRAWS)
    columns = {name: np.full(DRAWS, value) for name, value in DESIGN.items()}
    for share_of, (name, (middle, sd)) in zip(share.T, normal.items(), strict=False):
        bounds = VARIABLES[name].lower, VARIABLES[name].upper
        columns[name] = np.clip(middle * np.exp(sd * norm.ppf(share_of)), *bounds)
    for share_of, (name, (low, high)) in zip(share.T[len(normal) :], even.items(), strict=True):
        columns[name] = low + share_of * (high - low)
    return columns


def answers(columns: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Targets of the designs that were solved."""
    anfo = load_explosive("anfo").to_explosive()
    batch = run_blasts([anfo], np.zeros(DRAWS, dtype=np.int64), columns)
    solved = batch.status == Status.OK
    return {name: values[solved] for name, values in batch_values(batch).items() if name in TARGETS}


if __name__ == "__main__":
    main()
