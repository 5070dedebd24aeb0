"""How the burden of one hole is set in motion by the gas: the entry point for one case."""

from __future__ import annotations

from math import nan
from typing import Final

import numpy as np

from castblast.burden.batch import BurdenColumns, solve_with_histories
from castblast.burden.case import BurdenGeometry, BurdenParameters, BurdenResult
from castblast.errors import Status
from castblast.explosive.isentrope import Explosive

HISTORY_POINTS: Final = 64


def solve_burden_motion(
    explosive: Explosive,
    geometry: BurdenGeometry,
    parameters: BurdenParameters,
    expanded_hole_radius: float,
) -> BurdenResult:
    """Move the burden of one hole by the gas of its charge.

    Parameters
    ----------
    explosive : Explosive
    geometry : BurdenGeometry
    parameters : BurdenParameters
    expanded_hole_radius : float [m]
        Hole radius at the end of the near field; the gas starts on the isentrope at that volume.

    Returns
    -------
    BurdenResult
        Never raises on physics: failures are in `status`. BAD_INPUT for values that describe no
        case, among them an expanded hole wider than the break-out plane.

    Notes
    -----
    The velocity is taken where the gas stops pushing: at 1 percent above the pressure of the open
    air (plus floor friction). There the acceleration vanishes, so that the velocity does not
    depend on where exactly the run ends; a fixed end time or end pressure would show in it.
    """
    numbers = geometry._asdict() | parameters._asdict()
    numbers["expanded_hole_radius"] = expanded_hole_radius
    columns = BurdenColumns(
        explosive=np.zeros(1, dtype=np.int64),
        **{name: np.array([value], dtype=np.float64) for name, value in numbers.items()},
    )
    histories = np.full((1, 4, HISTORY_POINTS), nan)
    batch = solve_with_histories([explosive], columns, histories)
    time, pressure, velocity, displacement = histories[0]
    return BurdenResult(
        **{name: values[0].item() for name, values in batch._asdict().items()},
        history_time=time,
        history_pressure=pressure,
        history_velocity=velocity,
        history_displacement=displacement,
    )


def no_burden_motion(status: Status) -> BurdenResult:
    """Make the result of a case that could not run: NaN, with the status that says why."""
    numbers = dict.fromkeys(BurdenResult._fields, nan)
    history = np.full(HISTORY_POINTS, nan)
    rest = {name: history for name in BurdenResult._fields if name.startswith("history_")}
    return BurdenResult(**(numbers | rest | {"status": int(status), "n_steps": 0}))  # type: ignore[arg-type]
