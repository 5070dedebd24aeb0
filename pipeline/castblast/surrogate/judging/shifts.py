"""Beyond random splits: explosives never seen, corners of the domain, extreme dimensionless groups.

Every test refits the spec without the rows of one kind and judges it on the test rows of that
kind, beside the fit that saw such rows. What is judged are always rows of the frozen test split.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from castblast.disk.plain import finite
from castblast.errors import DatasetError
from castblast.progress import ProgressCallback, silent
from castblast.specs.models.model import ModelSpec
from castblast.surrogate.fitting.features import MINIMUM_ROWS, Table
from castblast.surrogate.fitting.metrics import score_targets, summary_error
from castblast.surrogate.fitting.training import Fit, fit_spec
from castblast.surrogate.judging.domain import Domain
from castblast.types import BoolArray, FloatArray, IntArray

Refit: TypeAlias = Callable[[ModelSpec, Table], Fit]

#: Share of the rows, those with the largest group, that an extrapolation leaves out.
_EXTREME = 0.2
#: Share of the training rows inside the inner box.
_INNER = 0.5
#: Fewest rows that a figure is given for.
_FEWEST = 20


class Shift(NamedTuple):
    """One test: rows (n,) of the table that are kept from the training and judged."""

    kind: str
    name: str
    says: str
    away: BoolArray


def shift_tests(
    fit: Fit,
    table: Table,
    domain: Domain | None = None,
    *,
    able: bool | None = None,
    refit: Refit = fit_spec,
    progress: ProgressCallback = silent,
) -> dict[str, Any]:
    """Run all tests on the spec of a fit: a refit per explosive, two for the corners, one a group.

    Parameters
    ----------
    fit : Fit
        The spec fitted on all training rows, for comparison.
    table : Table
    domain : Domain, optional
        Gives the explosion pressures; without it the group with them is left out.
    able : bool, optional
        Whether the model knows an explosive by numbers that describe it, so that one it was never
        shown means something to it; default: what the spec says.
    refit : callable
        Fits a spec; pass one with fewer restarts to save time.
    progress : callable

    Returns
    -------
    dict
        Plain JSON values: ``able_to_meet_new_explosives`` and ``tests``, a list with kind
        (explosive, corner, group), name, says, train_rows, judged_rows, error (geometric mean over
        the targets of the 95 % relative error), error_when_seen (of the fit that saw such rows, on
        the same rows), ratio and targets (scores); or with not_run, which says why.
    """
    table = table.select(fit.table.feature_names, fit.table.target_names)
    able = describes_explosives(fit.spec) if able is None else able
    shifts = [*_explosives(table), _corner(table), *_groups(table, domain)]
    tests = []
    for number, shift in enumerate(shifts):
        progress(number / len(shifts), f"{fit.spec.name} without {shift.name}")
        if shift.kind == "explosive" and not able:
            why = "the model knows explosives by name alone"
            tests.append({**_head(shift), "not_run": why})
            continue
        tests.append(_test(fit, table, shift, refit))
    progress(1.0, f"{fit.spec.name}: shifts judged")
    return {"able_to_meet_new_explosives": able, "tests": tests}


def describes_explosives(spec: ModelSpec) -> bool:
    """Whether a spec gives its model numbers that describe an explosive, instead of its name."""
    return str(getattr(spec, "explosive_code", "one_hot")) != "one_hot"


def _explosives(table: Table) -> Iterator[Shift]:
    kinds = table.frame["explosive"].to_numpy(dtype=str)
    for name in table.explosives:
        yield Shift("explosive", name, f"{name} never shown", kinds == name)


def _corner(table: Table) -> Shift:
    """Rows outside the box that holds `_INNER` of the rows, the same share of every input.

    What lies outside is at one of the two ends of an input.
    """
    numeric = table.frame[list(table.feature_names)].to_numpy(dtype=np.float64)
    train = table.rows("train")
    reach = np.zeros(len(numeric))
    for column in numeric.T:
        ordered = np.sort(column[train])
        share = np.searchsorted(ordered, column) / len(ordered)
        reach = np.maximum(reach, np.abs(2.0 * share - 1.0))
    edge = float(np.quantile(reach[train], _INNER))
    says = f"some input in its outer {1.0 - edge:.1%}"
    return Shift("corner", "the outer box", says, reach > edge)


def _groups(table: Table, domain: Domain | None) -> Iterator[Shift]:
    """Largest values of dimensionless groups."""
    train = table.rows("train")
    for name, values in dimensionless_groups(table, domain).items():
        edge = float(np.quantile(values[train], 1.0 - _EXTREME))
        yield Shift("group", name, f"{name} above {edge:.4g}", values > edge)


def dimensionless_groups(table: Table, domain: Domain | None = None) -> dict[str, FloatArray]:
    """Groups that the inputs of a table allow, by name, (n,)."""
    columns: dict[str, FloatArray] = {
        name: table.frame[name].to_numpy(dtype=np.float64) for name in table.feature_names
    }
    columns |= {name: np.full(len(table.frame), v) for name, v in table.held.items()}
    if "stemming_length" not in columns and {"bench_height", "charge_length"} <= set(columns):
        columns["stemming_length"] = columns["bench_height"] - columns["charge_length"]
    if domain is not None:
        columns["explosion_pressure"] = _explosion_pressures(table, domain)
    ratios = (
        ("burden", "hole_diameter"),
        ("ucs", "explosion_pressure"),
        ("young_modulus", "ucs"),
        ("stemming_length", "burden"),
    )
    return {
        f"{above} over {below}".replace("_", " "): columns[above] / columns[below]
        for above, below in ratios
        if above in columns and below in columns
    }


def _explosion_pressures(table: Table, domain: Domain) -> FloatArray:
    """Explosion pressure of each row's explosive [Pa], of the simulator on one point each."""
    count = len(domain.explosives)
    one = domain.spread(1)
    points = one.take(np.zeros(count, dtype=np.int64))._replace(
        explosive=np.arange(count, dtype=np.int64)
    )
    pressures = domain.simulate(points, ("explosion_pressure",))[:, 0]
    by_name: Mapping[str, float] = dict(zip(domain.explosives, pressures.tolist(), strict=True))
    return np.array([by_name[name] for name in table.frame["explosive"]])


