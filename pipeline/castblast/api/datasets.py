"""Datasets of simulated blasts: made from a recipe, opened with names instead of codes.

Opening registers the accessor ``castblast`` of xarray Datasets.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from castblast.api.many import resized
from castblast.api.shared.frames import library
from castblast.api.shared.reporting import Progress, reporter
from castblast.dataset.file.form import require_form
from castblast.dataset.file.schema import (
    flag_attributes,
    flag_names,
    label_attributes,
    names_with_role,
    varying_inputs,
)
from castblast.dataset.file.store import reading_dataset
from castblast.errors import DatasetError, nearest_name
from castblast.extras import require
from castblast.specs.recipe import SPLIT_NAMES, load_recipe

if TYPE_CHECKING:
    import pandas as pd

_LABELS = ("explosive", "split", "status")


def open_dataset(path: str | Path) -> xr.Dataset:
    """Open a dataset of `castblast.generate`; values are read when they are asked for.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    Dataset
        Dimension `sample`. `explosive` and `split` are coordinates of names, `status` is a name
        as well; everything else is as in the file, with CF attributes. The accessor
        ``dataset.castblast`` has a table for training.

    Raises
    ------
    DatasetError
        No such file, damaged, or of another kind.

    Examples
    --------
    >>> import castblast as cb
    >>> ds = cb.generate("quickstart", size=200)
    >>> ds.burden_velocity.sel(sample=ds.split == "train").sizes["sample"]
    160
    >>> X, y = ds.castblast.training_table(split="train")
    >>> X.shape, list(y)[0]
    ((160, 10), 'equilibrium_pressure')
    """
    require("data", purpose="castblast.open_dataset")
    path = Path(path)
    with reading_dataset(path) as stored:
        require_form(stored, path)
    opened = xr.open_dataset(path, engine="netcdf4", decode_times=False)
    whole = decoded(opened)
    whole.set_close(opened.close)
    return whole


def generate(
    recipe: str | Path,
    out: str | Path | None = None,
    *,
    size: int | None = None,
    seed: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    restart: bool = False,
    progress: Progress = None,
) -> xr.Dataset:
    """Simulate the dataset of a recipe.

    Parameters
    ----------
    recipe : str or path
        Name of a recipe that comes with castblast, or a recipe file.
    out : str or path, optional
        A netCDF file, or a folder for ``data.nc``; a build that was interrupted there resumes, and
        one that is finished is only opened. Without it the dataset is kept in memory alone.
    size, seed : int, optional
        Instead of those of the recipe.
    workers : int, optional
        Threads; default: one per core. Changes no number.
    scheduler : str, optional
        Address of a running Dask scheduler whose workers see the folder of `out`.
    restart : bool
        Discard what an earlier run left.
    progress : bool or callable, optional
        True: a line on the screen.

    Returns
    -------
    Dataset
        As of `castblast.open_dataset`.

    Raises
    ------
    MissingLibraryError
        A library of the extras `simulate` or `data` is not installed.
    SpecError
        Faults of recipe or explosives, impossible designs, results of another recipe in the way.
    OutputError
        Nothing can be written there, or the disk is full.
    SimulationError
        More failed samples than the recipe allows.

    Examples
    --------
    >>> import castblast as cb
    >>> ds = cb.generate("quickstart", size=60, workers=1)
    >>> ds.sizes["sample"], sorted(set(ds.status.values.tolist()))
    (60, ['ok'])
    """
    require("simulate", "data", purpose="castblast.generate")
    from castblast.dataset.building.produce import build_dataset, output_path
    from castblast.stopping import sigterm_as_interrupt

    source = resized(load_recipe(recipe, size), seed)
    with TemporaryDirectory(prefix="castblast-") as scratch, sigterm_as_interrupt():
        path = output_path(source, scratch if out is None else out)
        build_dataset(
            source,
            path,
            workers=workers,
            scheduler=scheduler,
            restart=restart,
            progress=reporter(progress),
        )
        if out is not None:
            return open_dataset(path)
        with open_dataset(path) as dataset:
            loaded: xr.Dataset = dataset.load()
    return loaded


def decoded(dataset: xr.Dataset) -> xr.Dataset:
    """Names in place of the codes of explosive, split and status.

    Raises
    ------
    DatasetError
        A code that stands for nothing.
    """
    coded = [n for n in _LABELS if n in dataset.variables and dataset[n].dtype.kind in "iu"]
    named = {}
    for name in coded:
        about = {"long_name": dataset[name].attrs.get("long_name", name)}
        meanings = dataset[name].attrs.get("flag_meanings")
        about |= {} if meanings is None else {"names": meanings}
        named[name] = (dataset[name].dims, flag_names(dataset[name]), about)
    whole = dataset.assign(named)
    return whole.set_coords([n for n in ("explosive", "split") if n in whole.variables])


def encoded(dataset: xr.Dataset) -> xr.Dataset:
    """Codes with CF flags in place of names: the form of a file; undoes `decoded`."""
    codes = {}
    for name in _LABELS:
        if name not in dataset.variables or dataset[name].dtype.kind in "iu":
            continue
        values = dataset[name].to_numpy().astype(str)
        known = _names_of(dataset, name, values)
        strange = sorted(set(values.tolist()) - set(known))
        if strange:
            message = f"{name}: '{strange[0]}': one of {', '.join(known)}"
            raise DatasetError(message, field=name, value=strange[0], allowed=known)
        position = {text: code for code, text in enumerate(known)}
        numbers = np.array([position[text] for text in values.tolist()], dtype=np.int8)
        about = {**label_attributes(name, known), **flag_attributes(known)}
        codes[name] = (dataset[name].dims, numbers, about)
    labels = [name for name in ("explosive", "split") if name in dataset.coords]
    return dataset.reset_coords(labels).assign(codes) if labels else dataset.assign(codes)


def _names_of(dataset: xr.Dataset, name: str, values: Any) -> tuple[str, ...]:
    """Names that the codes of a label stand for, in their order."""
    if "names" in dataset[name].attrs:
        return tuple(str(dataset[name].attrs["names"]).split())
    if name == "split":
        return SPLIT_NAMES
    if name == "status":
        return tuple(str(label_attributes("status")["flag_meanings"]).split())
    return tuple(sorted(set(values.tolist())))


@xr.register_dataset_accessor("castblast")  # type: ignore[no-untyped-call]
class CastblastAccessor:
    """What castblast adds to a Dataset of simulated blasts, as ``dataset.castblast``.

    Parameters
    ----------
    dataset : Dataset
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = decoded(dataset)

    @property
    def features(self) -> tuple[str, ...]:
        """Inputs that the dataset varies, those that follow from others left out."""
        return varying_inputs(self._dataset)

    @property
    def targets(self) -> tuple[str, ...]:
        """Outputs that models are trained for."""
        return names_with_role(self._dataset, "target")

    def training_table(
        self,
        split: str | None = None,
        *,
        features: list[str] | tuple[str, ...] | None = None,
        targets: list[str] | tuple[str, ...] | None = None,
        one_hot: bool = True,
    ) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Finished rows as two tables of numbers, for scikit-learn and torch.

        Parameters
        ----------
        split : {"train", "valid", "calibration", "test"}, optional
            Default: the rows of all splits.
        features, targets : sequence of str, optional
            Default: what the dataset varies, and its targets.
        one_hot : bool
            The explosive as columns of 0 and 1, ``explosive_NAME``; otherwise as one categorical
            column.

        Returns
        -------
        X, y : DataFrame
            SI, indexed by `sample`; units in ``attrs["units"]``.

        Raises
        ------
        DatasetError
            An unknown split or column.
        """
        pandas = library("pandas", "training_table")
        rows = self._rows(split)
        inputs = self._columns(self.features if features is None else features, rows)
        outputs = self._columns(self.targets if targets is None else targets, rows)
        index = pandas.Index(self._dataset["sample"].to_numpy()[rows], name="sample")
        explosive = self._dataset["explosive"].to_numpy().astype(str)
        x, y = pandas.DataFrame(inputs, index=index), pandas.DataFrame(outputs, index=index)
        names = _names_of(self._dataset, "explosive", explosive)
        if one_hot:
            for name in names:
                x[f"explosive_{name}"] = (explosive[rows] == name).astype(np.float64)
        else:
            x["explosive"] = pandas.Categorical(explosive[rows], categories=list(names))
        for table in (x, y):
            table.attrs["units"] = {
                name: self._dataset[name].attrs.get("units", "1")
                for name in table.columns
                if name in self._dataset.variables and name != "explosive"
            }
        return x, y

    def export(
        self, folder: str | Path, formats: tuple[str, ...] | list[str] = ("csv",)
    ) -> list[Path]:
        """Write the rows as tables for other tools, with a Croissant record beside them.

        Parameters
        ----------
        folder : str or path
        formats : sequence of {"csv", "parquet"}

        Returns
        -------
        list of path

        Raises
        ------
        MissingLibraryError
            Parquet needs a library that is not installed.
        SpecError
            No format, or an unknown one.
        OutputError
            The folder cannot be written to, or the disk is full.
        """
        from castblast.dataset.file.tables import write_tables

        return write_tables(encoded(self._dataset), Path(folder), formats)

    def _rows(self, split: str | None) -> Any:
        finished = self._dataset["status"].to_numpy().astype(str) == "ok"
        if split is None:
            return np.flatnonzero(finished)
        if split not in SPLIT_NAMES:
            hint = nearest_name(str(split), SPLIT_NAMES)
            message = f"split: '{split}': one of {', '.join(SPLIT_NAMES)}{hint}"
            raise DatasetError(message, field="split", value=split, allowed=SPLIT_NAMES)
        return np.flatnonzero(finished & (self._dataset["split"].to_numpy().astype(str) == split))

    def _columns(self, names: Any, rows: Any) -> dict[str, Any]:
        columns = {}
        for name in names:
            if name not in self._dataset.variables or self._dataset[name].dims != ("sample",):
                known = [str(n) for n in self._dataset.data_vars]
                message = f"{name}: the dataset has no such column{nearest_name(str(name), known)}"
                raise DatasetError(message, field=str(name), allowed=tuple(known))
            columns[str(name)] = self._dataset[name].to_numpy()[rows]
        return columns
