"""Recipes: what a dataset is made of, from variables and their ranges to the solver settings.

A recipe is the only input of a build. Every variable that is not named in it takes the default of
`castblast.design.variables`; everything that can change a number of the dataset is part of its
identity.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import yaml
from pydantic import Field, ValidationInfo, field_validator, model_validator

from castblast.design.variables import INPUTS, VARIABLES, Variable
from castblast.disk.resources import find_spec
from castblast.errors import nearest_name
from castblast.names import each_once
from castblast.specs.case import ModeName, TensionName
from castblast.specs.loading import Name, Spec, make_spec, parse_yaml, read_yaml_text
from castblast.specs.quantity import QuantityIn, convert, convert_variable

#: Variables a recipe may name; settings of the solver have their own block.
DESIGN_NAMES = tuple(v.name for v in INPUTS if v.role != "solver")
#: Splits in the order of their codes in a dataset.
SPLIT_NAMES = ("train", "valid", "calibration", "test")
#: Keys that describe a dataset without changing one number of it.
DESCRIPTIVE_KEYS = ("title", "summary", "license", "creator", "max_failed_share")
#: Keys that say how a dataset is made, without changing one number of it either.
EXECUTION_KEYS = ("shard_size",)

Distribution = Literal["uniform", "log_uniform"]


class VariableSpec(Spec):
    """How one variable is chosen: sampled between two bounds, or held at one value.

    Attributes
    ----------
    name : str
        A name of `castblast.design.variables`; in the file it is the key of the entry.
    ratio_of : str or None
        Another variable of the recipe. The numbers are then ratios to it: a stemming of 0.4 to 1
        burdens.
    lower, upper : float or None
        Bounds of a sampled variable, SI unit, or dimensionless with `ratio_of`.
    value : float or None
        Value of a fixed variable, same unit.
    distribution : {"uniform", "log_uniform"}
        Marginal of a sampled variable.
    """

    name: str
    ratio_of: str | None = None
    lower: float | None = None
    upper: float | None = None
    value: float | None = None
    distribution: Distribution = "uniform"

    @field_validator("name")
    @classmethod
    def _known(cls, name: str) -> str:
        if name not in DESIGN_NAMES:
            hint = nearest_name(name, DESIGN_NAMES)
            if name in VARIABLES:
                hint = hint or "; a setting of the solver goes under 'solver'"
            message = f"no such input{hint}"
            raise ValueError(message)
        return name

    @field_validator("ratio_of")
    @classmethod
    def _ratio_base(cls, base: str | None, info: ValidationInfo) -> str | None:
        name = info.data.get("name")
        if base is None or name is None:
            return base
        if base not in DESIGN_NAMES:
            message = f"no such input{nearest_name(base, DESIGN_NAMES)}"
            raise ValueError(message)
        if base == name or VARIABLES[base].unit != VARIABLES[name].unit:
            message = f"{name} is not a ratio of {base}: another input of the same unit is needed"
            raise ValueError(message)
        return base

    @field_validator("lower", "upper", "value", mode="before")
    @classmethod
    def _number(cls, value: object, info: ValidationInfo) -> float | None:
        name = info.data.get("name")
        if value is None or name is None or "ratio_of" not in info.data:
            return None  # the fault is the name or the ratio and is reported there
        if info.data["ratio_of"] is None:
            return convert_variable(name, value)
        ratio = convert(value, "1")
        if ratio < 0.0:
            message = "a ratio must not be negative"
            raise ValueError(message)
        return ratio

    @model_validator(mode="after")
    def _consistent(self) -> VariableSpec:
        if self.value is not None:
            if self.lower is not None or self.upper is not None:
                message = "give either a value or lower and upper, not both"
                raise ValueError(message)
        elif self.lower is None or self.upper is None:
            missing = " and ".join(k for k in ("lower", "upper") if getattr(self, k) is None)
            message = f"{missing} missing; write 'lower' and 'upper', or a 'value'"
            raise ValueError(message)
        elif not self.lower < self.upper:
            low, high = self.show(self.lower), self.show(self.upper)
            message = f"lower ({low}) must be below upper ({high})"
            raise ValueError(message)
        elif self.distribution == "log_uniform" and self.lower <= 0.0:
            message = f"log_uniform needs a lower bound above zero, not {self.show(self.lower)}"
            raise ValueError(message)
        return self

    @property
    def sampled(self) -> bool:
        """Whether the design draws this variable."""
        return self.value is None

    @property
    def variable(self) -> Variable:
        """Unit, meaning and plausibility bounds."""
        return VARIABLES[self.name]

    def show(self, number: float) -> str:
        """Format one of the numbers of this entry for people."""
        return self.variable.show(number) if self.ratio_of is None else f"{number:.6g}"

    def at(self, share: float) -> float:
        """Quantile of the marginal; `share` in [0, 1]."""
        if self.lower is None or self.upper is None:
            return math.nan if self.value is None else self.value
        if share in (0.0, 1.0):
            return self.upper if share else self.lower  # exactly, without rounding of exp and log
        if self.distribution == "log_uniform":
            return math.exp(
                math.log(self.lower) + share * (math.log(self.upper) - math.log(self.lower))
            )
        return self.lower + share * (self.upper - self.lower)


class Constraints(Spec):
    """Rules that every design obeys; a design that breaks one is drawn anew, never clipped.

    Attributes
    ----------
    minimum_stemming_ratio, maximum_stemming_ratio : float [-]
        Stemming length over burden.
    minimum_charge_length : float [m]
    """

    minimum_stemming_ratio: Annotated[float, QuantityIn("1", lower=0.0, upper=10.0)] = 0.4
    maximum_stemming_ratio: Annotated[float, QuantityIn("1", lower=0.0)] | None = None
    minimum_charge_length: Annotated[float, QuantityIn("m", lower=0.0, upper=100.0)] = 1.0

    @model_validator(mode="after")
    def _ordered(self) -> Constraints:
        top = self.maximum_stemming_ratio
        if top is not None and not self.minimum_stemming_ratio < top:
            message = (
                f"minimum_stemming_ratio ({self.minimum_stemming_ratio:g}) must be below "
                f"maximum_stemming_ratio ({top:g})"
            )
            raise ValueError(message)
        return self


class SolverSpec(Spec):
    """Settings of the near-field solver; what is left out takes the default of the solver.

    Attributes
    ----------
    mode : {"equilibrium", "paper"}
        End of a run: the hole wall at rest, or 0.9 of the travel time of the p-wave.
    tension : {"ductile", "brittle", "none"}
        Behaviour of rock that yields in tension.
    zones : int
        Zones of the mesh; 0: the default of the mode.
    outer_radius : float [m] or None
        None: the default of the mode.
    quadratic_viscosity, linear_viscosity : float [-]
    history_points : int
        Points of the pressure and radius histories of every sample.
    """

    mode: ModeName = "equilibrium"
    tension: TensionName = "ductile"
    zones: int = Field(default=0, ge=0, le=int(VARIABLES["zones"].upper))
    outer_radius: float | None = None
    quadratic_viscosity: float = 1.5
    linear_viscosity: float = 0.15
    history_points: int = Field(default=64, ge=2, le=4096)

    @field_validator("outer_radius", "quadratic_viscosity", "linear_viscosity", mode="before")
    @classmethod
    def _number(cls, value: object, info: ValidationInfo) -> float | None:
        return None if value is None else convert_variable(str(info.field_name), value)

    @field_validator("zones")
    @classmethod
    def _enough(cls, zones: int) -> int:
        fewest = int(VARIABLES["zones"].lower)
        if 0 < zones < fewest:
            message = f"at least {fewest} zones are needed (0: the default of the mode)"
            raise ValueError(message)
        return zones


class SplitShares(Spec):
    """Shares of the rows that models are trained, chosen, calibrated and judged on."""

    train: float = Field(default=0.8, ge=0.0, le=1.0)
    valid: float = Field(default=0.05, ge=0.0, le=1.0)
    calibration: float = Field(default=0.05, ge=0.0, le=1.0)
    test: float = Field(default=0.1, ge=0.0, le=1.0)

    @model_validator(mode="after")
    def _whole(self) -> SplitShares:
        total = math.fsum(self.shares)
        if abs(total - 1.0) > 1e-9:
            message = f"the shares add up to {total:.6g}; they must add up to 1"
            raise ValueError(message)
        return self

    @property
    def shares(self) -> tuple[float, ...]:
        """Shares in the order of `SPLIT_NAMES`."""
        return tuple(float(getattr(self, name)) for name in SPLIT_NAMES)


class Recipe(Spec):
    """One dataset to build. Quantities are SI floats once read.

    Attributes
    ----------
    name, version : str
        Together they name the dataset. Raise the major number of the version for a new meaning of
        a variable, the minor one for new ranges or physics, the last for descriptive changes.
    title, summary, license, creator : str
        Go into the file and its card.
    size, seed : int
        Rows, and where the random numbers start.
    explosives : tuple of str
        Names in the catalogue or paths relative to the recipe; balanced over the rows.
    variables : dict of str to VariableSpec
    constraints : Constraints
    solver : SolverSpec
    burden_parameter_set : {"authors", "field"}
        Of the burden model; neither is calibrated on measured blasts.
    split : SplitShares
    max_failed_share : float
        A build with a larger share of failed samples is refused.
    shard_size : int
        Rows that one task simulates and writes; changes no number. A shard should last a second or
        so, and there should be many per worker, so that all end at nearly the same time.
    """

    name: Name
    version: str
    title: str = Field(min_length=1)
    summary: str = ""
    license: str = "CC-BY-4.0"
    creator: str = "the castblast developers"
    size: int = Field(ge=1, le=100_000_000)
    seed: int = Field(ge=0, lt=2**63)
    explosives: tuple[str, ...] = Field(min_length=1, max_length=100)
    variables: dict[str, VariableSpec]
    constraints: Constraints = Constraints()
    solver: SolverSpec = SolverSpec()
    burden_parameter_set: Literal["authors", "field"] = "authors"
    split: SplitShares = SplitShares()
    max_failed_share: float = Field(default=0.01, ge=0.0, le=1.0)
    shard_size: int = Field(default=500, ge=1, le=1_000_000)

    @field_validator("version", mode="before")
    @classmethod
    def _three_numbers(cls, version: object) -> object:
        if not isinstance(version, str) or not re.fullmatch(
            r"(?:[0-9]{1,6}\.){2}[0-9]{1,6}", version
        ):
            message = "three numbers are needed, such as 1.0.0"
            raise ValueError(message)
        return version

    @field_validator("explosives")
    @classmethod
    def _each_once(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        return each_once(names)

    @field_validator("variables", mode="before")
    @classmethod
    def _entries(cls, entries: object) -> object:
        """Give every entry its name; a bare quantity is short for a fixed value."""
        if not isinstance(entries, Mapping):
            return entries
        return {
            name: {"name": name, **(entry if isinstance(entry, Mapping) else {"value": entry})}
            for name, entry in entries.items()
        }

    @model_validator(mode="after")
    def _design(self) -> Recipe:
        """Look at the variables together: ratios, lengths along the hole, something to draw."""
        faults = [fault for spec in self.variables.values() for fault in self._ratio_faults(spec)]
        if not self.sampled:
            faults.append("variables: none is sampled; give one 'lower' and 'upper'")
        if {"bench_height", "charge_length", "stemming_length"} <= set(self.variables):
            faults.append(
                "variables: bench_height, charge_length and stemming_length are all given; "
                "leave one out, it follows from the others"
            )
        if faults:
            raise ValueError("; ".join(faults))
        return self

    def _ratio_faults(self, spec: VariableSpec) -> list[str]:
        if spec.ratio_of is None:
            return []
        base = self.variables.get(spec.ratio_of)
        if base is None:
            return [f"variables.{spec.name}.ratio_of: {spec.ratio_of} is not among the variables"]
        if base.ratio_of is not None:
            return [f"variables.{spec.name}.ratio_of: {base.name} is a ratio itself"]
        low, high = spec.at(0.0) * base.at(0.0), spec.at(1.0) * base.at(1.0)
        variable = spec.variable
        if low < variable.lower * (1 - 1e-12) or high > variable.upper * (1 + 1e-12):
            return [
                f"variables.{spec.name}: implausible: {variable.show(low)} to {variable.show(high)}"
                f"; allowed: {variable.show(variable.lower)} to {variable.show(variable.upper)}"
            ]
        return []

    @property
    def sampled(self) -> tuple[VariableSpec, ...]:
        """Variables that the design draws, in the order of `castblast.design.variables`."""
        return tuple(
            self.variables[name]
            for name in DESIGN_NAMES
            if name in self.variables and self.variables[name].sampled
        )

    @property
    def fixed(self) -> tuple[VariableSpec, ...]:
        """Variables held at one value (or ratio), in the order of `castblast.design.variables`."""
        return tuple(
            self.variables[name]
            for name in DESIGN_NAMES
            if name in self.variables and not self.variables[name].sampled
        )


class RecipeSource(NamedTuple):
    """A recipe with the text it was read from, which goes into the dataset, and its file."""

    recipe: Recipe
    text: str
    path: Path


def load_recipe(path: str | Path, size: int | None = None) -> RecipeSource:
    """Read a recipe, from a file or one that came with castblast, by name.

    `size` replaces the number of rows, in the kept text too.

    Raises
    ------
    SpecError
        One line for every fault.
    """
    path = find_spec(path, "recipe")
    text = read_yaml_text(path)
    content = parse_yaml(text, str(path))
    if size is not None and size != content.get("size"):
        content["size"] = size
        text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True)
    recipe = make_spec(content, Recipe, str(path), folder=path.parent)
    return RecipeSource(recipe, text, path)


def recipe_from_text(text: str, where: str) -> Recipe:
    """Read the recipe that a dataset carries.

    Raises
    ------
    SpecError
        The text is no recipe of this version.
    """
    return make_spec(parse_yaml(text, where), Recipe, where)
