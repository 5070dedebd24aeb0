"""The core of a model of any shape, given as an ONNX model, inside the graph of the rest.

All of it must be float64: a float32 constant inside costs half the digits of every answer. Where
onnxruntime has an operator in float32 only, the same function is put together from others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any

import numpy as np

from castblast.errors import SpecError
from castblast.export.onnx_graph import Graph
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
    for node in model.graph.node:
        node.doc_string = ""
        form = _FORMS.get(node.op_type)
        if form is None:
            graph.nodes.append(node)
        else:
            form(_Form(graph, node))
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


class _Form:
    """A node in the making as several others, the last of which has its name."""

    def __init__(self, graph: Graph, node: Any) -> None:
        self.graph, self.name, self.count = graph, node.output[0], 0
        self.x, *self.others = node.input
        self.attributes = {entry.name: entry.f for entry in node.attribute}

    def number(self, value: float) -> str:
        self.count += 1
        return self.graph.constant(f"{self.name}_number_{self.count}", np.array(value))

    def attribute(self, name: str, default: float) -> str:
        """A number of the node. ONNX rounds it to float32: the plain one that was meant."""
        if name not in self.attributes:
            return self.number(default)
        single = np.float32(self.attributes[name])
        plain = float(Fraction(float(single)).limit_denominator(1000))
        return self.number(plain if np.float32(plain) == single else float(str(single)))

    def do(self, operator: str, *operands: str) -> str:
        self.count += 1
        return self.graph.add(operator, f"{self.name}_step_{self.count}", *operands)

    def end(self, operator: str, *operands: str) -> None:
        self.graph.add(operator, self.name, *operands)

    def halves(self) -> tuple[str, str]:
        """The positive and the negative part of what enters."""
        return self.do("Relu", self.x), self.do("Min", self.x, self.number(0.0))


def _elu(form: _Form) -> None:
    form.end("Identity", _exponential(form, form.attribute("alpha", 1.0)))


def _selu(form: _Form) -> None:
    """Scaled ELU with the constants of Klambauer et al. (2017), in full."""
    elu = _exponential(form, form.number(1.6732632423543772))
    form.end("Mul", elu, form.number(1.0507009873554805))


def _exponential(form: _Form, alpha: str) -> str:
    """max(x, 0) + alpha (exp(min(x, 0)) - 1)."""
    above, below = form.halves()
    step = form.do("Sub", form.do("Exp", below), form.number(1.0))
    return form.do("Add", above, form.do("Mul", alpha, step))


def _leaky(form: _Form) -> None:
    above, below = form.halves()
    slope = form.others[0] if form.others else form.attribute("alpha", 0.01)
    form.end("Add", above, form.do("Mul", slope, below))


def _softplus(form: _Form) -> None:
    """max(x, 0) + log(1 + exp(-|x|)), which never overflows."""
    small = form.do("Exp", form.do("Neg", form.do("Abs", form.x)))
    logarithm = form.do("Log", form.do("Add", small, form.number(1.0)))
    form.end("Add", form.do("Relu", form.x), logarithm)


def _hard_sigmoid(form: _Form) -> None:
    line = form.do("Mul", form.x, form.attribute("alpha", 0.2))
    line = form.do("Add", line, form.attribute("beta", 0.5))
    form.end("Min", form.do("Relu", line), form.number(1.0))


#: Operators that onnxruntime has in float32 only.
_FORMS: dict[str, Callable[[_Form], None]] = {
    "Elu": _elu,
    "Selu": _selu,
    "LeakyRelu": _leaky,
    "PRelu": _leaky,
    "Softplus": _softplus,
    "HardSigmoid": _hard_sigmoid,
}
