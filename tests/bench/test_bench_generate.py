"""Speed of `castblast generate` on the full recipe, physics and file included.

Libraries and kernels are loaded before. What a stand-in for the physics shows is in
`test_bench_dataset.py`.
"""

import re
import time

import pytest

import castblast.burden.batch
import castblast.nearfield.lockstep.batch
from castblast.dataset.file.provenance import load_explosives
from castblast.dataset.rows.design import make_design
from castblast.dataset.rows.simulation import blast_simulator
from castblast.specs.recipe import load_recipe
from castblast.stages.datasets.generate import generate

ROWS = 4000
DESIGN_ROWS = 100_000
#: Samples per second that give 10,000 in 30 s, and a million in 50 minutes.
RATE = 10_000 / 30
#: Wall time of `generate` by the number of workers.
SECONDS: dict[int, float] = {}


@pytest.fixture(scope="module")
def recipe(repository):
    return repository / "data_specs" / "recipes" / "full.yaml"


@pytest.fixture(scope="module")
def make_rows(recipe):
    """Simulator and design of so many rows."""

    def make(rows):
        source = load_recipe(recipe, rows)
        explosives = tuple(entry.spec.to_explosive() for entry in load_explosives(source))
        simulator = blast_simulator(source.recipe, explosives)
        return simulator, make_design(source.recipe, simulator, "full")

    return make


def timed(call, into):
    """Note the processor time of the thread that every call takes."""

    def run(*arguments):
        begin = time.thread_time()
        result = call(*arguments)
        into.append(time.thread_time() - begin)
        return result

    return run


@pytest.fixture
def in_kernels(monkeypatch):
    """Processor seconds of the kernels, call by call."""
    seconds = []
    for module, name in (
        (castblast.nearfield.lockstep.batch, "march_many"),
        (castblast.burden.batch, "_solve_rows"),
    ):
        monkeypatch.setattr(module, name, timed(getattr(module, name), seconds))
    return seconds


@pytest.mark.benchmark(group=f"generate, {ROWS} rows of the full recipe")
@pytest.mark.parametrize("workers", [1, 2])
def test_generate(benchmark, recipe, tmp_path, figure, in_kernels, workers):
    """Marks: 10,000 samples in 30 s on two cores; less than 3 % of the time for scheduling."""
    generate(recipe, tmp_path / "first", size=2)  # imports, and kernels that may be compiled
    in_kernels.clear()
    begin = time.process_time()
    outcome = benchmark.pedantic(
        generate, (recipe, tmp_path), {"size": ROWS, "workers": workers}, rounds=1
    )
    spent = time.process_time() - begin
    seconds = SECONDS[workers] = benchmark.stats.stats.min
    mark = {"at_least": round(RATE)} if workers == 2 else {}
    name = f"generate, {workers} worker{'s'[: workers - 1]}"
    figure(name, ROWS / seconds, "samples/s", **mark)
    share = float(re.search(r"scheduling ([\d.]+)%", "\n".join(outcome.lines))[1])
    figure(f"{name}: scheduling", share, "%", at_most=3.0)
    beside = 100.0 * (1.0 - sum(in_kernels) / spent)
    figure(f"{name}: processor time beside the kernels", beside, "%")
    if workers == 2 and 1 in SECONDS:
        figure("generate: speed of 2 workers over 1", SECONDS[1] / seconds)


@pytest.mark.benchmark(group="generate, parts")
def test_python_around_kernels(benchmark, make_rows, figure, in_kernels):
    """Mark: at most 20 us a row for everything in a shard that is not a kernel.

    In processor time, as differences of wall time mean nothing on a busy machine.
    """
    simulator, design = make_rows(1000)
    simulator.run(
        {name: values[:9] for name, values in design.inputs.items()}, design.explosive[:9]
    )
    in_kernels.clear()
    whole = []
    arguments = (design.inputs, design.explosive)
    benchmark.pedantic(timed(simulator.run, whole), arguments, rounds=1)
    around = (sum(whole) - sum(in_kernels)) / 1000
    figure("Python around the kernels", 1e6 * around, "us/row", at_most=20.0)


@pytest.mark.benchmark(group="generate, parts")
def test_design(benchmark, make_rows, figure):
    """Mark: at most 20 us a row."""
    benchmark.pedantic(make_rows, (DESIGN_ROWS,), rounds=1)
    figure("design", 1e6 * benchmark.stats.stats.min / DESIGN_ROWS, "us/row", at_most=20.0)
