"""From a frame in SI to the columns that a model takes, and back: stock scikit-learn steps.

Order of the columns: numeric features, derived columns, code of the explosive.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.compose import ColumnTransformer
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import FunctionTransformer, OneHotEncoder, StandardScaler

from castblast.errors import DatasetError
from castblast.network import DerivedColumn, Transform
from castblast.specs.models.model import SurrogateSpec
from castblast.surrogate.fitting.features import Table
from castblast.types import FloatArray


def make_columns(spec: SurrogateSpec, table: Table) -> Any:
    """Make the unfitted transformer of the inputs of a spec whose features are named.

    Raises
    ------
    DatasetError
        The spec wants descriptors of the explosives and the dataset has none.
    """
    features = list(spec.features)
    numeric = make_scaler([spec.transform_of(name) for name in features])
    blocks: list[tuple[str, Any, list[str]]] = [("numeric", numeric, features)]
    if spec.derived:
        sums = FunctionTransformer(func=linear_sums, kw_args={"matrix": sums_matrix(spec)})
        scaler = make_scaler([entry.transform for entry in spec.derived.values()])
        blocks.append(("derived", Pipeline([("sums", sums), *scaler.steps]), features))
    blocks.append(("explosive", _explosive_encoder(spec, table), ["explosive"]))
    return ColumnTransformer(blocks)


def make_scaler(transforms: Sequence[Transform]) -> Any:
    """Standard scaling of columns, some of them logged; the step ``scale`` has the numbers."""
    logged = tuple(transform == "log" for transform in transforms)
    kind = {"logged": logged}
    log = FunctionTransformer(
        func=log_some, inverse_func=exp_some, kw_args=kind, inv_kw_args=kind, check_inverse=False
    )
    return Pipeline([*([("log", log)] if any(logged) else []), ("scale", StandardScaler())])


def log_some(values: Any, logged: Sequence[bool]) -> FloatArray:
    """Natural logarithm of the columns that are to be logged."""
    x = np.array(values, dtype=np.float64)
    chosen = np.array(logged)
    x[:, chosen] = np.log(x[:, chosen])
    return x


def exp_some(values: Any, logged: Sequence[bool]) -> FloatArray:
    """Inverse of `log_some`."""
    x = np.array(values, dtype=np.float64)
    chosen = np.array(logged)
    x[:, chosen] = np.exp(x[:, chosen])
    return x


def linear_sums(values: Any, matrix: FloatArray) -> FloatArray:
    """Derived columns: values (n, k) times coefficients (k, d)."""
    sums: FloatArray = np.asarray(values, dtype=np.float64) @ matrix
    return sums


def sums_matrix(spec: SurrogateSpec) -> FloatArray:
    """Coefficients (k, d) of the derived columns."""
    return np.array(
        [
            [entry.coefficients.get(name, 0.0) for entry in spec.derived.values()]
            for name in spec.features
        ],
        dtype=np.float64,
    )


def derived_columns(spec: SurrogateSpec, columns: Any) -> tuple[DerivedColumn, ...]:
    """Describe the derived columns of a fitted transformer."""
    if not spec.derived:
        return ()
    scale = columns.named_transformers_["derived"]["scale"]
    return tuple(
        DerivedColumn(
            name=name,
            unit=entry.unit,
            transform=entry.transform,
            mean=float(scale.mean_[j]),
            scale=float(scale.scale_[j]),
            coefficients=dict(entry.coefficients),
        )
        for j, (name, entry) in enumerate(spec.derived.items())
    )


def explosive_codes(columns: Any, explosives: Sequence[str]) -> FloatArray:
    """What enters a model for each explosive, (len(explosives), c)."""
    encoder = columns.named_transformers_["explosive"]
    if isinstance(encoder, DescriptorEncoder):
        return np.array(encoder.codes, dtype=np.float64)
    return np.eye(len(explosives))


def code_width(spec: SurrogateSpec, table: Table) -> int:
    """Columns of the code of the explosive."""
    if spec.explosive_code == "one_hot":
        return len(table.explosives)
    return len(_descriptor_codes(table)[0])


def _explosive_encoder(spec: SurrogateSpec, table: Table) -> Any:
    if spec.explosive_code == "one_hot":
        return OneHotEncoder(categories=[list(table.explosives)], sparse_output=False)
    return DescriptorEncoder(table.explosives, _descriptor_codes(table))


def _descriptor_codes(table: Table) -> tuple[tuple[float, ...], ...]:
    """Logarithms of the descriptors, standardised over the explosives of the table."""
    names = sorted({name for numbers in table.descriptors.values() for name in numbers})
    missing = [
        f"explosive '{explosive}': the dataset has no descriptors for it"
        for explosive in table.explosives
        if not names or set(table.descriptors.get(explosive, ())) != set(names)
    ]
    if missing:
        raise DatasetError("\n".join(missing))
    numbers = np.array([[table.descriptors[e][name] for name in names] for e in table.explosives])
    logs = np.log(numbers)
    spread = np.ptp(logs, axis=0)
    codes = (logs - logs.mean(axis=0)) / np.where(spread > 0.0, 0.5 * spread, 1.0)
    return tuple(tuple(row) for row in codes.tolist())


class DescriptorEncoder(TransformerMixin, BaseEstimator):  # type: ignore[misc]
    """Replaces the name of an explosive by a row of numbers.

    Parameters
    ----------
    names : sequence of str
    codes : sequence of rows, one for each name
    """

    def __init__(self, names: Sequence[str], codes: Sequence[Sequence[float]]) -> None:
        self.names = names
        self.codes = codes

    def fit(self, values: Any, y: Any = None) -> Self:
        """Nothing to learn; the numbers are known."""
        self.n_features_in_ = 1
        return self

    def transform(self, values: Any) -> FloatArray:
        """Rows (n, 1) of names to rows (n, c) of numbers."""
        names = np.asarray(values, dtype=object).ravel()
        index = {name: k for k, name in enumerate(self.names)}
        codes: FloatArray = np.array(self.codes, dtype=np.float64)[[index[name] for name in names]]
        return codes
