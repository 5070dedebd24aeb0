"""The joint domain against distributions whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from castblast.network import (
    GoldenRows,
    InputColumn,
    Layer,
    Network,
    OutputColumn,
    density_reliefs,
    density_score,
    domain_violations,
    in_domain,
)
from castblast.specs.models.model import PAPER_FEATURES, PAPER_TARGETS, RidgeSpec
from castblast.surrogate.fitting.density import LEVEL, fit_density, term_count, with_density
from castblast.surrogate.fitting.features import read_table
from castblast.surrogate.fitting.training import fit_spec

NAMES = ("burden", "spacing", "bench_height")


def network_of(rows: np.ndarray) -> Network:
    """A network that answers nothing, with the scaling and box of rows [m]."""
    inputs = tuple(
        InputColumn(name, "m", "linear", float(x.mean()), float(x.std()), x.min(), x.max())
        for name, x in zip(NAMES, rows.T, strict=True)
    )
    return Network(
        inputs=inputs,
        explosives=("anfo",),
        codes=np.empty((1, 0)),
        layers=(Layer(np.zeros((len(inputs), 1)), np.zeros(1), "identity"),),
        outputs=(OutputColumn("burden_velocity", "m s-1", "linear", 0.0, 1.0, 0.1),),
        constraints=(),
        golden=GoldenRows(np.ones((1, len(inputs))), ("anfo",), np.ones((1, 1))),
    )


def scaled(network: Network, rows: np.ndarray) -> np.ndarray:
    return (rows - [c.mean for c in network.inputs]) / [c.scale for c in network.inputs]


def test_of_one_normal_distribution_it_is_the_mahalanobis_distance() -> None:
    """With one term the score is (z - m)' S^-1 (z - m) / threshold.

    m and S are mean and covariance of the training rows; of a normal distribution the distance
    follows chi-squared with k degrees of freedom, so the threshold is its 99.5 % quantile, up to
    the sampling error of S (a few per cent with 900 rows).
    """
    rng = np.random.default_rng(0)
    mix = np.tril(rng.normal(size=(12, 12))) + 2.0 * np.eye(12)
    train, held = (rng.normal(size=(n, 12)) @ mix.T for n in (900, 20_000))
    density = fit_density(train, held)
    assert len(density.centres) == term_count(900, 12) == 1
    covariance = np.cov(train.T, bias=True) + 1e-6 * np.eye(12)
    steps = held[:50] - train.mean(axis=0)
    expected = np.einsum("ni,ij,nj->n", steps, np.linalg.inv(covariance), steps)
    np.testing.assert_allclose(density.distances(held[:50])[0], expected, rtol=1e-9)
    assert density.threshold == pytest.approx(chi2.ppf(LEVEL, 12), rel=0.1)


def ratio_design(count: int, seed: int) -> np.ndarray:
    """Burden 1 to 15 m, spacing 0.8 to 1.8 burdens, bench 5 to 30 m: a wedge in the box."""
    rng = np.random.default_rng(seed)
    burden = rng.uniform(1.0, 15.0, count)
    return np.stack(
        [burden, burden * rng.uniform(0.8, 1.8, count), rng.uniform(5.0, 30.0, count)], axis=1
    )


@pytest.fixture(scope="module")
def wedge() -> Network:
    network = network_of(ratio_design(4000, 0))
    density = fit_density(
        scaled(network, ratio_design(4000, 0)), scaled(network, ratio_design(1000, 1))
    )
    return replace(network, density=density)


def test_false_alarms_are_as_many_as_stated(wedge: Network) -> None:
    """Exchangeable rows exceed the bound with 1 - level; its own 1,000 rows decide the rest."""
    alarms = np.mean(density_score(wedge, ratio_design(20_000, 2)) > 1.0)
    assert 0.001 < alarms < 0.012


def test_corners_beyond_the_joint_rules_are_out_though_every_value_is_in(wedge: Network) -> None:
    corners = np.array([[2.0, 20.0, 15.0], [14.0, 2.0, 15.0], [3.0, 24.0, 10.0]])
    assert in_domain(replace(wedge, density=None), corners).all()
    assert not in_domain(wedge, corners).any()
    inside = np.array([[2.0, 2.5, 15.0], [14.0, 18.0, 8.0], [8.0, 10.0, 29.0]])
    assert in_domain(wedge, inside).all()


def test_the_tied_inputs_are_named_and_nothing_else(wedge: Network) -> None:
    row = {"burden": 3.0, "spacing": 22.0, "bench_height": 17.0}
    (violation,) = domain_violations(wedge, row)
    assert violation.kind == "density"
    assert violation.inputs == ("burden", "spacing")
    assert "unusual together" in violation.message
    assert "bench_height" not in violation.message


def test_relief_is_what_the_best_value_of_one_input_would_bring(wedge: Network) -> None:
    """Within one term the score is quadratic, so a scan over one input finds the same minimum."""
    one = replace(
        wedge.density, centres=wedge.density.centres[:1], whitening=wedge.density.whitening[:1],
        offsets=np.zeros(1),
    )  # fmt: skip
    network = replace(wedge, density=one)
    row = np.array([[4.0, 9.0, 20.0]])
    reliefs = density_reliefs(network, row)[0]
    for i, step in enumerate(np.eye(3)):
        scan = row + np.linspace(-40.0, 40.0, 160_001)[:, None] * step
        best = density_score(network, row)[0] - density_score(network, scan).min()
        assert reliefs[i] == pytest.approx(best, rel=1e-4, abs=1e-6)


def test_few_held_rows_lower_the_stated_level() -> None:
    rng = np.random.default_rng(4)
    density = fit_density(rng.normal(size=(200, 2)), held := rng.normal(size=(39, 2)))
    assert density.level == pytest.approx(39 / 40)
    assert density.distances(held).min(axis=0).max() == density.threshold


def test_an_input_that_never_changed_may_not_change() -> None:
    rows = ratio_design(500, 5)
    rows[:, 2] = 12.0
    train = (rows - rows.mean(axis=0)) / [rows[:, 0].std(), rows[:, 1].std(), 1.0]
    density = fit_density(train, train)
    moved = train[:5] + np.array([0.0, 0.0, 0.05])
    assert (density.distances(moved).min(axis=0) > density.threshold).all()


def test_of_a_fit(toy_dataset) -> None:
    table = read_table(toy_dataset(3000), PAPER_FEATURES, PAPER_TARGETS)
    bare = replace(fit_spec(RidgeSpec(name="r"), table).network, density=None)
    network = with_density(bare, table)
    numeric = table.frame[list(PAPER_FEATURES)].to_numpy()
    test = table.rows("test")
    assert np.mean(density_score(network, numeric[test]) > 1.0) <= 0.03
    assert with_density(bare, table).density.threshold == network.density.threshold
