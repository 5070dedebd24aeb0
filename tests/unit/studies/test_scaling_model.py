"""The scaling law of builds against a simulation of its queue, and its limits.

No figure of any machine: costs are drawn at random or chosen so that the answer is known.
"""

import heapq
from dataclasses import dataclass
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scaling_law import (
    GOOD_ENOUGH,
    SHARD_SIZES,
    Build,
    Costs,
    Means,
    Sizes,
    best_shard_size,
    core_hours,
    even_parts,
    parts_for_memory,
    plan,
    predict,
    worker_seconds,
)

seconds = st.floats(0.0, 10.0)
some_costs = st.builds(Costs, *([seconds] * len(Costs._fields)))
sizes = Sizes(memory=1e3, row_memory=10.0, row_shard=5.0, row_file=3.0, row_task=4.0)
shard_counts, worker_counts = st.integers(1, 60), st.integers(1, 80)


@dataclass
class Queue:
    """One coordinator that hands out shards one by one; workers that take them when free."""

    hand_out: float
    run: float

    def end(self, shards, workers):
        free = [0.0] * workers
        for number in range(1, shards + 1):
            begin = max(heapq.heappop(free), number * self.hand_out)
            heapq.heappush(free, begin + self.run)
        return max(free)


@given(hand_out=seconds, run=seconds, shards=shard_counts, workers=worker_counts)
def test_shards_end_as_in_a_simulated_queue(hand_out, run, shards, workers):
    """The closed form is the exact end of a greedy queue with releases at i c and service t."""
    costs = Costs(task=hand_out, shard=run)
    predicted = predict(costs, sizes, Build(shards, workers, 1)).shards
    expected = Queue(hand_out, run).end(shards, workers)
    assert predicted == pytest.approx(expected, rel=1e-12, abs=1e-12)


@given(costs=some_costs, shards=shard_counts, rows=st.integers(1, 50))
def test_one_worker_costs_the_sum(costs, shards, rows):
    """One worker does everything in turn; only handing out runs beside it, except for one shard."""
    costs = costs._replace(task=0.0, send=0.0)
    n = shards * rows
    total = (
        costs.start + costs.connect + costs.warm + costs.end
        + n * (costs.design + costs.sample + costs.write + costs.final)
        + shards * (costs.gap + costs.shard + costs.final_shard)
    )  # fmt: skip
    assert predict(costs, sizes, Build(n, 1, rows)).wall == pytest.approx(total)


@given(costs=some_costs, shards=shard_counts, rows=st.integers(1, 50))
def test_endless_workers_leave_the_serial_part(costs, shards, rows):
    """What is left: fixed costs, drawing, handing out everything, one shard, joining."""
    n = shards * rows
    serial = (
        costs.start + costs.connect + costs.warm + costs.end
        + n * (costs.design + costs.final + costs.send)
        + shards * (costs.final_shard + costs.task)
    )  # fmt: skip
    expected = serial + worker_seconds(costs, rows)
    assert predict(costs, sizes, Build(n, 10**9, rows)).wall == pytest.approx(expected)


@given(costs=some_costs, n=st.integers(1, 500), rows=st.integers(1, 50), workers=worker_counts)
def test_more_workers_never_take_longer(costs, n, rows, workers):
    fewer = predict(costs, sizes, Build(n, workers, rows)).wall
    more = predict(costs, sizes, Build(n, workers + 1, rows)).wall
    assert more <= fewer * (1.0 + 1e-12)


@given(costs=some_costs, n=st.integers(1, 500), workers=worker_counts)
def test_workers_cannot_gain_more_than_their_number(costs, n, workers):
    """Speed-up is at most the number of workers."""
    one, many = (predict(costs, sizes, Build(n, w, 10)).wall for w in (1, workers))
    assert many >= one / workers * (1.0 - 1e-12)


@pytest.mark.parametrize(
    ("name", "costs", "rate"),
    [
        ("start", Costs(start=1e9, sample=1.0), inf),
        ("workers", Costs(sample=1.0), inf),
        ("scheduler", Costs(task=1e3, sample=1.0), inf),
        ("disk", Costs(sample=1.0), 1e-3),
        ("assembly", Costs(sample=1.0, final=1.0), inf),
    ],
)
def test_limit_is_named(name, costs, rate):
    assert predict(costs, sizes, Build(1000, 10, 10), rate).limit == name


def test_full_disk_rate_is_the_time_to_write_everything():
    assert predict(Costs(), sizes, Build(1000, 10, 10), 50.0).shards == 1000 * 5.0 / 50.0


@given(costs=some_costs, n=st.integers(1, 10**6), workers=worker_counts)
def test_recommended_shard_is_good(costs, n, workers):
    """No other allowed size is better by more than the margin, and no smaller one as good."""
    chosen = best_shard_size(costs, sizes, n, workers)
    walls = {
        size: predict(costs, sizes, Build(n, workers, min(size, n))).wall
        for size in SHARD_SIZES
        if worker_seconds(costs, size) <= max(60.0, worker_seconds(costs, chosen))
    }
    assert walls[chosen] <= GOOD_ENOUGH * min(walls.values()) * (1.0 + 1e-12)


@pytest.mark.parametrize(("samples", "parts"), [(1, 1), (100, 1), (101, 2), (1000, 10)])
def test_parts_fill_the_memory(samples, parts):
    """Room for 100 samples beside what a coordinator needs by itself."""
    assert parts_for_memory(sizes, samples, 1e3 + 100 * 10.0) == parts


def test_coordinator_without_room_is_refused():
    with pytest.raises(ValueError, match="cannot start"):
        parts_for_memory(sizes, 10, 1e3)


@given(parts=st.integers(1, 100), workers=worker_counts)
def test_even_parts_leave_no_worker_idle(parts, workers):
    """Whole workers for every part, or whole rounds of parts; never fewer than asked for."""
    even = even_parts(parts, workers)
    assert even >= parts
    assert workers % even == 0 if even <= workers else even % workers == 0
    assert even < parts + workers


@given(costs=some_costs, n=st.integers(1, 10**5), workers=worker_counts)
def test_core_hours_are_never_less_than_the_physics(costs, n, workers):
    made = plan(costs, sizes, Means(memory=1e3 + 1e5), n, workers)
    assert made.core_hours * 3600.0 >= n * costs.sample * (1.0 - 1e-12)


def test_parts_take_turns_on_too_few_workers():
    """Ten parts on two workers: five turns of two parts side by side, so half the sum."""
    costs = Costs(sample=1.0, final=0.5)
    made = plan(costs, sizes, Means(memory=1e3 + 100 * 10.0), 1000, 2)
    assert (made.parts, made.build.workers, made.build.samples) == (10, 1, 100)
    assert made.prediction.wall == pytest.approx(1000 * 1.5 / 2)
    assert made.memory <= 1e3 + 100 * 10.0


def test_parts_share_workers_and_disk():
    """Physics and disk gain nothing from parts; the joining of files does."""
    costs, means = Costs(final=1.0), Means(disk_rate=10.0)
    one, ten = (plan(costs, sizes, means, 1000, 10, parts=p).prediction for p in (1, 10))
    assert one.shards == ten.shards == 1000 * 5.0 / 10.0
    assert one.after == pytest.approx(10.0 * ten.after)


def test_core_hours_count_workers_while_there_are_shards():
    prediction = predict(Costs(sample=3600.0, final=3600.0), sizes, Build(4, 2, 1))
    assert core_hours(prediction, 2) == pytest.approx(2 * 2 + 2 + 4)
