"""Coverage of the conformal bands on test rows, for quick models. For uncertainty.md.

nice python pipeline/studies/coverage_study.py data/full/1.1.0/data.nc models/specs/ridge_cubic.yaml
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from castblast.dataset.file.store import reading_dataset
from castblast.specs.models.model import read_model_spec
from castblast.surrogate.fitting.conformal import band_coverage, conformal_band, expected_coverage
from castblast.surrogate.fitting.features import read_table
from castblast.surrogate.fitting.training import fit_spec

REDRAWS = 500


def main() -> None:
    """Print band and coverage per target, once as split and over redrawn splits."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("specs", type=Path, nargs="+")
    arguments = parser.parse_args()
    for path in arguments.specs:
        spec = read_model_spec(path)
        with reading_dataset(arguments.dataset) as dataset:
            table = read_table(dataset, spec.features, spec.targets)
        fit = fit_spec(spec, table)
        sizes = [len(table.rows(split)) for split in ("calibration", "test")]
        low, high = expected_coverage(*sizes)
        print(f"{arguments.dataset}, {spec.name}: a sound band shows {low:.1%} to {high:.1%}")
        test = table.rows("test")
        found = band_coverage(fit.table.targets[test], fit.predicted[test], fit.band)
        over = redrawn(fit.table.targets, fit.predicted, table.rows("calibration", "test"), sizes)
        for name, band, entry, mean in zip(
            fit.table.target_names, fit.band, found, over, strict=True
        ):
            print(
                f"  {name}: band {band:.2%}, coverage {entry.share:.1%} "
                f"({entry.lower:.1%} to {entry.upper:.1%}), over redrawn splits {mean:.2%}"
            )


def redrawn(
    truth: np.ndarray, predicted: np.ndarray, rows: np.ndarray, sizes: list[int]
) -> np.ndarray:
    """Mean coverage per target when calibration and test rows are dealt anew many times."""
    rng = np.random.default_rng(0)
    shares = []
    for _ in range(REDRAWS):
        dealt = rng.permutation(rows)
        calibration, test = dealt[: sizes[0]], dealt[sizes[0] :]
        band = conformal_band(truth[calibration], predicted[calibration])
        shares.append(np.mean(np.abs(truth - predicted)[test] <= band * np.abs(predicted[test]), 0))
    return np.asarray(np.mean(shares, axis=0))


if __name__ == "__main__":
    main()
