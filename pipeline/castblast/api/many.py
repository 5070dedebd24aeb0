"""Many blasts at once: designs drawn from a recipe, and tables of designs simulated."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from castblast.api.shared.designs import Designs, Table, read_designs
from castblast.api.shared.frames import cf_attributes, library, with_units
from castblast.api.shared.reporting import Progress, reporter
from castblast.api.simulation import blast_settings
from castblast.blast.inputs import resolve_columns
from castblast.blast.run import BlastSettings, batch_values, run_blasts
from castblast.dataset.rows.design import make_design
from castblast.dataset.rows.simulation import HISTORY_NAMES, blast_simulator
from castblast.design.rule import fault_columns
from castblast.design.variables import INPUT_NAMES, OUTPUT_NAMES
from castblast.errors import SpecError, Status
from castblast.explosive.isentrope import Explosive
from castblast.extras import require
from castblast.specs.case import require_none
from castblast.specs.explosive import load_explosive, require_consistent
from castblast.specs.loading import parse_yaml
from castblast.specs.recipe import RecipeSource, load_recipe
from castblast.stopping import interruptible
from castblast.types import FloatArray, IntArray

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

#: Rows that are simulated between two looks at Ctrl-C; a row does not depend on the others.
_CHUNK = 256
_HISTORIES = {
    "history_time": ("s", "time since detonation"),
    "history_pressure": ("Pa", "gas pressure in the hole"),
    "history_radius": ("m", "radius of the hole wall"),
}


def simulate_many(
    designs: Table,
    explosive: str | Path | None = None,
    *,
    mode: str = "equilibrium",
    tension: str = "ductile",
    parameters: str = "authors",
    allow_inconsistent: bool = False,
    progress: Progress = None,
) -> xr.Dataset:
    """Simulate every row of a table.

    Parameters
    ----------
    designs : DataFrame, Dataset or mapping of name to (n,)
        Inputs of `castblast.variables`: numbers in SI, or texts with a unit; what is left out, or
        blank in a row, takes its default. A column `explosive` names that of each row.
    explosive : str or path, optional
        Of all rows, where there is no such column; default ``anfo``.
    mode, tension, parameters, allow_inconsistent
        As in `castblast.simulate`.
    progress : bool or callable, optional
        True: a line on the screen. The work can be interrupted.

    Returns
    -------
    Dataset
        Dimension `sample` with the labels of the rows: completed inputs, every output (NaN where
        the run failed), `status` by name, `explosive` as a coordinate, histories over
        `history_point`; all with CF attributes.

    Raises
    ------
    MissingLibraryError
        A library of the extras `simulate` or `data` is not installed.
    SpecError
        Unknown columns, units, explosives, impossible designs; with the label of the row.
    CheckError
        An inconsistent explosive, unless `allow_inconsistent`.

    Examples
    --------
    >>> import castblast as cb
    >>> runs = cb.simulate_many({"burden": [3.0, 4.0], "ucs": "80 MPa"}, "anfo")
    >>> runs.burden_velocity.round(1).values
    array([14.8, 10.1])
    >>> runs.status.values.tolist(), runs.burden_velocity.units
    (['ok', 'ok'], 'm s-1')
    """
    require("simulate", purpose="castblast.simulate_many")
    library("xarray", "castblast.simulate_many")
    settings = blast_settings(mode, tension, parameters)
    read = read_designs(designs, explosive)
    names, kinds, index = _load(read, allow_inconsistent=allow_inconsistent)
    inputs = _completed(read, kinds, index, parameters)
    return _dataset(read, names, index, inputs, _run(kinds, index, inputs, settings, progress))


def sample(recipe: str | Path, size: int | None = None, *, seed: int | None = None) -> pd.DataFrame:
    """Draw possible designs from the ranges of a recipe, as `castblast.generate` does.

    Parameters
    ----------
    recipe : str or path
        Name of a recipe that comes with castblast, or a recipe file.
    size : int, optional
        Rows; default: those of the recipe.
    seed : int, optional
        Instead of that of the recipe.

    Returns
    -------
    DataFrame
        Sampled and fixed inputs in SI (units in ``attrs["units"]``) and the `explosive`, one row
        for each design.

    Raises
    ------
    SpecError
        An unknown or faulty recipe; most designs in its ranges are impossible.

    Examples
    --------
    >>> import castblast as cb
    >>> designs = cb.sample("paper", 8)
    >>> len(designs), designs.attrs["units"]["ucs"]
    (8, 'Pa')
    """
    require("simulate", purpose="castblast.sample")
    pandas = library("pandas", "castblast.sample")
    source = resized(load_recipe(Path(recipe), size), seed)
    specs = [load_explosive(_beside(source, name)) for name in source.recipe.explosives]
    simulator = blast_simulator(source.recipe, tuple(spec.to_explosive() for spec in specs))
    design = interruptible(make_design, source.recipe, simulator, str(source.path))
    codes = np.asarray(design.explosive)
    names = np.array([spec.name for spec in specs], dtype=object)
    table = pandas.DataFrame(
        {**design.columns, "explosive": names[codes]},
        index=pandas.Index(design.sample, name="sample"),
    )
    return with_units(table)


def resized(source: RecipeSource, seed: int | None) -> RecipeSource:
    """Give a recipe another seed, in the kept text too.

    Raises
    ------
    SpecError
        No seed.
    """
    if seed is None or seed == source.recipe.seed:
        return source
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or not 0 <= seed < 2**63:
        message = f"seed: {seed}: a whole number from 0 is needed"
        raise SpecError(message, field="seed", value=seed, allowed="0 to 2**63 - 1")
    import yaml

    content = {**parse_yaml(source.text, str(source.path)), "seed": int(seed)}
    text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True)
    return source._replace(recipe=source.recipe.model_copy(update={"seed": int(seed)}), text=text)


def _beside(source: RecipeSource, name: str) -> str | Path:
    """Explosive of a recipe: a name of the catalogue, or a path relative to the recipe."""
    path = Path(name)
    return name if not path.suffix else source.path.parent / path


class _Results(NamedTuple):
    """Outcome of all rows: status, outputs and histories by name."""

    status: NDArray[np.int8]
    outputs: dict[str, FloatArray]
    histories: dict[str, FloatArray]


def _load(
    read: Designs, *, allow_inconsistent: bool
) -> tuple[list[str], tuple[Explosive, ...], IntArray]:
    """Names and records of the explosives that occur, and the position of each row's."""
    position: dict[str, int] = {}
    names: list[str] = []
    kinds: list[Explosive] = []
    faults: list[SpecError] = []
    for text in dict.fromkeys(read.explosive):
        try:
            spec = load_explosive(text or "anfo")
        except SpecError as fault:
            where = read.where(read.explosive.index(text))
            faults.append(
                SpecError(
                    f"{where}: {fault}",
                    field="explosive",
                    value=text,
                    allowed=fault.allowed,
                )
            )
            continue
        require_consistent(spec, allow_inconsistent=allow_inconsistent)
        position[text] = len(names)
        names.append(spec.name)
        kinds.append(spec.to_explosive())
    require_none(faults)
    return names, tuple(kinds), np.array([position[t] for t in read.explosive], dtype=np.int64)


