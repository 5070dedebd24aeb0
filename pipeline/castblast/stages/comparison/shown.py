"""What the screen shows of a comparison."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from castblast.api.training.document import HEADLINE, paper_met_from
from castblast.api.training.found import Comparison
from castblast.names import as_words
from castblast.stages.outcome import Outcome
from castblast.surrogate.fitting.metrics import show_r_squared, show_share


def outcome(found: Comparison, document: Mapping[str, Any], out: Path) -> Outcome:
    """Give what the screen shows of a comparison."""
    league = found.league
    paper = league["paper"]
    first = HEADLINE if HEADLINE in league["targets"] else league["targets"][0]
    others = [name for name in league["targets"] if name != first]
    shown = [as_words(name) for name in (first, *others)]
    header = ["model", "gate", "export", f"{shown[0]}: R²", *(f"{name}: 95 %" for name in shown)]
    rows = []
    for entry in league["league"]:
        mark = " *" if entry["name"] == league["chosen"] else ""
        gate = {True: "passed", False: "failed", None: "-"}[entry["gate_passed"]]
        figures = entry["targets"]
        rows.append(
            [
                entry["name"] + mark,
                gate,
                "yes" if entry["exportable"] else "no",
                show_r_squared(figures[first]["r2"]),
                *(show_share(figures[name]["relative_error_95"]) for name in (first, *others)),
            ]
        )
    if paper["target"] == first:
        published = [f"{paper['r2']:.4f}", f"{paper['relative_error_95']:.1%}"]
        rows.append([f"paper, {paper['runs']:,} runs", "", "", *published, *("" for _ in others)])
    title = f"{league['test_rows']:,} held-out test rows"
    return Outcome(
        document={**document, "out": str(out)},
        title=title,
        header=header,
        rows=rows,
        lines=_lines(found, out),
        ok=league["chosen"] is not None,
    )


def _lines(found: Comparison, out: Path) -> list[str]:
    league = found.league
    if league["chosen"] is None:
        lines = ["no model that can be exported passes the physics gate: none is chosen"]
        first = league["best_exportable"]
        reasons = found.gates[first]["reasons"]
        lines += [f"{first}: {reason}" for reason in reasons[:3]]
    else:
        lines = [f"* chosen: {league['rule']}"]
    if league["gap"] > 1.0:
        lines.append(
            f"its validation error is {league['gap']:.2f} times that of the best overall, "
            f"{league['best_overall']}"
        )
    for name, curve in found.curves.items():
        rows = paper_met_from(curve, league["paper"])
        lines.append(
            f"{name}: the published figures are not met with {curve[-1].rows:,} training rows"
            if rows is None
            else f"{name}: the published figures are met from {rows:,} training rows on"
        )
    return [*lines, *found.remarks, f"wrote {out / 'report.html'}"]
