"""What a surrogate is to be: one frozen spec per family, read from ``models/specs/*.yaml``.

A setting that a family does not use is no field of its spec, so writing it is an error. The name
of a candidate is the name of its file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeAlias

from pydantic import Field, field_validator, model_validator

from castblast.errors import SpecError, nearest_name
from castblast.network import Transform
from castblast.specs.loading import Spec, make_spec, read_yaml
from castblast.variables import INPUT_NAMES, OUTPUT_NAMES

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


class SurrogateSpec(Spec):
    """What every family has in common.

    Attributes
    ----------
    name : str
        Name of the candidate; the stem of its file unless given.
    description : str
        One line for tables.
    features : tuple of str
        Numeric inputs; the explosive always enters as well, one-hot.
    targets : tuple of str
    input_transform, target_transform : {"linear", "log"}
        Applied to every numeric input or every target before standard scaling. With "log" the
        squared error that is minimised is one of relative deviations.
    """

    name: str = Field(min_length=1, pattern=r"^[a-z0-9_]+$")
    description: str = ""
    features: tuple[str, ...] = Field(PAPER_FEATURES, min_length=1)
    targets: tuple[str, ...] = Field(PAPER_TARGETS, min_length=1)
    input_transform: Transform = "linear"
    target_transform: Transform = "linear"

    @field_validator("features", "targets")
    @classmethod
    def _distinct(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            message = f"given twice: {', '.join(twice)}"
            raise ValueError(message)
        return names

    @model_validator(mode="after")
    def _known_names(self) -> Self:
        faults = []
        for field, names, allowed in (
            ("features", self.features, INPUT_NAMES),
            ("targets", self.targets, OUTPUT_NAMES),
        ):
            faults += [
                f"{field}: unknown variable '{name}'{nearest_name(name, allowed)}"
                for name in names
                if name not in allowed
            ]
        if faults:
            raise ValueError("; ".join(faults))
        return self


class MlpSpec(SurrogateSpec):
    """Fully connected network of scikit-learn, full-batch L-BFGS.

    Attributes
    ----------
    hidden_layers : tuple of int
        Nodes of each hidden layer.
    activation : {"tanh", "relu", "logistic"}
        Of every hidden layer; the last layer is linear.
    penalty : float
        L2 penalty on the weights (``alpha`` of scikit-learn).
    max_iterations : int
        Bound on L-BFGS iterations of each round; reaching it is recorded, not an error.
    tolerance : float
        Change of loss or gradient at which L-BFGS stops.
    refinements : int
        Further rounds from the weights found, in each of which the solver sees the scaled targets
        ten times larger. L-BFGS as scikit-learn calls it also stops when the loss falls by less
        than 2.2e-9, an absolute bound that ends the first round early.
    restarts : int
        Fits from different random weights; the best on the validation rows is kept.
    seed : int
        Random weights of restart i come from ``seed + i``.
    """

    kind: Literal["mlp"] = "mlp"
    hidden_layers: tuple[Annotated[int, Field(ge=1, le=4096)], ...] = Field((7, 7, 7), min_length=1)
    activation: Literal["tanh", "relu", "logistic"] = "tanh"
    penalty: float = Field(0.0, ge=0.0)
    max_iterations: int = Field(5000, ge=1)
    tolerance: float = Field(1e-7, gt=0.0)
    refinements: int = Field(0, ge=0, le=4)
    restarts: int = Field(1, ge=1, le=100)
    seed: int = Field(0, ge=0, lt=2**31)


class RidgeSpec(SurrogateSpec):
    """Linear regression with an L2 penalty on polynomials of the scaled inputs: the floor.

    Attributes
    ----------
    degree : int
        Degree of the polynomial; only degree 1 can be exported, as a network of one layer.
    penalty : float
        ``alpha`` of scikit-learn.
    """

    kind: Literal["ridge"] = "ridge"
    degree: int = Field(1, ge=1, le=6)
    penalty: float = Field(1e-6, ge=0.0)


ModelSpec: TypeAlias = MlpSpec | RidgeSpec
_KINDS: dict[str, type[MlpSpec] | type[RidgeSpec]] = {"mlp": MlpSpec, "ridge": RidgeSpec}


def read_model_spec(path: Path) -> ModelSpec:
    """Read a candidate from its YAML file.

    Raises
    ------
    SpecError
        Unreadable file, unknown family, unknown or unusable settings; all faults at once.
    """
    content: dict[str, Any] = read_yaml(path)
    kind = content.get("kind")
    if kind not in _KINDS:
        known = ", ".join(_KINDS)
        what = "is missing" if kind is None else f"{kind}: unknown{nearest_name(str(kind), _KINDS)}"
        message = f"{path}: kind: {what} (known kinds: {known})"
        raise SpecError(message)
    return make_spec({"name": path.stem, **content}, _KINDS[kind], str(path), folder=path.parent)


def read_model_specs(paths: list[Path]) -> list[ModelSpec]:
    """Read several candidates, reporting the faults of all files at once.

    Raises
    ------
    SpecError
        As `read_model_spec`; also no file at all, or two candidates of one name.
    """
    specs: list[ModelSpec] = []
    faults = [] if paths else ["no model spec given"]
    for path in paths:
        try:
            spec = read_model_spec(path)
        except SpecError as fault:
            faults.append(str(fault))
            continue
        if spec.name in (known.name for known in specs):
            faults.append(f"{path}: name: '{spec.name}' is taken by another spec")
        specs.append(spec)
    if faults:
        raise SpecError("\n".join(faults))
    return specs
