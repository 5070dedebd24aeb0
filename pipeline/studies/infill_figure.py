"""Table and picture of the infill study from its CSV file.

python pipeline/studies/infill_figure.py data/infill/infill.csv pipeline/docs/figures/infill.png
"""

from __future__ import annotations

import argparse
import csv
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from castblast.report.style import BLUE, GREEN, ORANGE, in_style, new_figure, save_figure

ARMS = {"latin hypercube": BLUE, "infill": ORANGE, "infill, not apart": GREEN}
MODELS = {"networks": "--", "process": "-"}
MODEL_NAMES = {"networks": "networks that chose", "process": "Gaussian process"}
FIGURES = {"within_95": "95 % of rows within", "within_99": "99 % within", "worst": "worst row"}
TITLES = {"crushed_zone_radius": "Crushed zone radius", "burden_velocity": "Burden velocity"}

Key = tuple[str, str, str, str]
Runs = Mapping[Key, Mapping[int, list[float]]]


def read(path: Path) -> Runs:
    """(model, target, figure, arm) to rows to the values of the seeds."""
    runs: dict[Key, dict[int, list[float]]] = defaultdict(lambda: defaultdict(list))
    with path.open() as stream:
        for line in csv.DictReader(stream):
            for figure in FIGURES:
                key = (line["model"], line["target"], figure, line["arm"])
                runs[key][int(line["rows"])].append(float(line[figure]))
    return runs


def table(runs: Runs) -> list[str]:
    """Lines of a Markdown table: errors at the largest size, and infill over Latin hypercube."""
    heads = ("judged by", "target", "figure", *ARMS, "infill over hypercube, seed by seed")
    lines = [f"| {' | '.join(heads)} |", f"|{' --- |' * len(heads)}"]
    for model in MODELS:
        for target in TITLES:
            for figure, label in FIGURES.items():
                series = {arm: runs[model, target, figure, arm] for arm in ARMS}
                size = max(series["latin hypercube"])
                means = [f"{np.mean(series[arm][size]):.2%}" for arm in ARMS]
                pairs = zip(series["infill"][size], series["latin hypercube"][size], strict=False)
                ratios = ", ".join(f"{new / old:.2f}" for new, old in pairs)
                cells = [model, TITLES[target], f"{label}, {size} rows", *means, ratios]
                lines.append(f"| {' | '.join(cells)} |")
    return lines


def savings(runs: Runs, model: str, target: str, figure: str) -> float:
    """Rows of Latin hypercube that give what infill gives at its largest size, over that size."""
    plain, chosen = (runs[model, target, figure, arm] for arm in ("latin hypercube", "infill"))
    sizes = sorted(plain)
    slope, start = np.polyfit(np.log(sizes), [np.log(np.mean(plain[s])) for s in sizes], 1)
    reached = np.log(np.mean(chosen[sizes[-1]]))
    return float(np.exp((reached - start) / slope)) / sizes[-1]


@in_style
def draw(runs: Runs, path: Path, figures: Sequence[str] = ("within_95", "worst")) -> None:
    """Errors over rows, one panel per target and figure."""
    picture, axes = new_figure(len(figures), len(TITLES), width=8.5, height=6.0, sharex=True)
    for row, figure in enumerate(figures):
        for column, (target, title) in enumerate(TITLES.items()):
            axis = axes[row, column]
            for arm, colour in ARMS.items():
                for model, dash in MODELS.items():
                    series = runs[model, target, figure, arm]
                    sizes = sorted(series)
                    means = [100 * np.mean(series[size]) for size in sizes]
                    ends = [[100 * f(series[size]) for size in sizes] for f in (min, max)]
                    label = f"{arm}, {MODEL_NAMES[model]}" if row == column == 0 else None
                    axis.plot(sizes, means, dash, color=colour, marker="o", ms=3, label=label)
                    if model == "process":
                        axis.fill_between(sizes, *ends, color=colour, alpha=0.12, lw=0)
            axis.set_title(f"{title}: {FIGURES[figure]}")
            axis.set_ylabel("relative error [%]")
            axis.set_ylim(bottom=0)
    for axis in axes[-1]:
        axis.set_xlabel("training rows")
    axes[0, 0].legend(fontsize=7)
    save_figure(picture, path)


def main() -> None:
    """Print the table and save the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("csv", type=Path)
    parser.add_argument("picture", type=Path)
    arguments = parser.parse_args()
    runs = read(arguments.csv)
    print("\n".join(table(runs)))
    for target in TITLES:
        for figure in ("within_95", "within_99"):
            share = savings(runs, "process", target, figure)
            print(f"{target}, {figure}: as good as a Latin hypercube {share:.2f} times as large")
    draw(runs, arguments.picture)


if __name__ == "__main__":
    main()
