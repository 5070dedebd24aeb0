"""`Network` to ONNX, float64, with every transform and scaling inside the graph.

The graph is put together with `onnx.helper`: converters of whole scikit-learn pipelines know no
transformed targets and fall back to float32. Opset 13 and IR 7 load in runtimes since 2021.

Inputs: ``numeric`` float64 [n, k] in SI, columns in the order of the metadata entry ``inputs``;
``explosive`` int64 [n], positions in the entry ``explosives``. Outputs: one float64 [n] per
output, under its own name, SI. The metadata carry units, domain box, rules and error bands.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from castblast.network import Column, Floats, Layer, Network, derived_matrix

if TYPE_CHECKING:
    from collections.abc import Sequence

OPSET = 13
_IR_VERSION = 7
_OPERATORS = {"tanh": "Tanh", "relu": "Relu", "logistic": "Sigmoid"}


class _Graph:
    """Nodes and constants in the making; every method returns the name of its result."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def constant(self, name: str, values: NDArray[Any]) -> str:
        from onnx import numpy_helper

        self.constants.append(numpy_helper.from_array(values.copy(order="C"), name))
        return name

    def add(self, operator: str, result: str, *operands: str, **attributes: Any) -> str:
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
        mean = self.constant(f"{prefix}_mean", _of(columns, "mean"))
        scale = self.constant(f"{prefix}_scale", _of(columns, "scale"))
        x = self.transform("Log", x, columns)
        x = self.add("Sub", f"{prefix}_centred", x, mean)
        return self.add("Div", f"{prefix}_scaled", x, scale)

    def dense(self, x: str, number: int, layer: Layer) -> str:
        """One layer; the last node carries its activation."""
        weights = self.constant(f"weights_{number}", layer.weights)
        biases = self.constant(f"biases_{number}", layer.biases)
        x = self.add("Gemm", f"sum_{number}", x, weights, biases)
        if layer.activation == "identity":
            return x
        if layer.activation == "silu":
            gate = self.add("Sigmoid", f"gate_{number}", x)
            return self.add("Mul", f"node_{number}", x, gate)
        return self.add(_OPERATORS[layer.activation], f"node_{number}", x)


def to_onnx(network: Network) -> bytes:
    """Build the ONNX file of a network.

    Returns
    -------
    bytes
        A checked model; the same network gives the same bytes.
    """
    import onnx
    from onnx import TensorProto, helper

    graph = _Graph()
    parts = [graph.scaled("numeric", "input", network.inputs)]
    if network.derived:
        combination = graph.constant("derived_coefficients", derived_matrix(network))
        derived = graph.add("MatMul", "derived", "numeric", combination)
        parts.append(graph.scaled(derived, "derived", network.derived))
    codes = graph.constant("explosive_codes", network.codes)
    parts.append(graph.add("Gather", "explosive_code", codes, "explosive", axis=0))
    x = graph.add("Concat", "features", *parts, axis=1)
    for number, layer in enumerate(network.layers, 1):
        x = graph.dense(x, number, layer)
    x = graph.add("Mul", "spread", x, graph.constant("output_scale", _of(network.outputs, "scale")))
    x = graph.add("Add", "values", x, graph.constant("output_mean", _of(network.outputs, "mean")))
    x = graph.transform("Exp", x, network.outputs)
    for j, name in enumerate(network.output_names):
        position = graph.constant(f"{name}_position", np.array(j, dtype=np.int64))
        graph.add("Gather", name, x, position, axis=1)
    numeric = helper.make_tensor_value_info(
        "numeric", TensorProto.DOUBLE, ["n", len(network.inputs)]
    )
    explosive = helper.make_tensor_value_info("explosive", TensorProto.INT64, ["n"])
    outputs = [
        helper.make_tensor_value_info(name, TensorProto.DOUBLE, ["n"])
        for name in network.output_names
    ]
    model = helper.make_model(
        helper.make_graph(
            graph.nodes, "castblast", [numeric, explosive], outputs, initializer=graph.constants
        ),
        producer_name="castblast",
        producer_version=str(network.provenance.get("castblast_version", "")),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=_IR_VERSION,
    )
    helper.set_model_props(model, _metadata(network))
    onnx.checker.check_model(model, full_check=True)
    return bytes(model.SerializeToString(deterministic=True))


def _of(columns: Sequence[Column], attribute: str) -> Floats:
    return np.array([getattr(column, attribute) for column in columns], dtype=np.float64)


def _metadata(network: Network) -> dict[str, str]:
    entries: dict[str, Any] = {
        "inputs": list(network.input_names),
        "input_units": [column.unit for column in network.inputs],
        "input_lower": [column.lower for column in network.inputs],
        "input_upper": [column.upper for column in network.inputs],
        "constraints": [
            {"label": rule.label, "coefficients": dict(rule.coefficients), "lower": rule.lower}
            for rule in network.constraints
        ],
        "explosives": list(network.explosives),
        "outputs": list(network.output_names),
        "output_units": [column.unit for column in network.outputs],
        "relative_band": [column.relative_band for column in network.outputs],
        "provenance": dict(network.provenance),
    }
    return {key: json.dumps(value) for key, value in entries.items()}


def run_onnx(model: bytes, numeric: Floats, index: NDArray[np.int64]) -> Floats:
    """Evaluate an ONNX file: with onnxruntime on one thread, or with the reference of ONNX.

    Parameters
    ----------
    model : bytes
        Contents of the file.
    numeric : (n, k) float64, SI
    index : (n,) int64

    Returns
    -------
    (n, m) float64, SI, in the order of the model's outputs.
    """
    rows = {"numeric": numeric, "explosive": index}
    try:
        import onnxruntime
    except ImportError:
        return np.stack(_reference_columns(model, rows), axis=1)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    return np.stack(session.run(None, rows), axis=1)


def _reference_columns(model: bytes, rows: dict[str, NDArray[Any]]) -> list[Floats]:
    """Outputs by the evaluator that comes with the format: slow, and right by definition."""
    from onnx.reference import ReferenceEvaluator

    return list(ReferenceEvaluator(model).run(None, rows))
