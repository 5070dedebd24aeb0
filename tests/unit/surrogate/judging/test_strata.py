"""Errors put where they are: by explosive, by input, row by row; and pictures of all of it."""

import dataclasses
import json

import numpy as np
import pytest
from toy_physics import FEATURES, TARGETS, toy_domain, toy_predict

from castblast.specs.models.model import PAPER_FEATURES, PAPER_TARGETS, RidgeSpec
from castblast.surrogate.fitting.features import read_table
from castblast.surrogate.fitting.training import fit_spec
from castblast.surrogate.judging.strata import error_maps, strata, worst_cases

SPEC = RidgeSpec(name="power_law", input_transform="log", target_transform="log", penalty=0.0)
VELOCITY = PAPER_TARGETS.index("burden_velocity")


@pytest.fixture(scope="module")
def fit(toy_dataset):
    """An exact fit, spoiled: velocity 1 % off, and 20 % off where the burden is above 5 m."""
    table = read_table(toy_dataset(1500, bend=0.0), PAPER_FEATURES, PAPER_TARGETS)
    fit = fit_spec(SPEC, table)
    off = np.where(table.frame["burden"].to_numpy() > 5.0, 1.2, 1.01)
    predicted = fit.predicted.copy()
    predicted[:, VELOCITY] *= off
    return dataclasses.replace(fit, predicted=predicted)


def test_the_spoiled_stratum_is_found(fit) -> None:
    document = strata(fit)
    json.dumps(document, allow_nan=False)
    cells = document["by_input"]["burden"]
    assert len(cells) == 10
    rows = [cell["targets"]["burden_velocity"]["rows"] for cell in cells]
    assert sum(rows) == document["rows"] == len(fit.table.rows("test"))
    assert max(rows) - min(rows) <= 2
    for cell in cells:
        error = cell["targets"]["burden_velocity"]["relative_error_95"]
        if cell["upper"] < 5.0:
            assert error == pytest.approx(0.01, rel=1e-6)
        if cell["lower"] > 5.0:
            assert error == pytest.approx(0.2, rel=1e-6)
    spread = document["spread"]["burden_velocity"]
    assert spread["burden"] == pytest.approx(20.0, rel=1e-6)


def test_maps_are_of_the_inputs_that_matter(fit) -> None:
    maps = error_maps(fit, bins=4, pairs=3)
    json.dumps(maps, allow_nan=False)
    assert "burden" in (maps[0]["across"], maps[0]["up"])
    error = np.array(maps[0]["error"], dtype=float)
    assert error.shape == (4, 4)
    assert np.nanmax(error) == pytest.approx(0.2, rel=1e-6)
    assert np.array(maps[0]["rows"]).sum() == len(fit.table.rows("test"))


def test_worst_cases_are_ranked_and_placed(fit) -> None:
    """One row is spoiled more, another given an input beyond all training rows."""
    test = fit.table.rows("test")
    burden = fit.table.frame["burden"].to_numpy()
    low = test[burden[test] < 5.0]
    predicted = fit.predicted.copy()
    predicted[low[0], VELOCITY] *= 0.5
    predicted[low[1], 0] *= 0.7
    frame = fit.table.frame.copy()
    frame.iloc[low[1], frame.columns.get_loc("ucs")] = 1e9
    table = dataclasses.replace(fit.table, frame=frame)
    cases = worst_cases(dataclasses.replace(fit, predicted=predicted, table=table), count=4)
    json.dumps(cases, allow_nan=False)
    assert [case["sample"] for case in cases[:2]] == fit.table.sample[low[:2]].tolist()
    assert cases[0]["target"] == "burden_velocity"
    assert cases[0]["relative_error"] == pytest.approx(0.5 * 1.01 - 1.0)
    assert cases[0]["in_domain"]
    assert 0.0 <= cases[0]["edge"]["place"] <= 1.0
    assert not cases[1]["in_domain"]
    assert cases[1]["edge"]["input"] == "ucs"
    assert cases[1]["edge"]["place"] > 1.0
    assert cases[1]["inputs"]["ucs"] == 1e9
    sizes = [abs(case["relative_error"]) for case in cases]
    assert sizes == sorted(sizes, reverse=True)


def test_every_picture_is_drawn(fit, tmp_path) -> None:
    from castblast.report.models import error_figures, inquiry_figures, league_figures
    from castblast.surrogate.fitting.training import learning_curve
    from castblast.surrogate.judging.comparison import compare
    from castblast.surrogate.judging.gate import Surrogate, check_physics
    from castblast.surrogate.judging.learning import learning_report
    from castblast.surrogate.judging.probe import physics_probe
    from castblast.surrogate.judging.sensitivity import sobol_report
    from castblast.surrogate.judging.shifts import shift_tests

    domain = toy_domain()
    perfect = Surrogate(toy_predict, FEATURES, TARGETS)
    gates = {
        "perfect": check_physics(perfect, physics_probe(domain, points=32, dense=64)),
        "bad": {"passed": False, "checks": [
            {"name": "burden_velocity falls with burden", "asked": 100, "broken": 3},
            {"name": "equilibrium_pressure is positive", "asked": 0, "broken": 0},
        ]},
    }  # fmt: skip
    curve = learning_curve(fit, fit.table, sizes=(120, 200, 400, 600))
    learning = learning_report(curve, dict.fromkeys(PAPER_TARGETS, 1e-3))
    pictures = [
        league_figures.draw_league(
            tmp_path / "league.png",
            compare([fit], {"power_law": {"passed": False, "reasons": ["x"]}}),
        ),
        league_figures.draw_gate(tmp_path / "gate.png", gates),
        error_figures.draw_error_maps(tmp_path / "maps.png", "maps", error_maps(fit, bins=4)),
        error_figures.draw_strata(tmp_path / "strata.png", "strata", strata(fit)),
        error_figures.draw_shifts(
            tmp_path / "shifts.png", {"power_law": shift_tests(fit, fit.table)}
        ),
        inquiry_figures.draw_sobol(
            tmp_path / "sobol.png", "sobol",
            sobol_report(perfect, domain, rows=64, checked_rows=32),
        ),
        inquiry_figures.draw_learning_laws(tmp_path / "laws.png", "laws", learning),
    ]  # fmt: skip
    for picture in pictures:
        assert picture.stat().st_size > 10_000
