"""The pair list against brute force: no pair that may touch before the horizon is missing."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from castblast.muckpile.bench.geometry import Bench, assign_blocks, block_shape
from castblast.muckpile.search.neighbours import make_grid, sort_by_cell
from castblast.muckpile.search.pair_search import list_pairs
from castblast.muckpile.search.paths import lay_out


def listed_pairs(position, velocity, radius, skin, horizon, held=None):
    """Pairs of the list, as the solver makes it, in the caller's numbering."""
    middle = position + 0.5 * horizon * velocity
    spread = velocity - velocity.mean(axis=0)
    fastest = float(np.sqrt(np.max(np.sum(spread**2, axis=1))))
    reach = 2.0 * float(radius.max()) + skin + fastest * horizon
    grid = make_grid(middle.min(axis=0), middle.max(axis=0), reach, len(radius))
    path = np.column_stack([position, velocity]).astype(np.float32)
    order, cell_start, slab = sort_by_cell(path, grid, 0.5 * horizon)
    held = np.zeros(0, dtype=bool) if held is None else held[order]
    paths = lay_out(path, radius, order, skin)
    start, partner = list_pairs(paths, held, cell_start, slab, grid, horizon, guess=0.5)
    n = len(radius)
    first = np.repeat(np.arange(n), np.diff(start))
    slab_of = np.searchsorted(slab, np.arange(n), side="right")
    assert np.all(partner > first)
    assert np.all(slab_of[partner] - slab_of[first] <= 1)
    found = {tuple(sorted(pair)) for pair in zip(order[first], order[partner], strict=True)}
    assert len(found) == len(partner)
    return found


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(2, 120),
    skin=st.floats(0.0, 0.2),
    horizon=st.sampled_from([0.0, 0.001, 0.02]),
    flat=st.booleans(),
)
def test_list_is_complete(seed, count, skin, horizon, flat):
    """Every pair that comes within the skin of contact at any of 50 times is in the list."""
    rng = np.random.default_rng(seed)
    size = np.array([2.0, 1.0, 0.0 if flat else 1.0])
    position = rng.uniform(0.0, 1.0, (count, 3)) * size
    velocity = rng.normal(0.0, 10.0, (count, 3))
    position, velocity = (np.float32(path).astype(float) for path in (position, velocity))
    velocity[:, 0] += 12.7
    if horizon == 0.0:
        velocity[:] = 0.0
    radius = rng.uniform(0.02, 0.1, count)
    found = listed_pairs(position, velocity, radius, skin, horizon)
    first, second = np.triu_indices(count, 1)
    least = np.full(len(first), np.inf)
    for time in np.linspace(0.0, horizon, 50):
        at = position + time * velocity
        least = np.minimum(least, np.linalg.norm(at[first] - at[second], axis=1))
    near = least < (radius[first] + radius[second] + skin) * (1.0 - 1e-12)
    needed = set(zip(first[near], second[near], strict=True))
    assert needed <= found
    held = rng.random(count) < 0.5
    loose = listed_pairs(position, velocity, radius, skin, horizon, held)
    assert loose == {pair for pair in found if not held[list(pair)].all()}


@settings(max_examples=60, deadline=None)
@given(
    x=st.floats(-30.0, 5.0),
    y=st.floats(-5.0, 90.0),
    burden=st.floats(0.5, 10.0),
    spacing=st.floats(0.5, 10.0),
)
def test_every_place_has_a_block(x, y, burden, spacing):
    bench = Bench(burden=burden, spacing=spacing)
    rows, columns = block_shape(bench)
    block = int(assign_blocks(np.array([[x, y, 1.0]]), bench)[0])
    assert 0 <= block < rows * columns
    row, column = divmod(block, columns)
    if -bench.width < x < 0.0 and 0.0 < y < bench.length:
        assert row * burden - 1e-9 <= -x <= (row + 1) * burden + 1e-9
        assert column * spacing - 1e-9 <= y <= (column + 1) * spacing + 1e-9
