"""The design of a dataset: which rows are simulated, and which split each belongs to.

Latin-hypercube batches (McKay, Beckman & Conover 1979) over the sampled variables. Rows that no
bench can hold, or that break a constraint of the recipe, are dropped whole and replaced by rows of
further batches, each as large as what is still missing. A Latin hypercube spreads evenly over the
box of the ranges; what is left after the drops spreads evenly over its possible part, without the
pile-up at the edge that clipping would leave.

A hole that expands as wide as its burden or spacing is known after its near field only. Rows near
that limit are tried, with their explosive, and those beyond it are replaced last.

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

from castblast.dataset.rows.simulation import Columns, Simulator, fault_kind
from castblast.design.variables import VARIABLES
from castblast.errors import SpecError
from castblast.specs.recipe import Recipe, VariableSpec
from castblast.types import BoolArray, FloatArray, Int32Array, IntArray

#: A recipe with a smaller share of possible rows is refused: what is left of a Latin hypercube
#: of which most was dropped is hardly one, and other ranges (or ratios) say better what is meant.
LEAST_ACCEPTANCE = 0.5
#: Rows tried before anything else, where the recipe asks for fewer.
_PILOT_ROWS = 500
_MOST_BATCHES = 1000
_BATCHES, _EXPLOSIVES, _SPLITS, _PILOT = range(4)


class Design(NamedTuple):
    """Rows to simulate, in the order of their ids.

    Attributes
    ----------
    sample : (n,) int32
        Stable ids, consecutive.
    columns : dict of (n,) [SI]
        Sampled and fixed variables of the recipe.
    inputs : dict of (n,) [SI]
        Every input of the physics, defaults and derived ones included; read-only, and shared
        with `columns` where that saves memory.
    explosive : (n,) int8
        Index into the explosives of the recipe.
    split : (n,) int8
        Index into `specs.recipe.SPLIT_NAMES`.
    batch : (n,) int16
        Latin-hypercube batch the row was drawn in, 0 the first of all.
    drawn : int
        Rows drawn until n were possible.
    """

    sample: Int32Array
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
        Most rows are impossible; the message names the constraints that refuse them.
    """
    return _draw_rows(recipe, simulator, where, count=recipe.size, first_sample=0, first_batch=0)


def extend_design(
    recipe: Recipe,
    simulator: Simulator,
    where: str,
    *,
    add: int,
    first_sample: int,
    first_batch: int,
) -> Design:
    """Draw more rows for a recipe that has rows already.

    The new rows are Latin hypercubes of their own, so old and new rows are spread evenly each.
    Old rows keep everything, their split included; the new ones are dealt to the splits by the
    shares of the recipe.

    Parameters
    ----------
    add : int
        New rows; the size of the recipe does not matter.
    first_sample, first_batch : int
        One more than the largest sample id and batch number so far. Every batch number has its
        own stream of the seed, so that the same steps give the same rows.

    Returns
    -------
    Design
        The new rows alone; see `join_designs`.

    Raises
    ------
    SpecError
        As `make_design`.
    """
    return _draw_rows(
        recipe, simulator, where, count=add, first_sample=first_sample, first_batch=first_batch
    )


def join_designs(parts: Sequence[Design]) -> Design:
    """Put designs of one recipe one after the other."""
    return Design(
        sample=np.concatenate([part.sample for part in parts]),
        columns=_join([part.columns for part in parts]),
        inputs=_join([part.inputs for part in parts]),
        explosive=np.concatenate([part.explosive for part in parts]),
        split=np.concatenate([part.split for part in parts]),
        batch=np.concatenate([part.batch for part in parts]),
        drawn=sum(part.drawn for part in parts),
    )


def _draw_rows(
    recipe: Recipe,
    simulator: Simulator,
    where: str,
    *,
    count: int,
    first_sample: int,
    first_batch: int,
) -> Design:
    """Draw `count` possible rows with ids and batch numbers from the given ones on."""
    _require_possible(recipe, simulator, where)
    kept: list[dict[str, FloatArray]] = []
    batches: list[NDArray[np.int16]] = []
    missing, drawn = count, 0
    for number in range(first_batch, first_batch + _MOST_BATCHES):
        rows = draw_batch(recipe, missing, _stream(recipe, _BATCHES, number))
        possible = _possible(recipe, simulator, rows)
        kept.append({name: values[possible] for name, values in rows.items()})
        batches.append(np.full(np.count_nonzero(possible), number, dtype=np.int16))
        drawn += missing
        missing -= len(batches[-1])
        if missing == 0:
            break
    else:
        message = (
            f"{where}: variables: {missing} of {count} designs are still impossible after {drawn} "
            "were drawn"
        )
        raise SpecError(message)
    columns, batch = _join(kept), np.concatenate(batches)
    explosive = _balanced(count, len(recipe.explosives), _stream(recipe, _EXPLOSIVES, first_batch))
    inputs = simulator.resolve(columns, explosive)
    bad = np.flatnonzero(simulator.outgrown(inputs, explosive))
    if len(bad):
        drawn += _redraw(recipe, simulator, where, bad, columns, explosive, batch, number + 1)
        inputs = simulator.resolve(columns, explosive)
    return Design(
        sample=np.arange(first_sample, first_sample + count, dtype=np.int32),
        columns=columns,
        inputs=inputs,
        explosive=explosive,
        split=split_labels(count, recipe.split.shares, _stream(recipe, _SPLITS, first_batch)),
        batch=batch,
        drawn=drawn,
    )


