"""Designs: the Latin-hypercube property, rules by resampling, splits and explosives in balance."""

from pathlib import Path

import numpy as np
import pytest
from fake_blast import fake_simulator, write_recipe

from castblast.blast.run import run_blasts
from castblast.dataset.rows.design import draw_batch, make_design, split_labels
from castblast.errors import SpecError, Status
from castblast.specs.recipe import load_recipe

ROOT = Path(__file__).resolve().parents[3]


def design_of(tmp_path, **changes):
    path = write_recipe(tmp_path / "r.yaml", **changes)
    recipe = load_recipe(path).recipe
    return recipe, make_design(recipe, fake_simulator(path), str(path))


ROOMY = {  # every bench of these ranges has room for its charge
    "ucs": {"lower": "10 MPa", "upper": "200 MPa", "distribution": "log_uniform"},
    "burden": {"lower": "1 m", "upper": "5 m"},
    "friction_angle": {"lower": "25 deg", "upper": "55 deg"},
    "spacing": {"lower": 1.0, "upper": 1.5, "ratio_of": "burden"},
    "stemming_length": {"lower": 0.4, "upper": 1.0, "ratio_of": "burden"},
}


def test_one_sample_in_every_stratum(tmp_path):
    """A Latin hypercube of n rows has exactly one value in each of n equal parts of a marginal."""
    n = 101
    recipe, design = design_of(tmp_path, size=n, variables=ROOMY)
    assert design.drawn == n
    for spec in recipe.sampled:
        values = design.columns[spec.name]
        if spec.ratio_of:
            values = values / design.columns[spec.ratio_of]
        low, high = spec.at(0.0), spec.at(1.0)
        if spec.distribution == "log_uniform":
            values, low, high = np.log(values), np.log(low), np.log(high)
        strata = np.floor((values - low) / (high - low) * n).astype(int)
        assert sorted(strata) == list(range(n)), spec.name


def test_acceptance_is_the_possible_share_of_the_box(tmp_path):
    """Bench 10 m, charge L in [1, 9] m, burden B in [1, 15] m, stemming 10 - L >= 0.4 B.

    The possible share of the box is 3/8 (L <= 4: every burden) + 5/8 of the mean of
    (2.5 (10 - L) - 1) / 14 over L in [4, 9], which is linear from 1 to 1.5/14.
    """
    exact = 3 / 8 + 5 / 8 * (1.0 + 1.5 / 14.0) / 2.0
    n = 2000
    _, design = design_of(tmp_path, size=n)
    error = np.sqrt(exact * (1 - exact) / design.drawn)
    assert n / design.drawn == pytest.approx(exact, abs=4 * error)


def test_rules_hold_and_nothing_is_clipped_to_their_edge(tmp_path):
    """Among possible rows the density of B falls towards the edge 2.5 (10 - L): no pile there."""
    _, design = design_of(tmp_path, size=2000)
    stemming = design.inputs["stemming_length"]
    assert np.allclose(stemming, 10.0 - design.columns["charge_length"])
    ratio = stemming / design.columns["burden"]
    assert ratio.min() >= 0.4
    assert np.count_nonzero(ratio < 0.4 * 1.001) < 10  # about 2 are expected
    assert set(np.unique(design.batch)) == set(range(design.batch.max() + 1))
    assert design.batch.max() >= 2


def test_what_is_left_is_uniform_over_the_possible_part(tmp_path):
    """Given L <= 4 m every burden is possible, so burdens of those rows keep their uniform law."""
    _, design = design_of(tmp_path, size=4000)
    burden = design.columns["burden"][design.columns["charge_length"] <= 4.0]
    steps = np.sort((burden - 1.0) / 14.0)
    distance = np.abs(steps - np.arange(1, len(steps) + 1) / len(steps)).max()
    assert distance < 1.63 / np.sqrt(len(steps))  # Kolmogorov-Smirnov, 1 %


