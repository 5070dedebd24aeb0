"""An ONNX graph in the making: nodes, constants, scalings and dense layers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from castblast.network import Column, Constraint, Layer
from castblast.types import FloatArray

_OPERATORS = {"tanh": "Tanh", "relu": "Relu", "logistic": "Sigmoid"}


class Graph:
    """Nodes and constants in the making; every method returns the name of its result."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def constant(self, name: str, values: NDArray[Any]) -> str:
        """Keep numbers under a name."""
        from onnx import numpy_helper

        self.constants.append(numpy_helper.from_array(values.copy(order="C"), name))
        return name

    def add(self, operator: str, result: str, *operands: str, **attributes: Any) -> str:
        """Add a node with one result."""
        from onnx import helper

        self.nodes.append(
            helper.make_node(operator, list(operands), [result], name=result, **attributes)
        )
        return result

    def transform(self, operator: str, x: str, columns: Sequence[Column]) -> str:
        """Apply Log or Exp to the columns that ask for it; the others pass."""
        logged = np.array([column.transform == "log" for column in columns])
        if not logged.any():
            return x
        changed = self.add(operator, f"{x}_{operator.lower()}", x)
        if logged.all():
            return changed
        mask = self.constant(f"{x}_is_log", logged)
        return self.add("Where", f"{x}_transformed", mask, changed, x)

    def scaled(self, x: str, prefix: str, columns: Sequence[Column]) -> str:
        """Transform and standardise the columns of `x`."""
        mean = self.constant(f"{prefix}_mean", values_of(columns, "mean"))
        scale = self.constant(f"{prefix}_scale", values_of(columns, "scale"))
        x = self.transform("Log", x, columns)
        x = self.add("Sub", f"{prefix}_centred", x, mean)
        return self.add("Div", f"{prefix}_scaled", x, scale)

    def unscaled(self, x: str, prefix: str, columns: Sequence[Column]) -> str:
        """Undo the scaling and transform of outputs: (n, m) in SI."""
        scale = self.constant(f"{prefix}_output_scale", values_of(columns, "scale"))
        mean = self.constant(f"{prefix}_output_mean", values_of(columns, "mean"))
        x = self.add("Mul", f"{prefix}_unscaled", x, scale)
        x = self.add("Add", f"{prefix}_values", x, mean)
        return self.transform("Exp", x, columns)

    def chain(self, x: str, prefix: str, layers: Sequence[Layer]) -> str:
        """Dense layers one after the other."""
        for number, layer in enumerate(layers, 1):
            x = self.dense(x, f"{prefix}_{number}", layer)
        return x

    def dense(self, x: str, label: str, layer: Layer) -> str:
        """One layer; its last node carries the activation."""
        weights = self.constant(f"{label}_weights", layer.weights)
        biases = self.constant(f"{label}_biases", layer.biases)
        x = self.add("Gemm", f"{label}_sum", x, weights, biases)
        if layer.activation == "identity":
            return x
        if layer.activation == "silu":
            gate = self.add("Sigmoid", f"{label}_gate", x)
            return self.add("Mul", f"{label}_node", x, gate)
        return self.add(_OPERATORS[layer.activation], f"{label}_node", x)

    def columns(self, x: str, names: Sequence[str]) -> None:
        """Make every column of (n, m) an output of its own."""
        for j, name in enumerate(names):
            position = self.constant(f"{name}_position", np.array(j, dtype=np.int64))
            self.add("Gather", name, x, position, axis=1)

    def column(self, x: str, label: str) -> str:
        """Make (n,) into (n, 1)."""
        axes = self.constant(f"{label}_axes", np.array([1], dtype=np.int64))
        return self.add("Unsqueeze", f"{label}_column", x, axes)

    def row_sums(self, x: str, label: str) -> str:
        """Sum along the columns: (n, m) to (n,)."""
        axes = self.constant(f"{label}_axes", np.array([1], dtype=np.int64))
        return self.add("ReduceSum", label, x, axes, keepdims=0)


def values_of(columns: Sequence[Column | Constraint], attribute: str) -> FloatArray:
    """One number of every column or rule."""
    return np.array([getattr(column, attribute) for column in columns], dtype=np.float64)
