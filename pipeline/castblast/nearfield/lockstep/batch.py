"""Many near fields at once: columns in, columns out, the same bits as one by one.

`solve_near_fields` holds no interpreter lock while it works, so that several batches can run on
threads side by side.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from castblast.errors import Status
from castblast.explosive.isentrope import Explosive
from castblast.explosive.packed import pack_isentropes
from castblast.nearfield.case import FloatArray, IntArray, NearFieldColumns, NearFieldSettings
from castblast.nearfield.lockstep.lane_march import march_many
from castblast.nearfield.lockstep.state import Cases
from castblast.nearfield.outcome import STATE_NAMES, no_state
from castblast.nearfield.setup import (
    MAX_STEPS,
    HoleParameters,
    common_parameters,
    hole_parameters,
    possible,
)


class NearFieldBatch(NamedTuple):
    """End states of n holes: the fields of `NearFieldResult` as columns, SI.

    Attributes
    ----------
    status, n_steps, zone_steps, return_map_fallbacks : int array (n,)
    settled : bool array (n,)
    history_time, history_pressure, history_radius : array (n, history_points) [s, Pa, m]
    equilibrium_pressure, ... : array (n,)
        See `NearFieldResult`.
    """

    status: IntArray
    equilibrium_pressure: FloatArray
    expanded_hole_radius: FloatArray
    crushed_zone_radius: FloatArray
    plastic_zone_radius: FloatArray
    hoop_crushed_radius: FloatArray
    tensile_zone_radius: FloatArray
    intense_shear_radius: FloatArray
    explosion_pressure: FloatArray
    equilibrium_time: FloatArray
    end_time: FloatArray
    wall_velocity: FloatArray
    settled: NDArray[np.bool_]
    gas_work: FloatArray
    kinetic_energy: FloatArray
    elastic_energy: FloatArray
    plastic_work: FloatArray
    tensile_work: FloatArray
    viscous_work: FloatArray
    boundary_work: FloatArray
    head_energy: FloatArray
    ramp_energy: FloatArray
    gas_energy: FloatArray
    energy_residual: FloatArray
    n_steps: IntArray
    zone_steps: IntArray
    return_map_fallbacks: IntArray
    history_time: FloatArray
    history_pressure: FloatArray
    history_radius: FloatArray


def solve_near_fields(
    explosives: Sequence[Explosive], columns: NearFieldColumns, settings: NearFieldSettings
) -> NearFieldBatch:
    """Expand many holes until their end states.

    Parameters
    ----------
    explosives : sequence of Explosive
    columns : NearFieldColumns
        One hole a row; `explosive` is its index in `explosives`.
    settings : NearFieldSettings
        The same for all rows.

    Returns
    -------
    NearFieldBatch
        Every row as `solve_near_field` gives it, to the bit. No exception is raised for any
        input; `status` says what went wrong.
    """
    columns = _exact(columns)
    count = columns.explosive.size
    states = np.empty((count, len(STATE_NAMES)))
    points = np.full((count, 3, max(settings.history_points, 2)), np.nan)
    good = possible(explosives, columns, settings)
    for row in np.flatnonzero(~good):
        no_state(int(Status.BAD_INPUT), 0, 0, 0, states[row])
    if good.any():
        holes = hole_parameters(explosives, columns, settings)
        cases = Cases(
            pack_isentropes([e.isentrope for e in explosives]),
            columns.explosive,
            holes,
            common_parameters(settings),
        )
        rows = np.flatnonzero(good)
        # Lanes with as many zones run together: all lanes wait for the one with the most.
        order = np.lexsort(
            (-_expected_steps(holes)[rows], -np.round(holes.mesh.zones[rows] / 16.0))
        )
        march_many(cases, rows[order], MAX_STEPS, states, points)
    return _batch(states, points)


def _exact(columns: NearFieldColumns) -> NearFieldColumns:
    """The columns with the exact types of the compiled signature."""
    numbers = (np.ascontiguousarray(values, dtype=np.float64) for values in columns[1:])
    return NearFieldColumns(np.ascontiguousarray(columns.explosive, dtype=np.int64), *numbers)


def _expected_steps(holes: HoleParameters) -> FloatArray:
    """Rank the holes by how long they take, by a fit; the results do not depend on it."""
    strength = holes.ucs + 1.5 * holes.in_situ_stress - 2.5 * holes.tension
    return np.asarray(np.maximum(strength, 0.1 * holes.ucs) ** -0.68)


def _batch(states: FloatArray, points: FloatArray) -> NearFieldBatch:
    """Give columns of end states their names and types."""
    values: dict[str, Any] = {
        name: np.ascontiguousarray(states[:, k]) for k, name in enumerate(STATE_NAMES)
    }
    for name in ("status", "n_steps", "zone_steps", "return_map_fallbacks"):
        values[name] = values[name].astype(np.int64)
    values["settled"] = values["settled"] == 1.0
    return NearFieldBatch(
        **values,
        history_time=points[:, 0],
        history_pressure=points[:, 1],
        history_radius=points[:, 2],
    )
