"""State of all lanes of a lockstep march; see `castblast.nearfield.lockstep.lane_march`."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from castblast.explosive.packed import PackedIsentropes, unpack_isentrope
from castblast.kernel import inline_kernel, kernel
from castblast.nearfield.clock import Clock
from castblast.nearfield.lockstep.lanes import LANES, EdgeModels, clear_lane, lane_array_sizes
from castblast.nearfield.lockstep.merging import AtRest
from castblast.nearfield.march import Annulus
from castblast.nearfield.rock.lagrangian import FloatArray
from castblast.nearfield.rock.merging import Coarse
from castblast.nearfield.rock.mohr_coulomb import IntArray
from castblast.nearfield.setup import CommonParameters, HoleParameters, make_annulus

IDLE: Final = -1


class Lanes(NamedTuple):
    """State of all lanes.

    Attributes
    ----------
    zones, rows : array
        See `castblast.nearfield.lockstep.lanes`.
    edges : EdgeModels
    case, active, steps, zone_steps, fallbacks, status : int array (LANES,)
        Row of the case (-1: idle), zones in motion, steps taken, zones in motion summed over
        them, failed returns, outcome so far.
    finishing : bool array (LANES,)
        The step at hand is the last one.
    clock : array (LANES, 8)
        Fields of `Clock`.
    schedule : array (LANES, 4)
        Fields of `Schedule`.
    charge_radius, inner_mass, outer_mass, old_radius, peak : array (LANES,) [m, kg, kg, m, m/s]
        `old_radius` is that of the wall before the step, `peak` its highest speed so far.
    work : array (LANES, 3) [J/m per radian]
        Boundary, load, ramp.
    nodes : array (LANES, zones + 1) [m]
        Initial radii of all zones of every lane, see `castblast.nearfield.lockstep.merging`.
    origin : int array (LANES, zones + 1)
        Numbers of these nodes in the mesh before any merging.
    rest : array (LANES, 4)
        Fields of `AtRest`.
    coarse : array (LANES, 3)
        Fields of `Coarse`.
    """

    zones: FloatArray
    rows: FloatArray
    edges: EdgeModels
    case: IntArray
    active: IntArray
    steps: IntArray
    zone_steps: IntArray
    fallbacks: IntArray
    status: IntArray
    finishing: IntArray
    clock: FloatArray
    schedule: FloatArray
    charge_radius: FloatArray
    inner_mass: FloatArray
    outer_mass: FloatArray
    old_radius: FloatArray
    peak: FloatArray
    work: FloatArray
    nodes: FloatArray
    origin: IntArray
    rest: FloatArray
    coarse: FloatArray


class Cases(NamedTuple):
    """All cases of a batch.

    Attributes
    ----------
    isentropes : PackedIsentropes
    explosive : int array (n,)
    holes : HoleParameters
    common : CommonParameters
    """

    isentropes: PackedIsentropes
    explosive: IntArray
    holes: HoleParameters
    common: CommonParameters


@kernel
def annulus(cases: Cases, row: int) -> Annulus:
    """Annulus of a row."""
    isentrope = unpack_isentrope(cases.isentropes, cases.explosive[row])
    return make_annulus(cases.holes, row, cases.common, isentrope)


@kernel
def make_lanes(blocks: int, zones: int) -> Lanes:
    """All lanes, idle, with blocks for so many zones in motion and nodes for so many zones."""
    zone_size, row_size = lane_array_sizes(blocks)
    state = Lanes(
        zones=np.zeros(zone_size),
        rows=np.zeros(row_size),
        edges=EdgeModels(np.zeros((LANES, 11), np.int64), np.zeros((LANES, 11, 3, 3))),
        case=np.full(LANES, IDLE),
        active=np.zeros(LANES, np.int64),
        steps=np.zeros(LANES, np.int64),
        zone_steps=np.zeros(LANES, np.int64),
        fallbacks=np.zeros(LANES, np.int64),
        status=np.zeros(LANES, np.int64),
        finishing=np.zeros(LANES, np.int64),
        clock=np.zeros((LANES, 8)),
        schedule=np.zeros((LANES, 4)),
        charge_radius=np.ones(LANES),
        inner_mass=np.ones(LANES),
        outer_mass=np.ones(LANES),
        old_radius=np.zeros(LANES),
        peak=np.zeros(LANES),
        work=np.zeros((LANES, 3)),
        nodes=np.zeros((LANES, zones + 1)),
        origin=np.zeros((LANES, zones + 1), np.int64),
        rest=np.zeros((LANES, 4)),
        coarse=np.zeros((LANES, 3)),
    )
    for lane in range(LANES):
        clear_lane(state.zones, state.rows, lane)
    return state


@kernel
def with_blocks(state: Lanes, blocks: int) -> Lanes:
    """The same lanes with blocks for so many zones in motion."""
    more = make_lanes(blocks, 1)
    more.zones[: state.zones.size] = state.zones
    s = state
    return Lanes(
        more.zones, s.rows, s.edges, s.case, s.active, s.steps, s.zone_steps, s.fallbacks,
        s.status, s.finishing, s.clock, s.schedule, s.charge_radius, s.inner_mass, s.outer_mass,
        s.old_radius, s.peak, s.work, s.nodes, s.origin, s.rest, s.coarse,
    )  # fmt: skip


@inline_kernel
def rest_of(state: Lanes, lane: int) -> AtRest:
    """Rock of a lane that no wave has reached."""
    r = state.rest
    return AtRest(stress=r[lane, 0], tension=r[lane, 1], sheared=r[lane, 2], opened=r[lane, 3])


@inline_kernel
def coarse_of(state: Lanes, lane: int) -> Coarse:
    """Widths to which the zones of a lane merge."""
    c = state.coarse
    return Coarse(first=c[lane, 0], growth=c[lane, 1], reach=c[lane, 2])


@inline_kernel
def clock_of(state: Lanes, lane: int) -> Clock:
    """Clock of a lane."""
    c = state.clock
    return Clock(
        c[lane, 0], c[lane, 1], c[lane, 2], c[lane, 3], c[lane, 4], c[lane, 5], c[lane, 6],
        c[lane, 7],
    )  # fmt: skip


@inline_kernel
def set_clock(state: Lanes, lane: int, clock: Clock) -> None:
    """Set the clock of a lane."""
    for k in range(len(clock)):
        state.clock[lane, k] = clock[k]