def test_maximum_stemming_ratio(tmp_path):
    rules = {"minimum_stemming_ratio": 0.5, "maximum_stemming_ratio": 2.5}
    _, design = design_of(tmp_path, constraints=rules)
    ratio = design.inputs["stemming_length"] / design.inputs["burden"]
    assert ratio.min() >= 0.5
    assert 2.0 < ratio.max() <= 2.5


def test_explosives_and_splits_are_in_balance(tmp_path):
    recipe, design = design_of(tmp_path, size=200)
    counts = np.bincount(design.explosive)
    assert counts.max() - counts.min() <= 1
    assert np.bincount(design.split).tolist() == [160, 10, 10, 20]
    # Neither follows the order of the rows or the other.
    assert len(np.unique(design.explosive[:20])) == len(recipe.explosives)
    assert abs(np.corrcoef(design.explosive, design.split)[0, 1]) < 0.25
    assert design.sample.tolist() == list(range(200))
    assert design.sample.dtype == np.int32


@pytest.mark.parametrize("size", [1, 7, 19, 1000])
def test_split_counts_are_the_shares_to_the_nearest_row(size):
    shares = (0.8, 0.05, 0.05, 0.1)
    labels = split_labels(size, shares, np.random.default_rng(0))
    counts = np.bincount(labels, minlength=4)
    assert counts.sum() == size
    assert np.all(np.abs(counts - np.array(shares) * size) < 1.0)


def test_seed_decides_everything(tmp_path):
    _, one = design_of(tmp_path)
    _, same = design_of(tmp_path)
    _, other = design_of(tmp_path, seed=8)
    for name in one.inputs:
        assert np.array_equal(one.inputs[name], same.inputs[name])
    assert np.array_equal(one.split, same.split)
    assert not np.array_equal(one.columns["ucs"], other.columns["ucs"])
    assert not np.array_equal(one.split, other.split)


def test_shipped_designs_stay_what_they_were():
    """Published figures rest on these rows; counts exact, values but for the last bit of exp."""
    drawn = {}
    for name, row in (
        ("quickstart", (134320216.58534864, 10.400830081964651, 2.0125847408470144e-05)),
        ("full", (53744969.28978618, 7.588940083797139, 5.6917675863026905e-05)),
    ):
        path = ROOT / "data_specs" / "recipes" / f"{name}.yaml"
        design = make_design(load_recipe(path).recipe, fake_simulator(path), str(path))
        first = tuple(design.inputs[k][0] for k in ("ucs", "burden", "rise_time"))
        assert first == pytest.approx(row, rel=1e-14)
        drawn[name] = (design.drawn, np.bincount(design.batch).tolist())
    assert drawn == {
        "quickstart": (2611, [1525, 365, 91, 15, 2, 1, 1]),
        "full": (11057, [9037, 877, 78, 8]),
    }


def test_split_does_not_depend_on_the_variables(tmp_path):
    _, one = design_of(tmp_path)
    _, other = design_of(tmp_path, variables=ROOMY)
    assert np.array_equal(one.split, other.split)
    assert np.array_equal(one.explosive, other.explosive)


def test_ratios_become_values(tmp_path):
    _, design = design_of(tmp_path, variables=ROOMY)
    ratio = design.inputs["spacing"] / design.inputs["burden"]
    assert ratio.min() >= 1.0
    assert ratio.max() <= 1.5
    recipe = load_recipe(write_recipe(tmp_path / "r.yaml", variables=ROOMY)).recipe
    drawn = draw_batch(recipe, 5, np.random.default_rng(0))
    assert list(drawn) == ["ucs", "friction_angle", "burden", "spacing", "stemming_length"]


def test_impossible_ranges_stop_before_any_run_and_name_the_rule(tmp_path):
    """Burdens above 14 m need 5.6 m of stemming; a bench of 10 m with 5 m of charge has 5 m."""
    variables = {
        "burden": {"lower": "14 m", "upper": "15 m"},
        "bench_height": "10 m",
        "charge_length": {"lower": "5 m", "upper": "9 m"},
    }
    with pytest.raises(SpecError) as caught:
        design_of(tmp_path, variables=variables)
    message = str(caught.value)
    assert "100.0% of the designs" in message
    assert "stemming_length below 0.4 burden" in message
    assert "r.yaml" in message


