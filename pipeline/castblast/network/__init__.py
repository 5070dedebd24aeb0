"""A fitted surrogate as plain numbers: the one record that every export and `predict` reads.

`record` says what is in it, `evaluate` computes values, `domain` says where they may be used.
It knows no training library; NumPy alone evaluates it.
"""

from castblast.network.domain import (
    BLAME,
    DomainKind,
    DomainViolation,
    density_reliefs,
    density_score,
    domain_faults,
    domain_violations,
    in_domain,
    keeps_ranges_and_rules,
    offending_inputs,
    scale_columns,
)
from castblast.network.evaluate import (
    Bounds,
    RowPredictions,
    derived_matrix,
    evaluate,
    evaluate_rows,
    explosive_index,
    member_spread,
    network_bounds,
    predict_rows,
    prediction_bounds,
    prediction_factors,
    run_layers,
    scaled_inputs,
)
from castblast.network.parts import (
    Column,
    Constraint,
    DensityScore,
    DerivedColumn,
    GoldenRows,
    InputColumn,
    Layer,
    OutputColumn,
)
from castblast.network.record import Network, Shell
from castblast.network.terms import SCHEMA_VERSION, Activation, Transform

__all__ = [
    "BLAME",
    "SCHEMA_VERSION",
    "Activation",
    "Bounds",
    "Column",
    "Constraint",
    "DensityScore",
    "DerivedColumn",
    "DomainKind",
    "DomainViolation",
    "GoldenRows",
    "InputColumn",
    "Layer",
    "Network",
    "OutputColumn",
    "RowPredictions",
    "Shell",
    "Transform",
    "density_reliefs",
    "density_score",
    "derived_matrix",
    "domain_faults",
    "domain_violations",
    "evaluate",
    "evaluate_rows",
    "explosive_index",
    "in_domain",
    "keeps_ranges_and_rules",
    "member_spread",
    "network_bounds",
    "offending_inputs",
    "predict_rows",
    "prediction_bounds",
    "prediction_factors",
    "run_layers",
    "scale_columns",
    "scaled_inputs",
]
