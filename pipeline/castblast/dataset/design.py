"""The design of a dataset: which rows are simulated, and which split each belongs to.

Latin-hypercube batches (McKay, Beckman & Conover 1979) over the sampled variables. Rows that no
bench can hold, or that break a constraint of the recipe, are dropped whole and replaced by rows of
further batches, each as large as what is still missing. A Latin hypercube spreads evenly over the
box of the ranges; what is left after the drops spreads evenly over its possible part, without the
pile-up at the edge that clipping would leave.

Every number depends on the recipe alone: batches, explosives and splits draw from their own streams
of the seed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from castblast.dataset.simulation import Columns, FloatArray, Simulator, fault_kind
from castblast.errors import SpecError
from castblast.specs.recipe import Constraints, Recipe, VariableSpec
from castblast.variables import VARIABLES

#: A first batch with a smaller share of possible rows stops the build.
LEAST_ACCEPTANCE = 0.02
#: Rows tried before anything else, where the recipe asks for fewer.
_PILOT_ROWS = 500
_MOST_BATCHES = 1000
_BATCHES, _EXPLOSIVES, _SPLITS, _PILOT = range(4)


class Design(NamedTuple):
    """Rows to simulate, in the order of their ids.

    Attributes
    ----------
    sample : (n,) int32
        Stable ids, 0 to n - 1.
    columns : dict of (n,) [SI]
        Sampled and fixed variables of the recipe.
    inputs : dict of (n,) [SI]
        Every input of the physics, defaults and derived ones included.
    explosive : (n,) int8
        Index into the explosives of the recipe.
    split : (n,) int8
        Index into `specs.recipe.SPLIT_NAMES`.
    batch : (n,) int16
        Latin-hypercube batch the row was drawn in, 0 the first.
    drawn : int
        Rows drawn until n were possible.
    """

    sample: NDArray[np.int32]
    columns: dict[str, FloatArray]
    inputs: dict[str, FloatArray]
    explosive: NDArray[np.int8]
    split: NDArray[np.int8]
    batch: NDArray[np.int16]
    drawn: int


def make_design(recipe: Recipe, simulator: Simulator, where: str) -> Design:
    """Draw the rows of a recipe; `where` names its file in messages.

    Raises
    ------
    SpecError
        Next to none of the rows are possible; the message names the constraints that refuse them.
    """
    _require_possible(recipe, simulator, where)
    size = recipe.size
    kept: list[dict[str, FloatArray]] = []
    batches: list[int] = []
    missing, drawn = size, 0
    for number in range(_MOST_BATCHES):
        columns = draw_batch(recipe, missing, _stream(recipe, _BATCHES, number))
        possible = np.array([not fault for fault in row_faults(recipe, simulator, columns)])
        kept.append({name: values[possible] for name, values in columns.items()})
        batches += [number] * int(possible.sum())
        drawn += missing
        missing = size - len(batches)
        if missing == 0:
            break
    else:
        message = (
            f"{where}: variables: {missing} of {size} designs are still impossible after {drawn} "
            "were drawn"
        )
        raise SpecError(message)
    joined = {name: np.concatenate([part[name] for part in kept]) for name in kept[0]}
    explosive = _balanced(size, len(recipe.explosives), _stream(recipe, _EXPLOSIVES, 0))
    return Design(
        sample=np.arange(size, dtype=np.int32),
        columns=joined,
        inputs=simulator.resolve(joined, explosive),
        explosive=explosive,
        split=split_labels(size, recipe.split.shares, _stream(recipe, _SPLITS, 0)),
        batch=np.array(batches, dtype=np.int16),
        drawn=drawn,
    )


def draw_batch(recipe: Recipe, count: int, rng: np.random.Generator) -> dict[str, FloatArray]:
    """Draw one Latin hypercube of `count` rows and map it onto the marginals.

    Returns
    -------
    dict of (count,) [SI]
        Sampled variables, then fixed ones; ratios are turned into values.
    """
    sampled = recipe.sampled
    shares = qmc.LatinHypercube(d=len(sampled), rng=rng).random(count)
    raw = {spec.name: _quantiles(spec, shares[:, j]) for j, spec in enumerate(sampled)}
    raw |= {spec.name: np.full(count, spec.at(0.0)) for spec in recipe.fixed}
    for spec in (*sampled, *recipe.fixed):
        if spec.ratio_of is not None:
            raw[spec.name] = raw[spec.name] * raw[spec.ratio_of]
    return raw


def row_faults(recipe: Recipe, simulator: Simulator, columns: Columns) -> list[str]:
    """Say for every row what makes it impossible; the physics first, then the constraints."""
    faults = simulator.faults(columns)
    possible = np.array([not fault for fault in faults])
    if not possible.any():
        return faults
    rows = {name: values[possible] for name, values in columns.items()}
    # The constraints need derived lengths, which do not depend on the explosive.
    inputs = simulator.resolve(rows, np.zeros(int(possible.sum()), dtype=np.int8))
    broken = _constraint_faults(recipe.constraints, inputs)
    for i, fault in zip(np.flatnonzero(possible), broken, strict=True):
        faults[i] = fault
    return faults


def split_labels(size: int, shares: Sequence[float], rng: np.random.Generator) -> NDArray[np.int8]:
    """Deal `size` rows to splits: exact counts (largest remainder), random order.

    Parameters
    ----------
    shares : sequence of float
        Adding up to 1, in the order of `specs.recipe.SPLIT_NAMES`.
    """
    exact = np.asarray(shares, dtype=np.float64) * size
    counts = np.floor(exact + 1e-9).astype(np.int64)
    rest = size - int(counts.sum())
    counts[np.argsort(counts - exact, kind="stable")[:rest]] += 1
    return rng.permutation(np.repeat(np.arange(len(counts), dtype=np.int8), counts))


def _stream(recipe: Recipe, purpose: int, number: int) -> np.random.Generator:
    """Random numbers of one purpose, independent of all others of the same seed."""
    return np.random.default_rng(np.random.SeedSequence(recipe.seed, spawn_key=(purpose, number)))


def _quantiles(spec: VariableSpec, shares: FloatArray) -> FloatArray:
    low, high = spec.at(0.0), spec.at(1.0)
    if spec.distribution == "log_uniform":
        values = np.exp(np.log(low) + shares * (np.log(high) - np.log(low)))
    else:
        values = low + shares * (high - low)
    return np.asarray(
        np.clip(values, low, high)
    )  # rounding of exp and log must not leave the range


def _balanced(size: int, kinds: int, rng: np.random.Generator) -> NDArray[np.int8]:
    """Every kind equally often, up to one row, in random order."""
    return rng.permutation((np.arange(size) % kinds).astype(np.int8))


def _constraint_faults(rules: Constraints, inputs: Columns) -> list[str]:
    """First broken constraint of every row."""
    ratio = inputs["stemming_length"] / inputs["burden"]
    charge = inputs["charge_length"]
    # A rounding margin: a ratio sampled between the very bounds of the rule is allowed.
    low = rules.minimum_stemming_ratio * (1.0 - 1e-12)
    high = np.inf
    if rules.maximum_stemming_ratio is not None:
        high = rules.maximum_stemming_ratio * (1.0 + 1e-12)
    shortest = VARIABLES["charge_length"].show(rules.minimum_charge_length)
    table = (
        (ratio < low, f"stemming_length below {rules.minimum_stemming_ratio:g} burden"),
        (ratio > high, f"stemming_length above {rules.maximum_stemming_ratio} burden"),
        (charge < rules.minimum_charge_length * (1.0 - 1e-12), f"charge_length below {shortest}"),
    )
    faults = [""] * len(ratio)
    for mask, text in table:
        for i in np.flatnonzero(mask):
            faults[i] = faults[i] or f"constraints: {text}"
    return faults


def _require_possible(recipe: Recipe, simulator: Simulator, where: str) -> None:
    """Stop where next to nothing can be simulated, before anything is."""
    count = max(_PILOT_ROWS, min(recipe.size, 4 * _PILOT_ROWS))
    columns = draw_batch(recipe, count, _stream(recipe, _PILOT, 0))
    faults = [fault for fault in row_faults(recipe, simulator, columns) if fault]
    if len(faults) <= (1.0 - LEAST_ACCEPTANCE) * count:
        return
    kinds = Counter(fault_kind(fault) for fault in faults)
    lines = [
        f"{kinds[kind] / count:.1%} of the designs: "
        f"{next(fault for fault in faults if fault_kind(fault) == kind)}"
        for kind, _ in kinds.most_common(3)
    ]
    message = (
        f"{where}: variables: {len(faults) / count:.1%} of the designs in these ranges are "
        f"impossible; nothing was run. Refused are {'; '.join(lines)}"
    )
    raise SpecError(message)
