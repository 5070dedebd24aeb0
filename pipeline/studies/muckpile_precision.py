"""Does single precision change a muckpile? A cast done in three ways.

Every packing (one per seed) is thrown in double precision, again in double precision with its
balls moved by a billionth of a metre, and in mixed precision. A granular cast is chaotic: the
second run is another sample of the same cast, and the measure of the third. What counts as
harmless: the mean difference to the first run lies within twice its standard error, or is small
against the scatter of that second run and against that between packings.

    python pipeline/studies/muckpile_precision.py FOLDER --seeds 1 2 3 4 5 6 --again 2
    python pipeline/studies/muckpile_precision.py OTHER --seeds 1 2 3 4 5 6 --delay 3
    python pipeline/studies/muckpile_precision.py FOLDER --table

The first line makes what is missing in FOLDER, one file per run, so that several processes may
share the seeds; the second throws each row at a pile that has come to rest; the third prints the
tables of `docs/muckpile_precision.md`.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from math import sqrt
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from castblast.disk.files import write_text
from castblast.muckpile.balls.contact import ContactLaw
from castblast.muckpile.balls.particles import Particles, centre_of_mass, particles_at_rest
from castblast.muckpile.balls.state import PRECISIONS
from castblast.muckpile.bench.geometry import Bench, block_shape, block_velocities, row_delays
from castblast.muckpile.bench.packing import fill_bench, mean_radius_for_count
from castblast.muckpile.bench.surroundings import bench_walls
from castblast.muckpile.cast.solver import CastCase, CastResult, run_cast
from castblast.muckpile.results.metrics import pile_metrics
from castblast.muckpile.results.profile import mean_profile, surface_height
from castblast.types import FloatArray

BENCH = Bench(length=6.0, width=9.0, height=6.0, burden=3.0, spacing=3.0)
SPEED = 12.7
NOISE = 1e-9
#: What is changed against the first, in the order of the tables.
WAYS: dict[str, dict[str, Any]] = {
    "float64": {},
    "float64, other noise": {},
    "mixed": {"precision": "mixed"},
}
_MEASURES = (
    ("throw", "m"), ("drop", "m"), ("cast_fraction", "1"), ("runout_95", "m"),
    ("runout_99", "m"), ("maximum_height", "m"), ("dig_height", "m"), ("swell", "1"),
    ("slip", "share"), ("rolling_slip", "share"), ("dashpot", "share"), ("time", "s"),
)  # fmt: skip
#: Places [m] at which mean profiles are compared.
_GRID = np.arange(-9.0, 45.0, 0.25)


def make_case(balls: Particles, delay: float) -> CastCase:
    """Cast of the bench between mirrors, a row every `delay` [s]."""
    rows, columns = block_shape(BENCH)
    return CastCase(
        balls,
        ContactLaw(),
        bench_walls(BENCH, ends="mirror"),
        row_delays(rows, columns, delay),
        block_velocities(SPEED, rows * columns),
        max_time=20.0,
        threads=1,
    )


def packing(folder: Path, seed: int, balls: int) -> Particles:
    """Packing of this seed; made once."""
    path = folder / f"packing_{seed}.npz"
    if not path.exists():
        radius = mean_radius_for_count(BENCH, balls)
        packed = fill_bench(BENCH, mean_radius=radius, seed=seed, threads=1).particles
        np.savez(path, x=packed.position, r=packed.radius, block=packed.block)
    stored = np.load(path)
    return particles_at_rest(stored["x"], stored["r"], stored["block"])


def with_noise(balls: Particles, seed: int) -> Particles:
    """The same balls, moved by a billionth of a metre."""
    noise = NOISE * np.random.default_rng(seed).standard_normal(balls.position.shape)
    return balls._replace(position=balls.position + noise)


def describe(case: CastCase, result: CastResult, seconds: float) -> dict[str, Any]:
    """What is compared, in plain numbers."""
    after = result.particles
    metrics = pile_metrics(
        case.particles, after, BENCH, block_velocity=case.block_velocity, walls=case.walls
    )
    cell = float(after.radius.mean())
    surface = surface_height(after.position, after.radius, cell=cell, y_range=(0.0, BENCH.length))
    profile = mean_profile(surface)
    released = float(centre_of_mass(case.particles)[2] - centre_of_mass(after)[2])
    ledger = result.ledger
    total = ledger.slip + ledger.rolling_slip + ledger.dashpot
    return {
        "throw": float(metrics.throw[0]),
        "drop": released,
        **{name: getattr(metrics, name) for name, _ in _MEASURES[2:8]},
        **{name: getattr(ledger, name) / total for name in ("slip", "rolling_slip", "dashpot")},
        "residual": ledger.residual,
        "time": result.time,
        "steps": result.counters.steps,
        "seconds": seconds,
        "profile": np.interp(_GRID, profile.x, profile.height, left=0.0, right=0.0).tolist(),
    }


def produce(folder: Path, seeds: list[int], balls: int, delay: float) -> None:
    """Make the runs that are missing."""
    folder.mkdir(parents=True, exist_ok=True)
    for seed in seeds:
        packed = packing(folder, seed, balls)
        for number, (way, changes) in enumerate(WAYS.items()):
            path = folder / f"seed_{seed}_way_{number}.json"
            if path.exists():
                continue
            case = make_case(with_noise(packed, seed) if number == 1 else packed, delay)
            case = case._replace(**changes)
            # Compiled before the clock runs.
            run_cast(case._replace(max_time=0.01))
            began = process_time()
            result = run_cast(case)
            document = describe(case, result, process_time() - began)
            write_text(path, json.dumps(document))
            print(f"seed {seed}, {way}: {document['seconds']:.1f} s", flush=True)


def repeat(folder: Path, seeds: list[int], balls: int, delay: float, times: int) -> None:
    """Throw every packing so many more times in both precisions, each time with other noise."""
    for seed in seeds:
        packed = packing(folder, seed, balls)
        for number in range(1, times + 1):
            for precision in PRECISIONS:
                path = folder / f"again_{seed}_{number}_{precision}.json"
                if path.exists():
                    continue
                case = make_case(with_noise(packed, seed + 100 * number), delay)
                began = process_time()
                result = run_cast(case._replace(precision=precision))
                document = describe(case, result, process_time() - began)
                write_text(path, json.dumps(document))
                print(f"seed {seed}, again {number}, {precision}", flush=True)


def print_repeats(folder: Path, runs: list[list[dict[str, Any]]]) -> None:
    """Mixed less double precision, both as means over all runs of a packing."""
    print("\n| number | unit | mixed less float64 | scatter of runs of a packing |")
    print("|---|---|---|---|")
    seeds = sorted(int(path.name.split("_")[1]) for path in folder.glob("seed_*_way_2.json"))
    for name, unit in _MEASURES:
        apart, scatter = [], []
        for seed, ways in zip(seeds, runs, strict=True):
            found = {"float64": [ways[0][name], ways[1][name]], "mixed": [ways[2][name]]}
            for path in sorted(folder.glob(f"again_{seed}_*.json")):
                found[path.stem.split("_")[-1]].append(json.loads(path.read_text())[name])
            apart.append(np.mean(found["mixed"]) - np.mean(found["float64"]))
            scatter.append(np.var(found["float64"], ddof=1))
        error = np.std(apart, ddof=1) / sqrt(len(apart))
        shown = f"{np.mean(apart):+.2g} ± {error:.2g} | {sqrt(np.mean(scatter)):.2g}"
        print(f"| {name} | {unit} | {shown} |")


def read_runs(folder: Path) -> list[list[dict[str, Any]]]:
    """Runs of each seed that is complete, in the order of `WAYS`."""
    seeds = sorted(folder.glob("seed_*_way_0.json"))
    found = []
    for first in seeds:
        paths = [first.with_name(first.name.replace("way_0", f"way_{n}")) for n in range(len(WAYS))]
        if all(path.exists() for path in paths):
            found.append([json.loads(path.read_text()) for path in paths])
    return found


def column(runs: list[list[dict[str, Any]]], way: int, name: str) -> FloatArray:
    """One number of one way over the seeds."""
    return np.array([seed[way][name] for seed in runs], dtype=np.float64)


def print_differences(runs: list[list[dict[str, Any]]]) -> None:
    """Mean and scatter over packings, and the mean difference of each way with its error."""
    print("| number | unit | float64: mean ± scatter | " + " | ".join(list(WAYS)[1:]) + " |")
    print("|---|---|---|" + "---|" * (len(WAYS) - 1))
    for name, unit in _MEASURES:
        base = column(runs, 0, name)
        cells = [f"{base.mean():.4g} ± {base.std(ddof=1):.2g}"]
        for way in range(1, len(WAYS)):
            apart = column(runs, way, name) - base
            error = apart.std(ddof=1) / sqrt(len(apart))
            cells.append(f"{apart.mean():+.2g} ± {error:.2g}")
        print(f"| {name} | {unit} | " + " | ".join(cells) + " |")


def _profiles(runs: list[list[dict[str, Any]]], way: int) -> FloatArray:
    return np.array([seed[way]["profile"] for seed in runs])


def print_profiles(runs: list[list[dict[str, Any]]]) -> None:
    """Root mean square over the pile of differences between mean profiles."""
    base = _profiles(runs, 0)
    pile = base.max(axis=0) > 0.0
    between = [
        np.sqrt(np.mean((one - other)[pile] ** 2))
        for k, one in enumerate(base)
        for other in base[:k]
    ]
    print(f"\nrms between profiles of two packings: {np.mean(between):.4f} m")
    for number, way in enumerate(WAYS):
        if number:
            apart = (_profiles(runs, number) - base)[:, pile]
            single = np.sqrt(np.mean(apart**2, axis=1)).mean()
            mean = np.sqrt(np.mean(apart.mean(axis=0) ** 2))
            print(f"{way}: per packing {single:.4f} m, of the mean profiles {mean:.4f} m")


def print_costs(runs: list[list[dict[str, Any]]]) -> None:
    """Ledger and processor time of each way."""
    print("\n| way | largest residual of the ledger | seconds |")
    print("|---|---|---|")
    for number, way in enumerate(WAYS):
        get: Callable[[str], FloatArray] = lambda name, n=number: column(runs, n, name)  # type: ignore[misc] # noqa: E731
        print(
            f"| {way} | {100.0 * np.abs(get('residual')).max():.3f} % "
            f"| {get('seconds').mean():.1f} |"
        )


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5, 6])
    parser.add_argument("--balls", type=int, default=3000)
    parser.add_argument("--delay", type=float, default=0.1, help="between rows [s]")
    parser.add_argument("--again", type=int, default=0, help="further runs in both precisions")
    parser.add_argument("--table", action="store_true", help="print what is there")
    given = parser.parse_args()
    if not given.table:
        produce(given.folder, given.seeds, given.balls, given.delay)
        repeat(given.folder, given.seeds, given.balls, given.delay, given.again)
        return
    runs = read_runs(given.folder)
    if len(runs) < 2:
        parser.error(f"{given.folder}: at least two seeds are needed that are complete")
    print_differences(runs)
    print_profiles(runs)
    print_costs(runs)
    print_repeats(given.folder, runs)


if __name__ == "__main__":
    main()
