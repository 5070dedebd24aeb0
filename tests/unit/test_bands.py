"""The prediction band: a stated prior about every quantity shown, and what a network adds."""

import json
import math
import shlex
from pathlib import Path
from statistics import NormalDist

import pytest

from castblast.bands import (
    BASIS,
    NORMAL_95,
    NORMAL_975,
    PRIORS,
    band_document,
    prediction_band,
    prediction_factor,
    show_band,
    show_value,
)
from castblast.design.variables import OUTPUT_NAMES, VARIABLES
from castblast.prediction.answer import predict
from castblast.stages.predict import predict_design
from castblast.stages.simulate import simulate

#: ANFO in a hole of 102 mm, burden 3 m, bench of 12.5 m: what both parameter sets give.
DESIGN = {"hole_diameter": 0.102, "burden": 3.0}
AUTHORS, FIELD = 9.74, 15.09


def test_quantiles_are_those_of_the_normal_distribution() -> None:
    assert pytest.approx(NormalDist().inv_cdf(0.95), rel=1e-12) == NORMAL_95
    assert pytest.approx(NormalDist().inv_cdf(0.975), rel=1e-12) == NORMAL_975


def test_velocity_is_known_to_a_factor_of_one_point_eight() -> None:
    """Sd of ln v 0.35: 5th and 95th percentile of a lognormal variable about its median."""
    normal = NormalDist(math.log(10.0), 0.35)
    ends = prediction_band("burden_velocity", 10.0)
    assert ends.lower == pytest.approx(math.exp(normal.inv_cdf(0.05)), rel=1e-12)
    assert ends.upper == pytest.approx(math.exp(normal.inv_cdf(0.95)), rel=1e-12)
    assert round(prediction_factor("burden_velocity"), 1) == 1.8


def test_a_network_adds_in_quadrature() -> None:
    """A 95 % half-width of 0.69 is an sd of 0.35 more: the band of an sd of 0.35 times sqrt 2."""
    alone = math.log(prediction_factor("burden_velocity"))
    both = math.log(prediction_factor("burden_velocity", 0.35 * NORMAL_975))
    assert both == pytest.approx(alone * math.sqrt(2.0), rel=1e-12)
    assert prediction_factor("burden_velocity", 0.003) == pytest.approx(math.exp(alone), rel=1e-4)


def test_every_prior_is_of_a_known_output_and_gives_its_reason() -> None:
    assert set(PRIORS) <= set(OUTPUT_NAMES)
    assert {n for n in OUTPUT_NAMES if VARIABLES[n].role == "target"} <= set(PRIORS)
    for name, prior in PRIORS.items():
        assert 0.05 <= prior.sd <= 0.7, name
        assert prior.reason


def test_ends_are_in_order_below_zero_and_unknown_without_a_prior() -> None:
    low, high = prediction_band("burden_velocity", -2.0)
    assert low < -2.0 < high < 0.0
    assert prediction_band("burden_velocity", 0.0) == (0.0, 0.0)
    assert all(math.isnan(end) for end in prediction_band("gas_work", 1.0))
    assert "gas_work" not in band_document({"gas_work": 1.0})["prediction_band"]


def test_people_read_figures_that_the_band_bears_out() -> None:
    assert show_value("burden_velocity", 9.727944) == "9.73"
    assert show_band("burden_velocity", 9.727944) == "5.5 to 17"
    assert show_value("equilibrium_pressure", 2.6157e8) == "262"
    assert show_band("equilibrium_pressure", 2.6157e9) == "1400 to 5100"
    assert show_band("expanded_hole_radius", 0.0868) == "70.1 to 107"
    assert show_band("gas_work", 1e6) == "-"


def test_the_shipped_network_holds_both_parameter_sets() -> None:
    answer = predict(DESIGN, "anfo")
    band, network = (
        answer[f"{kind}_band"]["burden_velocity"] for kind in ("prediction", "network")
    )
    assert band["lower"] < AUTHORS < FIELD < band["upper"]
    assert not network["lower"] < FIELD < network["upper"]
    assert band["upper"] / answer["burden_velocity"] == pytest.approx(
        prediction_factor("burden_velocity", network["relative"]), rel=1e-12
    )
    assert answer["prediction_basis"]["words"] == BASIS
    assert answer["prediction_basis"]["sd_of_ln"]["burden_velocity"] == 0.35
    json.dumps(answer, allow_nan=False)


@pytest.mark.parametrize("parameter_set", ["authors", "field"])
def test_the_physics_holds_both_parameter_sets(parameter_set: str) -> None:
    """Each set's band holds the velocity of the other."""
    outcome = simulate(
        explosive="anfo", values={"hole_diameter": "102 mm"}, parameter_set=parameter_set
    )
    band = outcome.document["prediction_band"]["burden_velocity"]
    assert band["lower"] < AUTHORS < FIELD < band["upper"]
    assert "network_band" not in outcome.document
    (row,) = (row for row in outcome.rows if row[0] == "burden velocity")
    assert row[2] == show_band("burden_velocity", outcome.document["burden_velocity"])
    assert any(BASIS in line for line in outcome.remarks)


def test_predict_and_simulate_of_the_readme_show_one_number() -> None:
    """One design, one number and one band in the two lines of the README."""
    readme = Path(__file__).parents[2] / "README.md"
    lines = [shlex.split(line, comments=True) for line in readme.read_text().splitlines()
             if line.startswith(("castblast predict", "castblast simulate"))]  # fmt: skip
    assert [line[1] for line in lines] == ["predict", "simulate"]
    predicted, simulated = lines
    options = dict(zip(predicted[2::2], predicted[3::2], strict=True))
    explosive = options.pop("--explosive")
    asked = {name[2:].replace("-", "_"): value for name, value in options.items()}
    given = dict(word.split("=", 1) for word in simulated if "=" in word)
    assert given == asked
    answers = (
        predict_design(asked, explosive).rows,
        simulate(explosive=simulated[simulated.index("--explosive") + 1], values=given).rows,
    )
    shown = [next(row for row in rows if row[0] == "burden velocity") for rows in answers]
    assert shown[0] == shown[1]
