"""How a fitted model goes into the lab book: in the flavour that its family has there.

Torch networks go in as modules from scaled columns to scaled targets, everything else as the
scikit-learn estimator it is. Our own steps in such an estimator need castblast where it is loaded.
A user's own estimator is not stored, as it may hold anything, and its run says so.
"""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

import numpy as np

from castblast.surrogate.fitting.estimators import bare_model, is_torch_model, predict
from castblast.surrogate.fitting.training import Fit

#: Classes whose state skops may restore: functions of our stock pipelines, and our own.
_FUNCTIONS = ["numpy.log", "numpy.exp"]
_OWN = ("castblast.", "sklearn.", "numpy.")


def log_model(mlflow: Any, fit: Fit) -> tuple[str | None, str]:
    """Log the model of a fit in the active run, with its signature.

    Parameters
    ----------
    mlflow
        The module, with a run open.
    fit : Fit

    Returns
    -------
    uri : str or None
        Of the logged model; None where it is not stored.
    flavour : str
        "sklearn", "pytorch" or "none".
    """
    rows = fit.table.frame.iloc[fit.table.rows("train")].head(2)
    model = bare_model(fit.estimator)
    if is_torch_model(model):
        return _log_module(mlflow, fit, model, rows), "pytorch"
    if not _is_known(fit.estimator):
        return None, "none"
    info = mlflow.sklearn.log_model(
        fit.estimator,
        name="model",
        signature=mlflow.models.infer_signature(rows, _frame(fit, predict(fit.estimator, rows))),
        pip_requirements=_requirements("scikit-learn", "numpy", "pandas", "scipy"),
        skops_trusted_types=[*_FUNCTIONS, *_own_types(fit.estimator)],
    )
    return str(info.model_uri), "sklearn"


def _log_module(mlflow: Any, fit: Fit, model: Any, rows: Any) -> str:
    """Log a torch module; the example of two rows leaves the number of rows open."""
    from castblast.surrogate.fitting.families.torch_mlp import as_module

    columns = np.asarray(fit.estimator.regressor_["columns"].transform(rows), dtype=np.float64)
    scaled = np.asarray(model.predict(columns), dtype=np.float64).reshape(len(columns), -1)
    info = mlflow.pytorch.log_model(
        as_module(model),
        name="model",
        input_example=columns,
        signature=mlflow.models.infer_signature(columns, scaled),
        pip_requirements=_requirements("torch", "numpy"),
    )
    return str(info.model_uri)


def _parts(estimator: Any) -> list[Any]:
    """An estimator and everything inside it that has parameters."""
    found = [estimator, *estimator.get_params(deep=True).values()]
    fitted = [estimator.regressor_["model"], estimator.transformer_]
    return [part for part in (*found, *fitted) if hasattr(part, "get_params")]


def _is_known(estimator: Any) -> bool:
    """Whether every part of an estimator is scikit-learn's or ours."""
    parts = (*_parts(estimator), bare_model(estimator))
    return all(type(part).__module__.startswith(_OWN) for part in parts)


def _own_types(estimator: Any) -> list[str]:
    """Types in an estimator that skops asks about, as far as they are known ones."""
    import skops.io  # type: ignore[import-untyped]

    names: list[str] = skops.io.get_untrusted_types(data=skops.io.dumps(estimator))
    return [name for name in names if name.startswith(_OWN)]


def _frame(fit: Fit, values: Any) -> Any:
    import pandas as pd

    return pd.DataFrame(values, columns=list(fit.table.target_names))


def _requirements(*names: str) -> list[str]:
    return [f"{name}=={version(name)}" for name in names]
