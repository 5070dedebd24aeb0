"""Batches of designs to simulate next: where the worth is, apart from each other."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from castblast.errors import SpecError
from castblast.network import evaluate_rows, member_spread
from castblast.specs.models.model import PAPER_FEATURES, PAPER_TARGETS, MlpSpec, RidgeSpec
from castblast.surrogate.fitting.features import read_table
from castblast.surrogate.fitting.training import fit_spec
from castblast.surrogate.searching.ensemble import ensemble_spread, fit_members
from castblast.surrogate.searching.infill import choose_batch, infill_worth


def nearest_gaps(points: np.ndarray) -> np.ndarray:
    return cKDTree(points).query(points, k=2)[0][:, 1]


def test_with_equal_worth_the_rows_fill_the_space() -> None:
    """Nothing else to go by: the closest pair is much farther apart than among random rows."""
    points = np.random.default_rng(0).random((2000, 2))
    chosen = choose_batch(points, np.zeros(2000, dtype=np.int64), np.ones(2000), 50)
    assert len(set(chosen.tolist())) == 50
    random = np.median([nearest_gaps(points[i : i + 50]).min() for i in range(0, 2000, 50)])
    assert nearest_gaps(points[chosen]).min() > 5.0 * random


def test_rows_follow_the_worth() -> None:
    """Worth 10 in a tenth of the square and 1 elsewhere: the first rows lie in the tenth, dense."""
    points = np.random.default_rng(1).random((4000, 2))
    rich = points[:, 0] < 0.1
    chosen = choose_batch(points, np.zeros(4000, dtype=np.int64), np.where(rich, 10.0, 1.0), 60)
    assert rich[chosen[:10]].all()
    assert 0.2 < rich[chosen].mean() < 0.9
    useless = np.where(rich, 1.0, 1e-12)
    assert rich[choose_batch(points, np.zeros(4000, dtype=np.int64), useless, 20)].all()


def test_any_first_part_of_a_batch_was_taken_first() -> None:
    """The worth left falls from row to row; one row is the best row."""
    rng = np.random.default_rng(2)
    points, worth = rng.random((500, 3)), rng.random(500)
    chosen = choose_batch(points, np.zeros(500, dtype=np.int64), worth, 30)
    assert chosen[0] == np.argmax(worth)


def test_a_row_of_one_explosive_does_not_stand_for_another() -> None:
    """Two equal sets of points, one per explosive: both are taken in turn at the same places."""
    points = np.tile(np.random.default_rng(3).random((200, 2)), (2, 1))
    kinds = np.repeat([0, 1], 200)
    chosen = choose_batch(points, kinds, np.ones(400), 40)
    assert np.count_nonzero(kinds[chosen] == 0) == 20
    assert set((chosen % 200).tolist()[:20]) <= set(chosen[kinds[chosen] == 0].tolist())


def test_equal_points_and_a_whole_pool_can_be_chosen() -> None:
    points = np.zeros((6, 2))
    chosen = choose_batch(points, np.zeros(6, dtype=np.int64), np.arange(1.0, 7.0), 6)
    assert sorted(chosen.tolist()) == list(range(6))


def test_worth_measures_every_target_in_its_own_median() -> None:
    """Target 2 has a hundred times the spread of target 1; both count alike."""
    spread = np.array([[1.0, 100.0], [2.0, 100.0], [1.0, 200.0]])
    expected = np.sqrt([1.0, (4.0 + 1.0) / 2.0, (1.0 + 4.0) / 2.0])
    np.testing.assert_allclose(infill_worth(spread), expected)


QUICK = MlpSpec(name="q", hidden_layers=(5,), max_iterations=40, target_transform="log", restarts=2)


@pytest.fixture(scope="module")
def table(toy_dataset):
    return read_table(toy_dataset(600), PAPER_FEATURES, PAPER_TARGETS)


def test_members_travel_in_the_network(table) -> None:
    """The spread of the record is that of the estimators, and the value stays the first one's."""
    fits = fit_members(QUICK, table, 3)
    assert [fit.restart.seed for fit in fits] == [0, 1, 2]
    others = tuple(fit.network.layers for fit in fits[1:])
    network = replace(fits[0].network, members=others)
    frame = table.frame.iloc[:50]
    numeric = frame[list(network.input_names)].to_numpy()
    index = np.array([network.explosives.index(name) for name in frame["explosive"]])
    found = member_spread(network, numeric, index)
    np.testing.assert_allclose(found, ensemble_spread(fits, frame), rtol=1e-9)
    assert (found > 0.0).all()
    own = evaluate_rows(fits[0].network, numeric, index)
    np.testing.assert_array_equal(evaluate_rows(network, numeric, index), own)


def test_restarts_that_were_not_chosen_can_travel(table) -> None:
    """The members are the other restarts, whichever of them the validation rows chose."""
    one = fit_spec(QUICK.model_copy(update={"keep_members": True}), table)
    assert len(one.network.members) == 1
    assert fit_spec(QUICK, table).network.members == ()
    other = fit_members(QUICK, table, 2)[1 - one.chosen]
    for mine, its in zip(one.network.members[0], other.network.layers, strict=True):
        np.testing.assert_array_equal(mine.weights, its.weights)


def test_what_cannot_be_an_ensemble_is_refused(table) -> None:
    with pytest.raises(SpecError, match=r"ridge.*has no random start"):
        fit_members(RidgeSpec(name="ridge"), table, 3)
    with pytest.raises(SpecError, match="members: 1; an ensemble needs"):
        fit_members(QUICK, table, 1)
