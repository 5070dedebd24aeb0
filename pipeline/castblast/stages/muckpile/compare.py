"""Several muckpiles side by side: mean and scatter of every metric, and their profiles."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from castblast.api.muckpile.document import HEADER, bench_content
from castblast.disk.files import require_writable, tried, write_json, written_together
from castblast.disk.locks import LOCK_NAME, only_writer
from castblast.disk.note import forget_note, read_note, write_note
from castblast.disk.plain import as_plain
from castblast.disk.resources import find_spec
from castblast.errors import SpecError
from castblast.identity import make_key
from castblast.muckpile.results.metrics import UNITS, Band, band
from castblast.muckpile.results.profile import Profile
from castblast.names import as_words
from castblast.progress import ProgressCallback, silent
from castblast.report.piles.movement_figures import draw_profiles
from castblast.specs.bench.bench import BenchSpec, load_bench
from castblast.stages.muckpile.read import FinishedRun, numbers, read_runs
from castblast.stages.muckpile.run import run_muckpile
from castblast.stages.outcome import Outcome

_PER_BLOCK = ("block_throw", "block_spread")


def compare_runs(folders: Sequence[str | Path], out: str | Path) -> Outcome:
    """Compare finished runs, such as one bench with several seeds, or a bench with variants.

    Parameters
    ----------
    folders : sequence of path
        Results of `castblast muckpile`.
    out : path
        Folder for ``comparison.json`` and ``profiles.png``.

    Returns
    -------
    Outcome
        `document` holds ``ok``, ``faults`` (of the runs), ``runs`` (name to headline metrics),
        ``bands`` (metric to mean, sd and number of runs that know it) and ``units``.

    Raises
    ------
    SpecError
        Fewer than two runs, or a folder without results or with damaged ones; one line per fault.
    OutputError
        Nothing can be written to `out`.
    """
    runs_at = [Path(path) for path in folders]
    out = Path(out)
    if len(runs_at) < 2:
        raise SpecError("a comparison needs at least two runs")
    runs = read_runs(runs_at)
    require_writable(out)
    documents = [run.document for run in runs]
    names = _names(runs_at)
    bands = metric_bands_of(documents)
    faults = _run_faults(names, documents)
    document = {
        "ok": not faults,
        "faults": faults,
        "runs": {
            name: {key: found[key] for key in UNITS if key not in _PER_BLOCK}
            for name, found in zip(names, documents, strict=True)
        },
        "bands": {name: as_plain(found._asdict()) for name, found in bands.items()},
        "units": UNITS,
    }
    files = written_together(
        out,
        lambda folder: [
            write_json(folder / "comparison.json", document),
            _draw(folder / "profiles.png", runs, names),
        ],
    )
    title = f"{len(folders)} runs: mean and standard deviation"
    return Outcome(
        document=document,
        title=title,
        header=HEADER,
        rows=band_rows(bands),
        files=files,
        faults=faults,
        ok=not faults,
    )


def _run_faults(names: Sequence[str], documents: Sequence[Mapping[str, Any]]) -> list[str]:
    """Reasons not to believe a run, each with its name; runs of old versions say nothing."""
    return [
        f"{name}: {fault}"
        for name, found in zip(names, documents, strict=True)
        for fault in found.get("faults") or ()
    ]


def run_seeds(
    bench: str | Path,
    out: str | Path | None,
    seeds: int,
    *,
    progress: ProgressCallback = silent,
    **options: Any,
) -> Outcome:
    """Run a bench with several seeds, from that of its file on, and compare the runs.

    Seeds that were finished before a stop are not run again.

    Parameters
    ----------
    bench, out, options
        As `run_muckpile` takes them; the runs are written to ``seed_K`` in `out`.
    seeds : int
        At least 2.
    progress : callback
    """
    out = None if out is None else Path(out)
    spec = load_bench(bench)
    folder = Path("runs") / spec.name if out is None else out
    first = options.pop("seed", None)
    first = spec.seed if first is None else first
    key = _seeds_key(spec, find_spec(bench, "bench").parent, options)
    folders: list[Path] = []
    files: list[Path] = []
    remarks: list[str] = []
    with tried(folder), only_writer(folder / LOCK_NAME, folder):
        for k in range(seeds):
            each = folder / f"seed_{first + k}"
            folders.append(each)

            def report(share: float, line: str, k: int = k) -> None:
                progress((k + share) / seeds, f"seed {first + k}: {line}")

            if read_note(each) != key:
                forget_note(each)
                run = run_muckpile(bench, each, seed=first + k, progress=report, **options)
                files, remarks = files + run.files, run.remarks
                write_note(each, key)
        compared = compare_runs(folders, folder)
        for each in folders:
            forget_note(each)
    return replace(compared, files=files + compared.files, remarks=remarks)


def _seeds_key(spec: BenchSpec, beside: Path, options: Mapping[str, Any]) -> dict[str, str]:
    """All that the runs depend on but their seed, which names their folders."""
    extras = options.get("extras")
    named = {"ore": extras.ore} if extras is not None and extras.ore else {}
    free = ("threads", "packings")
    asked = {name: value for name, value in options.items() if name not in free}
    content = bench_content(spec, beside)["bench_sha256"]
    return make_key(bench=content, options=repr(sorted(asked.items())), **named)


def metric_bands_of(documents: Sequence[Mapping[str, Any]]) -> dict[str, Band]:
    """Bands of all metrics that the runs have in common; per-block ones only for equal blocks."""
    bands = {}
    for name in UNITS:
        values = [numbers(document.get(name)) for document in documents]
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
        value = "-" if math.isnan(found.mean) else f"{float(found.mean):.3g}{spread}"
        rows.append((as_words(name), value, UNITS[name]))
    return rows


def _names(folders: Sequence[Path]) -> list[str]:
    """Names of the folders; whole paths where two have the same name."""
    short = [folder.resolve().name for folder in folders]
    return short if len(set(short)) == len(short) else [str(folder) for folder in folders]


def _draw(path: Path, runs: Sequence[FinishedRun], names: Sequence[str]) -> Path:
    profiles = [run.pile for run in runs]
    widest = max(runs, key=lambda run: float(run.ground.x[-1]))
    low = max(float(profile.x[0]) for profile in profiles)
    high = max(float(profile.x[-1]) for profile in profiles)
    x = np.linspace(low, high, 400)
    heights = np.stack([np.interp(x, profile.x, profile.height) for profile in profiles])
    scatter = band(list(heights))
    return draw_profiles(
        path,
        dict(zip(names, profiles, strict=True)),
        runs[0].bench,
        widest.ground,
        band=(Profile(x, scatter.mean), scatter.sd) if len(runs) > 2 else None,
        band_words="one standard deviation over the runs",
        title="Mean surface of each run",
    )