def _completed(
    read: Designs, kinds: tuple[Explosive, ...], index: IntArray, parameters: str
) -> dict[str, FloatArray]:
    """Every input of every row; blank cells are filled by what the row gives itself."""
    parts = list(read.kinds())
    for rows, given in parts:
        read.at(rows).require_possible(fault_columns(given, len(rows)))
    whole = {name: np.empty(read.rows) for name in INPUT_NAMES}
    for rows, given in parts:
        part = resolve_columns(given, kinds, index[rows], parameters)
        for name, column in part.items():
            whole[name][rows] = column
    return whole


def _run(
    kinds: tuple[Explosive, ...],
    index: IntArray,
    inputs: dict[str, FloatArray],
    settings: BlastSettings,
    progress: Progress,
) -> _Results:
    """Simulate all rows, some at a time."""
    report, count = reporter(progress), len(index)
    parts = []
    for begin in range(0, count, _CHUNK):
        report(begin / count, f"{begin} of {count} blasts simulated")
        rows = slice(begin, begin + _CHUNK)
        part = {name: column[rows] for name, column in inputs.items()}
        parts.append(interruptible(run_blasts, kinds, index[rows], part, settings))
    report(1.0, f"{count} blasts simulated")
    status = np.concatenate([part.status for part in parts])
    outputs = [batch_values(part) for part in parts]
    finished = (status == Status.OK)[:, np.newaxis]
    histories = {
        name: np.where(
            finished, np.concatenate([getattr(part.near_field, name) for part in parts]), np.nan
        )
        for name in HISTORY_NAMES
    }
    return _Results(
        status=status,
        outputs={n: np.concatenate([part[n] for part in outputs]) for n in OUTPUT_NAMES},
        histories=histories,
    )


def _dataset(
    read: Designs,
    names: list[str],
    index: IntArray,
    inputs: dict[str, FloatArray],
    results: _Results,
) -> xr.Dataset:
    xarray = library("xarray", "castblast.simulate_many")
    status = np.array([Status(code).name.lower() for code in results.status.tolist()])
    columns: dict[str, Any] = {
        name: ("sample", values, cf_attributes(name))
        for name, values in {**inputs, **results.outputs}.items()
    }
    for name, values in results.histories.items():
        unit, words = _HISTORIES[name]
        columns[name] = (
            ("sample", "history_point"),
            values,
            {"units": unit, "long_name": words},
        )
    columns["status"] = ("sample", status, {"long_name": "outcome of the simulation"})
    explosive = np.array(names)[index]
    made: xr.Dataset = xarray.Dataset(
        columns,
        coords={
            "sample": ("sample", np.asarray(read.index)),
            "explosive": ("sample", explosive, {"long_name": "explosive of the sample"}),
        },
    )
    return made