@pytest.mark.parametrize(("least", "share"), [(0.5, None), (1.0, r"71\.[46]% of the designs")])
def test_most_designs_must_be_possible(tmp_path, least, share):
    """Burden B in [1, 15] m, 5 m of stemming and a rule B <= 5 m / k: (15 - 5 / k) / 14 break it.

    A third of the designs with k = 0.5, which is drawn anew; ten in fourteen with k = 1, which is
    refused. The share is exact to one of the 500 strata of the trial.
    """
    variables = {
        "burden": {"lower": "1 m", "upper": "15 m"},
        "bench_height": "10 m",
        "charge_length": "5 m",
    }
    changes = {"variables": variables, "constraints": {"minimum_stemming_ratio": least}}
    if share is None:
        _, design = design_of(tmp_path, size=1000, **changes)
        assert design.columns["burden"].max() <= 10.0
        assert 1000 / design.drawn == pytest.approx(9 / 14, abs=0.005)
        return
    with pytest.raises(SpecError, match=share) as caught:
        design_of(tmp_path, **changes)
    assert f"stemming_length below {least:g} burden" in str(caught.value)


def test_no_room_for_a_charge_names_the_physics(tmp_path):
    """A charge must be a column: the hole is too wide for the charges that fit."""
    variables = {
        "hole_diameter": "300 mm",
        "bench_height": "5 m",
        "charge_length": {"lower": "1 m", "upper": "1.5 m"},
    }
    with pytest.raises(SpecError, match="no room for a column charge"):
        design_of(tmp_path, variables=variables)


NARROW = {  # soft rock, wide holes: in one bench of six the hole is as wide as burden or spacing
    "ucs": {"lower": "10 MPa", "upper": "40 MPa", "distribution": "log_uniform"},
    "burden": {"lower": "0.3 m", "upper": "2 m"},
    "spacing": {"lower": 1.0, "upper": 1.5, "ratio_of": "burden"},
    "hole_diameter": "250 mm",
    "bench_height": "10 m",
}


def test_a_hole_that_outgrows_its_bench_is_drawn_anew(tmp_path):
    """All rows end well in the real physics; the others are those of the plain draw."""
    path = write_recipe(tmp_path / "r.yaml", variables=NARROW, size=60, constraints=None)
    recipe, simulator = load_recipe(path).recipe, fake_simulator(path)
    design = make_design(recipe, simulator, str(path))
    plain = make_design(recipe, Credulous(simulator), str(path))
    moved = design.columns["burden"] != plain.columns["burden"]
    assert 3 <= moved.sum() <= 30
    for name in ("explosive", "split", "sample"):
        assert np.array_equal(getattr(design, name), getattr(plain, name))
    assert np.all(design.batch[moved] > plain.batch.max())
    assert design.drawn >= plain.drawn + moved.sum()

    def status(rows):
        return run_blasts(simulator.explosives, rows.explosive, rows.inputs).status

    assert np.all(status(design) == Status.OK)
    assert np.array_equal(status(plain) == Status.BAD_INPUT, moved)
    again = make_design(recipe, simulator, str(path))
    assert np.array_equal(again.columns["burden"], design.columns["burden"])


class Credulous:
    """A simulator that lets every hole expand."""

    def __init__(self, real):
        self.real = real

    def __getattr__(self, name):
        return getattr(self.real, name)

    def outgrown(self, inputs, explosive):
        return np.zeros(len(explosive), dtype=bool)


def test_ranges_in_which_no_hole_fits_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("castblast.dataset.rows.design._MOST_BATCHES", 3)
    variables = NARROW | {"burden": {"lower": "0.25 m", "upper": "0.3 m"}, "ucs": "10 MPa"}
    path = write_recipe(tmp_path / "r.yaml", variables=variables, size=4)
    with pytest.raises(SpecError, match="still expand as wide as their burden or spacing"):
        make_design(load_recipe(path).recipe, fake_simulator(path), str(path))
