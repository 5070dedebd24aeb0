"""A hole that expands as wide as the rock it should move: refused with the field, by everybody."""

from __future__ import annotations

import re

import numpy as np
import pytest

from castblast.blast.run import run_blasts
from castblast.burden.case import BurdenGeometry
from castblast.burden.geometry import breakout_width as kernel_width
from castblast.burden.geometry import mean_burden as kernel_mean_burden
from castblast.design.hole import breakout_width, expanded_hole_faults, mean_burden
from castblast.design.rule import complete_columns
from castblast.errors import SpecError, Status
from castblast.prediction.answer import predict
from castblast.specs.explosive import load_explosive
from castblast.stages.simulate import simulate


def lines_of(call) -> list[str]:
    with pytest.raises(SpecError) as fault:
        call()
    return str(fault.value).splitlines()


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("burden", {"burden": 0.2, "spacing": 3.0}),
        ("spacing", {"burden": 3.0, "spacing": 0.3}),
    ],
)
def test_simulate_and_predict_refuse_the_same_field(name: str, values: dict[str, float]) -> None:
    """The hole of predict is that of the network: the same field, the same limit to 2 percent."""
    soft = {"ucs": 1.2e7, "hole_diameter": 0.2}
    written = {n: f"{v!r} {'Pa' if n == 'ucs' else 'm'}" for n, v in (soft | values).items()}
    lines = {
        "simulate": lines_of(lambda: simulate(explosive="anfo", values=written)),
        "predict": lines_of(lambda: predict(soft | values, "anfo")),
    }
    numbers = {}
    for verb, said in lines.items():
        assert len(said) == 1, verb
        assert said[0].startswith(f"{name} {values[name]:g} m is too small for a hole of 200 mm")
        numbers[verb] = [float(x) for x in re.findall(r"(?:to|than) ([\d.]+) m", said[0])]
    assert numbers["predict"] == pytest.approx(numbers["simulate"], rel=0.02)


@pytest.mark.parametrize("name", ["burden", "spacing"])
def test_the_limit_that_is_named_is_enough(name: str) -> None:
    """A little more than the least value that the message gives, and the rule is kept."""
    full = complete_columns({"burden": 0.4, "spacing": 0.5, "face_angle": 1.4}, 1)
    full["burden" if name == "spacing" else "spacing"] = np.array([2.5])
    radius = np.array([0.45])
    if name == "burden":
        full["burden"] = np.array([0.2])
        full["bench_height"] = np.array([1.0])
    said = [f.say(0) for f in expanded_hole_faults(full, radius) if f.rows[0]]
    assert [line.split()[0] for line in said] == [name]
    least = float(re.search(r"more than ([\d.]+) m is needed", said[0])[1])
    for factor, broken in ((1.0001, False), (0.9999, True)):
        moved = full | {name: np.array([least * factor])}
        assert any(f.rows[0] for f in expanded_hole_faults(moved, radius)) == broken


def test_both_are_named_where_both_are_too_small() -> None:
    full = complete_columns({"burden": 0.3, "spacing": 0.5}, 2)
    faults = expanded_hole_faults(full, np.array([0.4, np.nan]))
    assert [f.say(0).split()[0] for f in faults if f.rows[0]] == ["burden", "spacing"]
    assert not any(f.rows[1] for f in faults)


def test_a_hole_that_closes_on_its_charge_is_named() -> None:
    full = complete_columns({"charge_diameter": 0.1, "in_situ_stress": 1e8}, 1)
    (line,) = [f.say(0) for f in expanded_hole_faults(full, np.array([0.04])) if f.rows[0]]
    assert line.startswith("charge_diameter 100 mm: rock under an in_situ_stress of 100 MPa closes")


def test_the_rule_is_that_of_the_kernels() -> None:
    """Width of the break-out plane and mean burden over random benches, to rounding."""
    rng = np.random.default_rng(5)
    names = {"burden": (0.2, 12.0), "spacing": (0.2, 15.0), "bench_height": (1.0, 30.0),
             "face_angle": (0.8, 1.57)}  # fmt: skip
    full = {name: rng.uniform(*ends, 200) for name, ends in names.items()}
    widths = breakout_width(full["spacing"], mean_burden(full))
    for i in range(200):
        row = dict.fromkeys(BurdenGeometry._fields, 1.0) | {n: c[i] for n, c in full.items()}
        geometry = BurdenGeometry(**{n: float(v) for n, v in row.items()})
        assert mean_burden(full)[i] == pytest.approx(kernel_mean_burden(geometry), rel=1e-13)
        assert widths[i] == pytest.approx(kernel_width(geometry), rel=1e-12)


def test_every_random_design_that_the_burden_refuses_is_named() -> None:
    """Thirty holes between narrow benches: BAD_INPUT exactly where the rule names a field."""
    rng = np.random.default_rng(8)
    n = 30
    values = {
        "ucs": np.full(n, 5e7),
        "hole_diameter": np.full(n, 0.2),
        "burden": rng.uniform(0.15, 0.6, n),
        "spacing": rng.uniform(0.25, 0.8, n),
        "zones": np.full(n, 40.0),
    }
    values["burden"] = np.maximum(values["burden"], 0.2)
    batch = run_blasts((load_explosive("anfo").to_explosive(),), np.zeros(n, np.int64), values)
    faults = expanded_hole_faults(
        complete_columns(values, n), batch.near_field.expanded_hole_radius
    )
    named = np.any([fault.rows for fault in faults], axis=0)
    assert np.array_equal(batch.status == Status.BAD_INPUT, named)
    assert 5 < named.sum() < 25