def _redraw(
    recipe: Recipe,
    simulator: Simulator,
    where: str,
    bad: NDArray[np.intp],
    columns: dict[str, FloatArray],
    explosive: NDArray[np.int8],
    batch: NDArray[np.int16],
    number: int,
) -> int:
    """Draw rows `bad`, whose hole outgrows its bench, anew in place; how many were drawn.

    A row keeps its explosive, and the first batch of new rows is `number`.
    """
    drawn, most = 0, number + _MOST_BATCHES
    while len(bad):
        if number == most:
            message = (
                f"{where}: variables: the holes of {len(bad)} designs still expand as wide as "
                f"their burden or spacing after {drawn} were drawn anew"
            )
            raise SpecError(message)
        rows = draw_batch(recipe, len(bad), _stream(recipe, _BATCHES, number))
        possible = np.flatnonzero(_possible(recipe, simulator, rows))
        place, rest = bad[: len(possible)], bad[len(possible) :]
        for name, values in rows.items():
            columns[name][place] = values[possible]
        batch[place] = number
        drawn, number = drawn + len(bad), number + 1
        inputs = simulator.resolve(_take(columns, place), explosive[place])
        bad = np.concatenate([place[simulator.outgrown(inputs, explosive[place])], rest])
    return drawn


def _join(parts: Sequence[Columns]) -> dict[str, FloatArray]:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def draw_batch(recipe: Recipe, count: int, rng: np.random.Generator) -> dict[str, FloatArray]:
    """Draw one Latin hypercube of `count` rows and map it onto the marginals.

    Returns
    -------
    dict of (count,) [SI]
        Sampled variables, then fixed ones; ratios are turned into values.
    """
    sampled = recipe.sampled
    shares = qmc.LatinHypercube(d=len(sampled), rng=rng).random(count)
    raw = {spec.name: quantiles(spec, shares[:, j]) for j, spec in enumerate(sampled)}
    raw |= {spec.name: np.full(count, spec.at(0.0)) for spec in recipe.fixed}
    for spec in (*sampled, *recipe.fixed):
        if spec.ratio_of is not None:
            raw[spec.name] = raw[spec.name] * raw[spec.ratio_of]
    return raw


def row_faults(recipe: Recipe, simulator: Simulator, columns: Columns) -> list[str]:
    """Say for every row what makes it impossible; the physics first, then the constraints."""
    faults = simulator.faults(columns)
    rows = np.array([i for i, fault in enumerate(faults) if not fault], dtype=np.int64)
    broken = _broken_constraints(recipe, simulator, _take(columns, rows))
    for text, mask in reversed(broken.items()):  # the first constraint has the last word
        for i in rows[mask].tolist():
            faults[i] = f"constraints: {text}"
    return faults


def _possible(recipe: Recipe, simulator: Simulator, columns: Columns) -> BoolArray:
    """Rows that neither the physics nor a constraint refuses."""
    possible = simulator.possible(columns)
    rows = np.flatnonzero(possible)
    for mask in _broken_constraints(recipe, simulator, _take(columns, rows)).values():
        possible[rows[mask]] = False
    return possible


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


def quantiles(spec: VariableSpec, shares: FloatArray) -> FloatArray:
    """Marginal of a sampled variable at the shares (n,)."""
    low, high = spec.at(0.0), spec.at(1.0)
    if spec.distribution == "log_uniform":
        values = np.exp(np.log(low) + shares * (np.log(high) - np.log(low)))
    else:
        values = low + shares * (high - low)
    # Rounding of exp and log must not leave the range.
    return np.asarray(np.clip(values, low, high))


def _balanced(size: int, kinds: int, rng: np.random.Generator) -> NDArray[np.int8]:
    """Every kind equally often, up to one row, in random order."""
    return rng.permutation((np.arange(size) % kinds).astype(np.int8))


def _broken_constraints(
    recipe: Recipe, simulator: Simulator, columns: Columns
) -> dict[str, BoolArray]:
    """Every constraint of the recipe in words, and the rows (n,) that break it.

    Parameters
    ----------
    columns : dict of (n,)
        Rows that the physics does not refuse.
    """
    rules = recipe.constraints
    # The constraints need derived lengths, which do not depend on the explosive.
    count = len(next(iter(columns.values())))
    inputs = simulator.resolve(columns, np.zeros(count, dtype=np.int8))
    ratio = inputs["stemming_length"] / inputs["burden"]
    # A rounding margin: a ratio sampled between the very bounds of the rule is allowed.
    low = rules.minimum_stemming_ratio * (1.0 - 1e-12)
    shortest = VARIABLES["charge_length"].show(rules.minimum_charge_length)
    broken = {f"stemming_length below {rules.minimum_stemming_ratio:g} burden": ratio < low}
    if rules.maximum_stemming_ratio is not None:
        high = rules.maximum_stemming_ratio * (1.0 + 1e-12)
        broken[f"stemming_length above {rules.maximum_stemming_ratio:g} burden"] = ratio > high
    too_short = inputs["charge_length"] < rules.minimum_charge_length * (1.0 - 1e-12)
    return broken | {f"charge_length below {shortest}": too_short}


def _take(columns: Columns, rows: IntArray) -> dict[str, FloatArray]:
    return {name: values[rows] for name, values in columns.items()}


def _require_possible(recipe: Recipe, simulator: Simulator, where: str) -> None:
    """Stop where most rows are impossible, before anything is simulated."""
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
        f"impossible, at most {1.0 - LEAST_ACCEPTANCE:.0%} may be; nothing was run. Refused are "
        f"{'; '.join(lines)}"
    )
    raise SpecError(message)
