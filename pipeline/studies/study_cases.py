"""Designs that the studies of the near field run on: drawn from a recipe, by kind of rock."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from castblast.blast.run import BlastCase, BlastSettings, make_case
from castblast.dataset.file.provenance import load_explosives
from castblast.dataset.rows.design import make_design
from castblast.dataset.rows.simulation import blast_simulator
from castblast.nearfield.front import front_number
from castblast.nearfield.rock.mohr_coulomb import friction_number
from castblast.specs.recipe import load_recipe

ROOT = Path(__file__).resolve().parent.parent.parent


def draw_cases(
    size: int, seed: int, name: str = "full", *, yields: bool = False, of: int = 0
) -> list[BlastCase]:
    """First designs of a recipe whose rock yields in the wave front, or does not.

    Parameters
    ----------
    size : int
        How many are wanted; there may be fewer.
    yields : bool
        True: the rock yields in the front.
    of : int
        Designs that are drawn, all explosives equally often; 0: twice as many as wanted.
    """
    drawn = _draw(of or 2 * size, seed, name)
    return [case for case in drawn if (front_of(case) < 1.0) == yields][:size]


def front_of(case: BlastCase) -> float:
    """Front number of the rock: below 1 it yields in the wave front."""
    friction = np.array([friction_number(case.rock.friction_angle)])
    return float(front_number(friction, np.array([case.rock.poisson_ratio]))[0])


def _draw(size: int, seed: int, name: str) -> list[BlastCase]:
    """Draw designs of a recipe."""
    source = load_recipe(ROOT / f"data_specs/recipes/{name}.yaml", size)
    recipe = source.recipe.model_copy(update={"seed": seed})
    explosives = tuple(entry.spec.to_explosive() for entry in load_explosives(source))
    simulator = blast_simulator(recipe, explosives)
    design = make_design(recipe, simulator, name)
    rows = [{name: float(column[i]) for name, column in design.inputs.items()} for i in range(size)]
    return [
        make_case(explosives[kind], row, BlastSettings())
        for kind, row in zip(design.explosive, rows, strict=True)
    ]
