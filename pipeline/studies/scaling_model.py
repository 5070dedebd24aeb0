"""How wall time and cost of a dataset grow with samples and workers: measured parts, one law.

    python pipeline/studies/scaling_model.py         # about three minutes on two cores

Measures what the parts of a build cost here, predicts builds from that by the law of
`scaling_law.py`, checks the law against builds whose simulator sleeps, and writes the tables and
the figure of `pipeline/docs/scaling.md` between their marks.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from mesh_study import put
from scaling_costs import Measured, measure
from scaling_law import Build, Means, Plan, Prediction, plan, predict
from scaling_runs import Order, Timed, cluster, timed

from castblast.disk.files import write_text
from castblast.report.style import CYCLE, GREY, in_style, new_figure, save_figure

PAGE = Path(__file__).resolve().parent.parent / "docs/scaling.md"
SAMPLES = (10**6, 10**7, 10**8, 10**9)
WORKERS = (1, 2, 8, 32, 100, 300, 1000)
#: Datasets side by side that the second table tries.
PARTS = (1, 10, 100)
#: The check: samples, rows of a shard, sleep per sample [s], workers. The last wave of the
#: second of each number of workers is not full.
CHECKS = (
    Order(8_000, 500, 1e-3, 2),
    Order(9_000, 1000, 1e-3, 2),
    Order(16_000, 500, 2e-3, 8),
    Order(21_000, 1000, 2e-3, 8),
    Order(48_000, 500, 4e-3, 32),
    Order(34_000, 250, 4e-3, 32),
)
_THREADS = "threads of one process"
_PROCESSES = 2
#: Load before the start above which the figures are not to be trusted.
_BUSY = 1.5
_UNITS = ((86_400.0, "d"), (3600.0, "h"), (60.0, "min"), (1.0, "s"))


class Check(NamedTuple):
    """A build as predicted and as measured."""

    order: Order
    where: str
    predicted: Prediction
    measured: Timed

    @property
    def error(self) -> float:
        """Departure of the predicted wall time [percent]."""
        return 100.0 * (self.predicted.wall / self.measured.wall - 1.0)

    @property
    def shards_error(self) -> float:
        """Departure of the predicted time from first to last shard [percent]."""
        return 100.0 * (self.predicted.shards / self.measured.shards - 1.0)


def check(folder: Path, measured: Measured) -> list[Check]:
    """Time builds with sleeping workers, over TCP and in one process, beside their prediction."""
    done = []

    def compare(order: Order, where: str) -> None:
        build = Build(order.samples, order.workers, order.shard_size)
        costs = measured.without_physics._replace(sample=order.sleep)
        done.append(
            Check(order, where, predict(costs, measured.sizes, build), timed(folder, order))
        )
        print(_check_row(done[-1]), flush=True)

    for workers in sorted({order.workers for order in CHECKS}):
        with cluster(folder, _PROCESSES, workers // _PROCESSES) as (address, _):
            timed(folder, Order(40 * workers, 10, 0.0, workers, address))  # workers import
            for order in CHECKS:
                if order.workers == workers:
                    compare(order._replace(scheduler=address), "TCP")
    compare(CHECKS[2], _THREADS)
    return done


def _check_row(done: Check) -> str:
    order, predicted, measured = done.order, done.predicted, done.measured
    return (
        f"| {order.workers} | {done.where} | {order.samples:,} | {order.shard_size} "
        f"| {1e3 * order.sleep:g} | {predicted.shards:.2f} | {measured.shards:.2f} "
        f"| {done.shards_error:+.1f} % | {predicted.wall:.2f} | {measured.wall:.2f} "
        f"| {done.error:+.1f} % |"
    )


def check_table(done: Sequence[Check]) -> list[str]:
    """Prediction against measurement."""
    head = (
        "| workers | where | samples | shard | sleep [ms] | shards: predicted [s] | measured [s] "
        "| error | all: predicted [s] | measured [s] | error |"
    )
    worst = max(abs(one.error) for one in done)
    passed = "within" if worst <= 10.0 else "NOT within"
    note = f"Largest error of the wall time: {worst:.1f} %, {passed} the 10 % asked for."
    return [head, "|---:|---|" + "---:|" * 9, *map(_check_row, done), "", note]


def costs_table(measured: Measured, load: float) -> list[str]:
    """What the parts cost."""
    costs, sizes = measured.costs, measured.sizes
    fixed = f"{costs.start:.2f}, {costs.connect:.2f}, {costs.end:.2f} s"
    memory = f"{sizes.memory / 1e9:.2f} GB + {sizes.row_memory:.0f} B per sample"
    serial = "coordinator, serial"
    rows = [
        ("start, connect, end of a build", fixed, serial),
        ("drawing the design, per sample", f"{1e6 * costs.design:.1f} us", serial),
        ("joining, writing, checking, per sample", f"{1e6 * costs.final:.1f} us", serial),
        ("reading a shard back, per shard", f"{1e3 * costs.final_shard:.2f} ms", serial),
        ("scheduling, per shard", f"{1e3 * costs.task:.2f} ms", "coordinator"),
        ("sending its inputs, per sample", f"{1e6 * costs.send:.2f} us", "coordinator"),
        ("loading the compiled kernels, once", f"{costs.warm:.2f} s", "every worker"),
        ("physics, per sample", f"{1e3 * costs.sample:.3f} ms", "worker"),
        ("hashing and writing, per sample", f"{1e6 * costs.write:.1f} us", "worker"),
        ("idle lanes at the end and the file, per shard", f"{1e3 * costs.shard:.1f} ms", "worker"),
        ("waiting for the next shard, per shard", f"{1e3 * costs.gap:.1f} ms", "worker"),
        ("shard on disk, per sample", f"{sizes.row_shard:.0f} B", "shared disk"),
        ("dataset on disk, per sample", f"{sizes.row_file:.0f} B", "shared disk"),
        ("inputs on the wire, per sample", f"{sizes.row_task:.0f} B", "network"),
        ("memory of the coordinator", memory, "coordinator"),
    ]
    head = ["| part | cost | of |", "|---|---:|---|"]
    note = f"Taken on {os.cpu_count()} cores with a load of {load:.1f} at the start."
    if load > _BUSY:
        note += " **The machine was busy: costs and errors of the check are too large.**"
    return [*head, *(f"| {' | '.join(cells)} |" for cells in rows), "", note]


def plans(measured: Measured, means: Means) -> dict[tuple[int, int], Plan]:
    """Recommended build for all samples and workers."""
    return {
        (n, w): plan(measured.costs, measured.sizes, means, n, w) for n in SAMPLES for w in WORKERS
    }


def plan_table(made: dict[tuple[int, int], Plan], price: float) -> list[str]:
    """Wall time, core-hours, price, shard, parts and limit."""
    lines = [
        "| samples | workers | wall time | core-hours | price | shard | datasets | limit |",
        "|---:|---:|---:|---:|---:|---:|---:|---|",
    ]
    for (samples, workers), one in made.items():
        lines.append(
            f"| {_power(samples)} | {workers} | {_time(one.prediction.wall)} "
            f"| {_number(one.core_hours)} | {_number(price * one.core_hours)} "
            f"| {one.build.shard_size} | {one.parts} | {one.prediction.limit} |"
        )
    return lines


def parts_table(measured: Measured, means: Means) -> list[str]:
    """What cutting a dataset into several brings on the most workers."""
    workers = WORKERS[-1]
    lines = [
        f"| samples, {workers} workers | " + " | ".join(f"{p} datasets" for p in PARTS) + " |",
        "|---:|" + "---:|" * len(PARTS),
    ]
    for samples in SAMPLES:
        cells = []
        for parts in PARTS:
            one = plan(measured.costs, measured.sizes, means, samples, workers, parts)
            room = "" if one.memory <= means.memory else f", needs {one.memory / 1e9:.0f} GB"
            cells.append(f"{_time(one.prediction.wall)} ({one.prediction.limit}{room})")
        lines.append(f"| {_power(samples)} | " + " | ".join(cells) + " |")
    return lines


def limits_table(measured: Measured, means: Means) -> list[str]:
    """Where the rate of one dataset stops growing."""
    costs, sizes = measured.costs, measured.sizes
    physics = 1.0 / (costs.sample + costs.write)
    rows = [
        ("one worker simulates", physics),
        *(
            (f"one scheduler, shards of {size}", 1.0 / (costs.task / size + costs.send))
            for size in (500, 2000, 10_000)
        ),
        (f"a disk of {means.disk_rate / 1e6:.0f} MB/s", means.disk_rate / sizes.row_shard),
        ("drawing and joining one file", 1.0 / (costs.design + costs.final)),
    ]
    return [
        "| | samples per second | as many as workers |",
        "|---|---:|---:|",
        *(f"| {name} | {rate:,.0f} | {rate / physics:,.0f} |" for name, rate in rows),
    ]


@in_style
def draw(
    made: dict[tuple[int, int], Plan], done: Sequence[Check], measured: Measured, path: Path
) -> None:
    """Wall time over workers; prediction over measurement."""
    figure, axes = new_figure(1, 2, width=9.0, height=3.4, width_ratios=[2, 1])
    costs = measured.costs
    for samples, colour in zip(SAMPLES, CYCLE, strict=False):
        walls = [made[samples, w].prediction.wall / 3600.0 for w in WORKERS]
        ideal = [samples * costs.sample / w / 3600.0 for w in WORKERS]
        axes[0].loglog(WORKERS, ideal, ":", color=colour, linewidth=1.0)
        label = f"$10^{{{len(str(samples)) - 1}}}$ samples"
        axes[0].loglog(WORKERS, walls, "o-", color=colour, markersize=4, label=label)
    axes[0].set_title("Predicted wall time (dotted: physics alone)")
    axes[0].set_xlabel("workers")
    axes[0].set_ylabel("wall time [h]")
    axes[0].legend()
    top = 1.1 * max(one.measured.wall for one in done)
    axes[1].plot([0, top], [0, top], color=GREY, linewidth=1.0)
    axes[1].fill_between([0, top], [0, 0.9 * top], [0, 1.1 * top], color=GREY, alpha=0.2)
    for place, colour in zip(("TCP", _THREADS), CYCLE, strict=False):
        points = [(c.measured.wall, c.predicted.wall) for c in done if c.where == place]
        axes[1].plot(*zip(*points, strict=True), "o", color=colour, markersize=5, label=place)
    axes[1].set_title("Check, band of 10 %")
    axes[1].set_xlabel("measured [s]")
    axes[1].set_ylabel("predicted [s]")
    axes[1].legend()
    save_figure(figure, path, dpi=110)


def _time(seconds: float) -> str:
    for unit, name in _UNITS:
        if seconds >= 2.0 * unit:
            return f"{seconds / unit:.3g} {name}"
    return f"{seconds:.2g} s"


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 10.0 else f"{value:.2g}"


def _power(samples: int) -> str:
    return f"10^{len(str(samples)) - 1}"


def main() -> None:
    """Measure, predict, check, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--memory", type=float, default=16.0, help="of a coordinator [GB]")
    parser.add_argument("--disk-rate", type=float, default=500.0, help="of all workers [MB/s]")
    parser.add_argument("--price", type=float, default=0.05, help="of a core-hour")
    parser.add_argument("--page", type=Path, default=PAGE)
    options = parser.parse_args()
    means = Means(options.memory * 1e9, options.disk_rate * 1e6, options.price)
    begin, load = time.monotonic(), os.getloadavg()[0]
    with TemporaryDirectory() as folder:
        measured = measure(Path(folder))
        blocks = {"costs": costs_table(measured, load)}
        print(*blocks["costs"], sep="\n", flush=True)
        done = check(Path(folder), measured)
    made = plans(measured, means)
    blocks["means"] = [
        f"Taken as given: {options.memory:g} GB for a coordinator, {options.disk_rate:g} MB/s for "
        f"the disk of all workers, a core-hour at {options.price:g}."
    ]
    blocks |= {
        "check": check_table(done),
        "plans": plan_table(made, options.price),
        "parts": parts_table(measured, means),
        "limits": limits_table(measured, means),
    }
    page = options.page.read_text(encoding="utf-8")
    for name, lines in blocks.items():
        page = put(page, name, lines)
    write_text(options.page, page)
    draw(made, done, measured, options.page.parent / "figures/scaling.png")
    print(f"{options.page} written after {time.monotonic() - begin:.0f} s; {blocks['check'][-1]}")


if __name__ == "__main__":
    main()
