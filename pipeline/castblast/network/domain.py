"""Where a network may be used: box, linear rules and joint density of its training rows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np

from castblast.network.parts import Column
from castblast.network.record import Shell
from castblast.types import BoolArray, FloatArray

#: What refuses a row: range of one input, rule between inputs, joint density; or an input that the
#: network cannot see was given.
DomainKind = Literal["box", "rule", "density", "unseen"]
#: Inputs whose free choice would lower the score by this share of the best such choice are named.
BLAME = 0.5


class DomainViolation(NamedTuple):
    """One reason why a row lies outside the training domain."""

    inputs: tuple[str, ...]
    message: str
    kind: DomainKind


def scale_columns(values: FloatArray, columns: tuple[Column, ...]) -> FloatArray:
    """Transform and standardise SI values (n, len(columns)); what cannot be logged gives NaN."""
    logged = np.array([column.transform == "log" for column in columns], dtype=bool)
    mean = np.array([column.mean for column in columns])
    scale = np.array([column.scale for column in columns])
    x: FloatArray = values.astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        x[:, logged] = np.log(x[:, logged])
        scaled: FloatArray = (x - mean) / scale
    return scaled


def density_score(shell: Shell, numeric: FloatArray) -> FloatArray:
    """Score rows of SI inputs (n, k) against the joint density of the training rows.

    Returns
    -------
    (n,) float64
        At most 1 inside; NaN where an input cannot be scaled, and everywhere if the network has
        no density.
    """
    if shell.density is None:
        return np.full(len(numeric), np.nan)
    distances = shell.density.distances(scale_columns(numeric, shell.inputs))
    return np.asarray(np.min(distances, axis=0) / shell.density.threshold)


def density_reliefs(shell: Shell, numeric: FloatArray) -> FloatArray:
    """How far the score of each row would fall if one input were free, (n, k).

    About the nearest centre c with P = whitening' whitening and d = z - c, letting input i go to
    its best value given the others lowers the squared distance by (P d)_i² / P_ii.
    """
    density = shell.density
    if density is None:
        return np.zeros((len(numeric), len(shell.inputs)))
    scaled = scale_columns(numeric, shell.inputs)
    nearest = np.argmin(np.nan_to_num(density.distances(scaled), nan=np.inf), axis=0)
    whitening = density.whitening[nearest]
    steps = np.einsum("nij,nj->ni", whitening, scaled - density.centres[nearest])
    slopes = np.einsum("nij,ni->nj", whitening, steps)
    return np.asarray(slopes**2 / np.sum(whitening**2, axis=1) / density.threshold)


def keeps_ranges_and_rules(shell: Shell, numeric: FloatArray) -> BoolArray:
    """Tell for each row of SI inputs (n, k) whether ranges and rules hold; NaN breaks them."""
    lower = np.array([column.lower for column in shell.inputs])
    upper = np.array([column.upper for column in shell.inputs])
    inside: BoolArray = np.all((numeric >= lower) & (numeric <= upper), axis=1)
    row = dict(zip(shell.input_names, numeric.T, strict=True))
    for rule in shell.constraints:
        with np.errstate(invalid="ignore"):
            inside &= rule.margin(row) >= 0.0
    return inside


def in_domain(shell: Shell, numeric: FloatArray, score: FloatArray | None = None) -> BoolArray:
    """Tell for each row of SI inputs (n, k) whether it lies in the domain; NaN does not.

    `score` is that of `density_score`, where it is known already.
    """
    inside = keeps_ranges_and_rules(shell, numeric)
    if shell.density is not None:
        inside &= (density_score(shell, numeric) if score is None else score) <= 1.0
    return inside


def offending_inputs(shell: Shell, numeric: FloatArray) -> BoolArray:
    """Inputs that `domain_violations` names, for rows of SI inputs (n, k): (n, k) bool."""
    lower = np.array([column.lower for column in shell.inputs])
    upper = np.array([column.upper for column in shell.inputs])
    named: BoolArray = ~((numeric >= lower) & (numeric <= upper))
    columns = dict(zip(shell.input_names, numeric.T, strict=True))
    for rule in shell.constraints:
        with np.errstate(invalid="ignore"):
            broken = ~(rule.margin(columns) >= 0.0)
        involved = np.array([name in rule.coefficients for name in shell.input_names])
        named |= broken[:, None] & involved
    if shell.density is not None:
        unusual = ~named.any(axis=1) & ~(density_score(shell, numeric) <= 1.0)
        reliefs = density_reliefs(shell, numeric[unusual])
        most = np.max(reliefs, axis=1, keepdims=True, initial=0.0)
        named[unusual] = ~(reliefs < BLAME * most)
    return named


def domain_violations(shell: Shell, row: Mapping[str, float]) -> list[DomainViolation]:
    """Give every reason why one row of SI inputs lies outside the training domain.

    Returns
    -------
    list of DomainViolation
        The inputs at fault and a line with value and range in display units; empty if inside.
        The joint density is told only where ranges and rules say nothing.
    """
    violations = []
    for column in shell.inputs:
        value = float(row[column.name])
        if not column.lower <= value <= column.upper:
            trained = f"{column.show(column.lower)} to {column.show(column.upper)}"
            message = f"{column.name} = {column.show(value)}: trained on {trained}"
            violations.append(DomainViolation((column.name,), message, "box"))
    shown = {column.name: column.show(float(row[column.name])) for column in shell.inputs}
    for rule in shell.constraints:
        # Written so that NaN breaks the rule, as in `in_domain`.
        if not rule.margin(row) >= 0.0:
            values = ", ".join(f"{name} = {shown[name]}" for name in rule.coefficients)
            message = f"{values}: trained on {rule.label}"
            violations.append(DomainViolation(tuple(rule.coefficients), message, "rule"))
    return violations or _density_violation(shell, row, shown)


def _density_violation(
    shell: Shell, row: Mapping[str, float], shown: Mapping[str, str]
) -> list[DomainViolation]:
    """Tell of a row whose single values are usual, but not together."""
    numeric = np.array([[float(row[name]) for name in shell.input_names]])
    score = float(density_score(shell, numeric)[0])
    if shell.density is None or score <= 1.0:
        return []
    reliefs = density_reliefs(shell, numeric)[0]
    named = tuple(
        name
        for name, relief in zip(shell.input_names, reliefs, strict=True)
        if not relief < BLAME * np.max(reliefs)
    )
    values = ", ".join(f"{name} = {shown[name]}" for name in named)
    message = (
        f"{values}: unusual {'together' if len(named) > 1 else 'beside the other inputs'}, "
        f"score {score:.3g} where {shell.density.level:.1%} of the training designs stay below 1"
    )
    return [DomainViolation(named, message, "density")]


def domain_faults(shell: Shell, row: Mapping[str, float]) -> list[str]:
    """Messages of `domain_violations`."""
    return [violation.message for violation in domain_violations(shell, row)]
