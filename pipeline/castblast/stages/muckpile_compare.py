"""Several muckpiles side by side: mean and scatter of every metric, and their profiles."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from castblast.errors import SpecError
from castblast.files import write_text
from castblast.muckpile.bench import Bench
from castblast.muckpile.metrics import UNITS, Band, band
from castblast.muckpile.profile import Profile
from castblast.progress import ProgressCallback, silent
from castblast.stages.muckpile_results import MuckpileOutcome, finite
from castblast.stages.muckpile_tables import GROUND_COLUMN, MEAN_COLUMN, X_COLUMN

_NEEDED = ("metrics.json", "profile.csv")
_PER_BLOCK = ("block_throw", "block_spread")


def compare_runs(folders: Sequence[Path], out: Path) -> MuckpileOutcome:
    """Compare finished runs, such as one bench with several seeds, or a bench with variants.

    Parameters
    ----------
    folders : sequence of path
        Results of `castblast muckpile`.
    out : path
        Folder for ``comparison.json`` and ``profiles.png``.

    Returns
    -------
    MuckpileOutcome
        `document` holds ``runs`` (name to headline metrics), ``bands`` (metric to mean, sd and
        number of runs that know it) and ``units``.

    Raises
    ------
    SpecError
        Fewer than two runs, or a folder without results; one line per fault.
    """
    if len(folders) < 2:
        raise SpecError("a comparison needs at least two runs")
    missing = [
        f"{folder}: {name} is missing; run castblast muckpile --out {folder} first"
        for folder in folders
        for name in _NEEDED
        if not (folder / name).is_file()
    ]
    if missing:
        raise SpecError("\n".join(missing))
    documents = [json.loads((folder / "metrics.json").read_text("utf-8")) for folder in folders]
    names = _names(folders)
    bands = metric_bands_of(documents)
    document = {
        "runs": {
            name: {key: found[key] for key in UNITS if key not in _PER_BLOCK}
            for name, found in zip(names, documents, strict=True)
        },
        "bands": {name: _plain(found) for name, found in bands.items()},
        "units": UNITS,
    }
    files = [
        write_text(out / "comparison.json", json.dumps(finite(document), indent=2) + "\n"),
        _draw(out / "profiles.png", folders, names, documents[0]),
    ]
    title = f"{len(folders)} runs: mean and standard deviation"
    return MuckpileOutcome(document, title, band_rows(bands), files)


def run_seeds(
    bench: str | Path,
    out: Path | None,
    seeds: int,
    *,
    progress: ProgressCallback = silent,
    **options: Any,
) -> MuckpileOutcome:
    """Run a bench with several seeds, from that of its file on, and compare the runs.

    Parameters
    ----------
    bench, out, options
        As `run_muckpile` takes them; the runs are written to ``seed_K`` in `out`.
    seeds : int
        At least 2.
    progress : callback
    """
    from castblast.specs.bench import load_bench
    from castblast.stages.muckpile import run_muckpile

    spec = load_bench(bench)
    folder = Path("runs") / spec.name if out is None else out
    first = options.pop("seed", None)
    first = spec.seed if first is None else first
    folders, files = [], []
    for k in range(seeds):
        folders.append(folder / f"seed_{first + k}")

        def report(share: float, line: str, k: int = k) -> None:
            progress((k + share) / seeds, f"seed {first + k}: {line}")

        run = run_muckpile(bench, folders[-1], seed=first + k, progress=report, **options)
        files += run.files
    compared = compare_runs(folders, folder)
    return replace(compared, files=files + compared.files, remarks=run.remarks)


def metric_bands_of(documents: Sequence[Mapping[str, Any]]) -> dict[str, Band]:
    """Bands of all metrics that the runs have in common; per-block ones only for equal blocks."""
    bands = {}
    for name in UNITS:
        values = [_numbers(document.get(name)) for document in documents]
        if len({value.shape for value in values}) == 1:
            bands[name] = band(values)
    return bands


def band_rows(bands: Mapping[str, Band]) -> list[tuple[str, str, str]]:
    """Bands of single numbers for people: name, mean and deviation, unit."""
    rows = []
    for name, found in bands.items():
        if found.mean.ndim:
            continue
        spread = "" if math.isnan(found.sd) else f" ± {float(found.sd):.2g}"
        words = "-" if math.isnan(found.mean) else f"{float(found.mean):.3g}{spread}"
        rows.append((name.replace("_", " "), words, UNITS[name]))
    return rows


def _numbers(value: Any) -> Any:
    """Array of what JSON holds, null as NaN."""
    if isinstance(value, list):
        return np.array([_numbers(item) for item in value], dtype=np.float64)
    return np.array(math.nan if value is None else value, dtype=np.float64)


def _plain(found: Band) -> dict[str, Any]:
    return {key: np.asarray(value).tolist() for key, value in found._asdict().items()}


def _names(folders: Sequence[Path]) -> list[str]:
    """Names of the folders; whole paths where two have the same name."""
    short = [folder.resolve().name for folder in folders]
    return short if len(set(short)) == len(short) else [str(folder) for folder in folders]


def _draw(
    path: Path, folders: Sequence[Path], names: Sequence[str], first: Mapping[str, Any]
) -> Path:
    from castblast.report.movement_figures import draw_profiles

    tables = [
        np.genfromtxt(
            folder / "profile.csv", delimiter=",", names=True, deletechars="", replace_space=" "
        )
        for folder in folders
    ]
    profiles = [Profile(table[X_COLUMN], table[MEAN_COLUMN]) for table in tables]
    widest = max(tables, key=lambda table: float(table[X_COLUMN][-1]))
    low = max(float(profile.x[0]) for profile in profiles)
    high = max(float(profile.x[-1]) for profile in profiles)
    x = np.linspace(low, high, 400)
    heights = np.stack([np.interp(x, profile.x, profile.height) for profile in profiles])
    scatter = band(list(heights))
    return draw_profiles(
        path,
        dict(zip(names, profiles, strict=True)),
        Bench(**first["geometry"]),
        Profile(widest[X_COLUMN], widest[GROUND_COLUMN]),
        band=(Profile(x, scatter.mean), scatter.sd) if len(folders) > 2 else None,
        band_words="one standard deviation over the runs",
        title="Mean surface of each run",
    )
