"""The model of each family, unfitted: what stands between scaled columns and scaled targets."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from castblast.design.variables import VARIABLES
from castblast.extras import require
from castblast.specs.models.model import (
    CustomSpec,
    GaussianProcessSpec,
    GradientBoostingSpec,
    LevenbergSpec,
    MlpSpec,
    ModelSpec,
    RidgeSpec,
    TorchSpec,
)
from castblast.surrogate.fitting.features import Table

#: Outputs of the burden motion; all others are of the near field, which knows rock and hole only.
BURDEN_OUTPUTS = frozenset(
    {
        "burden_velocity", "powder_factor", "venting_time", "vented_fraction",
        "acceleration_time", "acceleration_distance", "burden_kinetic_energy", "fracture_work",
        "stemming_work", "vented_enthalpy", "burden_energy_residual",
    }
)  # fmt: skip
_NEAR_FIELD_ROLES = ("rock", "hole")


def make_model(spec: ModelSpec, table: Table, seed: int) -> Any:
    """Make the unfitted model of a spec whose features are named.

    Parameters
    ----------
    spec : ModelSpec
    table : Table
    seed : int
        Of the random starting weights; families without any ignore it.

    Returns
    -------
    An estimator with ``fit`` and ``predict`` on scaled columns and targets.
    """
    make: Callable[[Any, Table, int], Any] = _MAKERS[spec.kind]
    return make(spec, table, seed)


def seen_columns(spec: LevenbergSpec, target: str, codes: int) -> list[int]:
    """Positions of the columns that a target may depend on, with `codes` code columns last."""
    sources = [{name} for name in spec.features]
    sources += [set(entry.coefficients) for entry in spec.derived.values()]
    near = spec.use_physics and target not in BURDEN_OUTPUTS
    seen = [
        position
        for position, names in enumerate(sources)
        if not near or all(VARIABLES[name].role in _NEAR_FIELD_ROLES for name in names)
    ]
    return seen + list(range(len(sources), len(sources) + codes))


def _mlp(spec: MlpSpec, table: Table, seed: int) -> Any:
    from sklearn.neural_network import MLPRegressor

    return MLPRegressor(
        hidden_layer_sizes=spec.hidden_layers,
        activation=spec.activation,
        solver="lbfgs",
        alpha=spec.penalty,
        max_iter=spec.max_iterations,
        max_fun=10**6,
        tol=spec.tolerance,
        random_state=seed,
    )


def _levenberg(spec: LevenbergSpec, table: Table, seed: int) -> Any:
    from castblast.surrogate.fitting.columns import code_width
    from castblast.surrogate.fitting.families.dense_models import LevenbergMlp

    codes = code_width(spec, table)
    return LevenbergMlp(
        hidden_layers=spec.hidden_layers,
        activation=spec.activation,
        penalty=spec.penalty,
        start_rows=spec.start_rows,
        start_iterations=spec.start_iterations,
        starts=spec.starts,
        max_iterations=spec.max_iterations,
        tolerance=spec.tolerance,
        columns=tuple(tuple(seen_columns(spec, name, codes)) for name in spec.targets),
        categories=codes if spec.per_explosive else 0,
        random_state=seed,
    )


def _torch(spec: TorchSpec, table: Table, seed: int) -> Any:
    require("torch", purpose=f"{spec.name}: kind torch_mlp")
    from castblast.surrogate.fitting.families.torch_mlp import TorchMlp

    return TorchMlp(
        hidden_layers=spec.hidden_layers,
        activation=spec.activation,
        penalty=spec.penalty,
        adam_epochs=spec.adam_epochs,
        batch_size=spec.batch_size,
        learning_rate=spec.learning_rate,
        max_iterations=spec.max_iterations,
        tolerance=spec.tolerance,
        members=spec.members,
        categories=len(table.explosives) if spec.per_explosive else 0,
        random_state=seed,
    )


def _gradient_boosting(spec: GradientBoostingSpec, table: Table, seed: int) -> Any:
    from sklearn.ensemble import HistGradientBoostingRegressor
    from sklearn.multioutput import MultiOutputRegressor

    return MultiOutputRegressor(
        HistGradientBoostingRegressor(
            max_iter=spec.max_iterations,
            learning_rate=spec.learning_rate,
            max_leaf_nodes=spec.leaves,
            min_samples_leaf=spec.least_leaf_rows,
            l2_regularization=spec.penalty,
            early_stopping=False,
            random_state=seed,
        )
    )


def _gaussian_process(spec: GaussianProcessSpec, table: Table, seed: int) -> Any:
    from castblast.surrogate.fitting.families.gaussian_process import SubsetGaussianProcess

    return SubsetGaussianProcess(
        rows=spec.rows,
        tuning_rows=spec.tuning_rows,
        smoothness={"3/2": 1.5, "5/2": 2.5}.get(spec.smoothness, float("inf")),
        random_state=seed,
    )


def _ridge(spec: RidgeSpec, table: Table, seed: int) -> Any:
    from sklearn.linear_model import Ridge
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import PolynomialFeatures

    ridge = Ridge(alpha=spec.penalty)
    if spec.degree == 1:
        return ridge
    return make_pipeline(PolynomialFeatures(degree=spec.degree, include_bias=False), ridge)


def _custom(spec: CustomSpec, table: Table, seed: int) -> Any:
    from castblast.surrogate.fitting.families.custom import CustomModel

    return CustomModel(
        factory=spec.factory,
        options=dict(spec.options),
        folder=str(spec.folder),
        training=dict(spec.training),
        random_state=seed,
    )


_MAKERS: dict[str, Callable[..., Any]] = {
    "mlp": _mlp,
    "levenberg": _levenberg,
    "torch_mlp": _torch,
    "gradient_boosting": _gradient_boosting,
    "gaussian_process": _gaussian_process,
    "ridge": _ridge,
    "custom": _custom,
}
