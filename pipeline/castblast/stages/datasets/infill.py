"""From a dataset and a model to the designs that would teach the model most."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from castblast.dataset.building.extend import Existing, read_existing
from castblast.dataset.file.store import reading_dataset
from castblast.dataset.rows.design import Design, extend_design
from castblast.dataset.rows.design_file import write_design_file
from castblast.dataset.rows.simulation import blast_simulator
from castblast.disk.resources import is_bare_name
from castblast.errors import SpecError
from castblast.names import as_words
from castblast.network import Network, explosive_index, member_spread
from castblast.network.json_file import read_network
from castblast.progress import ProgressCallback, part, silent
from castblast.specs.models.model import ModelSpec, make_model_spec, read_model_spec, refuse_code
from castblast.specs.recipe import Recipe
from castblast.stages.export import find_network
from castblast.stages.outcome import Outcome
from castblast.surrogate.fitting.features import read_table
from castblast.surrogate.searching.ensemble import ensemble_spread, fit_members
from castblast.surrogate.searching.infill import POOL_FACTOR, choose_batch, infill_worth
from castblast.types import FloatArray

#: Batch numbers from here on are for pools: no dataset gets that far, so a later extension never
#: draws the numbers of a pool again.
_POOL_BATCH = 20_000


def infill(
    dataset: str | Path,
    model: str | Path,
    rows: int,
    out: str | Path,
    *,
    members: int = 3,
    allow_code: bool = False,
    progress: ProgressCallback = silent,
) -> Outcome:
    """Choose the next designs to simulate and write them as a design file.

    Parameters
    ----------
    dataset : Path
        Gives the domain, and the rows to fit members on.
    model : Path
        A model spec (YAML), or a fit of `castblast train`: members of its network are used if it
        has any, else its spec is fitted anew from `members` random starts.
    rows : int
    out : Path
        CSV for ``castblast dataset extend --design``.

    members : int
        Random starts, where the spec is fitted anew.
    allow_code : bool
        Run the Python code that a spec of kind ``custom`` names.
    progress : callable

    Raises
    ------
    SpecError
        Unusable model, one that runs code of its own, or rows that cannot be drawn.
    DatasetError, CheckError, StaleResultError
        The dataset cannot be read or extended.
    """
    dataset = Path(dataset)
    model = Path(model)
    out = Path(out)
    if rows < 1:
        message = f"rows: {rows}; at least 1 is needed"
        raise SpecError(message)
    found = _find_model(model)
    if not isinstance(found, Network):
        refuse_code([found], allowed=allow_code)
    existing = read_existing(dataset, lambda _, line: progress(0.0, line))
    recipe = existing.source.recipe
    names = tuple(entry.name for entry in existing.explosives)
    explosives = tuple(entry.spec.to_explosive() for entry in existing.explosives)
    progress(0.05, f"drawing {POOL_FACTOR * rows} candidates")
    pool = extend_design(
        recipe,
        blast_simulator(recipe, explosives),
        str(dataset),
        add=POOL_FACTOR * rows,
        first_sample=int(existing.design.sample.max()) + 1,
        first_batch=_POOL_BATCH + int(existing.design.batch.max()),
    )
    labels = [names[kind] for kind in pool.explosive.tolist()]
    targets, spread = _spread(existing, found, pool, labels, members, part(progress, 0.1, 0.9))
    progress(0.9, "choosing")
    kinds = pool.explosive.astype(np.int64)
    chosen = choose_batch(shares_of(recipe, pool.columns), kinds, infill_worth(spread), rows)
    columns = {name: values[chosen] for name, values in pool.columns.items()}
    write_design_file(out, recipe, columns, [labels[k] for k in chosen.tolist()])
    return _outcome(dataset, out, targets, np.median(spread, axis=0), spread[chosen])


def shares_of(recipe: Recipe, columns: Mapping[str, FloatArray]) -> FloatArray:
    """Place of each row in the range of each sampled variable, (n, k) between 0 and 1."""
    shares = []
    for spec in recipe.sampled:
        values = columns[spec.name]
        if spec.ratio_of is not None:
            values = values / columns[spec.ratio_of]
        low, high = spec.at(0.0), spec.at(1.0)
        if spec.distribution == "log_uniform":
            values, low, high = np.log(values), float(np.log(low)), float(np.log(high))
        shares.append((values - low) / (high - low))
    return np.stack(shares, axis=1)


def _spread(
    existing: Existing,
    found: Network | ModelSpec,
    pool: Design,
    labels: list[str],
    members: int,
    progress: ProgressCallback,
) -> tuple[tuple[str, ...], FloatArray]:
    """Targets, and relative spread of the ensemble for every row of the pool."""
    if isinstance(found, Network):
        numeric = np.stack([pool.inputs[name] for name in found.input_names], axis=1)
        index = np.array([explosive_index(found, name) for name in labels], dtype=np.int64)
        return found.output_names, member_spread(found, numeric, index)
    import pandas as pd

    with reading_dataset(existing.path) as dataset:
        table = read_table(dataset, found.features, found.targets)
    fits = fit_members(found, table, members, progress)
    frame = pd.DataFrame({name: pool.inputs[name] for name in fits[0].spec.features})
    return found.targets, ensemble_spread(fits, frame.assign(explosive=labels))


def _find_model(model: Path) -> Network | ModelSpec:
    """Give the network of a fit if it has members, else the spec to fit members from."""
    if model.suffix in (".yaml", ".yml") or (is_bare_name(model) and not model.is_dir()):
        return read_model_spec(model)
    path = find_network(model)
    network = read_network(path)
    if network.members:
        return network
    try:
        return make_model_spec(network.provenance.get("spec"), f"{path}: spec", path.parent)
    except SpecError:
        message = f"{path}: has no members and no usable spec; pass the model spec (YAML) instead"
        raise SpecError(message) from None


def _outcome(
    dataset: Path, out: Path, targets: tuple[str, ...], usual: FloatArray, spread: FloatArray
) -> Outcome:
    """Say how much wider the spread is where the new rows lie."""
    medians = np.median(spread, axis=0)
    rows = [
        (as_words(name), f"{100 * u:.3g} %", f"{100 * m:.3g} %", f"{m / u:.2g}")
        for name, u, m in zip(targets, usual.tolist(), medians.tolist(), strict=True)
    ]
    document = {
        "dataset": str(dataset),
        "design": str(out),
        "rows": len(spread),
        "spread_of_candidates": dict(zip(targets, usual.tolist(), strict=True)),
        "spread_of_chosen": dict(zip(targets, medians.tolist(), strict=True)),
    }
    lines = [
        f"wrote {len(spread)} designs, all for training, to {out}",
        f"simulate and join them: castblast dataset extend {dataset} --design {out}",
    ]
    header = ("target", "median spread of candidates", "of chosen", "ratio")
    return Outcome(document=document, header=header, rows=rows, lines=lines)
