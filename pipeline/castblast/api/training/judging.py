"""Fits of one dataset judged: gate, league, curves, shifts, indices.

What takes long is kept in the cache of the user (`castblast.surrogate.fitting.kept`), so that a
comparison which was stopped resumes and a second one only writes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castblast.api.training.found import Comparison, Extent
from castblast.api.training.parts import (
    Done,
    Part,
    curve_part,
    open_domain,
    probe_part,
    run_parts,
    shift_part,
    sobol_part,
)
from castblast.errors import DatasetError, SpecError
from castblast.identity import file_hash
from castblast.progress import ProgressCallback, part

if TYPE_CHECKING:
    from castblast.surrogate.fitting.features import Table
    from castblast.surrogate.fitting.training import Fit

FULL = Extent("full")
#: For a first look, in two minutes: fewer rows, iterations and starts.
QUICK = Extent(
    "quick",
    train_rows=2000,
    quick_specs=True,
    every_curve=False,
    curve_sizes=(250, 500, 1000),
    shifts=False,
    probe_points=128,
    dense_points=2048,
    sobol_rows=1024,
    checked_rows=0,
)
#: What the demo has time for.
DEMO = Extent(
    "demo", every_curve=False, shifts=False, always_choose=True, probe_points=128,
    dense_points=2048, sobol_rows=1024, checked_rows=0,
)  # fmt: skip


def judge(
    fits: list[Fit],
    table: Table,
    dataset: Path,
    folder: Path,
    extent: Extent,
    remarks: list[str],
    workers: int | None,
    progress: ProgressCallback,
) -> Comparison:
    """Gate and league, then what is asked of the chosen model only."""
    from castblast.surrogate.judging.comparison import compare as league_of
    from castblast.surrogate.judging.gate import check_physics

    domain = _domain_or_remark(dataset, remarks)
    about = {"dataset": file_hash(dataset)}
    parts = [_curve(fit, table, about, extent) for fit in fits if extent.every_curve]
    if domain:
        sizes = (extent.probe_points, extent.dense_points)
        parts.append(Part("probe", probe_part, (dataset, *sizes), {**about, "sizes": sizes}))
    done = run_parts(parts, folder, workers=workers, progress=part(progress, 0.0, 0.6))
    gates: dict[str, dict[str, Any]] = {}
    if domain:
        probe = done["probe"].value
        gates = {fit.spec.name: check_physics(fit, probe) for fit in fits}
    league = league_of(fits, gates)
    first = league["best_exportable"]
    if league["chosen"] is None and extent.always_choose:
        league["chosen"] = first
        remarks.append(f"no model passes the physics gate; {first} is selected anyway")
    first = league["chosen"] or first
    chosen = next(fit for fit in fits if fit.spec.name == first)
    known = dataset if domain else None
    parts = _parts_of_chosen(chosen, table, known, about, extent)
    parts += _shift_parts(_shifted(chosen, fits, league), table, known, about, extent)
    parts = [one for one in parts if one.name not in done]
    done |= run_parts(parts, folder, workers=workers, progress=part(progress, 0.6, 1.0))
    return Comparison(
        fits=fits,
        table=table,
        league=league,
        gates=gates,
        chosen=chosen,
        curves=_curves(fits, done),
        shifts={
            name.removeprefix("shifts_"): result.value
            for name, result in done.items()
            if name.startswith("shifts_")
        },
        sobol=_value(done, f"sobol_{chosen.spec.name}"),
        remarks=remarks,
        times={
            name: {"seconds": result.seconds, "cpu_seconds": result.cpu_seconds}
            for name, result in done.items()
        },
        extent=extent,
    )


def _domain_or_remark(dataset: Path, remarks: list[str]) -> bool:
    """Whether the dataset says from which domain it comes; if not, what is left out for that."""
    try:
        open_domain(dataset)
    except (DatasetError, SpecError) as fault:
        remarks.append(f"no physics gate and no Sobol indices: {fault}")
        return False
    return True


def _identity(fit: Fit, about: Mapping[str, Any]) -> dict[str, Any]:
    from castblast.surrogate.fitting.fit_store import fit_key

    return {**about, **fit_key(fit.spec, fit.table)}


def _curve(fit: Fit, table: Table, about: Mapping[str, Any], extent: Extent) -> Part:
    return Part(
        f"curve_{fit.spec.name}",
        curve_part,
        (replace(fit, estimator=None), table, extent.curve_sizes),  # the scores are all it takes
        {**_identity(fit, about), "sizes": extent.curve_sizes},
    )


def _parts_of_chosen(
    fit: Fit, table: Table, dataset: Path | None, about: Mapping[str, Any], extent: Extent
) -> list[Part]:
    name, identity = fit.spec.name, _identity(fit, about)
    parts = [_curve(fit, table, about, extent)]
    if extent.sobol_rows and dataset is not None:
        sizes = (extent.sobol_rows, extent.checked_rows)
        inputs = {**identity, "sizes": sizes}
        parts.append(Part(f"sobol_{name}", sobol_part, (fit, dataset, *sizes), inputs))
    return parts


def _shifted(chosen: Fit, fits: Sequence[Fit], league: Mapping[str, Any]) -> list[Fit]:
    """The chosen fit, and the best of those that can be asked for an explosive never shown."""
    from castblast.surrogate.judging.shifts import describes_explosives

    named = {fit.spec.name: fit for fit in fits}
    ranked = [named[entry["name"]] for entry in league["league"]]
    able = [fit for fit in ranked if describes_explosives(fit.spec)]
    return list(dict.fromkeys([chosen, *able[:1]]))


def _shift_parts(
    fits: Sequence[Fit],
    table: Table,
    dataset: Path | None,
    about: Mapping[str, Any],
    extent: Extent,
) -> list[Part]:
    if not extent.shifts:
        return []
    return [
        Part(
            f"shifts_{fit.spec.name}", shift_part, (fit.spec, table, dataset), _identity(fit, about)
        )
        for fit in fits
    ]


def _curves(fits: Sequence[Fit], done: Mapping[str, Done]) -> dict[str, Any]:
    """Learning curves in the order of the fits."""
    names = [fit.spec.name for fit in fits]
    return {name: done[f"curve_{name}"].value for name in names if f"curve_{name}" in done}


def _value(done: Mapping[str, Done], name: str) -> dict[str, Any] | None:
    return done[name].value if name in done else None
