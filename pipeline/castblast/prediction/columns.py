"""The core of a prediction: columns of designs through a network, refused as the physics refuses.

`castblast.design.rule` completes and refuses the designs; what is added here is what a network
cannot see. An input that it was not trained on has one value for it: that which was held in
training, or that which follows from its own inputs. Stemming and charge that do not fit the way in
which the network was trained are refused, for any number would be that of another charge; other
such inputs are marked. Imports NumPy and light modules only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from castblast.design.hole import breakout_width, expanded_hole_faults, mean_burden
from castblast.design.rule import (
    COMPLETED,
    FaultyRows,
    InputColumns,
    as_columns,
    complete_columns,
    completions_of,
    fault_columns,
    name_faults,
    require_none,
)
from castblast.design.variables import INPUT_NAMES, VARIABLES
from castblast.network import (
    Bounds,
    DomainViolation,
    Evaluate,
    Network,
    RowPredictions,
    Shell,
    answer_rows,
    domain_violations,
    evaluate_rows,
    explosive_index,
    keeps_ranges_and_rules,
)
from castblast.specs.catalogue import resolve_explosive
from castblast.types import BoolArray, FloatArray, IntArray

#: Inputs that share the hole: a network that cannot see how they do so answers for another charge.
_CHARGE = ("stemming_length", "charge_length")
#: What a hole is as wide as when the burden begins to move.
_EXPANSION = "expanded_hole_radius"
#: Diameters that no hole expands to: at most 10.1 over the whole table of inputs.
_FARTHEST = 12.0
#: Two values of an input are the same to this relative tolerance.
_SAME = 1e-9


class UnseenInput(NamedTuple):
    """An input that the network cannot see and that differs from what it was trained on.

    Attributes
    ----------
    name : str
    rows : (n,) bool
        Where it differs.
    say : callable
        Turns the number of such a row into a line with the value and what was trained on.
    """

    name: str
    rows: BoolArray
    say: Callable[[int], str]


class NetworkDesigns(NamedTuple):
    """Designs as a network takes them.

    Attributes
    ----------
    inputs : dict of (n,) [SI]
        The numeric inputs of the network, in its order.
    faults : list of FaultyRows
        What refuses a design; such rows hold whatever was given.
    unseen : list of UnseenInput
        What the network cannot see though the design has it, without what is refused.
    """

    inputs: dict[str, FloatArray]
    faults: list[FaultyRows]
    unseen: list[UnseenInput]


class ColumnPredictions(NamedTuple):
    """Answers for n designs.

    Attributes
    ----------
    designs : NetworkDesigns
    rows : RowPredictions
        Outputs, bands, density score; NaN in refused rows.
    refused : (n,) bool
        Rows that are no possible design, or none for this network; see `designs.faults`.
    domain : (n,) str
        ``inside``, ``unusual`` (only the joint density objects) or ``outside``.
    """

    designs: NetworkDesigns
    rows: RowPredictions
    refused: BoolArray
    domain: NDArray[np.str_]


def predict_columns(
    values: InputColumns,
    explosive: NDArray[np.integer],
    network: Shell,
    evaluate: Evaluate | None = None,
) -> ColumnPredictions:
    """Predict columns of designs.

    Parameters
    ----------
    values : mapping of input name to (n,) or float [SI]
        What is missing is completed; the same inputs are given in every row.
    explosive : (n,) int
        Positions in `network.explosives`.
    network : Network
    evaluate : callable, optional
        A model of another shape, of which `network` is the shell; asked for possible rows only.

    Returns
    -------
    ColumnPredictions
        Designs are refused in `designs.faults`, not by an exception; `design.rule.lines_by_row`
        words them.

    Raises
    ------
    SpecError
        Unknown names, values that are no numbers, or an input without a default that is missing.
    """
    index = np.asarray(explosive, dtype=np.int64)
    designs, full = _completed(values, len(index), network)
    numeric = np.stack(list(designs.inputs.values()), axis=1)
    asked = _evaluator(network, evaluate)
    if evaluate is None:
        values_of_rows = asked(numeric, index)
    else:
        possible = ~_any_row(designs.faults, len(index))
        values_of_rows = _some_rows(asked, numeric, index, possible, len(network.outputs))
    rows = answer_rows(network, numeric, values_of_rows)
    designs.faults.extend(_outgrown(network, numeric, index, rows, designs, full, asked))
    refused = _any_row(designs.faults, len(index))
    outside = ~keeps_ranges_and_rules(network, numeric)
    for entry in designs.unseen:
        outside |= entry.rows
    domain = np.where(outside, "outside", np.where(rows.inside, "inside", "unusual"))
    if refused.any():
        rows = _without(rows, refused)
        domain = np.where(refused, "outside", domain)
    return ColumnPredictions(designs, rows, refused, domain)


def _evaluator(network: Shell, evaluate: Evaluate | None) -> Evaluate:
    """What computes values: the network itself, or the model that belongs to a shell."""
    if evaluate is not None:
        return evaluate
    if not isinstance(network, Network):
        message = "a shell without layers needs a model that computes its values"
        raise TypeError(message)
    return partial(evaluate_rows, network)


def _some_rows(
    evaluate: Evaluate, numeric: FloatArray, index: IntArray, rows: BoolArray, width: int
) -> FloatArray:
    """Values (n, width) of some rows, NaN in the others: libraries refuse odd numbers."""
    values = np.full((len(numeric), width), np.nan)
    if rows.any():
        values[rows] = evaluate(numeric[rows], index[rows])
    return values


def explosive_position(network: Shell, text: str) -> int:
    """Position in a network of an explosive as people write it: ``ANFO``, ``Heavy ANFO``.

    Raises
    ------
    SpecError
        The network was not trained on it; the message lists those it knows.
    """
    return explosive_index(network, resolve_explosive(text, network.explosives) or text)


def _without(rows: RowPredictions, refused: BoolArray) -> RowPredictions:
    """Answers with NaN in every number of the refused rows."""

    def blank(part: FloatArray) -> FloatArray:
        return np.where(refused[:, None], np.nan, part)

    return RowPredictions(
        values=blank(rows.values),
        prediction=Bounds(*map(blank, rows.prediction)),
        network=Bounds(*map(blank, rows.network)),
        score=np.where(refused, np.nan, rows.score),
        inside=rows.inside & ~refused,
    )


def network_designs(values: InputColumns, count: int, network: Shell) -> NetworkDesigns:
    """Complete and check `count` designs for a network; see `predict_columns`."""
    return _completed(values, count, network)[0]


def _completed(
    values: InputColumns, count: int, network: Shell
) -> tuple[NetworkDesigns, dict[str, FloatArray]]:
    """Designs as a network takes them, and all inputs that they have."""
    require_none(name_faults(values))
    given = as_columns(values, count)
    held = held_inputs(network)
    # Where training held an input at another value than the default, that is what is answered for.
    known: dict[str, float | FloatArray] = {n: v for n, v in held.items() if n not in COMPLETED}
    known |= given
    faults = fault_columns(known, count)
    full = complete_columns(known, count)
    missing = [name for name in network.input_names if name not in full]
    require_none([f"{name}: must be given, it has no default" for name in missing])
    inputs = {name: full[name] for name in network.input_names}
    trained: dict[str, float | FloatArray] = {**held, **inputs}
    unseen = _unseen({*given, *COMPLETED}, full, trained, count)
    faulty = _any_row(faults, count)
    faults += [
        FaultyRows(entry.rows & ~faulty, entry.say) for entry in unseen if entry.name in _CHARGE
    ]
    return NetworkDesigns(inputs, faults, [e for e in unseen if e.name not in _CHARGE]), full


@np.errstate(all="ignore")  # what is no number is refused by its bounds
def _outgrown(
    network: Shell,
    numeric: FloatArray,
    index: IntArray,
    rows: RowPredictions,
    designs: NetworkDesigns,
    full: Mapping[str, FloatArray],
    evaluate: Evaluate,
) -> list[FaultyRows]:
    """Designs whose hole, as predicted, expands as wide as their burden or spacing.

    The hole knows rock, explosive and its own diameter only. The bench is put into its trained
    range before the hole is asked for, and nothing is said where anything else lies outside.
    """
    if _EXPANSION not in network.output_names:
        return []
    radius = rows.values[:, network.output_names.index(_EXPANSION)].copy()
    bench = np.array([VARIABLES[n].role == "bench" if n in VARIABLES else False
                      for n in network.input_names])  # fmt: skip
    lower = np.array([column.lower for column in network.inputs])
    upper = np.array([column.upper for column in network.inputs])
    beyond = ~((numeric >= lower) & (numeric <= upper))
    narrow = breakout_width(full["spacing"], mean_burden(full)) < _FARTHEST * full["hole_diameter"]
    possible = ~_any_row(designs.faults, len(index))
    moved = np.flatnonzero((beyond & bench).any(axis=1) & narrow & possible)
    if len(moved):
        near = np.where(bench, np.clip(numeric[moved], lower, upper), numeric[moved])
        answers = evaluate(near, index[moved])
        radius[moved] = answers[:, network.output_names.index(_EXPANSION)]
    known = narrow & ~(beyond & ~bench).any(axis=1) & possible
    for entry in designs.unseen:  # the answer is for another hole
        known &= ~entry.rows
    faults = expanded_hole_faults(full, np.where(known, radius, np.nan))
    return [fault for fault in faults if fault.rows.any()]


def held_inputs(network: Shell) -> dict[str, float]:
    """Inputs that were the same in every row of the training data, by name [SI]."""
    held = network.provenance.get("held_inputs", {})
    return {name: float(held[name]) for name in INPUT_NAMES if name in held}


def row_violations(answers: ColumnPredictions, row: int, network: Shell) -> list[DomainViolation]:
    """Give every reason why one row lies outside the training domain, in words."""
    design = {name: float(column[row]) for name, column in answers.designs.inputs.items()}
    unseen = [
        DomainViolation((entry.name,), entry.say(row), "unseen")
        for entry in answers.designs.unseen
        if entry.rows[row]
    ]
    return domain_violations(network, design) + unseen


def _any_row(faults: Sequence[FaultyRows], count: int) -> BoolArray:
    rows = np.zeros(count, dtype=bool)
    for fault in faults:
        rows |= fault.rows
    return rows


def _unseen(
    names: set[str],
    full: Mapping[str, FloatArray],
    trained: Mapping[str, float | FloatArray],
    count: int,
) -> list[UnseenInput]:
    """Inputs of `names` whose values are not those that go with the training inputs `trained`."""
    expected = complete_columns(trained, count)
    sums = {entry.name: entry.words for entry in completions_of(trained)}
    found = []
    for name in INPUT_NAMES:
        if name not in names or full[name] is trained.get(name):
            continue
        column, other = full[name], expected.get(name)
        rows = np.ones(count, dtype=bool)
        if other is not None:
            rows = ~np.isclose(column, other, rtol=_SAME, atol=1e-12)
        if rows.any():
            say = _say_charge if name in _CHARGE else _say_unseen
            words = sums.get(name, "")
            found.append(UnseenInput(name, rows, _sayer(say, name, words, full, other)))
    return found


def _sayer(
    say: Callable[..., str],
    name: str,
    words: str,
    full: Mapping[str, FloatArray],
    expected: FloatArray | None,
) -> Callable[[int], str]:
    def line(row: int) -> str:
        at = None if expected is None else VARIABLES[name].show(float(expected[row]))
        shown = {n: VARIABLES[n].show(float(full[n][row])) for n in (name, *_CHARGE)}
        return say(name, words, shown, at)

    return line


def _say_charge(name: str, words: str, shown: Mapping[str, str], expected: str) -> str:
    other = next(entry for entry in _CHARGE if entry != name)
    rule = f"{name.replace('_', ' ')} = {words} only, here {expected}" if words else expected
    return (
        f"{name} {shown[name]} with {other} {shown[other]}: the network was trained on {rule}; "
        "'castblast simulate' takes any"
    )


def _say_unseen(name: str, words: str, shown: Mapping[str, str], expected: str | None) -> str:
    trained = "" if expected is None else f", trained at {expected}"
    if words and expected is not None:
        trained += f" ({name.replace('_', ' ')} = {words} only)"
    return f"{name} = {shown[name]}: has no effect in this network{trained}"
