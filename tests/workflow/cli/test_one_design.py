"""One design, two verbs: `predict` and `simulate` refuse alike; on the command line, exit 2."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from castblast.errors import SpecError
from castblast.specs.case import split_assignments
from castblast.stages.predict import predict_design
from castblast.stages.predict_table import predict_csv
from castblast.stages.simulate import simulate

Run = Callable[..., "subprocess.CompletedProcess[str]"]

IMPOSSIBLE = {
    "stemming and charge longer than the bench": (
        ("stemming_length=11 m", "charge_length=5 m"),
        "their sum must not exceed it",
    ),
    "a charge of four diameters": (
        ("bench_height=3 m", "charge_length=0.6 m"),
        "at least 6 hole diameters, 0.9 m",
    ),
    "a charge wider than its hole": (
        ("charge_diameter=200 mm", "hole_diameter=100 mm"),
        "charge_diameter 200 mm must not exceed the hole_diameter of 100 mm",
    ),
    "dilation above friction": (
        ("dilation_angle=50 deg", "friction_angle=30 deg"),
        "dilation_angle 50 deg must not exceed the friction_angle of 30 deg",
    ),
    "holes that touch": (
        ("spacing=0.3 m", "hole_diameter=0.4 m"),
        "spacing 0.3 m leaves no rock between the holes",
    ),
}


def sets(values: tuple[str, ...]) -> list[str]:
    return [part for value in values for part in ("--set", value)]


@pytest.mark.parametrize("case", IMPOSSIBLE)
def test_both_verbs_refuse_with_the_same_words(case: str) -> None:
    values, words = IMPOSSIBLE[case]
    given = split_assignments(values)
    with pytest.raises(SpecError) as simulated:
        simulate(explosive="anfo", values=given)
    with pytest.raises(SpecError) as predicted:
        predict_design(given, "anfo")
    assert str(predicted.value) == str(simulated.value)
    assert words in str(predicted.value)


def test_an_impossible_design_ends_with_code_2_and_no_answer(castblast: Run) -> None:
    values, words = IMPOSSIBLE["stemming and charge longer than the bench"]
    done = castblast("predict", *sets(values))
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr


def test_a_charge_that_the_network_cannot_see_is_refused_and_simulated(castblast: Run) -> None:
    """5 m of charge under 2.5 m of stemming in a bench of 12.5 m: predict has no number for it."""
    values = sets(("charge_length=5 m", "stemming_length=2.5 m"))
    done = castblast("predict", *values)
    assert done.returncode == 2
    assert "trained on charge length = bench height - stemming length only" in done.stderr
    assert done.stdout == ""
    given = {"charge_length": "5 m", "stemming_length": "2.5 m"}
    physics = simulate(explosive="anfo", values=given).document
    assert physics["inputs"]["charge_length"] == 5.0
    assert physics["burden_velocity"] == pytest.approx(9.0, rel=0.01)


def test_one_design_by_charge_and_by_stemming() -> None:
    """The same numbers, bands and verdict; for tables `test_predict_table` asks that."""
    common = {"burden": "3 m", "hole_diameter": "150 mm", "bench_height": "10 m"}
    charge, stemming = (
        predict_design(common | option, "anfo").document
        for option in ({"charge_length": "7.3 m"}, {"stemming_length": "2.7 m"})
    )
    assert charge["domain"] == stemming["domain"] == "inside"
    for key in ("burden_velocity", "equilibrium_pressure"):
        assert charge[key] == pytest.approx(stemming[key], rel=1e-12)
        for band in ("prediction_band", "network_band"):
            assert charge[band][key]["upper"] == pytest.approx(stemming[band][key]["upper"])


def test_a_table_names_the_line_of_a_charge_that_cannot_be_seen(tmp_path: Path) -> None:
    path = tmp_path / "designs.csv"
    path.write_text("charge_length [m],stemming_length [m]\n10.4,2.1\n5,2.5\n")
    with pytest.raises(SpecError) as fault:
        predict_csv(path)
    (line,) = str(fault.value).splitlines()
    assert "line 3" in line
    assert "the network was trained on charge length" in line
