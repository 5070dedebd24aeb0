"""How a fitted model goes into the lab book: in the flavour that its family has there.

Stock scikit-learn estimators and torch modules go in as such. Another estimator is not stored, and
its run says so; its ``network.json``, if it has one, is among the files of the run all the same.
"""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

import numpy as np

from castblast.surrogate.estimators import predict
from castblast.surrogate.training import Fit

#: Functions of our stock pipelines that skops does not trust by itself.
_TRUSTED = ["numpy.log", "numpy.exp"]


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
        Of the logged model; None where there is no way to store it.
    flavour : str
        "sklearn", "pytorch" or "none".
    """
    rows = fit.table.frame.iloc[fit.table.rows("train")].head(2)
    module = getattr(fit.estimator, "module", None)
    if module is not None and hasattr(fit.estimator, "module_inputs"):
        return _log_module(mlflow, fit, module, rows), "pytorch"
    signature = mlflow.models.infer_signature(rows, _frame(fit, predict(fit.estimator, rows)))
    if _is_stock(fit.estimator):
        info = mlflow.sklearn.log_model(
            fit.estimator,
            name="model",
            signature=signature,
            pip_requirements=_requirements("scikit-learn", "numpy", "pandas"),
            skops_trusted_types=_TRUSTED,
        )
        return str(info.model_uri), "sklearn"
    return None, "none"


def _log_module(mlflow: Any, fit: Fit, module: Any, rows: Any) -> str:
    """A torch module takes and gives scaled columns; two rows leave the batch size open."""
    inputs = np.asarray(fit.estimator.module_inputs(rows))
    info = mlflow.pytorch.log_model(
        module, name="model", input_example=inputs, pip_requirements=_requirements("torch", "numpy")
    )
    return str(info.model_uri)


def _is_stock(estimator: Any) -> bool:
    """Whether every part of an estimator is scikit-learn's own."""
    parts = [estimator, *estimator.get_params(deep=True).values()]
    return all(
        type(part).__module__.startswith("sklearn.")
        for part in parts
        if hasattr(part, "get_params")
    )


def _frame(fit: Fit, values: Any) -> Any:
    import pandas as pd

    return pd.DataFrame(values, columns=list(fit.table.target_names))


def _requirements(*names: str) -> list[str]:
    return [f"{name}=={version(name)}" for name in names]
