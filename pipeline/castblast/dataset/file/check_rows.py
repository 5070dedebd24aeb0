"""Departures of the rows of a dataset from its format, counted block by block."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from castblast.dataset.file.schema import HISTORIES, plausible_range, role_of
from castblast.design.variables import INPUT_NAMES, OUTPUT_NAMES, VARIABLES
from castblast.errors import Status
from castblast.names import people_unit
from castblast.types import BoolArray

#: Roles an input, an output may have.
INPUT_ROLES = ("input", "derived", "fixed")
OUTPUT_ROLES = ("target", "diagnostic")
_SHOWN = 5


@dataclass
class _Found:
    """Rows with the same fault: how many, the first ids, the first value for people."""

    value: str
    count: int = 0
    ids: list[int] = field(default_factory=list)

    @property
    def text(self) -> str:
        named = f", id {', '.join(map(str, self.ids))}" if self.ids else ""
        rows = f"{self.count} sample{'s' if self.count > 1 else ''}{named}"
        return f"{rows} ({self.value} first)" if self.value else rows


class RowCheck:
    """Looks at the values of blocks of consecutive rows; remembers faults and codes, not rows.

    Attributes
    ----------
    failed : int
        Rows whose status is not OK.
    codes : dict of str to set of int
        Codes met in the columns that have flags.
    """

    def __init__(self) -> None:
        self.failed = 0
        self.codes: dict[str, set[int]] = {}
        self._ids: list[NDArray[Any]] = []
        self._found: dict[tuple[str, str], _Found] = {}
        self._single: set[str] = set()  # checked already, as they are the same in every block

    def add(self, block: xr.Dataset) -> None:
        """Check the next rows."""
        for name in ("explosive", "split", "status"):
            if name in block.variables and block[name].dtype.kind in "iu":
                met = np.unique(block[name].to_numpy()).tolist()
                self.codes.setdefault(name, set()).update(met)
        if "status" in block.variables:
            self.failed += int(np.count_nonzero(block["status"].to_numpy()))
        if "sample" in block.variables:
            ids = block["sample"].to_numpy()
            if ids.ndim == 1 and ids.dtype.kind in "iu":
                self._ids.append(ids)
        for name in (*INPUT_NAMES, *OUTPUT_NAMES):
            if name in block.variables:
                self._add_variable(block, name)
        for name in HISTORIES:
            if name in block.variables and block[name].ndim == 2 and block[name].dtype.kind == "f":
                finite = np.isfinite(block[name].to_numpy()).all(axis=1)
                ok = _finished(block, len(finite))
                self._note(block, name, "not finite in finished samples", ok & ~finite)

    def faults(self) -> list[tuple[str, str]]:
        """Place and message of every fault of the rows so far."""
        faults = [(name, f"{what}: {found.text}") for (name, what), found in self._found.items()]
        if not self._ids:
            return faults
        ids, counts = np.unique(np.concatenate(self._ids), return_counts=True)
        if (counts > 1).any():
            shown = ", ".join(map(str, ids[counts > 1][:_SHOWN]))
            faults.append(("sample", f"{int((counts > 1).sum())} ids twice: {shown}"))
        elif (np.diff(np.concatenate(self._ids)) < 0).any():
            faults.append(("sample", "rows are not in the order of their ids"))
        if (ids < 0).any():
            faults.append(("sample", "negative ids"))
        return faults

    def _add_variable(self, block: xr.Dataset, name: str) -> None:
        """Finite and plausible where the row is finished, NaN where it failed."""
        variable = block[name]
        dims = () if role_of(variable) == "fixed" else ("sample",)
        if variable.dims != dims or variable.dtype.kind != "f":
            return  # said already, of the form
        if not dims:
            if name in self._single:
                return
            self._single.add(name)
        values = np.atleast_1d(variable.to_numpy())
        ok = np.ones(values.size, dtype=bool)
        if name in OUTPUT_NAMES:
            ok = _finished(block, values.size)
        finite = np.isfinite(values)
        self._note(block, name, "not finite in finished samples", ok & ~finite, values)
        self._note(block, name, "not NaN in failed samples", ~ok & ~np.isnan(values), values)
        low, high = plausible_range(name)
        beyond = (values < low - 1e-9 * abs(low)) | (values > high + 1e-9 * abs(high))
        what = f"implausible; allowed: {low:g} to {high:g} {people_unit(VARIABLES[name].unit)}"
        self._note(block, name, what, ok & finite & beyond, values)
        bounds = [variable.attrs.get(f"sampled_{end}") for end in ("lower", "upper")]
        numbers = all(isinstance(bound, int | float | np.number) for bound in bounds)
        if numbers and "sampled_as_ratio_of" not in variable.attrs:
            outside = (values < bounds[0]) | (values > bounds[1])
            self._note(block, name, "outside the sampled range", outside, values)

    def _note(
        self,
        block: xr.Dataset,
        name: str,
        what: str,
        where: BoolArray,
        values: NDArray[Any] | None = None,
    ) -> None:
        rows = np.flatnonzero(where)
        if not len(rows):
            return
        if (name, what) not in self._found:
            shown = "" if values is None else VARIABLES[name].show(float(values[rows[0]]))
            self._found[name, what] = _Found(shown)
        found = self._found[name, what]
        found.count += len(rows)
        if "sample" in block.variables:
            ids = block["sample"].to_numpy()
            wanted = rows[rows < len(ids)][: _SHOWN - len(found.ids)]
            found.ids += ids[wanted].tolist()


def _finished(block: xr.Dataset, count: int) -> BoolArray:
    if "status" in block.variables and block["status"].shape == (count,):
        return np.asarray(block["status"].to_numpy() == Status.OK)
    return np.ones(count, dtype=bool)
