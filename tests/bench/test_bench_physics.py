"""Speed of the physics on rows of the full recipe: lanes against scalar, burden against near field.

All on the same rows in the same run, so that the ratios hold on any machine.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from castblast.blast.run import BlastSettings, make_case
from castblast.burden.batch import solve_burden_motions
from castblast.burden.case import BurdenColumns, BurdenGeometry, BurdenParameters
from castblast.dataset.file.provenance import load_explosives
from castblast.dataset.rows.design import make_design
from castblast.dataset.rows.simulation import blast_simulator
from castblast.nearfield.case import Hole, NearFieldColumns, NearFieldSettings, Rock
from castblast.nearfield.lockstep.batch import solve_near_fields
from castblast.nearfield.solver import solve_near_field
from castblast.specs.recipe import load_recipe

ROWS = 1000


class Design(NamedTuple):
    explosives: tuple
    cases: list
    holes: NearFieldColumns
    settings: NearFieldSettings


@pytest.fixture(scope="module")
def design(repository) -> Design:
    """The first rows of the full recipe, as cases and as columns."""
    source = load_recipe(repository / "data_specs" / "recipes" / "full.yaml", ROWS)
    explosives = tuple(entry.spec.to_explosive() for entry in load_explosives(source))
    rows = make_design(source.recipe, blast_simulator(source.recipe, explosives), "full")
    cases = [
        make_case(
            explosives[kind],
            {name: float(column[row]) for name, column in rows.inputs.items()},
            BlastSettings(),
        )
        for row, kind in enumerate(rows.explosive)
    ]
    near = {name: _column(case.rock for case in cases)(name) for name in Rock._fields}
    near |= {name: _column(case.hole for case in cases)(name) for name in Hole._fields}
    holes = NearFieldColumns(explosive=rows.explosive.astype(np.int64), **near)
    return Design(explosives, cases, holes, cases[0].near_field)


def _column(records):
    records = list(records)
    return lambda name: np.array([getattr(record, name) for record in records])


@cache
def _spent():
    """Seconds per row and ns per zone-step by name, for ratios between the tests."""
    return {}


@pytest.mark.benchmark(group=f"physics, {ROWS} rows of the full recipe")
def test_near_field_scalar(benchmark, design, figure):
    def solve():
        return [solve_near_field(c.explosive, c.rock, c.hole, c.near_field) for c in design.cases]

    solve_near_field(*design.cases[0][:4])
    results = benchmark.pedantic(solve, rounds=1)
    steps = sum(result.zone_steps for result in results)
    _note(benchmark, figure, "scalar", steps)


@pytest.mark.benchmark(group=f"physics, {ROWS} rows of the full recipe")
def test_near_field_lanes(benchmark, design, figure):
    arguments = (design.explosives, design.holes, design.settings)
    solve_near_fields(design.explosives, _first(design.holes), design.settings)
    batch = benchmark.pedantic(solve_near_fields, arguments, rounds=3)
    _note(benchmark, figure, "lanes", int(batch.zone_steps.sum()))
    if "scalar" in _spent():
        ratio = _spent()["scalar"] / _spent()["lanes"]
        figure("near field: speed of lanes over scalar, same rows", ratio)


@pytest.mark.benchmark(group=f"physics, {ROWS} rows of the full recipe")
def test_burden_motion(benchmark, design, figure):
    """Mark: at most 30 % of the near field of the same rows."""
    near = solve_near_fields(design.explosives, design.holes, design.settings)
    geometry, parameters = (
        _column(getattr(case, part) for case in design.cases) for part in ("geometry", "parameters")
    )
    columns = BurdenColumns(
        explosive=design.holes.explosive,
        expanded_hole_radius=near.expanded_hole_radius,
        **{name: geometry(name) for name in BurdenGeometry._fields},
        **{name: parameters(name) for name in BurdenParameters._fields},
    )
    solve_burden_motions(design.explosives, columns)
    benchmark.pedantic(solve_burden_motions, (design.explosives, columns), rounds=3)
    seconds = benchmark.stats.stats.min
    figure("burden motion", 1e3 * seconds / ROWS, "ms/sample")
    if "lanes" in _spent():
        share = 100.0 * seconds / ROWS / _spent()["lanes"]
        figure("burden motion: share of the near-field time", share, "%", at_most=30.0)


def _first(holes):
    return NearFieldColumns._make(column[:1] for column in holes)


def _note(benchmark, figure, name, zone_steps):
    seconds = benchmark.stats.stats.min
    _spent()[name] = seconds / ROWS
    figure(f"near field, {name}", 1e3 * seconds / ROWS, "ms/sample")
    figure(f"near field, {name}", 1e9 * seconds / zone_steps, "ns/zone-step")
    benchmark.extra_info["ns per zone-step"] = 1e9 * seconds / zone_steps
