"""What came out of one simulated blast, for people: quantities, histories, ledger, pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from castblast.api.shared.frames import cf_attributes, frame, library
from castblast.api.shared.markup import bar, box, folded, table
from castblast.api.shared.values import Quantity
from castblast.bands import BAND_TITLE, BAND_WORDS, band_document, show_band, show_value
from castblast.blast.run import (
    BlastResult,
)
from castblast.design.variables import VARIABLES
from castblast.errors import Status, nearest_name
from castblast.names import as_words

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure

_NEAR = (
    "plastic_work",
    "tensile_work",
    "elastic_energy",
    "kinetic_energy",
    "viscous_work",
    "boundary_work",
)
_BURDEN = (
    "burden_kinetic_energy",
    "fracture_work",
    "stemming_work",
    "vented_enthalpy",
    "atmospheric_work",
    "floor_work",
    "final_gas_energy",
)
#: Roles of inputs that describe the blast; the others are parameters of the models.
_DESIGN = ("rock", "hole", "bench")
_NEAR_HISTORY = {
    "pressure": ("Pa", "gas pressure in the hole"),
    "hole_radius": ("m", "radius of the hole wall"),
}
_BURDEN_HISTORY = {
    "pressure": ("Pa", "gas pressure behind the burden"),
    "velocity": ("m s-1", "velocity of the burden"),
    "displacement": ("m", "displacement of the burden"),
}


@dataclass(frozen=True, eq=False, repr=False)
class Blast:
    """Outcome of one simulated blast; made by `simulate`.

    Every output can be read by its name too: ``blast.burden_velocity``.

    Attributes
    ----------
    explosive : str
    mode, parameters : str
        End of the near field; parameter set of the burden model.
    inputs, outputs : mapping of name to Quantity
        SI floats that know their unit and, where one is stated, their prediction band.
    remarks : list of str
        What a reader should know of this run.
    result : BlastResult
        The records of the physics.
    """

    explosive: str
    mode: str
    parameters: str
    inputs: Mapping[str, Quantity]
    outputs: Mapping[str, Quantity]
    remarks: list[str]
    result: BlastResult

    def __getattr__(self, name: str) -> Quantity:
        outputs: Mapping[str, Quantity] = self.__dict__.get("outputs", {})
        if name in outputs:
            return outputs[name]
        hint = "" if name.startswith("_") else nearest_name(name, outputs)
        message = f"a blast has no '{name}'{hint}"
        raise AttributeError(message)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.outputs]

    @cached_property
    def near_field(self) -> xr.Dataset:
        """Histories of the hole over time: `pressure` and `hole_radius`."""
        near = self.result.near_field
        values = {"pressure": near.history_pressure, "hole_radius": near.history_radius}
        return _history(near.history_time, values, _NEAR_HISTORY, "time since detonation")

    @cached_property
    def burden(self) -> xr.Dataset:
        """Histories of the burden motion over time: `pressure`, `velocity`, `displacement`."""
        motion = self.result.burden
        values = {
            "pressure": motion.history_pressure,
            "velocity": motion.history_velocity,
            "displacement": motion.history_displacement,
        }
        words = "time since the burden begins to move"
        return _history(motion.history_time, values, _BURDEN_HISTORY, words)

    @cached_property
    def ledger(self) -> pd.DataFrame:
        """Where the energy goes: `part`, `value`, `unit` and `share` of each term.

        Shares of the near field are of the gas work, those of the burden of the energy in the gas
        when the burden begins to move.
        """
        near = [(n, "near field", self.outputs[n].value, "J m-1") for n in _NEAR]
        motion = self.result.burden
        burden = [(n, "burden", float(getattr(motion, n)), "J") for n in _BURDEN]
        whole = {"near field": self.outputs["gas_work"].value, "burden": motion.initial_gas_energy}
        terms = [*near, *burden]
        return frame(
            {
                "part": [part for _, part, _, _ in terms],
                "value": [value for _, _, value, _ in terms],
                "unit": [unit for _, _, _, unit in terms],
                "share": [value / whole[part] for _, part, value, _ in terms],
            },
            [name for name, *_ in terms],
            "energy",
            "Blast.ledger",
        )

    def to_frame(self) -> pd.DataFrame:
        """Inputs and outputs as a table: value [SI], unit, ends of the prediction band, meaning."""
        shown = [*self.inputs.values(), *self.outputs.values()]
        ends = [q.band or (float("nan"), float("nan")) for q in shown]
        return frame(
            {
                "value": [q.value for q in shown],
                "unit": [q.unit for q in shown],
                "prediction_lower": [low for low, _ in ends],
                "prediction_upper": [high for _, high in ends],
                "meaning": [VARIABLES[q.name].long_name for q in shown],
            },
            [q.name for q in shown],
            "variable",
            "Blast.to_frame",
        )

    def to_xarray(self) -> xr.Dataset:
        """All of it as one Dataset: scalars by name, histories over two times of their own."""
        xarray = library("xarray", "Blast.to_xarray")
        scalars = {
            name: ((), q.value, cf_attributes(name))
            for name, q in {**self.inputs, **self.outputs}.items()
        }
        histories = [
            part.rename(
                {"time": f"{name}_time", **{k: f"{name}_{k}_history" for k in part.data_vars}}
            )
            for name, part in (("near_field", self.near_field), ("burden", self.burden))
        ]
        whole: xr.Dataset = xarray.merge([xarray.Dataset(scalars), *histories])
        attributes = {"mode": self.mode, "parameters": self.parameters}
        return whole.assign_coords(explosive=self.explosive).assign_attrs(attributes)

    def plot(self) -> Figure:
        """Draw gas pressure, hole radius, burden motion and energy; writes nothing."""
        library("matplotlib", "Blast.plot")
        from castblast.report.simulation_figures import simulation_figure

        return simulation_figure(self.document(), self.result.near_field, self.result.burden)

    def document(self) -> dict[str, Any]:
        """Everything but the histories as plain JSON values, SI."""
        outputs: dict[str, Any] = {name: q.value for name, q in self.outputs.items()}
        return {
            "explosive": self.explosive,
            "mode": self.mode,
            "parameter_set": self.parameters,
            "status": Status(self.result.status).name.lower(),
            **outputs,
            "settled": bool(self.result.near_field.settled),
            **band_document({name: q.value for name, q in self.outputs.items()}),
            "inputs": {name: q.value for name, q in self.inputs.items()},
        }

    def __repr__(self) -> str:
        shown = ", ".join(
            f"{name.replace('_', ' ')} {self.outputs[name]!r}"
            for name in ("burden_velocity", "equilibrium_pressure")
        )
        return f"<Blast of {self.explosive}: {shown}>"

    def _repr_html_(self) -> str:
        units = {name: VARIABLES[name].shown_unit for name in self.outputs}
        found = [
            (as_words(name), show_value(name, q), show_band(name, q), units[name])
            for name, q in self.outputs.items()
            if q.band is not None
        ]
        work = self.outputs["gas_work"].value
        shares = [(as_words(name), self.outputs[name].value / work) for name in _NEAR]
        return box(
            f"{self.explosive}, {self.mode} mode, {self.parameters} parameters",
            table(("output", "value", BAND_TITLE, "unit"), found),
            self._html_inputs(),
            bar(shares, f"where {work * 1e-6:.3g} MJ/m of gas work goes"),
            lead=BAND_WORDS,
        )

    def _html_inputs(self) -> str:
        """The design as a table, and folded below it the parameters of the models."""
        rows: dict[bool, list[tuple[str, str]]] = {True: [], False: []}
        for name, value in self.inputs.items():
            variable = VARIABLES[name]
            rows[variable.role in _DESIGN].append((as_words(name), variable.show(value)))
        design, parameters = rows[True], rows[False]
        inner = table(("parameter", "value"), parameters)
        words = f"{len(parameters)} parameters of the models"
        return table(("input", "value"), design) + folded(words, inner)


def _history(
    time: Any, values: Mapping[str, Any], units: Mapping[str, tuple[str, str]], words: str
) -> xr.Dataset:
    xarray = library("xarray", "the history of a blast")
    columns = {
        name: ("time", values[name], {"units": unit, "long_name": long_name})
        for name, (unit, long_name) in units.items()
    }
    attributes = {"units": "s", "long_name": words}
    dataset: xr.Dataset = xarray.Dataset(columns, coords={"time": ("time", time, attributes)})
    return dataset
