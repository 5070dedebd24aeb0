"""Near field of one blasthole: from explosive, rock and hole to the equilibrium state.

`solve_near_field` is a thin driver over one kernel that holds no interpreter lock; it never
raises, a fault is a status. Many holes at once: `castblast.nearfield.lockstep.batch`.

**End of the run.** `paper` mode stops at 0.9 of the travel time of the p-wave to an outer
boundary at 5.5 m, wherever the wall then is: with large holes or weak rock it still moves, the
result depends on the hole diameter and `settled` is false. `equilibrium` mode works on a body of
1000 hole radii, detects the time t_rev at which the wall first turns back, runs on to 1.9 t_rev
and takes the time mean of the hole *radius* over [1.6, 1.9] t_rev; the equilibrium pressure is
the isentrope at that radius, so that the two are one state of the gas. All lengths and times
scale with the hole, so neither hole diameter nor rock density changes the result (given a rise
time in proportion). The end time is interpolated between steps: the result is smooth in every
input (relative noise of the order of 1e-4 in pressure).

With a tensile strength of zero there is no final rest in an infinite body: the cracked zone
keeps growing and the pressure falls slowly after the window: by less than 0.5 percent per
doubling of the time in weak rock, by 1 to 5 percent in strong rock. The window is then part of
the definition (with a tensile strength of UCS / 12 the pressure stays within 0.2 percent).

**Measured** (derived by this project, 95th percentile): in rock whose wave front stays elastic, 120
designs against a converged mesh, pressure 0.08 percent, hole radius 0.02, gas work 0.03. In rock
that yields in the front, 160 designs, pressure 0.46 percent and hole radius 0.14. Energy ledger
below 9e-4. See `pipeline/docs/mesh_study.md`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from castblast.errors import Status
from castblast.explosive.isentrope import Explosive, ProductIsentrope
from castblast.nearfield.case import Hole, NearFieldColumns, NearFieldSettings, Rock
from castblast.nearfield.march import Annulus, march
from castblast.nearfield.outcome import STATE_NAMES, end_state, histories, no_state
from castblast.nearfield.rock.lagrangian import FloatArray
from castblast.nearfield.setup import (
    common_parameters,
    hole_parameters,
    make_annulus,
    possible,
)


class NearFieldResult(NamedTuple):
    """State of hole and rock at the end of the near field; energies in J per metre of hole.

    Attributes
    ----------
    status : int
        `castblast.errors.Status`; all numbers are NaN if there is no state to speak of.
    equilibrium_pressure : float [Pa]
        Isentrope at the expanded hole radius.
    expanded_hole_radius : float [m]
        Paper mode: at the end; equilibrium mode: time mean over `WINDOW`.
    crushed_zone_radius : float [m]
        Initial radius inside which the plastic shear multiplier of the most compressive
        direction is at least 1 percent, interpolated between zone centres.
    plastic_zone_radius, hoop_crushed_radius, tensile_zone_radius : float [m]
        Outermost shear yield, shear yield under compressive hoop stress, tensile yield: initial
        radii, interpolated inside a zone by how far the next one stayed from yielding.
    intense_shear_radius : float [m]
        Initial radius inside which the accumulated plastic strain exceeds 20 percent.
    explosion_pressure : float [Pa]
        Isentrope at the initial hole volume.
    equilibrium_time, end_time : float [s]
    wall_velocity : float [m s-1]
    settled : bool
    gas_work, kinetic_energy, elastic_energy, plastic_work, tensile_work, viscous_work,
    boundary_work : float [J m-1]
        Rock ledger: the first is the sum of the others. Elastic energy is the change from the
        in-situ state.
    head_energy, ramp_energy, gas_energy : float [J m-1]
        With `gas_work` they add up to the energy of detonation.
    energy_residual : float [-]
        Open balance of the rock ledger over the gas work.
    n_steps, zone_steps, return_map_fallbacks : int
        Steps, zones in motion summed over them, stress returns that failed.
    history_time, history_pressure, history_radius : array (history_points,) [s, Pa, m]
    """

    status: int
    equilibrium_pressure: float
    expanded_hole_radius: float
    crushed_zone_radius: float
    plastic_zone_radius: float
    hoop_crushed_radius: float
    tensile_zone_radius: float
    intense_shear_radius: float
    explosion_pressure: float
    equilibrium_time: float
    end_time: float
    wall_velocity: float
    settled: bool
    gas_work: float
    kinetic_energy: float
    elastic_energy: float
    plastic_work: float
    tensile_work: float
    viscous_work: float
    boundary_work: float
    head_energy: float
    ramp_energy: float
    gas_energy: float
    energy_residual: float
    n_steps: int
    zone_steps: int
    return_map_fallbacks: int
    history_time: FloatArray
    history_pressure: FloatArray
    history_radius: FloatArray


def solve_near_field(
    explosive: Explosive, rock: Rock, hole: Hole, settings: NearFieldSettings
) -> NearFieldResult:
    """Expand one hole until its end state.

    Parameters
    ----------
    explosive : Explosive
    rock : Rock
    hole : Hole
    settings : NearFieldSettings

    Returns
    -------
    NearFieldResult
        `status` says what went wrong, if anything; no exception is raised for any input.
    """
    state = np.empty(len(STATE_NAMES))
    points = np.full((3, max(settings.history_points, 2)), np.nan)
    if not possible((explosive,), _column(rock, hole), settings)[0]:
        no_state(int(Status.BAD_INPUT), 0, 0, 0, state)
        return _result(state, points)
    run = march(annulus := _annulus(explosive, rock, hole, settings))
    end_state(annulus, run, float(explosive.total_energy), state)
    if run.status == Status.OK:
        histories(run.record, points)
    return _result(state, points)


def _column(rock: Rock, hole: Hole) -> NearFieldColumns:
    """One hole as columns of length one."""
    numbers = (np.array([x], dtype=np.float64) for x in (*rock, *hole))
    return NearFieldColumns(np.zeros(1, dtype=np.int64), *numbers)


def _annulus(explosive: Explosive, rock: Rock, hole: Hole, settings: NearFieldSettings) -> Annulus:
    """Annulus of one hole."""
    holes = hole_parameters((explosive,), _column(rock, hole), settings)
    return make_annulus(holes, 0, common_parameters(settings), plain(explosive.isentrope))


def plain(isentrope: ProductIsentrope) -> ProductIsentrope:
    """The isentrope with the exact types of the compiled signature."""
    i = isentrope
    scalars = [float(x) for x in (i.a, i.b, i.c, i.r1, i.r2, i.omega)]
    arrays = [
        np.ascontiguousarray(x, dtype=np.float64)
        for x in (i.log_volume, i.log_pressure, i.log_slope, i.energy)
    ]
    return ProductIsentrope(bool(i.tabulated), *scalars, *arrays)  # type: ignore[arg-type]


def _result(state: FloatArray, points: FloatArray) -> NearFieldResult:
    """Give the numbers of an end state their names and types."""
    values: dict[str, Any] = dict(zip(STATE_NAMES, state.tolist(), strict=True))
    for name in ("status", "n_steps", "zone_steps", "return_map_fallbacks"):
        values[name] = int(values[name])
    values["settled"] = bool(values["settled"])
    time, pressure, radius = points
    return NearFieldResult(
        **values, history_time=time, history_pressure=pressure, history_radius=radius
    )
