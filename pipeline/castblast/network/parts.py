"""Parts of a network record: columns, layers, rules, golden rows, and the shell around them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from castblast.design.variables import VARIABLES
from castblast.names import people_unit
from castblast.network.terms import Activation, Transform
from castblast.types import FloatArray


@dataclass(frozen=True)
class Column:
    """One numeric column and its scaling.

    Attributes
    ----------
    name : str
        Name in `castblast.design.variables`.
    unit : str
        SI unit.
    transform : {"linear", "log"}
        Applied before the scaling; "log" is the natural logarithm of the SI value.
    mean, scale : float
        Scaled value = (transformed value - mean) / scale; `scale` is positive.
    """

    name: str
    unit: str
    transform: Transform
    mean: float
    scale: float

    def show(self, value: float) -> str:
        """Format an SI value of this column in the unit that people use."""
        if self.name in VARIABLES:
            return VARIABLES[self.name].show(value)
        return f"{value:.6g} {people_unit(self.unit)}".removesuffix(" 1")


@dataclass(frozen=True)
class InputColumn(Column):
    """A numeric input; `lower` and `upper` are its least and greatest training value (SI)."""

    lower: float
    upper: float


@dataclass(frozen=True)
class DerivedColumn(Column):
    """A further column of the first layer: sum(coefficient * SI input), then as any column.

    Where the inputs are logged, ratios and products of powers of inputs need no such column: the
    first layer forms them. A length left over, such as bench height less charge length, does.
    """

    coefficients: Mapping[str, float]


@dataclass(frozen=True)
class OutputColumn(Column):
    """An output; 95 % of truths lie within `relative_band` of the prediction, relative to it."""

    relative_band: float


@dataclass(frozen=True, eq=False)
class Layer:
    """Dense layer: activation(x @ weights + biases), weights (n_in, n_out), biases (n_out,)."""

    weights: FloatArray
    biases: FloatArray
    activation: Activation


@dataclass(frozen=True)
class Constraint:
    """Linear rule of the domain on SI inputs: sum(coefficient * input) >= lower.

    `label` says it in words; `unit` is the unit of the sum.
    """

    label: str
    coefficients: Mapping[str, float]
    lower: float
    unit: str = "1"

    def margin(self, row: Mapping[str, Any]) -> Any:
        """Sum less its lower bound; negative where the rule is broken. Broadcasts."""
        return sum(c * row[name] for name, c in self.coefficients.items()) - self.lower


@dataclass(frozen=True, eq=False)
class DensityScore:
    """Joint domain of the numeric inputs: how unusual a row is beside the training rows.

    With z the scaled numeric inputs of a row, the score is
    min over c of (|whitening_c (z - centre_c)|² + offset_c) / threshold: at most 1 inside.
    Up to a constant it is minus twice the logarithm of the largest term of a Gaussian mixture.

    Attributes
    ----------
    centres : (c, k)
    whitening : (c, k, k)
        Lower triangular; whitening' whitening is the inverse covariance about a centre.
    offsets : (c,)
        At least 0, the least of them 0.
    threshold : float
        Positive.
    level : float
        Share of rows of the training distribution that score at most 1.
    """

    centres: FloatArray
    whitening: FloatArray
    offsets: FloatArray
    threshold: float
    level: float

    def distances(self, scaled: FloatArray) -> FloatArray:
        """Squared distance and offset of every centre for scaled inputs (n, k): (c, n)."""
        distances = np.empty((len(self.centres), len(scaled)))
        with np.errstate(invalid="ignore", over="ignore"):
            for j, (centre, whitening) in enumerate(zip(self.centres, self.whitening, strict=True)):
                steps = (scaled - centre) @ whitening.T
                distances[j] = np.sum(steps * steps, axis=1) + self.offsets[j]
        return distances


@dataclass(frozen=True, eq=False)
class GoldenRows:
    """Rows with the answers of the fitted estimator itself, to test every copy against.

    Attributes
    ----------
    inputs : (n, k) SI
    explosives : (n,) names
    outputs : (n, m) SI
    """

    inputs: FloatArray
    explosives: tuple[str, ...]
    outputs: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class ShellParts:
    """Everything about a surrogate but the map from scaled columns to scaled outputs.

    A `Network` is a shell with dense layers inside. A model of another shape has a shell too; what
    stands inside it is then for others to keep, and nothing here can evaluate it.

    Attributes
    ----------
    inputs : tuple of InputColumn, k of them
    explosives : tuple of str
        Names the surrogate knows, in the order of `codes`.
    codes : (len(explosives), c)
        What enters the model for each explosive; the identity matrix is one-hot.
    outputs : tuple of OutputColumn
    constraints : tuple of Constraint
        Rules of the domain beside the box of the inputs.
    golden : GoldenRows
    provenance : mapping
        Dataset, recipe, spec, scores and version; plain JSON values.
    derived : tuple of DerivedColumn, d of them
        Enter the model between the numeric inputs and the code.
    density : DensityScore, optional
        Joint domain of the training rows.
    """

    inputs: tuple[InputColumn, ...]
    explosives: tuple[str, ...]
    codes: FloatArray
    outputs: tuple[OutputColumn, ...]
    constraints: tuple[Constraint, ...]
    golden: GoldenRows
    provenance: Mapping[str, Any] = field(default_factory=dict)
    derived: tuple[DerivedColumn, ...] = ()
    density: DensityScore | None = None

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the numeric inputs, in order."""
        return tuple(column.name for column in self.inputs)

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs, in order."""
        return tuple(column.name for column in self.outputs)

    @property
    def width(self) -> int:
        """Number of values that enter the model: k + d + c."""
        return len(self.inputs) + len(self.derived) + int(self.codes.shape[1])
