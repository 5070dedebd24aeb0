"""A network with everything that a record can hold, made from random numbers."""

from dataclasses import replace

import numpy as np

from castblast.network import (
    Constraint,
    DensityScore,
    DerivedColumn,
    GoldenRows,
    InputColumn,
    Layer,
    Network,
    OutputColumn,
    evaluate_rows,
)


def toy_network(kinds: tuple[str, ...] = ("silu", "silu")) -> Network:
    """Random weights, SiLU, a derived stemming length, descriptors as codes, two members.

    `kinds` are the activations of the hidden layers.
    """
    rng = np.random.default_rng(5)

    def chain(width: int) -> tuple[Layer, ...]:
        sizes = (7, *(width for _ in kinds), 2)
        return tuple(
            Layer(rng.normal(size=(a, b)) / np.sqrt(a), rng.normal(size=b), kind)
            for a, b, kind in zip(sizes[:-1], sizes[1:], (*kinds, "identity"), strict=True)
        )

    inputs = tuple(
        InputColumn(name, "m", kind, mean, scale, lower, upper)
        for name, kind, mean, scale, lower, upper in (
            ("bench_height", "log", 2.5, 0.4, 8.0, 20.0),
            ("charge_length", "linear", 5.0, 1.5, 2.0, 7.0),
            ("burden", "log", 1.0, 0.3, 1.0, 5.0),
        )
    )
    stemming = {"bench_height": 1.0, "charge_length": -1.0}
    bare = Network(
        inputs=inputs,
        explosives=("anfo", "heavy_anfo"),
        codes=rng.normal(size=(2, 3)),
        layers=chain(8),
        outputs=(
            OutputColumn("burden_velocity", "m s-1", "log", 2.0, 0.5, 0.01),
            OutputColumn("expanded_hole_radius", "m", "linear", 0.1, 3.0, 0.02),
        ),
        constraints=(Constraint("bench at least 2 burdens", {"bench_height": 1, "burden": -2}, 0),),
        golden=GoldenRows(np.ones((1, 3)), ("anfo",), np.ones((1, 2))),
        derived=(DerivedColumn("stemming", "m", "log", 2.0, 0.4, stemming),),
        density=DensityScore(
            rng.normal(size=(2, 3)), np.tril(rng.normal(size=(2, 3, 3))) + np.eye(3),
            np.array([0.0, 0.7]), 6.0, 0.995,
        ),
        members=(chain(5), chain(6)),
    )  # fmt: skip
    lower, upper = ([getattr(c, end) for c in inputs] for end in ("lower", "upper"))
    rows = rng.uniform(lower, upper, (200, 3))
    index = rng.integers(0, 2, 200)
    kinds = tuple(bare.explosives[k] for k in index)
    return replace(bare, golden=GoldenRows(rows, kinds, evaluate_rows(bare, rows, index)))