def _test(fit: Fit, table: Table, shift: Shift, refit: Refit) -> dict[str, Any]:
    """Refit without the rows of a shift and judge on the test rows of it."""
    held = table.split == "test"
    judged = np.flatnonzero(held & shift.away)
    if len(judged) < _FEWEST:
        return {**_head(shift), "not_run": f"{len(judged)} test rows, {_FEWEST} are needed"}
    part = _rows(table, held | ~shift.away)
    short = [s for s in ("train", "valid", "calibration") if len(part.rows(s)) < MINIMUM_ROWS[s]]
    if short:
        return {**_head(shift), "not_run": f"too few rows are left to {' and '.join(short)}"}
    try:
        document = _judge(refit(fit.spec, part), table, judged)
        if shift.kind == "corner":  # half the rows are gone; tell their number from their place
            same = table.with_train_rows(len(part.rows("train")))
            control = _judge(refit(fit.spec, same), table, judged)
            document["error_of_as_many_random_rows"] = control["error"]
    except DatasetError as fault:
        return {**_head(shift), "not_run": str(fault)}
    seen = _judge(fit, table, judged)["error"]
    both = seen is not None and document["error"] is not None and seen > 0.0
    return {
        **_head(shift),
        **document,
        "error_when_seen": seen,
        "ratio": document["error"] / seen if both else None,
    }


def _judge(fit: Fit, table: Table, judged: IntArray) -> dict[str, Any]:
    """Scores of a fit on rows of `table`, found again in the table of the fit by their sample."""
    place = {sample: i for i, sample in enumerate(fit.table.sample.tolist())}
    rows = np.array([place[sample] for sample in table.sample[judged].tolist()])
    scores = score_targets(fit.table.targets[rows], fit.predicted[rows], fit.table.target_names)
    error = summary_error(scores)
    return {
        "train_rows": len(fit.table.rows("train")),
        "judged_rows": len(rows),
        "error": finite(error),
        "targets": {name: entry.to_document() for name, entry in scores.items()},
    }


def _rows(table: Table, keep: BoolArray) -> Table:
    return replace(
        table,
        frame=table.frame[keep],
        targets=table.targets[keep],
        sample=table.sample[keep],
        split=table.split[keep],
    )


def _head(shift: Shift) -> dict[str, Any]:
    return {"kind": shift.kind, "name": shift.name, "says": shift.says}
