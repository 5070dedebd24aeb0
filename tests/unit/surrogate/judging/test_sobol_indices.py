"""Sobol indices with known values, in a box and in a domain that is none."""

import json

import numpy as np
import pytest
from toy_physics import FEATURES, TARGETS, toy_domain, toy_predict

from castblast.surrogate.judging.gate import Surrogate
from castblast.surrogate.judging.sensitivity import draw_samples, sobol_indices, sobol_report


def everywhere(places):
    return np.ones(len(places), dtype=bool)


def test_ishigami_function() -> None:
    """Ishigami & Homma (1990): sin x1 + 7 sin^2 x2 + 0.1 x3^4 sin x1 on [-pi, pi]^3.

    First order 0.3139, 0.4424, 0; total 0.5576, 0.4424, 0.2437.
    """

    def ask(places):
        x = (2.0 * places - 1.0) * np.pi
        return (
            np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
        )[:, None]

    found = sobol_indices(draw_samples("abc", everywhere, 16384), ask)
    exact = {"a": (0.3139, 0.5576), "b": (0.4424, 0.4424), "c": (0.0, 0.2437)}
    for name, (first, total) in exact.items():
        index = found[name][0]
        # 2 of the stated half widths are 4 standard deviations.
        assert abs(index.first - first) < 2.0 * index.first_half_width
        assert abs(index.total - total) < 2.0 * index.total_half_width
        assert index.first_half_width < 0.04


def test_a_triangle_ties_its_inputs() -> None:
    """The answer x on the triangle x + y < 1, where the density of y is 2 (1 - y).

    E[x|y] = (1 - y) / 2 has a quarter of the variance 1/18 of x, so y explains 0.25 to first
    order although the answer never uses it; all is explained by x; without x, given y, is left
    E[(1 - y)^2 / 12] = 1/24 of 1/18: the total index of x is 0.75, that of y 0.
    """
    samples = draw_samples("xy", lambda places: places.sum(axis=1) < 1.0, 8192)
    for sample in samples.values():
        for places in sample:
            assert np.all(places.sum(axis=1) < 1.0)
    found = sobol_indices(samples, lambda places: places[:, :1])
    exact = {"x": (1.0, 0.75), "y": (0.25, 0.0)}
    for name, (first, total) in exact.items():
        index = found[name][0]
        assert abs(index.first - first) < 2.0 * index.first_half_width
        assert abs(index.total - total) <= 2.0 * index.total_half_width


def test_the_same_seed_gives_the_same_intervals() -> None:
    """Those of the first input too: SALib takes a seed of 0 for none and draws from anywhere."""
    samples = draw_samples("ab", everywhere, 128)
    first, again = (sobol_indices(samples, lambda places: places**2) for _ in range(2))
    assert first == again


def test_samples_share_what_they_should() -> None:
    samples = draw_samples("abc", everywhere, 64, only=["b"])
    assert list(samples) == ["b"]
    sample = samples["b"]
    np.testing.assert_array_equal(sample.same_input[:, 1], sample.base[:, 1])
    np.testing.assert_array_equal(sample.same_rest[:, [0, 2]], sample.base[:, [0, 2]])
    assert not np.any(sample.same_rest[:, 1] == sample.base[:, 1])
    assert not np.any(sample.same_input[:, [0, 2]] == sample.base[:, [0, 2]])


def test_a_corner_that_is_cut_off_alone_is_reported() -> None:
    def never(places):
        return np.zeros(len(places), dtype=bool)

    with pytest.raises(ValueError, match="find no possible neighbour"):
        draw_samples("a", never, 4)


def test_report_of_a_perfect_surrogate_agrees_with_its_simulator() -> None:
    """On the same rows the indices are the same numbers; near-field targets ignore the bench."""
    surrogate = Surrogate(toy_predict, FEATURES, TARGETS)
    report = sobol_report(surrogate, toy_domain(), rows=1024, checked_rows=256)
    json.dumps(report, allow_nan=False)
    assert report["inputs"]["charge_length"] == "charge length over bench height"
    assert list(report["inputs"])[-1] == "explosive"
    for target, checked in report["physics"]["targets"].items():
        assert len(checked) >= 2
        for entry in checked.values():
            assert entry["simulator"]["first"] == pytest.approx(entry["surrogate"]["first"])
            assert entry["simulator"]["total"] == pytest.approx(entry["surrogate"]["total"])
        assert set(checked) <= set(report["indices"][target])
    pressure = report["indices"]["equilibrium_pressure"]
    for name in ("burden", "bench_height", "hole_diameter", "charge_length"):
        assert pressure[name]["total"] == 0.0
    assert max(pressure, key=lambda name: pressure[name]["total"]) == "ucs"
