"""In what two datasets differ: making, form, rows, and the values of the rows they share.

Rows are the same row when their ids are equal. Columns are read one at a time and histories in
blocks of rows, so two long datasets are compared without being held.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from castblast.dataset.file.provenance import differences
from castblast.dataset.file.schema import DESCRIPTORS
from castblast.dataset.file.store import BLOCK_ROWS
from castblast.disk.reading import parse_json
from castblast.errors import DatasetError, SpecError
from castblast.names import printable
from castblast.progress import ProgressCallback, silent

_FORM = ("units", "role", "flag_meanings")
#: Attributes that follow from others or are told in words of their own.
_TOLD = (
    "made_from", "rows_sha256", "recipe_sha256", "content_sha256", "source_sha256", "recipe",
    "explosive_specs", "dependency_versions", "history", "id", "n_ok", "n_failed", "designs_drawn",
    "design_seed", "extends", "name", "dataset_version", "product_version", "castblast_version",
)  # fmt: skip


@dataclass(frozen=True)
class ColumnDifference:
    """One variable over the common rows.

    Attributes
    ----------
    name : str
    rows : int
        Rows in which it differs; for a variable without rows its entries.
    largest : float
        Largest relative difference, infinite where a number became NaN or a code or text changed.
    sample : int or None
        Id of that row.
    """

    name: str
    rows: int
    largest: float
    sample: int | None


@dataclass
class Comparison:
    """All differences; empty lists where there are none.

    Attributes
    ----------
    making : list of str
        Recipe, explosives, code and libraries, in the words of the recipe.
    attributes : list of str
        Descriptive attributes and version of the format.
    form : list of str
        Variables of one file only; types, dimensions, units, roles, codes.
    first_only, second_only : array of int
        Ids of rows of one file only.
    common : int
        Rows of both.
    columns : list of ColumnDifference
        Variables that differ, the largest difference first.
    """

    making: list[str] = field(default_factory=list)
    attributes: list[str] = field(default_factory=list)
    form: list[str] = field(default_factory=list)
    first_only: NDArray[np.integer] = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    second_only: NDArray[np.integer] = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    common: int = 0
    columns: list[ColumnDifference] = field(default_factory=list)

    @property
    def same(self) -> bool:
        """Whether nothing differs at all."""
        lists = (self.making, self.attributes, self.form, self.columns)
        return not any(lists) and not len(self.first_only) and not len(self.second_only)


def compare(
    first: xr.Dataset, second: xr.Dataset, progress: ProgressCallback = silent
) -> Comparison:
    """Compare two datasets, open or in memory.

    Raises
    ------
    DatasetError
        One has no ids of its samples.
    """
    for dataset in (first, second):
        if "sample" not in dataset.variables or dataset["sample"].dtype.kind not in "iu":
            message = f"{printable(str(dataset.attrs.get('id', '?')))}: has no ids of its samples"
            raise DatasetError(message)
    ids = [dataset["sample"].to_numpy() for dataset in (first, second)]
    common, left, right = np.intersect1d(ids[0], ids[1], return_indices=True)
    result = Comparison(
        making=_making(first.attrs, second.attrs),
        attributes=_attributes(first.attrs, second.attrs),
        form=_form(first, second),
        first_only=np.setdiff1d(ids[0], common),
        second_only=np.setdiff1d(ids[1], common),
        common=len(common),
    )
    names = [str(n) for n in first.variables if n in second.variables and n != "sample"]
    for number, name in enumerate(names):
        progress(number / len(names), f"comparing {name}")
        pair = first.variables[name], second.variables[name]
        if any("sample" in variable.dims[1:] for variable in pair):
            continue  # rows are not rows there: said already, of the form
        if any("sample" in variable.dims for variable in pair):
            found = _rows_difference(name, pair, (left, right), common)
        else:
            found = _plain_difference(name, pair)
        if found is not None:
            result.columns.append(found)
    result.columns.sort(key=lambda column: (-column.largest, column.name))
    return result


def relative_difference(name: str, first: NDArray[Any], second: NDArray[Any]) -> NDArray[Any]:
    """Difference over the larger of two numbers; NaN equals NaN and nothing else.

    A residual is the rounding of a balance: it is relative already.
    """
    if first.dtype.kind != "f" or second.dtype.kind != "f":
        return np.where(first == second, 0.0, np.inf)
    missing = np.isnan(first) & np.isnan(second)
    scale = np.maximum(np.abs(first), np.abs(second)).astype(np.float64)
    if name.endswith("residual"):
        scale = np.ones_like(scale)
    gap = np.abs(first.astype(np.float64) - second)
    share = np.divide(gap, scale, out=np.zeros_like(gap), where=gap != 0.0)
    return np.where(missing, 0.0, np.where(np.isnan(share), np.inf, share))


def _making(first: dict[str, Any], second: dict[str, Any]) -> list[str]:
    try:
        made = [
            parse_json(str(attributes.get("made_from", "{}"))) for attributes in (first, second)
        ]
    except SpecError:
        return ["made_from: is not JSON in one of the files"]
    if not all(isinstance(entry, dict) for entry in made):
        return ["made_from: is no group of entries in one of the files"]
    lines = differences(*made)
    for key in ("designs_drawn", "n_failed"):
        if first.get(key) != second.get(key):
            lines.append(f"{key}: {first.get(key)} → {second.get(key)}")
    return lines


def _attributes(first: dict[str, Any], second: dict[str, Any]) -> list[str]:
    names = sorted({*map(str, first), *map(str, second)} - set(_TOLD))
    return [
        f"{name}: {_short(first.get(name))} → {_short(second.get(name))}"
        for name in names
        if str(first.get(name)) != str(second.get(name))
    ]


def _form(first: xr.Dataset, second: xr.Dataset) -> list[str]:
    lines = []
    for name in sorted({*map(str, first.variables), *map(str, second.variables)}):
        if name not in second.variables or name not in first.variables:
            where = "second" if name in first.variables else "first"
            lines.append(f"{name}: is not in the {where}")
            continue
        one, two = first.variables[name], second.variables[name]
        facts = [("type", one.dtype, two.dtype), ("dimensions", one.dims, two.dims)]
        facts += [(key, one.attrs.get(key), two.attrs.get(key)) for key in _FORM]
        facts += [("length", one.shape[1:], two.shape[1:])] if one.dims == two.dims else []
        lines += [f"{name}: {key} {a} → {b}" for key, a, b in facts if str(a) != str(b)]
    return lines


def _rows_difference(
    name: str,
    pair: tuple[xr.Variable, xr.Variable],
    positions: tuple[NDArray[np.intp], NDArray[np.intp]],
    ids: NDArray[np.integer],
) -> ColumnDifference | None:
    """Compare a column over the common rows; a single value counts for every row."""
    rows, largest, sample = 0, 0.0, None
    for begin in range(0, len(ids), BLOCK_ROWS):
        part = slice(begin, begin + BLOCK_ROWS)
        values = [
            _take(variable, position[part])
            for variable, position in zip(pair, positions, strict=True)
        ]
        if values[0].shape[1:] != values[1].shape[1:]:
            return None  # said already, of the form
        gaps = relative_difference(name, *values).reshape(len(values[0]), -1).max(axis=1)
        rows += int(np.count_nonzero(gaps))
        if len(gaps) and gaps.max() > largest:
            largest, sample = float(gaps.max()), int(ids[part][gaps.argmax()])
    return ColumnDifference(name, rows, largest, sample) if rows else None


def _take(variable: xr.Variable, positions: NDArray[np.intp]) -> NDArray[Any]:
    """Rows of a column by their positions, read as one stretch of the file."""
    if "sample" not in variable.dims:
        return np.broadcast_to(variable.to_numpy(), len(positions))
    low, high = int(positions.min()), int(positions.max()) + 1
    stretch: NDArray[Any] = variable[low:high].to_numpy()
    return stretch[positions - low]


def _plain_difference(name: str, pair: tuple[xr.Variable, xr.Variable]) -> ColumnDifference | None:
    """Compare a variable without rows, entry by entry; explosives by their place in the list."""
    first, second = (np.atleast_1d(variable.to_numpy()) for variable in pair)
    if first.shape != second.shape:
        what = "number of explosives" if name in (*DESCRIPTORS, "explosive_name") else name
        return ColumnDifference(what, abs(len(first) - len(second)), float("inf"), None)
    gaps = relative_difference(name, first, second)
    if not gaps.any():
        return None
    return ColumnDifference(name, int(np.count_nonzero(gaps)), float(gaps.max()), None)


def _short(value: Any) -> str:
    text = "(not given)" if value is None else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
