"""Tables of designs as people give them: DataFrame, Dataset or a mapping of columns, into SI.

Columns carry the names of `castblast.variables`. Numbers are in SI, texts carry their unit, a
blank cell (NaN, None, an empty text) takes what a missing input takes. Columns that a table of
results has besides (outputs, labels of a dataset) are left out; what nobody knows is refused.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, Union

import numpy as np
from numpy.typing import ArrayLike

from castblast.api.shared.values import as_written, si_value, unit_words
from castblast.design.rule import FaultyRows, lines_by_row
from castblast.design.variables import INPUT_NAMES, OUTPUT_NAMES, VARIABLES
from castblast.errors import SpecError
from castblast.specs.case import require_none, unknown_input
from castblast.specs.quantity import QuantityError, allowed
from castblast.specs.units import scaled, unit_factor
from castblast.types import FloatArray, IndexArray

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

#: What the face takes as a table of designs.
Table: TypeAlias = Union["pd.DataFrame", "xr.Dataset", Mapping[str, ArrayLike]]
#: Columns of datasets and answers that are no inputs, and say nothing about a design.
_BESIDE = frozenset(
    {*OUTPUT_NAMES, "split", "status", "sample", "design_batch", "id", "domain", "at_fault",
     "domain_score", "explosive_name"}
)  # fmt: skip
_ENDS = ("_prediction_lower", "_prediction_upper", "_network_lower", "_network_upper")
_MOST_FAULTS = 20


class Designs(NamedTuple):
    """Designs in SI.

    Attributes
    ----------
    columns : dict of (n,) [SI]
        Given inputs; NaN in blank cells.
    explosive : list of str
        As written, one per row; empty where none is given.
    index : pandas.Index or (n,) array
        Labels of the rows, as given.
    index_name : str
    """

    columns: dict[str, FloatArray]
    explosive: list[str]
    index: Any
    index_name: str

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.explosive)

    def kinds(self) -> Iterator[tuple[IndexArray, dict[str, FloatArray]]]:
        """Rows that give the same inputs, with these: no blank cells are left."""
        if not self.columns:
            yield np.arange(self.rows), {}
            return
        given = np.stack([~np.isnan(column) for column in self.columns.values()], axis=1)
        kinds, kind_of = np.unique(given, axis=0, return_inverse=True)
        for number, kind in enumerate(kinds):
            rows = np.flatnonzero(kind_of.ravel() == number)
            there = [name for name, is_given in zip(self.columns, kind, strict=True) if is_given]
            yield rows, {name: self.columns[name][rows] for name in there}

    def at(self, rows: IndexArray) -> Designs:
        """Some of the rows."""
        return Designs(
            {name: column[rows] for name, column in self.columns.items()},
            [self.explosive[row] for row in rows.tolist()],
            self.index[rows],
            self.index_name,
        )

    def where(self, row: int) -> str:
        """Place of a row, for messages."""
        return _place(self.index, self.index_name, row)

    def require_possible(self, faults: Sequence[FaultyRows]) -> None:
        """Refuse designs that are impossible; the first rows are named.

        Raises
        ------
        SpecError
            `field` is the input that the first line names.
        """
        found = [
            self._fault(row, line) for row, lines in lines_by_row(faults).items() for line in lines
        ]
        more = len(found) - _MOST_FAULTS
        if more > 0:
            found = [*found[:_MOST_FAULTS], SpecError(f"... and {more} more lines")]
        require_none(found)

    def _fault(self, row: int, line: str) -> SpecError:
        name = line.partition(" ")[0]
        known = name in VARIABLES
        value = float(self.columns[name][row]) if name in self.columns else None
        return SpecError(
            f"{self.where(row)}: {line}",
            field=name if known else None,
            value=value,
            allowed=allowed(VARIABLES[name]) if known else None,
        )


def read_designs(designs: Table, explosive: object = None) -> Designs:
    """Read a table of designs.

    Parameters
    ----------
    designs : DataFrame, Dataset or mapping of name to (n,)
    explosive : str, path or sequence of them, optional
        Of all rows, where the table has no column `explosive`.

    Raises
    ------
    SpecError
        Unknown columns, wrong units, columns of different lengths, an index of mixed labels, an
        explosive given twice; a line each.
    """
    columns, index, index_name = _columns(designs)
    written = columns.pop("explosive", None)
    if written is not None and explosive is not None:
        message = "explosive: given twice, as a column of the table and as an argument"
        raise SpecError(message, field="explosive", value=explosive)
    faults: list[SpecError] = []
    unknown = [name for name in columns if name not in INPUT_NAMES and not _is_beside(name)]
    faults += [unknown_input(name, None, "designs") for name in unknown]
    numbers = {}
    for name, column in columns.items():
        if name in INPUT_NAMES:
            try:
                numbers[str(name)] = _si_column(str(name), column, index, index_name)
            except SpecError as fault:
                faults.append(fault)
    require_none(faults)
    names = _explosives(explosive if written is None else written, len(index))
    return Designs(numbers, names, index, index_name)


def _is_beside(name: object) -> bool:
    text = str(name)
    return text in _BESIDE or any(text.removesuffix(end) in OUTPUT_NAMES for end in _ENDS)


def _columns(designs: Table) -> tuple[dict[Any, Any], Any, str]:
    """Columns by name, labels of the rows, and what a row is called."""
    if hasattr(designs, "data_vars"):
        return _dataset_columns(designs)
    if hasattr(designs, "columns"):
        frame: Any = designs
        twice = [name for name in frame.columns if list(frame.columns).count(name) > 1]
        if twice:
            message = f"designs: {twice[0]}: two columns have this name"
            raise SpecError(message, field=str(twice[0]))
        return (
            {name: frame[name] for name in frame.columns},
            _checked_index(frame.index),
            str(frame.index.name or "row"),
        )
    if not isinstance(designs, Mapping):
        message = (
            f"designs: a {type(designs).__name__} is not a table; a DataFrame, Dataset or mapping "
            "of columns is needed"
        )
        raise SpecError(message, field="designs", value=designs)
    lengths = {
        name: np.shape(column)[0]
        for name, column in designs.items()
        if not isinstance(column, str) and np.ndim(column) == 1
    }
    count = max(lengths.values(), default=1)
    for name, length in lengths.items():
        if length != count:
            message = f"designs: {name}: {length} values, other columns have {count}"
            raise SpecError(message, field=str(name), value=length, allowed=count)
    return dict(designs), np.arange(count), "row"


def _dataset_columns(designs: Any) -> tuple[dict[Any, Any], Any, str]:
    """Columns of an xarray Dataset along its one dimension of designs."""
    names = [n for n in designs.variables if n in INPUT_NAMES or n == "explosive"]
    unknown = [
        n for n in designs.data_vars if n not in INPUT_NAMES and not _is_beside(n)
        and designs[n].dims and "sample" in designs[n].dims and designs[n].ndim == 1
        and n != "explosive"
    ]  # fmt: skip
    dims = list(dict.fromkeys(dim for name in names for dim in designs[name].dims))
    if len(dims) > 1:
        message = f"designs: the inputs have the dimensions {', '.join(dims)}; one is allowed"
        raise SpecError(message, field="designs", value=tuple(dims), allowed=1)
    dim = dims[0] if dims else "row"
    count = designs.sizes.get(dim, 1)
    index = designs[dim].to_numpy() if dim in designs.coords else np.arange(count)
    return {name: designs[name] for name in (*names, *unknown)}, index, str(dim)


def _checked_index(index: Any) -> Any:
    """Refuse an index whose labels cannot name rows: of several levels, or of mixed kinds."""
    if getattr(index, "nlevels", 1) > 1:
        message = f"designs: index: {index.nlevels} levels; one is allowed (reset_index)"
        raise SpecError(message, field="index", value=index.nlevels, allowed="one level")
    if index.dtype == object:
        kinds = sorted({type(label).__name__ for label in index})
        if len(kinds) > 1:
            message = f"designs: index: labels of mixed kinds ({', '.join(kinds)}); one is allowed"
            raise SpecError(message, field="index", value=tuple(kinds), allowed="one kind")
    return index


def _place(index: Any, name: str, row: int) -> str:
    """Place of a row, for messages."""
    label = index[row]
    return f"designs: {name} {getattr(label, 'item', lambda: label)()}"


def _si_column(name: str, column: Any, index: Any, index_name: str) -> FloatArray:
    """One column in SI; NaN in blank cells.

    Raises
    ------
    SpecError
        The cells at fault, a line each.
    """
    count = len(index)
    unit = getattr(column, "units", None) if hasattr(column, "magnitude") else None
    values = column.magnitude if unit is not None else column
    unit = getattr(column, "attrs", {}).get("units") if unit is None else unit
    if isinstance(unit, Mapping):  # of a DataFrame: by column
        unit = unit.get(name)
    if isinstance(values, str):
        return np.full(count, si_value(name, values, f"designs: {name}"))
    array = np.asarray(values)
    if array.ndim > 1:
        message = f"designs: {name}: {array.ndim} dimensions; one value a row is needed"
        raise SpecError(message, field=name, value=array.shape, allowed=f"({count},)")
    if array.dtype.kind in "iuf":
        numbers = np.asarray(array, dtype=np.float64)
        if unit is not None:
            numbers = scaled(numbers, _factor(name, unit))
        return np.array(np.broadcast_to(numbers, count))
    cells = np.broadcast_to(array, count).tolist() if array.ndim == 0 else list(values)
    found, faults = np.full(count, np.nan), []
    for row, cell in enumerate(cells):
        if _is_blank(cell):
            continue
        try:
            place = f"{_place(index, index_name, row)}: {name}"
            found[row] = si_value(name, as_written(cell), place)
        except SpecError as fault:
            faults.append(fault)
    more = len(faults) - _MOST_FAULTS
    if more > 0:
        faults = [*faults[:_MOST_FAULTS], SpecError(f"... and {more} more lines")]
    require_none(faults)
    return found


def _factor(name: str, unit: object) -> float:
    """Factor from the unit of a column to SI."""
    try:
        return unit_factor(unit_words(unit), VARIABLES[name].unit)
    except QuantityError as fault:
        message = f"designs: {name}: {fault}"
        raise SpecError(
            message, field=name, value=str(unit), allowed=VARIABLES[name].unit
        ) from None


def _is_blank(cell: object) -> bool:
    """Whether a cell holds nothing; pandas has a value of its own for that, NA."""
    if cell is None or type(cell).__name__ == "NAType":
        return True
    return not cell.strip() if isinstance(cell, str) else bool(cell != cell)


def _explosives(written: Any, count: int) -> list[str]:
    """Explosive of every row as text; empty where none is given."""
    if written is None:
        return [""] * count
    meanings = getattr(written, "attrs", {}).get("flag_meanings")
    if meanings is not None and np.asarray(written).dtype.kind in "iu":
        names = str(meanings).split()
        return [names[code] for code in np.asarray(written).tolist()]
    if isinstance(written, str | Path):
        return [str(written)] * count
    cells = np.atleast_1d(np.asarray(written, dtype=object)).tolist()
    if len(cells) == 1:
        cells *= count
    if len(cells) != count:
        message = f"explosive: {len(cells)} names for {count} designs"
        raise SpecError(message, field="explosive", value=len(cells), allowed=count)
    return ["" if _is_blank(cell) else str(cell) for cell in cells]
