"""How well the joint domain of a record tells designs of a dataset from others. For uncertainty.md.

Rows of the design are its test rows. Rows beyond it are made by shuffling every column of the test
rows on its own: each value stays in its range and keeps its distribution, but what the design ties
together is torn. Which of them happen to lie in the design all the same, the recipe says.

    nice python pipeline/studies/domain_study.py data/paper/1.1.0/data.nc data/full/1.1.0/data.nc
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from castblast.dataset.file.store import reading_dataset
from castblast.network import Network, density_score, in_domain, scale_columns
from castblast.specs.models.model import PAPER_TARGETS, RidgeSpec
from castblast.specs.recipe import Recipe, recipe_from_text
from castblast.stages.datasets.infill import shares_of
from castblast.surrogate.fitting.conformal import band_coverage
from castblast.surrogate.fitting.density import LEVEL, fit_density
from castblast.surrogate.fitting.features import Table, read_table
from castblast.surrogate.fitting.training import fit_spec
from castblast.types import BoolArray, FloatArray

COPIES = 20
TERMS = (1, 2, 4, 8, 16)


def in_design(recipe: Recipe, rows: dict[str, FloatArray]) -> BoolArray:
    """Whether rows (n,) lie in the ranges and constraints of a recipe."""
    full = {**rows}
    known = "charge_length" if "charge_length" in rows else "stemming_length"
    left = {"charge_length", "stemming_length"} - {known}
    full[left.pop()] = rows["bench_height"] - rows[known]
    shares = shares_of(recipe, full)
    rules = recipe.constraints
    inside = np.all((shares >= -1e-9) & (shares <= 1 + 1e-9), axis=1)
    inside &= full["stemming_length"] >= rules.minimum_stemming_ratio * full["burden"] * (1 - 1e-9)
    return np.asarray(inside & (full["charge_length"] >= rules.minimum_charge_length))


def shuffled(table: Table, names: tuple[str, ...]) -> dict[str, FloatArray]:
    """Test rows with every column shuffled, several times over."""
    rng = np.random.default_rng(0)
    test = table.frame.iloc[table.rows("test")]
    return {
        name: np.concatenate([rng.permutation(test[name].to_numpy()) for _ in range(COPIES)])
        for name in names
    }


def distances(train: FloatArray, rows: FloatArray) -> FloatArray:
    """Mean distance to the five nearest training rows in whitened inputs: every row is kept."""
    from scipy.spatial import cKDTree

    white = np.linalg.cholesky(np.linalg.inv(np.cov(train.T)))
    gaps = np.asarray(cKDTree(train @ white).query(rows @ white, k=5)[0])
    return np.asarray(gaps.mean(axis=1))


def report(network: Network, table: Table, recipe: Recipe) -> None:
    """Print the figures of one dataset."""
    names = network.input_names
    test = table.frame.iloc[table.rows("test")][list(names)].to_numpy()
    rows = shuffled(table, names)
    numeric = np.stack([rows[name] for name in names], axis=1)
    beyond = ~in_design(recipe, rows)
    parts = {
        "ranges": replace(network, constraints=(), density=None),
        "ranges and rules": replace(network, density=None),
        "ranges and density": replace(network, constraints=()),
        "all three": network,
    }
    print(f"  shuffled rows beyond the design: {beyond.mean():.1%} of {len(beyond)}")
    for label, part in parts.items():
        alarms = ~in_domain(part, test)
        refused = ~in_domain(part, numeric)
        print(
            f"  {label}: refused of test rows {alarms.mean():.2%}, of shuffled rows beyond the "
            f"design {refused[beyond].mean():.1%}, of those within {refused[~beyond].mean():.1%}"
        )
    scaled = scale_columns(table.frame[list(names)].to_numpy(), network.inputs)
    held = scaled[table.rows("valid", "calibration")]
    for terms in TERMS:
        density = fit_density(scaled[table.rows("train")], held, terms)
        refused = density_score(replace(network, density=density), numeric) > 1.0
        count = density.whitening.size + density.centres.size
        print(
            f"  density of {terms} terms ({count} numbers) alone: refused of shuffled rows "
            f"beyond the design {refused[beyond].mean():.1%}, within {refused[~beyond].mean():.1%}"
        )
    train = scaled[table.rows("train")]
    bound = np.sort(distances(train, held))[math.ceil((len(held) + 1) * LEVEL) - 1]
    refused = distances(train, scale_columns(numeric, network.inputs)) > bound
    print(
        f"  distance to the five nearest training rows: {refused[beyond].mean():.1%}, within "
        f"{refused[~beyond].mean():.1%}"
    )
    score = density_score(network, test) > 1.0
    truth = np.zeros((len(score), 1))
    truth[score] = 2.0
    (found,) = band_coverage(truth + 1.0, np.ones((len(score), 1)), np.array([0.5]))
    print(
        f"  density alone refuses {1 - found.share:.2%} of {found.rows} test rows, 95 % interval "
        f"{1 - found.upper:.2%} to {1 - found.lower:.2%}; stated {1 - network.density.level:.2%}"  # type: ignore[union-attr]
    )


def main() -> None:
    """Run for every dataset, in linear and, where it can be logged, logarithmic inputs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("datasets", type=Path, nargs="+")
    for path in parser.parse_args().datasets:
        with reading_dataset(path) as dataset:
            recipe = recipe_from_text(str(dataset.attrs["recipe"]), str(path))
            table = read_table(dataset, ("all",), PAPER_TARGETS)
        logged = [n for n in table.feature_names if (table.frame[n] > 0.0).all()]
        for label, transforms in (("linear", {}), ("log", dict.fromkeys(logged, "log"))):
            spec = RidgeSpec(name="domain", features=table.feature_names)  # type: ignore[call-arg]
            network = fit_spec(spec, table).network
            assert network is not None
            print(f"{path}, {label} inputs: {', '.join(table.feature_names)}")
            if transforms:
                network = logarithmic(network, table, logged)
            report(network, table, recipe)


def logarithmic(network: Network, table: Table, names: list[str]) -> Network:
    """Give the record log inputs where it can have them, and the density in those."""
    from castblast.surrogate.fitting.density import with_density

    train = table.frame.iloc[table.rows("train")]
    columns = tuple(
        replace(
            column,
            transform="log",
            mean=float(np.log(train[column.name]).mean()),
            scale=float(np.log(train[column.name]).std()),
        )
        if column.name in names
        else column
        for column in network.inputs
    )
    return with_density(replace(network, inputs=columns), table)


if __name__ == "__main__":
    main()
