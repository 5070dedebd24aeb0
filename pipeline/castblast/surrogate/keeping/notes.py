"""What the page of a run says at its top: a few lines of Markdown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from castblast.names import as_words
from castblast.surrogate.fitting.features import SPLITS, Table
from castblast.surrogate.fitting.metrics import show_share
from castblast.surrogate.judging.champion import champion_name

if TYPE_CHECKING:
    from castblast.surrogate.judging.comparison import League
    from castblast.surrogate.searching.tuning import StudyResult


def comparison_note(league: League, figures: Mapping[str, float | int | None]) -> str:
    """Champion and errors of a comparison.

    Parameters
    ----------
    league : League
    figures : mapping
        From `judging.champion.champion_figures`.
    """
    best = f"**No champion: none passes the physics gate.** Figures of `{champion_name(league)}`"
    lines = [f"**Champion: `{league['chosen']}`**" if league["chosen"] else best]
    lines += [
        "",
        f"- held-out test error {_percent(figures['test_error_percent'])}, validation error "
        f"{_percent(figures['valid_error_percent'])} (geometric mean over the targets of the 95 % "
        "relative error)",
    ]
    lines += [
        f"- {as_words(target)} on test rows: median error "
        f"{_percent(figures[f'test_median_percent_{target}'])}, 95 % of rows within "
        f"{_percent(figures[f'test_p95_percent_{target}'])}"
        for target in league["targets"]
    ]
    counts: dict[str, int] = {split: int(figures[f"rows_{split}"] or 0) for split in SPLITS}
    lines += [
        f"- dataset {_dataset(league['dataset'])}, {_rows(counts)}; {figures['models']} models",
        f"- ranked by validation rows: {league['rule']}; test rows decide nothing",
    ]
    return "\n".join(lines)


def study_note(study: StudyResult, table: Table) -> str:
    """Best trial of a study; test rows are not asked in a study."""
    best = study.best
    finished = sum(trial.error is not None for trial in study.trials)
    settings = ", ".join(f"{name} {value}" for name, value in best.settings.items())
    counts = {split: len(table.rows(split)) for split in ("train", "valid")}
    return "\n".join(
        [
            f"**Best: `{study.spec.name}`**, trial {best.number}",
            "",
            f"- validation error {show_share(best.error)} (geometric mean over the targets of the "
            "95 % relative error)",
            f"- settings: {settings}",
            f"- dataset {_dataset(table.source)}, {_rows(counts)}",
            f"- {len(study.trials)} trials of `{study.identity['spec']}`, {finished} finished, "
            "ranked by validation rows; test rows are not used, `castblast compare` scores on them",
        ]
    )


def _percent(value: float | int | None) -> str:
    return show_share(None if value is None else value / 100.0)


def _dataset(source: Mapping[str, str]) -> str:
    """Name, version and content of a dataset."""
    parts = [f"`{source.get('name', 'dataset')}`", source.get("dataset_version", "")]
    content = source.get("content_sha256", "")[:12]
    return " ".join([*filter(None, parts), *([f"({content})"] if content else [])])


def _rows(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{count:,} {split}" for split, count in counts.items()) + " rows"
