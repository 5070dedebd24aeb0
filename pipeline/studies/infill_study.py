"""Does infill beat plain Latin hypercubes on the `full` domain? Figures and picture of infill.md.

Training sets start at the same 1,000 rows of a Latin hypercube and grow by 500 rows at a time to
2,500: once by further Latin hypercubes, once by rows chosen where three networks disagree (greedy,
apart), once by such rows without keeping them apart. All are judged on the same rows of the `full`
dataset, which no training set contains. An ensemble of networks, fitted anew at every size,
predicts, chooses and is judged; a Gaussian process, whose kernel is fitted once on other rows, is
fitted to the same rows and judged too: it says what the rows are worth to a model that did not
choose them.

    nice python pipeline/studies/infill_study.py data/full/1.1.0/data.nc --seeds 3
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from castblast.dataset.building.extend import read_existing
from castblast.dataset.rows.design import Design, extend_design
from castblast.dataset.rows.simulation import BlastSimulator, blast_simulator
from castblast.errors import Status
from castblast.network import Layer, run_layers
from castblast.specs.recipe import Recipe
from castblast.surrogate.fitting.conformal import conformal_band
from castblast.surrogate.fitting.families.levenberg import fit_dense
from castblast.surrogate.searching.infill import POOL_FACTOR, choose_batch, infill_worth
from castblast.types import FloatArray, IntArray

#: One target of the near field and the one of the burden motion.
TARGETS = ("crushed_zone_radius", "burden_velocity")
FEATURES = (
    "ucs", "young_modulus", "poisson_ratio", "rock_density", "friction_angle", "dilation_angle",
    "tensile_strength", "in_situ_stress", "hole_diameter", "bench_height", "face_angle", "burden",
    "spacing", "charge_length",
)  # fmt: skip
LOGGED = ("ucs", "young_modulus", "hole_diameter", "bench_height", "burden", "spacing",
          "charge_length")  # fmt: skip
ARMS = ("latin hypercube", "infill", "infill, not apart")
START, STEP, END, MEMBERS = 1000, 500, 2500, 3
KERNEL_ROWS = 500
FIGURES = ("within_95", "within_99", "worst", "rms_log")


class Rows(NamedTuple):
    """Simulated rows: features as the networks see them (unscaled), and log targets."""

    features: FloatArray
    kinds: IntArray
    targets: FloatArray

    def joined(self, other: Rows) -> Rows:
        """These rows and then the others."""
        return Rows(*(np.concatenate(pair) for pair in zip(self, other, strict=True)))


class Ensemble(NamedTuple):
    """Networks with their common scalings: one per member and target."""

    members: list[list[tuple[Layer, ...]]]
    mean: FloatArray
    scale: FloatArray
    target_mean: FloatArray
    target_scale: FloatArray

    def scaled(self, features: FloatArray) -> FloatArray:
        """Features as the first layer takes them, without the explosive."""
        return (features - self.mean) / self.scale

    def answers(self, features: FloatArray, kinds: IntArray) -> FloatArray:
        """Log targets of every member, (members, n, m)."""
        x = np.concatenate([self.scaled(features), np.eye(4)[kinds]], axis=1)
        scaled = np.stack(
            [
                np.concatenate([run_layers(layers, x) for layers in member], axis=1)
                for member in self.members
            ]
        )
        return np.asarray(scaled * self.target_scale + self.target_mean)


def features_of(inputs: dict[str, FloatArray]) -> FloatArray:
    """Columns of the networks: logarithms where a design spans a decade or so."""
    return np.stack(
        [np.log(inputs[name]) if name in LOGGED else inputs[name] for name in FEATURES], axis=1
    )


def fit_ensemble(rows: Rows, seed: int) -> Ensemble:
    """Fit 16-8 tanh networks from different random weights by Levenberg-Marquardt, log targets."""
    mean, scale = rows.features.mean(axis=0), rows.features.std(axis=0)
    target_mean, target_scale = rows.targets.mean(axis=0), rows.targets.std(axis=0)
    x = np.concatenate([(rows.features - mean) / scale, np.eye(4)[rows.kinds]], axis=1)
    y = (rows.targets - target_mean) / target_scale
    members = [
        [
            fit_dense(
                x, y[:, j], (16, 8), "tanh",
                penalty=1e-3, max_steps=50, tolerance=1e-3, seed=MEMBERS * seed + member,
            ).layers
            for j in range(len(TARGETS))
        ]
        for member in range(MEMBERS)
    ]  # fmt: skip
    return Ensemble(members, mean, scale, target_mean, target_scale)


def simulate(simulator: BlastSimulator, design: Design, chosen: IntArray) -> Rows:
    """Simulate rows of a design; the few that fail fall away."""
    inputs = {name: values[chosen] for name, values in design.inputs.items()}
    kinds = design.explosive[chosen].astype(np.int64)
    result = simulator.run(inputs, kinds)
    ok = result.status == Status.OK
    targets = np.stack([np.log(result.outputs[name][ok]) for name in TARGETS], axis=1)
    return Rows(features_of(inputs)[ok], kinds[ok], targets)


def draw(recipe: Recipe, simulator: BlastSimulator, count: int, batch: int) -> Design:
    """Possible rows of the recipe, from a batch number of their own."""
    return extend_design(recipe, simulator, "full", add=count, first_sample=0, first_batch=batch)


class Process:
    """Gaussian processes of the log targets; kernels fitted once, on rows of their own."""

    def __init__(self, rows: Rows) -> None:
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, DotProduct, WhiteKernel

        self.mean, self.scale = rows.features.mean(axis=0), rows.features.std(axis=0)
        self.target_mean, self.target_scale = rows.targets.mean(axis=0), rows.targets.std(axis=0)
        start = ConstantKernel(10.0) * RBF(np.full(len(FEATURES) + 4, 4.0)) + DotProduct()
        self.kernels = [start + WhiteKernel(1e-4)] * len(TARGETS)
        self.kernels = [model.kernel_ for model in self._fit(rows, "fmin_l_bfgs_b")]

    def _inputs(self, rows: Rows) -> FloatArray:
        scaled = (rows.features - self.mean) / self.scale
        return np.concatenate([scaled, 2.0 * np.eye(4)[rows.kinds]], axis=1)

    def _fit(self, rows: Rows, optimizer: str | None) -> list[Any]:
        from sklearn.gaussian_process import GaussianProcessRegressor

        x, y = self._inputs(rows), (rows.targets - self.target_mean) / self.target_scale
        return [
            GaussianProcessRegressor(kernel, optimizer=optimizer).fit(x, y[:, j])
            for j, kernel in enumerate(self.kernels)
        ]

    def predict(self, rows: Rows, test: Rows) -> FloatArray:
        """Log targets of the test rows after fitting to `rows`."""
        x = self._inputs(test)
        scaled = np.stack([model.predict(x) for model in self._fit(rows, None)], axis=1)
        return np.asarray(scaled * self.target_scale + self.target_mean)


def judge(predicted: FloatArray, test: Rows) -> Iterator[dict[str, Any]]:
    """Figures per target of predicted log targets of the test rows."""
    steps = predicted - test.targets
    errors = np.abs(np.expm1(steps))
    for j, target in enumerate(TARGETS):
        yield {
            "target": target,
            "within_95": float(np.quantile(errors[:, j], 0.95)),
            "within_99": float(np.quantile(errors[:, j], 0.99)),
            "worst": float(errors[:, j].max()),
            "rms_log": float(np.sqrt(np.mean(steps[:, j] ** 2))),
        }


def run_arm(
    arm: str,
    seed: int,
    start: tuple[Rows, Ensemble],
    recipe: Recipe,
    simulator: BlastSimulator,
    process: Process,
    test: Rows,
) -> Iterator[dict[str, Any]]:
    """Grow one training set and judge it at every size."""
    rows, ensemble = start
    for step in range((END - START) // STEP + 1):
        began = time.perf_counter()
        if step:
            ensemble = fit_ensemble(rows, 100 * seed + step)
        seconds = time.perf_counter() - began
        answers = ensemble.answers(test.features, test.kinds).mean(axis=0)
        for model, predicted in (("networks", answers), ("process", process.predict(rows, test))):
            for entry in judge(predicted, test):
                size = START + step * STEP
                yield {"arm": arm, "seed": seed, "rows": size, "model": model, **entry}
        print(f"{arm}, seed {seed}, {len(rows.kinds)} rows: fitted in {seconds:.1f} s", flush=True)
        if START + step * STEP == END:
            return
        batch = 1000 + 100 * seed + 10 * step + 5 * ARMS.index(arm)
        if arm == "latin hypercube":
            design = draw(recipe, simulator, STEP, batch)
            chosen = np.arange(STEP)
        else:
            design = draw(recipe, simulator, POOL_FACTOR * STEP, batch)
            features = features_of(design.inputs)
            kinds = design.explosive.astype(np.int64)
            spread = np.std(ensemble.answers(features, kinds), axis=0, ddof=1)
            worth = infill_worth(spread)
            chosen = np.argsort(-worth)[:STEP]
            if arm == "infill":
                chosen = choose_batch(ensemble.scaled(features), kinds, worth, STEP)
        rows = rows.joined(simulate(simulator, design, chosen))


def adaptive_gain(ensemble: Ensemble, test: Rows) -> None:
    """Print what a band scaled by the spread would gain over one of a constant share."""
    half = len(test.kinds) // 2
    answers = ensemble.answers(test.features, test.kinds)
    predicted, truth = np.exp(answers.mean(axis=0)), np.exp(test.targets)
    spread = np.std(answers, axis=0, ddof=1)
    floor = np.median(spread, axis=0)
    for name, size in (("constant share", np.ones_like(spread)), ("by spread", spread + floor)):
        # Residuals in units of `size` are what the band is made of.
        scaled = predicted + (truth - predicted) / size
        band = conformal_band(scaled[:half], predicted[:half]) * size[half:]
        inside = np.abs(truth - predicted)[half:] <= band * predicted[half:]
        top = spread[half:] >= np.quantile(spread[half:], 0.9, axis=0)
        for j, target in enumerate(TARGETS):
            print(
                f"{name}, {target}: mean half-width {band[:, j].mean():.3%}, coverage "
                f"{inside[:, j].mean():.1%}, of the tenth with the widest spread "
                f"{inside[top[:, j], j].mean():.1%}"
            )


def main() -> None:
    """Run the study and write its figures and picture."""
    from threadpoolctl import threadpool_limits

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--out", type=Path, default=Path("data/infill"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    existing = read_existing(arguments.dataset)
    recipe = existing.source.recipe
    simulator = blast_simulator(recipe, tuple(e.spec.to_explosive() for e in existing.explosives))
    result = np.concatenate([block.status for block in existing.results()])
    targets = np.concatenate(
        [np.stack([block.outputs[t] for t in TARGETS], axis=1) for block in existing.results()]
    )
    ok = result == Status.OK
    test = Rows(
        features_of(existing.design.inputs)[ok],
        existing.design.explosive[ok].astype(np.int64),
        np.log(targets[ok]),
    )
    with threadpool_limits(1), (arguments.out / "infill.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, ("arm", "seed", "rows", "model", "target", *FIGURES))
        writer.writeheader()
        other = draw(recipe, simulator, KERNEL_ROWS, 800)
        process = Process(simulate(simulator, other, np.arange(KERNEL_ROWS)))
        for seed in range(arguments.seeds):
            first = simulate(
                simulator, draw(recipe, simulator, START, 900 + seed), np.arange(START)
            )
            start = first, fit_ensemble(first, 100 * seed)
            for arm in ARMS:
                for line in run_arm(arm, seed, start, recipe, simulator, process, test):
                    writer.writerow(line)
                stream.flush()
        adaptive_gain(start[1], test)


if __name__ == "__main__":
    main()
