"""Tables for people: pandas and xarray, imported when a table is made, units in every one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

from castblast.design.variables import VARIABLES
from castblast.errors import MissingLibraryError
from castblast.extras import is_installed, missing_line

if TYPE_CHECKING:
    import pandas as pd


def library(name: str, purpose: str) -> Any:
    """Import an optional library.

    Parameters
    ----------
    name : str
        Import name, of one that an extra brings.
    purpose : str
        What needs it, the subject of a sentence.

    Raises
    ------
    MissingLibraryError
        One line with the extra that brings it.
    """
    if not is_installed(name):
        raise MissingLibraryError(missing_line([name], purpose), field=name)
    return import_module(name)


def frame(
    columns: Mapping[str, Sequence[Any]], index: Sequence[Any], name: str, purpose: str
) -> pd.DataFrame:
    """Columns as a DataFrame whose index has a name."""
    pandas = library("pandas", purpose)
    return pandas.DataFrame(dict(columns), index=pandas.Index(index, name=name))


def cf_attributes(name: str) -> dict[str, Any]:
    """CF attributes of a variable of `castblast.design.variables`."""
    variable = VARIABLES[name]
    return {"units": variable.unit, "long_name": variable.long_name}


def with_units(table: pd.DataFrame) -> pd.DataFrame:
    """Note the SI units of the columns that have one in ``attrs["units"]`` of a frame."""
    table.attrs["units"] = {
        str(name): VARIABLES[str(name)].unit for name in table.columns if str(name) in VARIABLES
    }
    return table
