"""Readers of a design beside `predict` and the physics: fragments, lookup tables, examples."""

from __future__ import annotations

import csv
from math import pi

import pytest

from castblast.export.sheet.lookup import lookup_csv
from castblast.export.source.plain import example_row
from castblast.muckpile.bench.geometry import Bench
from castblast.prediction.answer import load_network
from castblast.specs.bench.fragments import FragmentsSpec, _pattern

BENCH = Bench(length=20.0, width=12.0, height=10.0, burden=3.0, spacing=3.6)


def test_fragments_complete_the_charge_as_predict_does() -> None:
    """0.7 burden of stemming; or that of the surrogate; or the charge of the fragments alone."""
    spec = FragmentsSpec(hole_diameter="150 mm")
    assert _pattern(spec, BENCH, {}).charge_length == pytest.approx(10.0 - 0.7 * 3.0)
    assert _pattern(spec, BENCH, {"stemming_length": 3.0}).charge_length == 7.0
    own = FragmentsSpec(hole_diameter="150 mm", charge_length="6 m")
    assert _pattern(own, BENCH, {"stemming_length": 3.0}).charge_length == 6.0


def test_fragments_weigh_the_charge_not_the_hole() -> None:
    """A charge of 100 mm in 150 mm of hole: 800 kg/m3 x pi/4 x 0.01 m2 x 7 m."""
    design = {"stemming_length": 3.0, "charge_diameter": 0.1}
    pattern = _pattern(FragmentsSpec(hole_diameter="150 mm"), BENCH, design)
    assert pattern.charge_mass == pytest.approx(800.0 * pi / 4 * 0.01 * 7.0)
    assert pattern.hole_diameter == 0.15


@pytest.mark.parametrize(
    ("fragments", "design", "words"),
    [
        ({"charge_length": "11 m"}, {}, "charge_length 11 m leaves no room for stemming"),
        ({}, {"stemming_length": 9.5}, "leaves no room for a column charge"),
        ({}, {"charge_diameter": 0.3}, "charge_diameter 300 mm must not exceed"),
        ({}, {"stemming_length": 4.0, "charge_length": 7.0}, "their sum must not exceed it"),
    ],
)
def test_fragments_refuse_what_the_physics_refuses(fragments, design, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        _pattern(FragmentsSpec(hole_diameter="150 mm", **fragments), BENCH, design)


def test_a_lookup_table_completes_its_designs_by_the_rule() -> None:
    """Spacing the burden, stemming 0.7 burdens or the charge what they leave; all possible."""
    for name in ("full", "paper"):
        network = load_network(name)
        rows = list(csv.DictReader(lookup_csv(network).splitlines()))
        assert len({row["burden [m]"] for row in rows}) > 3
        for row in rows:
            burden, height = float(row["burden [m]"]), float(row["bench_height [m]"])
            charge = height - 0.7 * burden
            if name == "full":
                assert float(row["spacing [m]"]) == pytest.approx(burden, rel=1e-5)
                assert float(row["stemming_length [m]"]) == pytest.approx(0.7 * burden, rel=1e-5)
            else:
                assert float(row["charge_length [m]"]) == pytest.approx(charge, rel=1e-5)
            assert charge >= 6.0 * float(row["hole_diameter [mm]"]) / 1000.0


def test_the_example_of_an_export_is_the_usual_design() -> None:
    network = load_network("full")
    row = dict(zip(network.input_names, example_row(network), strict=True))
    assert (row["spacing"], row["stemming_length"]) == (3.0, 0.7 * 3.0)
