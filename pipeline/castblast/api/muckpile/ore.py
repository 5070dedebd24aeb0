"""Ore of a bench through a blast: followed, described and tabled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from castblast.muckpile.cast.case import CastCase, CastResult
from castblast.muckpile.results.ore import DigPlan, OreMovement, OrePolygon, move_ore, ore_document


class OreRun(NamedTuple):
    """Ore polygons, how they are dug, and what became of them."""

    polygons: Sequence[OrePolygon]
    plan: DigPlan
    moved: OreMovement


def follow_ore(
    polygons: Sequence[OrePolygon], plan: DigPlan, case: CastCase, result: CastResult
) -> OreRun | None:
    """Follow ore through a cast; None without polygons."""
    if not polygons:
        return None
    density = case.law.density
    moved = move_ore(case.particles, result.particles, polygons, density=density, plan=plan)
    return OreRun(polygons, plan, moved)


def describe_ore(run: OreRun) -> Mapping[str, Any]:
    """Ore part of the document of a run."""
    plan = run.plan
    return {
        "dig_block": plan.block,
        "flitch": plan.flitch,
        "outline_share": plan.share,
        **ore_document(run.polygons, run.moved),
    }


def ore_rows(ore: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Headline numbers of the ore for people: name, value, unit."""
    rows = []
    for polygon in ore["polygons"]:
        name = polygon["name"]
        own = {entry["method"]: entry for entry in ore["digging"] if entry["polygon"] == name}
        best = own["dig_blocks"]
        rows += [
            (f"{name}: moved", _length(polygon["displacement"]), "m"),
            (f"{name}: ore loss, dug in blocks", _percent(best["loss"]), "%"),
            (f"{name}: dilution, dug in blocks", _percent(best["dilution"]), "%"),
        ]
    return rows


def _length(displacement: Sequence[float] | None) -> str:
    if displacement is None or any(part is None for part in displacement):
        return "-"
    return f"{float(np.hypot(displacement[0], displacement[1])):.3g}"


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100.0 * share:.3g}"
