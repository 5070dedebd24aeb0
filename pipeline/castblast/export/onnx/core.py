"""The core of a model of any shape, given as an ONNX model, inside the graph of the rest.

All of it must be float64: a float32 constant inside costs half the digits of every answer.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from castblast.errors import SpecError
from castblast.export.onnx.forms import add_node
from castblast.export.onnx.graph import Graph
from castblast.network import Shell

#: Operator sets of a file: the first for all that needs no newer one.
OPSET, LAST_OPSET = 13, 14
#: In front of every name of a core.
_PREFIX = "core_"


def add_core(graph: Graph, x: str, core: bytes, shell: Shell) -> tuple[str, int]:
    """Put an ONNX model behind `x`; give the name of its answers and its operator set.

    Raises
    ------
    SpecError
        It is no model of float64 rows, or of other numbers of columns than the shell.
    """
    import onnx
    from onnx import compose

    model = compose.add_prefix(onnx.load_from_string(core), _PREFIX)
    faults = list(_faults(model, shell))
    if faults:
        raise SpecError("\n".join(f"ONNX core: {fault}" for fault in faults))
    graph.constants.extend(model.graph.initializer)
    graph.add("Identity", _inputs(model)[0].name, x)
    numbers = _numbers(model)
    for node in model.graph.node:
        node.doc_string = ""
        add_node(graph, node, numbers)
    return model.graph.output[0].name, model.opset_import[0].version


def _faults(model: Any, shell: Shell) -> Iterator[str]:
    from onnx import TensorProto

    opsets = {entry.domain: entry.version for entry in model.opset_import}
    if set(opsets) != {""} or not OPSET <= opsets[""] <= LAST_OPSET or model.functions:
        yield f"operator sets {opsets}, those of ONNX from {OPSET} to {LAST_OPSET} are needed"
    for what, entries, width in (
        ("input", _inputs(model), shell.width),
        ("output", list(model.graph.output), len(shell.outputs)),
    ):
        if len(entries) != 1:
            yield f"{len(entries)} {what}s, one is needed"
            continue
        tensor = entries[0].type.tensor_type
        last = tensor.shape.dim[-1] if tensor.shape.dim else None
        # An output may leave its width open: the checker of the whole model infers it.
        fits = last is not None and len(tensor.shape.dim) == 2 and last.dim_value in (0, width)
        if tensor.elem_type != TensorProto.DOUBLE or not fits:
            yield f"its {what} must be float64 [n, {width}]"
    single = {TensorProto.FLOAT, TensorProto.FLOAT16, TensorProto.BFLOAT16}
    if any(tensor.data_type in single for tensor in model.graph.initializer):
        yield "a constant is float32, all must be float64"
    for node in model.graph.node:
        kinds = {entry.t.data_type for entry in node.attribute if entry.name == "value"}
        kinds |= {entry.i for entry in node.attribute if entry.name == "to"}
        if kinds & single:
            yield f"{node.name} is computed in float32, all must be float64"


def _inputs(model: Any) -> list[Any]:
    """Inputs of a model that are no constants: older writers list those too."""
    names = {tensor.name for tensor in model.graph.initializer}
    return [entry for entry in model.graph.input if entry.name not in names]


def _numbers(model: Any) -> dict[str, float]:
    """Constants of a model that are single numbers, by name."""
    from onnx import numpy_helper

    tensors = {tensor.name: tensor for tensor in model.graph.initializer}
    for node in model.graph.node:
        for entry in node.attribute:
            if node.op_type == "Constant" and entry.HasField("t"):
                tensors[node.output[0]] = entry.t
    arrays = {name: numpy_helper.to_array(tensor) for name, tensor in tensors.items()}
    return {name: float(array) for name, array in arrays.items() if array.ndim == 0}
