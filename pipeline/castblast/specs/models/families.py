"""One frozen spec per family of surrogates; a setting that a family does not use is no field."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

from pydantic import Field, ValidationInfo, field_validator, model_validator

from castblast.specs.models.base import RandomStarts, SurrogateSpec

HiddenLayers: TypeAlias = tuple[Annotated[int, Field(ge=1, le=4096)], ...]


class MlpSpec(RandomStarts):
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
    """

    kind: Literal["mlp"] = "mlp"
    hidden_layers: HiddenLayers = Field((7, 7, 7), min_length=1)
    activation: Literal["tanh", "relu", "logistic"] = "tanh"
    penalty: float = Field(0.0, ge=0.0)
    max_iterations: int = Field(5000, ge=1)
    tolerance: float = Field(1e-7, gt=0.0)
    refinements: int = Field(0, ge=0, le=4)

    def quick(self) -> Self:
        """One start, one round, 400 iterations."""
        fewer = {"restarts": 1, "refinements": 0, "max_iterations": min(self.max_iterations, 400)}
        return self.model_copy(update=fewer)


class LevenbergSpec(RandomStarts):
    """A small network for each target, fitted by Levenberg-Marquardt; exported as one network.

    Attributes
    ----------
    hidden_layers : tuple of int
        Nodes of each hidden layer of the network of one target.
    activation : {"tanh", "logistic", "silu"}
    penalty : float
        Squared weights count this much beside the sum of squared residuals of the scaled target.
    start_rows, start_iterations : int
        A fit starts on so many random training rows, with at most so many accepted steps, where
        they cost less; without effect where there are not 1.5 times as many rows.
    starts : int
        Random weights that are tried so; what has the lowest objective goes on.
    max_iterations : int
        Further steps on all rows; reaching it is recorded, not an error.
    tolerance : float
        Relative fall of the objective over ten steps at which a fit ends.
    per_explosive : bool
        A network for each explosive as well; needs ``explosive_code: one_hot``.
    use_physics : bool
        Leave out what a target cannot depend on: the near field does not know the bench.
    """

    kind: Literal["levenberg"] = "levenberg"
    hidden_layers: HiddenLayers = Field((32, 16), min_length=1)
    activation: Literal["tanh", "logistic", "silu"] = "tanh"
    penalty: float = Field(0.0, ge=0.0)
    start_rows: int = Field(2500, ge=10)
    start_iterations: int = Field(100, ge=1)
    starts: int = Field(1, ge=1, le=20)
    max_iterations: int = Field(40, ge=1)
    tolerance: float = Field(2e-2, ge=0.0, lt=1.0)
    per_explosive: bool = False
    use_physics: bool = True

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        faults = _per_explosive_faults(self)
        if faults:
            raise ValueError("; ".join(faults))
        return self

    def quick(self) -> Self:
        """One start, half the nodes, at most 40 and 10 steps."""
        fewer = {
            "restarts": 1,
            "starts": 1,
            "hidden_layers": tuple((width + 1) // 2 for width in self.hidden_layers),
            "start_iterations": min(self.start_iterations, 40),
            "max_iterations": min(self.max_iterations, 10),
        }
        return self.model_copy(update=fewer)


class TorchSpec(RandomStarts):
    """Fully connected network in PyTorch, float64: Adam on mini-batches, then full-batch L-BFGS.

    Attributes
    ----------
    hidden_layers : tuple of int
    activation : {"tanh", "silu", "relu", "logistic"}
    penalty : float
        Squared weights count this much beside the mean squared residual of the scaled targets.
    adam_epochs, batch_size, learning_rate
        First stage; the rate falls to 0 along half a cosine.
    max_iterations : int
        Bound on the L-BFGS iterations of the second stage.
    tolerance : float
        Largest entry of the gradient at which L-BFGS stops.
    members : int
        Networks from different random weights whose mean is the answer; exported as one network.
    per_explosive : bool
        A network for each explosive; needs ``explosive_code: one_hot``.
    """

    needs: ClassVar[tuple[str, ...]] = ("torch",)

    kind: Literal["torch_mlp"] = "torch_mlp"
    hidden_layers: HiddenLayers = Field((32, 32), min_length=1)
    activation: Literal["tanh", "silu", "relu", "logistic"] = "silu"
    penalty: float = Field(0.0, ge=0.0)
    adam_epochs: int = Field(30, ge=0)
    batch_size: int = Field(256, ge=1)
    learning_rate: float = Field(5e-3, gt=0.0)
    max_iterations: int = Field(1500, ge=0)
    tolerance: float = Field(1e-9, gt=0.0)
    members: int = Field(1, ge=1, le=20)
    per_explosive: bool = False

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        faults = _per_explosive_faults(self)
        if faults:
            raise ValueError("; ".join(faults))
        return self

    def quick(self) -> Self:
        """One network, ten epochs, 150 iterations of L-BFGS."""
        fewer = {"restarts": 1, "members": 1, "adam_epochs": min(self.adam_epochs, 10)}
        return self.model_copy(update={**fewer, "max_iterations": min(self.max_iterations, 150)})


def _per_explosive_faults(spec: LevenbergSpec | TorchSpec) -> list[str]:
    if spec.per_explosive and spec.explosive_code != "one_hot":
        return ["per_explosive: needs explosive_code: one_hot"]
    return []


class GradientBoostingSpec(SurrogateSpec):
    """Histogram gradient boosting of scikit-learn, one ensemble of trees for each target.

    Attributes
    ----------
    max_iterations : int
        Trees.
    learning_rate, leaves, least_leaf_rows, penalty
        As ``learning_rate``, ``max_leaf_nodes``, ``min_samples_leaf``, ``l2_regularization``.
    """

    kind: Literal["gradient_boosting"] = "gradient_boosting"
    max_iterations: int = Field(600, ge=1)
    learning_rate: float = Field(0.08, gt=0.0, le=1.0)
    leaves: int = Field(31, ge=2)
    least_leaf_rows: int = Field(10, ge=1)
    penalty: float = Field(0.0, ge=0.0)

    def quick(self) -> Self:
        """At most 80 trees."""
        return self.model_copy(update={"max_iterations": min(self.max_iterations, 80)})


class GaussianProcessSpec(RandomStarts):
    """Gaussian process of scikit-learn: one length per column, small noise.

    Attributes
    ----------
    rows : int
        Training rows, drawn at random, that the posterior is conditioned on: cost grows with the
        cube.
    tuning_rows : int
        Part of them on which the likelihood is maximised.
    smoothness : {"3/2", "5/2", "infinite"}
        Of the Matern kernel; "infinite" is the squared exponential.
    """

    kind: Literal["gaussian_process"] = "gaussian_process"
    rows: int = Field(3000, ge=10)
    tuning_rows: int = Field(500, ge=10)
    smoothness: Literal["3/2", "5/2", "infinite"] = "infinite"

    def quick(self) -> Self:
        """At most 1,000 rows, 200 of them for the likelihood."""
        fewer = {"rows": min(self.rows, 1000), "tuning_rows": min(self.tuning_rows, 200)}
        return self.model_copy(update={**fewer, "restarts": 1})


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


class CustomSpec(RandomStarts):
    """A user's own scikit-learn estimator or torch module.

    Attributes
    ----------
    factory : str
        ``package.module:function``. Modules beside the YAML file are found too. The function is
        called with `options` and, where it takes them, ``inputs``, ``outputs`` (numbers of
        columns) and ``seed``; it returns an object with ``fit`` and ``predict``, or a
        ``torch.nn.Module``, which is trained as a `TorchSpec` network is.
    options : mapping
        Keyword arguments for the function.
    folder : path
        Where modules are looked for first; the folder of the YAML file unless given.
    training : mapping
        For a torch module: ``adam_epochs``, ``batch_size``, ``learning_rate``,
        ``max_iterations``, ``tolerance``, ``penalty`` of `TorchSpec`.
    """

    kind: Literal["custom"] = "custom"
    factory: str = Field(pattern=r"^[A-Za-z_][\w.]*:[A-Za-z_][\w.]*$")
    options: Mapping[str, Any] = Field(default_factory=dict)
    training: Mapping[str, float] = Field(default_factory=dict)
    folder: Path = Field(default=Path(), exclude=True, validate_default=True)

    @field_validator("folder")
    @classmethod
    def _beside_the_file(cls, folder: Path, info: ValidationInfo) -> Path:
        return Path((info.context or {}).get("folder", Path()), folder).resolve()

    @field_validator("training")
    @classmethod
    def _known_training(cls, training: Mapping[str, float]) -> Mapping[str, float]:
        TorchSpec.model_validate({"name": "module", **training})
        allowed = {"adam_epochs", "batch_size", "learning_rate", "max_iterations", "tolerance",
                   "penalty"}  # fmt: skip
        unknown = sorted(set(training) - allowed)
        if unknown:
            message = f"unknown: {', '.join(unknown)} (known: {', '.join(sorted(allowed))})"
            raise ValueError(message)
        return training
