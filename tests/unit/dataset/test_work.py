"""Parts of a build: spans of rows, blocks, running hashes and the meter, each by itself."""

import numpy as np
import pytest
from fake_blast import fake_generate, fake_simulator, write_recipe

from castblast.dataset.building.assemble import regroup
from castblast.dataset.building.meter import Meter
from castblast.dataset.building.process import peak_memory
from castblast.dataset.building.shards import ShardReport, Span, find_spans, read_shard, run_shard
from castblast.dataset.building.work import Work
from castblast.dataset.file.content import ContentHash, content_hash
from castblast.dataset.file.store import open_dataset, reading_dataset, row_blocks, write_blocks
from castblast.dataset.rows.design import make_design
from castblast.errors import DatasetError
from castblast.specs.recipe import load_recipe


@pytest.fixture
def work(tmp_path):
    recipe = write_recipe(tmp_path / "r.yaml")
    simulator = fake_simulator(recipe)
    design = make_design(load_recipe(recipe).recipe, simulator, "")
    return Work(design, simulator, "0" * 64, tmp_path, 25)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    folder = tmp_path_factory.mktemp("work")
    return fake_generate(write_recipe(folder / "r.yaml"), folder / "data.nc").path


def test_missing_spans_are_the_gaps_cut_to_shards(work):
    assert list(work.missing()) == [(0, 25), (25, 50), (50, 60)]
    work.mark(Span(3, 10), np.zeros(7, dtype=np.int8))
    work.mark(Span(40, 60), np.ones(20, dtype=np.int8))
    assert list(work.missing()) == [(0, 3), (10, 35), (35, 40)]
    assert (work.done, work.failed) == (27, 20)


def test_shards_of_any_cut_are_found_again(work):
    """Two runs with other sizes of shards, the first one stopped: together they are complete."""
    for task in list(work.tasks())[1:2]:
        run_shard(task)
    again = Work(work.design, work.simulator, work.rows_sha256, work.folder, 9)
    assert again.resume() == (1, 0)
    for task in again.tasks():
        run_shard(task)
    whole = np.concatenate([part.outputs["burden_velocity"] for part in again.results()])
    straight = work.simulator.run(work.design.inputs, work.design.explosive)
    np.testing.assert_array_equal(whole, straight.outputs["burden_velocity"])


def test_a_missing_shard_is_named(work):
    tasks = list(work.tasks())
    run_shard(tasks[0])
    with pytest.raises(DatasetError, match="the shard from row 25 on is missing"):
        list(work.results())


def test_of_overlapping_shards_the_earlier_counts(tmp_path):
    for span in (Span(0, 10), Span(5, 15), Span(10, 12), Span(20, 20), Span(12, 30)):
        (tmp_path / span.file_name).touch()
    (tmp_path / "shard-000000000-000000010.npz.cut").touch()
    assert find_spans(tmp_path) == [(0, 10), (10, 12), (12, 30)]


@pytest.mark.parametrize("what", ["span", "origin", "outputs"])
def test_a_shard_of_something_else_is_refused(work, what):
    """The right content under the name of other rows, of another recipe, with other outputs."""
    run_shard(next(work.tasks()))
    span, origin, names = Span(0, 25), work.rows_sha256, work.simulator.output_names
    assert len(read_shard(work.folder, span, origin, names).status) == 25
    if what == "span":
        other = Span(25, 50)
        (work.folder / span.file_name).rename(work.folder / other.file_name)
        span = other
    elif what == "origin":
        origin = "1" * 64
    else:
        names = names[1:]
    with pytest.raises(DatasetError, match=r"damaged|something else|other variables"):
        read_shard(work.folder, span, origin, names)


@pytest.mark.parametrize("rows", [1, 7, 25, 60, 100])
def test_regrouped_rows_are_the_same_rows(work, rows):
    parts = [work.simulator.run(task.inputs, task.explosive) for task in work.tasks()]
    blocks = list(regroup(parts, rows))
    assert [len(block.status) for block in blocks[:-1]] == [rows] * (len(blocks) - 1)
    assert sum(len(block.status) for block in blocks) == 60
    for name in parts[0].outputs:
        np.testing.assert_array_equal(
            np.concatenate([block.outputs[name] for block in blocks]),
            np.concatenate([part.outputs[name] for part in parts]),
        )


@pytest.mark.parametrize("rows", [1, 13, 60, 1000])
def test_the_hash_does_not_depend_on_blocks(file, rows):
    with reading_dataset(file) as dataset:
        running = ContentHash()
        for block in row_blocks(dataset, rows):
            running.add(block)
        assert running.hexdigest() == dataset.attrs["content_sha256"]
    assert content_hash(open_dataset(file)) == running.hexdigest()


def test_bytes_do_not_depend_on_blocks(file, tmp_path, monkeypatch):
    """Blocks of one, of three and of all chunks; the last chunk is not full."""
    monkeypatch.setattr("castblast.dataset.file.store.CHUNK_ROWS", 8)
    dataset = open_dataset(file)
    written = []
    for rows in (8, 24, 64):
        write_blocks(tmp_path / "data.nc", 60, row_blocks(dataset, rows))
        written.append((tmp_path / "data.nc").read_bytes())
    assert written[0] == written[1] == written[2]
    assert open_dataset(tmp_path / "data.nc").identical(dataset)


def test_a_block_too_few(file, tmp_path):
    dataset = open_dataset(file)
    blocks = row_blocks(dataset.isel(sample=slice(0, 40)))
    with pytest.raises(ValueError, match="40 rows came, 60 were announced"):
        write_blocks(tmp_path / "data.nc", 60, blocks)


def report(worker, begin, end, rows=10, process="elsewhere", peak=0):
    status = np.zeros(rows, dtype=np.int8)
    return ShardReport(Span(0, rows), status, worker, process, begin, end, peak)


def test_meter_adds_up_the_gaps_between_shards():
    """Two workers with clocks of their own: 1 of 5 s and 1 of 5 s without a shard."""
    meter = Meter()
    for entry in (
        report("a", 102.0, 105.0), report("a", 100.0, 101.0), report("b", 7.0, 9.0),
        report("b", 10.0, 12.0, peak=5_000_000),
    ):  # fmt: skip
        meter.add(entry)
    assert meter.scheduling_share == pytest.approx(2.0 / 10.0)
    assert meter.rows == 40
    assert meter.memory.endswith("MB, largest worker 5 MB")


def test_peak_memory_covers_what_is_held():
    held = np.ones(40_000_000)
    assert held.nbytes < peak_memory() < 1e12
