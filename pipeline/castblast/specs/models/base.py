"""What every family of surrogates has in common, and the two families of plain linear algebra."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from castblast.design.variables import INPUT_NAMES, OUTPUT_NAMES, VARIABLES
from castblast.errors import nearest_name
from castblast.names import each_once, is_variable
from castblast.network import Transform
from castblast.specs.loading import Name, Spec
from castblast.specs.models.search import SearchSpace

#: The seven features of the published network are these six and the explosive.
PAPER_FEATURES = (
    "young_modulus",
    "ucs",
    "hole_diameter",
    "bench_height",
    "burden",
    "charge_length",
)
#: The three published targets and the expanded hole radius.
PAPER_TARGETS = (
    "equilibrium_pressure",
    "burden_velocity",
    "crushed_zone_radius",
    "expanded_hole_radius",
)
#: In place of names: every input that the dataset varies.
ALL_FEATURES = ("all",)

ExplosiveCode = Literal["one_hot", "descriptors"]


class DerivedSpec(Spec):
    """A further column for the model: a sum of inputs, scaled like an input.

    Attributes
    ----------
    coefficients : mapping of input name to float
        value = sum(coefficient * SI value); all inputs have the same unit.
    transform : {"linear", "log"}
        Applied to the value before standard scaling.
    """

    coefficients: Mapping[str, float] = Field(min_length=1)
    transform: Transform = "log"

    @model_validator(mode="after")
    def _one_unit(self) -> Self:
        unknown = [name for name in self.coefficients if name not in INPUT_NAMES]
        if unknown:
            hints = [f"unknown input '{n}'{nearest_name(n, INPUT_NAMES)}" for n in unknown]
            raise ValueError("; ".join(hints))
        units = {VARIABLES[name].unit for name in self.coefficients}
        if len(units) > 1:
            message = f"adds quantities of different units: {', '.join(sorted(units))}"
            raise ValueError(message)
        return self

    @property
    def unit(self) -> str:
        """SI unit of the sum."""
        return VARIABLES[next(iter(self.coefficients))].unit


class SurrogateSpec(Spec):
    """What every family has in common.

    Attributes
    ----------
    name : str
        Name of the candidate; the stem of its file unless given.
    description : str
        One line for tables.
    features : tuple of str
        Numeric inputs; ``all`` stands for every input that the dataset varies. The explosive
        always enters as well.
    targets : tuple of str
    input_transform, target_transform : {"linear", "log"}
        Applied to every numeric input or every target before standard scaling. With "log" the
        squared error that is minimised is one of relative deviations.
    linear_features : tuple of str
        Inputs that stay linear all the same, such as those that may be 0.
    derived : mapping of name to DerivedSpec
        Further columns. With ``features: all``, one that needs an input which the dataset holds is
        left out.
    explosive_code : {"one_hot", "descriptors"}
        How the explosive enters: by name, or by the numbers that the dataset has for it. By
        numbers, a model can be asked for an explosive that it was not trained on.
    search : mapping, optional
        Settings that a study may change; no part of the model, so not of its hash.
    """

    #: Extras of castblast that the family needs besides what all families need.
    needs: ClassVar[tuple[str, ...]] = ()

    name: Name
    description: str = ""
    features: tuple[str, ...] = Field(PAPER_FEATURES, min_length=1)
    targets: tuple[str, ...] = Field(PAPER_TARGETS, min_length=1)
    input_transform: Transform = "linear"
    linear_features: tuple[str, ...] = ()
    target_transform: Transform = "linear"
    derived: Mapping[str, DerivedSpec] = Field(default_factory=dict)
    explosive_code: ExplosiveCode = "one_hot"
    search: SearchSpace | None = Field(None, exclude=True)

    @field_validator("features", mode="before")
    @classmethod
    def _all(cls, value: Any) -> Any:
        return ALL_FEATURES if value == "all" else value

    @field_validator("features", "targets", "linear_features")
    @classmethod
    def _distinct(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        return each_once(names)

    @model_validator(mode="after")
    def _known_names(self) -> Self:
        faults = []
        features = () if self.takes_all else self.features
        for field, names, allowed in (
            ("features", features, INPUT_NAMES),
            ("targets", self.targets, OUTPUT_NAMES),
            ("linear_features", self.linear_features, features or INPUT_NAMES),
        ):
            faults += [
                f"{field}: unknown variable '{name}'{nearest_name(name, allowed)}"
                for name in names
                if name not in allowed
            ]
        for column, entry in self.derived.items():
            if not is_variable(column):
                faults.append(f"derived: '{column}': small letters, digits and '_' are allowed")
            if column in VARIABLES:
                faults.append(f"derived: '{column}' is the name of a variable; take another")
            missing = [name for name in entry.coefficients if features and name not in features]
            faults += [
                f"derived: {column}: '{name}' is not a feature of this spec" for name in missing
            ]
        if faults:
            raise ValueError("; ".join(faults))
        return self

    @property
    def takes_all(self) -> bool:
        """The features are not named but those that the dataset varies."""
        return self.features == ALL_FEATURES

    def resolved(self, varying: tuple[str, ...]) -> Self:
        """Give the spec with the features named: those that the dataset varies, if it takes all.

        Parameters
        ----------
        varying : tuple of str
            Inputs that the dataset varies.
        """
        if not self.takes_all:
            return self
        return self.model_copy(
            update={
                "features": varying,
                "linear_features": tuple(n for n in self.linear_features if n in varying),
                "derived": {
                    name: entry
                    for name, entry in self.derived.items()
                    if set(entry.coefficients) <= set(varying)
                },
            }
        )

    def transform_of(self, feature: str) -> Transform:
        """How one numeric input enters."""
        return "linear" if feature in self.linear_features else self.input_transform

    @property
    def seeds(self) -> range:
        """Seeds of the fits from which the validation rows choose."""
        return range(1)

    def quick(self) -> Self:
        """Give a spec of the same family for a first look: fitted in seconds, less well."""
        return self


class RandomStarts(SurrogateSpec):
    """Families that start from random weights.

    Attributes
    ----------
    restarts : int
        Fits from different random weights; the best on the validation rows is kept.
    seed : int
        Random numbers of restart i come from ``seed + i``.
    keep_members : bool
        The restarts that were not chosen travel in the exported network, for the spread of an
        ensemble; the file grows by as much.
    """

    restarts: int = Field(1, ge=1, le=100)
    seed: int = Field(0, ge=0, lt=2**31)
    keep_members: bool = False

    @property
    def seeds(self) -> range:
        """Seeds of the fits from which the validation rows choose."""
        return range(self.seed, self.seed + self.restarts)
