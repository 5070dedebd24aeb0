"""Many blasts at once: every row as if it were alone, and failures where they belong."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from castblast.blast import run as blast
from castblast.blast.run import (
    BlastSettings,
    batch_values,
    make_case,
    result_values,
    run_blast,
    run_blasts,
)
from castblast.dataset.rows.simulation import HISTORY_NAMES, BlastSimulator
from castblast.design.variables import OUTPUT_NAMES
from castblast.errors import SpecError, Status
from castblast.nearfield.case import EndMode
from castblast.specs.explosive import load_explosive

ANFO = load_explosive("anfo").to_explosive()
EXPLOSIVES = (ANFO, ANFO._replace(density=1000.0, detonation_velocity=5400.0))
INDEX = np.array([0, 1, 0, 1, 1, 0], dtype=np.int8)
#: Different rock, bench and near-field meshes; the rate factor is one that must not be lost.
VALUES = {
    "ucs": np.array([4e7, 6e7, 8e7, 1e8, 1.2e8, 1.6e8]),
    "tensile_strength": np.array([0.0, 1e6, 2e6, 3e6, 4e6, 5e6]),
    "strength_rate_factor": np.array([1.0, 1.0, 1.3, 1.0, 2.0, 1.0]),
    "in_situ_stress": np.array([0.0, 5e6, 0.0, 0.0, 1e6, 0.0]),
    "burden": np.array([2.0, 2.5, 3.0, 3.5, 4.0, 4.5]),
    "zones": np.array([0.0, 48.0, 0.0, 64.0, 64.0, 48.0]),
}
SETTINGS = BlastSettings(mode=EndMode.EQUILIBRIUM, history_points=16, parameter_set="field")


def row(i):
    return {name: float(column[i]) for name, column in VALUES.items()}


@pytest.fixture(scope="module")
def batch():
    return run_blasts(EXPLOSIVES, INDEX, VALUES, SETTINGS)


def test_every_row_is_the_blast_it_would_be_alone(batch):
    """Rows in lockstep, with three meshes in one batch, against one blast after the other."""
    values = batch_values(batch)
    assert tuple(values) == OUTPUT_NAMES
    for i, kind in enumerate(INDEX):
        alone = run_blast(make_case(EXPLOSIVES[kind], row(i), SETTINGS))
        assert batch.status[i] == alone.status == Status.OK
        for name, value in result_values(alone).items():
            scale = abs(value) if "residual" not in name else 1.0
            assert values[name][i] == pytest.approx(value, rel=1e-10, abs=1e-10 * scale), name
        for name in HISTORY_NAMES:
            expected = getattr(alone.near_field, name)
            assert getattr(batch.near_field, name)[i] == pytest.approx(expected, rel=1e-10)


def test_failed_near_field_leaves_no_numbers_in_its_row(batch, monkeypatch):
    """The burden gets no radius there; the row shows the status of the near field."""
    solve = blast.solve_near_fields

    def failing(explosives, columns, settings):
        result = solve(explosives, columns, settings)
        broken = columns.ucs == 8e7 * 1.3
        return result._replace(status=np.where(broken, Status.RETURN_MAP_FAILED, result.status))

    monkeypatch.setattr(blast, "solve_near_fields", failing)
    simulator = BlastSimulator(EXPLOSIVES, SETTINGS, {})
    result = simulator.run(VALUES, INDEX)
    expected = np.where(np.arange(6) == 2, Status.RETURN_MAP_FAILED, Status.OK)
    assert result.status.tolist() == expected.tolist()
    assert result.status.dtype == np.int8
    whole = batch_values(batch)
    for name, values in result.outputs.items():
        assert np.isnan(values[2]), name
        assert np.array_equal(np.delete(values, 2), np.delete(whole[name], 2)), name
    for name in HISTORY_NAMES:
        assert result.histories[name].shape == (6, 16)
        assert np.isnan(result.histories[name][2]).all()
        assert np.isfinite(np.delete(result.histories[name], 2, axis=0)).all()


def test_failed_burden_motion_keeps_its_own_status(batch, monkeypatch):
    solve = blast.solve_burden_motions

    def failing(explosives, columns):
        assert np.isfinite(columns.expanded_hole_radius).all()
        result = solve(explosives, columns)
        return result._replace(
            status=np.where(columns.burden == 3.5, Status.NOT_CONVERGED, result.status)
        )

    monkeypatch.setattr(blast, "solve_burden_motions", failing)
    broken = run_blasts(EXPLOSIVES, INDEX, VALUES, SETTINGS)
    assert broken.status.tolist() == [0, 0, 0, Status.NOT_CONVERGED, 0, 0]
    assert np.isnan(batch_values(broken)["equilibrium_pressure"][3])
    assert np.isfinite(np.delete(batch_values(broken)["equilibrium_pressure"], 3)).all()


def test_impossible_row_is_refused_before_any_run():
    with pytest.raises(SpecError, match="charge_length"):
        run_blasts(EXPLOSIVES, INDEX, VALUES | {"bench_height": 3.0}, SETTINGS)


def test_read_only_columns_of_another_process_will_do(batch):
    """Arrays that come over a wire are often views that must not be written to."""
    simulator = pickle.loads(pickle.dumps(BlastSimulator(EXPLOSIVES, SETTINGS, {})))
    inputs = simulator.resolve(VALUES, INDEX)
    for values in inputs.values():
        values.flags.writeable = False
    result = simulator.run(inputs, INDEX)
    for name, values in batch_values(batch).items():
        assert np.array_equal(values, result.outputs[name]), name
