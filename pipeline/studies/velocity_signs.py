"""Which way the simulated burden velocity moves with each input, over the shipped recipes.

``python pipeline/studies/velocity_signs.py [--points 1024]`` prints a table per recipe: slopes
d ln v / d ln input from pairs of simulated points 6 % apart, all over the joint domain. About 25 s
of one core per 1,000 points and recipe. The table is in ``pipeline/docs/physics_gate.md``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from castblast.dataset.file.provenance import load_explosives
from castblast.dataset.rows.simulation import blast_simulator
from castblast.specs.recipe import load_recipe
from castblast.surrogate.judging.domain import Domain
from castblast.surrogate.judging.probe import Pairs, physics_probe

RECIPES = Path(__file__).resolve().parents[2] / "data_specs" / "recipes"


def recipe_domain(name: str) -> Domain:
    """Joint domain of a shipped recipe."""
    source = load_recipe(RECIPES / f"{name}.yaml")
    entries = load_explosives(source)
    explosives = tuple(entry.spec.to_explosive() for entry in entries)
    return Domain(
        source.recipe,
        blast_simulator(source.recipe, explosives),
        tuple(entry.name for entry in entries),
        np.array([entry.density * entry.heat_of_explosion for entry in explosives]),
    )


def table_row(pairs: Pairs) -> str:
    """One line of the table."""
    document = pairs.to_document()
    slope = document["simulator_slope"]
    figures = " | ".join(f"{slope[key]:+.3f}" for key in ("least", "median", "most"))
    required = {1: "rises", -1: "falls", 0: "none"}[pairs.direction.sign]
    return (
        f"| {pairs.direction.name} | {required} | {document['sign_required']} of "
        f"{document['pairs']} | {document['simulator_breaks_sign']} | {figures} | "
        f"{document['rising_share']:.1%} |"
    )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=1024)
    points = parser.parse_args().points
    for name in ("paper", "full"):
        print(f"\n{name}, {points:,} points\n")
        print("| input | required | asked at | broken | least | median | most | rising |")
        print("|---|---|---|---|---|---|---|---|")
        for pairs in physics_probe(recipe_domain(name), points, dense=16).pairs:
            print(table_row(pairs), flush=True)


if __name__ == "__main__":
    main()
