"""More rows for a design that has rows: ids, batches and splits go on, what was there stays."""

import numpy as np
import pytest
from fake_blast import fake_simulator, write_recipe

from castblast.dataset.rows.design import extend_design, join_designs, make_design
from castblast.errors import SpecError
from castblast.specs.recipe import load_recipe


@pytest.fixture
def parts(tmp_path):
    path = write_recipe(tmp_path / "r.yaml", size=100)
    recipe, simulator = load_recipe(path).recipe, fake_simulator(path)
    return recipe, simulator, make_design(recipe, simulator, str(path))


def extended(parts, add, old=None):
    recipe, simulator, base = parts
    old = old or base
    after = {"first_sample": int(old.sample.max()) + 1, "first_batch": int(old.batch.max()) + 1}
    return extend_design(recipe, simulator, "r.yaml", add=add, **after)


def test_ids_and_batches_go_on(parts):
    base, more = parts[2], extended(parts, 40)
    assert more.sample.tolist() == list(range(100, 140))
    assert set(more.batch) == set(range(base.batch.max() + 1, more.batch.max() + 1))
    for name, values in more._asdict().items():
        if isinstance(values, np.ndarray):
            assert values.dtype == getattr(base, name).dtype, name
    assert list(more.inputs) == list(base.inputs)


def test_new_rows_are_balanced_among_themselves(parts):
    """Old rows keep their split, so the shares must hold in the new ones alone."""
    more = extended(parts, 40)
    assert np.bincount(more.split).tolist() == [32, 2, 2, 4]
    counts = np.bincount(more.explosive)
    assert counts.max() - counts.min() <= 1


def test_each_first_batch_is_a_latin_hypercube_of_its_own(parts):
    """With nothing dropped there is one value in each of n equal parts of a marginal."""
    recipe, simulator, base = parts
    roomy = recipe.model_copy(update={"variables": {"ucs": recipe.variables["ucs"]}, "size": 30})
    after = {"first_sample": 100, "first_batch": int(base.batch.max()) + 1}
    design = extend_design(roomy, simulator, "r.yaml", add=50, **after)
    assert design.drawn == 50
    strata = np.log(design.columns["ucs"] / 10e6) / np.log(20.0) * 50
    assert sorted(np.floor(strata).astype(int)) == list(range(50))


def test_new_rows_obey_the_rules_and_are_new(parts):
    base, more = parts[2], extended(parts, 100)
    assert (more.inputs["stemming_length"] / more.inputs["burden"]).min() >= 0.4
    assert not np.intersect1d(base.columns["burden"], more.columns["burden"]).size
    assert not np.array_equal(base.split, more.split)
    assert not np.array_equal(base.explosive, more.explosive)


def test_the_same_steps_give_the_same_rows(parts):
    """Size of the recipe and order of calls do not matter; numbers of batch and seed do."""
    recipe, simulator, base = parts
    one, same = extended(parts, 40), extended(parts, 40)
    larger = (recipe.model_copy(update={"size": 140}), simulator, base)
    for other in (same, extended(larger, 40)):
        for name, values in one.inputs.items():
            assert np.array_equal(values, other.inputs[name])
        assert np.array_equal(one.split, other.split)
        assert np.array_equal(one.explosive, other.explosive)
    twice = extended(parts, 40, old=one)
    assert twice.sample[0] == 140
    assert not np.array_equal(one.columns["ucs"], twice.columns["ucs"])
    reseeded = (recipe.model_copy(update={"seed": 8}), simulator, base)
    assert not np.array_equal(one.columns["ucs"], extended(reseeded, 40).columns["ucs"])


def test_joined_designs_begin_with_the_old_rows(parts):
    base, more = parts[2], extended(parts, 40)
    whole = join_designs([base, more])
    assert whole.sample.tolist() == list(range(140))
    assert whole.drawn == base.drawn + more.drawn
    for name in ("explosive", "split", "batch"):
        assert np.array_equal(getattr(whole, name)[:100], getattr(base, name)), name
        assert np.array_equal(getattr(whole, name)[100:], getattr(more, name)), name
    for name, values in whole.inputs.items():
        assert np.array_equal(values[:100], base.inputs[name]), name


def test_impossible_ranges_stop_an_extension_too(parts):
    recipe, simulator, base = parts
    rules = recipe.constraints.model_copy(update={"minimum_charge_length": 8.9})
    strict = (recipe.model_copy(update={"constraints": rules}), simulator, base)
    with pytest.raises(SpecError, match=r"charge_length below 8\.9 m"):
        extended(strict, 5)
