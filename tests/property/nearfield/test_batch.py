"""Near fields in lockstep: every row to the bit as one alone, whatever runs beside it."""

import numpy as np
import pytest
from near_field_problems import ANFO, DOPED, EMULSION

from castblast.errors import Status
from castblast.explosive.isentrope import pressure, tabulated_isentrope
from castblast.nearfield.case import EndMode, Hole, NearFieldColumns, NearFieldSettings, Rock
from castblast.nearfield.case import TensionMode as Tension
from castblast.nearfield.lockstep.batch import NearFieldBatch, solve_near_fields
from castblast.nearfield.solver import solve_near_field

_VOLUMES = np.geomspace(0.9, 60.0, 80)
TABLE = EMULSION._replace(
    isentrope=tabulated_isentrope(
        _VOLUMES, [pressure(EMULSION.isentrope, float(v)) for v in _VOLUMES]
    )
)
EXPLOSIVES = (ANFO, DOPED, TABLE)


def designs(count: int, seed: int = 7) -> NearFieldColumns:
    """Random rows over the whole domain of the shipped recipes, some of them decoupled."""
    rng = np.random.default_rng(seed)
    ucs = np.exp(rng.uniform(np.log(1e7), np.log(2e8), count))
    diameter = rng.uniform(0.08, 0.3, count)
    return NearFieldColumns(
        explosive=rng.integers(0, len(EXPLOSIVES), count),
        density=rng.uniform(1800.0, 3000.0, count),
        young_modulus=np.exp(rng.uniform(np.log(5e9), np.log(5e10), count)),
        poisson_ratio=rng.uniform(0.15, 0.35, count),
        ucs=ucs,
        friction_angle=np.radians(rng.uniform(25.0, 55.0, count)),
        dilation_angle=np.radians(rng.uniform(0.0, 15.0, count)),
        tensile_strength=ucs * rng.uniform(0.0, 0.1, count),
        diameter=diameter,
        charge_diameter=diameter * np.where(rng.random(count) < 0.3, 0.8, 1.0),
        rise_time=diameter / rng.uniform(3500.0, 6000.0, count),
        in_situ_stress=rng.uniform(0.0, 1e7, count),
    )


def take(columns: NearFieldColumns, rows) -> NearFieldColumns:
    return NearFieldColumns(*(values[rows] for values in columns))


def assert_same(batch: NearFieldBatch, other: NearFieldBatch, rows) -> None:
    """`other` holds the given rows of `batch`, to the bit."""
    for name in NearFieldBatch._fields:
        expected = getattr(batch, name)[rows]
        np.testing.assert_array_equal(getattr(other, name), expected, err_msg=name)


@pytest.mark.parametrize(
    "settings",
    [
        NearFieldSettings(history_points=16),
        NearFieldSettings(mode=EndMode.PAPER, zones=96, tension=Tension.BRITTLE),
        NearFieldSettings(tension=Tension.NONE, outer_radius=6.0, zones=64),
    ],
    ids=["equilibrium", "paper, brittle", "small body, no cut-off"],
)
def test_rows_are_those_of_the_scalar_solver(settings: NearFieldSettings) -> None:
    """More rows than lanes, three explosives, one of them a table; waves meet the boundary.

    Rock that turns back before the small body ends to matter.
    """
    columns = designs(36)
    columns.ucs[:] = 6e7 + 0.5 * columns.ucs
    batch = solve_near_fields(EXPLOSIVES, columns, settings)
    assert (batch.status == Status.OK).mean() > 0.8
    for row in range(36):
        numbers = [float(values[row]) for values in columns[1:]]
        alone = solve_near_field(
            EXPLOSIVES[columns.explosive[row]], Rock(*numbers[:7]), Hole(*numbers[7:]), settings
        )
        for name, value in alone._asdict().items():
            np.testing.assert_array_equal(getattr(batch, name)[row], value, err_msg=name)


def test_order_and_company_do_not_matter() -> None:
    columns = designs(50)
    settings = NearFieldSettings(history_points=8)
    batch = solve_near_fields(EXPLOSIVES, columns, settings)
    shuffled = np.random.default_rng(1).permutation(50)
    assert_same(batch, solve_near_fields(EXPLOSIVES, take(columns, shuffled), settings), shuffled)
    for rows in (slice(0, 1), slice(3, 20)):
        assert_same(batch, solve_near_fields(EXPLOSIVES, take(columns, rows), settings), rows)


def test_impossible_rows_leave_the_others_alone() -> None:
    """Not a number, dilation above friction, a start beyond the table, no rows at all."""
    columns = designs(20)
    settings = NearFieldSettings(history_points=8)
    batch = solve_near_fields(EXPLOSIVES, columns, settings)
    spoilt = NearFieldColumns(*(values.copy() for values in columns))
    spoilt.ucs[2] = np.nan
    spoilt.dilation_angle[5] = spoilt.friction_angle[5] + 0.1
    spoilt.explosive[9], spoilt.charge_diameter[9] = 2, 0.05 * spoilt.diameter[9]
    with_faults = solve_near_fields(EXPLOSIVES, spoilt, settings)
    bad = [Status.BAD_INPUT, Status.BAD_INPUT, Status.OUT_OF_ISENTROPE]
    assert with_faults.status[[2, 5, 9]].tolist() == bad
    assert np.isnan(with_faults.expanded_hole_radius[[2, 5, 9]]).all()
    assert np.isnan(with_faults.history_pressure[[2, 5, 9]]).all()
    others = np.setdiff1d(np.arange(20), [2, 5, 9])
    assert_same(batch, solve_near_fields(EXPLOSIVES, take(spoilt, others), settings), others)
    assert_same(with_faults, solve_near_fields(EXPLOSIVES, take(spoilt, others), settings), others)
    empty = solve_near_fields(EXPLOSIVES, take(columns, slice(0, 0)), settings)
    assert empty.status.size == 0
    assert empty.history_time.shape == (0, 8)
