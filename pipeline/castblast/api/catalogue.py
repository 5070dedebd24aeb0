"""What there is to choose from: the explosives of the catalogue and the variables."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from castblast.api.shared.frames import frame
from castblast.design.variables import INPUT_NAMES, INPUTS, OUTPUTS
from castblast.explosive.isentrope import pressure
from castblast.specs.catalogue import explosive_aliases, explosive_names
from castblast.specs.explosive import load_explosive

if TYPE_CHECKING:
    import pandas as pd

_UNITS = {
    "density": "kg m-3",
    "detonation_velocity": "m s-1",
    "heat_of_explosion": "J kg-1",
    "cj_pressure": "Pa",
    "explosion_pressure": "Pa",
}


def catalogue() -> list[dict[str, Any]]:
    """Short descriptions of the catalogue, in alphabetical order; SI units."""
    entries = []
    for name in explosive_names():
        spec = load_explosive(name)
        state = spec.cj_state()
        entries.append(
            {
                "name": spec.name,
                "density": spec.density,
                "detonation_velocity": spec.detonation_velocity,
                "heat_of_explosion": spec.heat_of_explosion,
                "cj_pressure": None if state is None else state.pressure,
                "explosion_pressure": pressure(spec.to_explosive().isentrope, 1.0),
            }
        )
    return entries


def explosives() -> pd.DataFrame:
    """Explosives of the catalogue.

    Returns
    -------
    DataFrame
        One row for each name: `density` [kg m-3], `detonation_velocity` [m s-1],
        `heat_of_explosion` [J kg-1], `cj_pressure` and `explosion_pressure` [Pa], and `aliases`,
        other names under which it is found. The units are in ``attrs["units"]``.

    Raises
    ------
    MissingLibraryError
        pandas is not installed.

    Examples
    --------
    >>> import castblast as cb
    >>> cb.explosives()["density"]
    explosive
    anfo                800.0
    doped_emulsion     1280.0
    gassed_emulsion    1150.0
    heavy_anfo          950.0
    Name: density, dtype: float64
    """
    entries = catalogue()
    aliases: dict[str, list[str]] = {}
    for alias, name in explosive_aliases().items():
        aliases.setdefault(name, []).append(alias)
    columns: dict[str, list[Any]] = {key: [entry[key] for entry in entries] for key in _UNITS}
    names = [entry["name"] for entry in entries]
    columns["aliases"] = [", ".join(aliases.get(name, ())) for name in names]
    table = frame(columns, names, "explosive", "castblast.explosives")
    table.attrs["units"] = dict(_UNITS)
    return table


def variables() -> pd.DataFrame:
    """All inputs and outputs of the physics: unit, range, default, meaning.

    Returns
    -------
    DataFrame
        One row for each name: `kind` (input or output), `role`, SI `unit`, `lower` and `upper`
        (plausible range, SI), `default` (NaN where it follows from other inputs), `shown_unit` for
        screens with `factor` from SI, `meaning`.

    Raises
    ------
    MissingLibraryError
        pandas is not installed.

    Examples
    --------
    >>> import castblast as cb
    >>> cb.variables().loc["ucs", ["unit", "lower", "upper", "shown_unit"]].to_dict()
    {'unit': 'Pa', 'lower': 1000000.0, 'upper': 600000000.0, 'shown_unit': 'MPa'}
    """
    known = (*INPUTS, *OUTPUTS)
    records = [asdict(variable) for variable in known]
    columns: dict[str, list[Any]] = {
        "kind": ["input" if v.name in INPUT_NAMES else "output" for v in known],
        **{key: [record[key] for record in records] for key in ("role", "unit", "lower", "upper")},
        "default": [float("nan") if v.default is None else v.default for v in known],
        "shown_unit": [v.shown_unit for v in known],
        "factor": [v.display_factor for v in known],
        "meaning": [v.long_name for v in known],
    }
    return frame(columns, [v.name for v in known], "variable", "castblast.variables")
