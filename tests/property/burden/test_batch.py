"""A batch of burden motions is its rows: bit for bit, in any order, good and bad ones together."""

from __future__ import annotations

import numpy as np
import pytest
from near_field_problems import ANFO, EMULSION

from castblast.burden.batch import BurdenBatch, BurdenColumns, solve_burden_motions
from castblast.burden.case import BurdenGeometry, BurdenParameters
from castblast.burden.motion import solve_burden_motion
from castblast.design.variables import VARIABLES
from castblast.errors import Status
from castblast.explosive.isentrope import pressure, tabulated_isentrope

_VOLUME = np.geomspace(0.73, 700.0, 40)
TABLE = ANFO._replace(
    isentrope=tabulated_isentrope(_VOLUME, [pressure(ANFO.isentrope, float(v)) for v in _VOLUME])
)
EXPLOSIVES = [ANFO, EMULSION, TABLE]
#: What makes a row describe no case, and where.
FAULTS = {
    "expanded_hole_radius": [np.nan, 0.001, 40.0],
    "burden": [np.nan, -1.0, 0.0],
    "face_angle": [2.0],
    "rock_density": [np.inf],
    "fracture_count": [0.0],
    "floor_friction": [-0.1],
    "explosive": [-1, 3],
}


def columns(n: int = 60, seed: int = 7) -> BurdenColumns:
    """Designs of the training domain with all model parameters varied around their defaults."""
    draw = np.random.default_rng(seed)
    diameter = draw.uniform(0.08, 0.3, n)
    burden = draw.uniform(1.0, 8.0, n)
    stemming = burden * draw.uniform(0.2, 1.0, n)
    charge = draw.uniform(2.0, 15.0, n)
    values = {
        name: float(VARIABLES[name].default or 0.0) * draw.uniform(0.5, 1.5, n)
        for name in BurdenParameters._fields
    }
    values |= {
        "burden": burden,
        "spacing": burden * draw.uniform(0.8, 2.5, n),
        "bench_height": stemming + charge,
        "face_angle": draw.uniform(1.0, 0.5 * np.pi, n),
        "stemming_length": stemming,
        "charge_length": charge,
        "rock_density": draw.uniform(1800.0, 3000.0, n),
        "hole_diameter": diameter,
        "charge_diameter": diameter * draw.uniform(0.7, 1.0, n),
        "expanded_hole_radius": 0.5 * diameter * draw.uniform(1.3, 2.6, n),
    }
    return BurdenColumns(explosive=draw.integers(0, len(EXPLOSIVES), n), **values)


def take(batch: BurdenColumns | BurdenBatch, rows: np.ndarray) -> list[np.ndarray]:
    return [np.ascontiguousarray(values[rows]) for values in batch]


def same(first: BurdenBatch | list[np.ndarray], second: BurdenBatch | list[np.ndarray]) -> bool:
    return all(a.tobytes() == b.tobytes() for a, b in zip(first, second, strict=True))


def test_a_row_is_the_single_case() -> None:
    cases = columns()
    batch = solve_burden_motions(EXPLOSIVES, cases)
    assert np.all(batch.status == Status.OK)
    assert np.any(np.isfinite(batch.ejection_time))
    for i in range(cases.burden.size):
        single = solve_burden_motion(
            EXPLOSIVES[cases.explosive[i]],
            BurdenGeometry(*(getattr(cases, name)[i] for name in BurdenGeometry._fields)),
            BurdenParameters(*(getattr(cases, name)[i] for name in BurdenParameters._fields)),
            cases.expanded_hole_radius[i],
        )
        for name in BurdenBatch._fields:
            assert getattr(single, name) == getattr(batch, name)[i], name


def test_rows_do_not_know_of_each_other() -> None:
    """Any order and any division into batches gives the same bits."""
    cases = columns()
    n = cases.burden.size
    batch = solve_burden_motions(EXPLOSIVES, cases)
    order = np.random.default_rng(1).permutation(n)
    shuffled = solve_burden_motions(EXPLOSIVES, BurdenColumns(*take(cases, order)))
    assert same(shuffled, take(batch, order))
    parts = [
        solve_burden_motions(EXPLOSIVES, BurdenColumns(*take(cases, rows)))
        for rows in np.array_split(np.arange(n), 7)
    ]
    assert same([np.concatenate(values) for values in zip(*parts, strict=True)], batch)


@pytest.mark.parametrize("name", FAULTS)
def test_rows_that_describe_no_case_are_marked_and_harm_no_other(name: str) -> None:
    cases = columns(12)
    clean = solve_burden_motions(EXPLOSIVES, cases)
    values = getattr(cases, name).copy()
    bad = np.arange(len(FAULTS[name])) * 2
    values[bad] = FAULTS[name]
    batch = solve_burden_motions(EXPLOSIVES, cases._replace(**{name: values}))
    assert np.all(batch.status[bad] == Status.BAD_INPUT)
    for field, column in batch._asdict().items():
        if field not in ("status", "n_steps"):
            assert np.all(np.isnan(column[bad])), field
    good = np.setdiff1d(np.arange(12), bad)
    assert same(take(batch, good), take(clean, good))


def test_empty_batch() -> None:
    none = BurdenColumns(*take(columns(3), np.arange(0)))
    assert solve_burden_motions(EXPLOSIVES, none).burden_velocity.shape == (0,)
