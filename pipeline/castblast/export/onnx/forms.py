"""Operators put together from others, where onnxruntime is not exact in float64.

Some it has in float32 only. A square it takes, with what stands around it, for a layer
normalisation, whose float32 epsilon costs digits where a row varies little.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from castblast.export.onnx.graph import Graph

# Rational functions for erf(x) = x P(x²)/Q(x²) to 0.46875 and erfc(x) = exp(-x²) P(x)/Q(x) beyond:
# W. J. Cody (1969), Rational Chebyshev approximations for the error function, Math. Comp. 23,
# 631-637. Highest power first; 1 - erfc is 1 to the last bit from 6 on.
_ERF_MIDDLE, _ERF_END = 0.46875, 6.0
_ERF = (
    (
        1.85777706184603153e-1, 3.16112374387056560e0, 1.13864154151050156e2,
        3.77485237685302021e2, 3.20937758913846947e3,
    ),
    (
        1.0, 2.36012909523441209e1, 2.44024637934444173e2, 1.28261652607737228e3,
        2.84423683343917062e3,
    ),
)  # fmt: skip
_ERFC = (
    (
        2.15311535474403846e-8, 5.64188496988670089e-1, 8.88314979438837594e0,
        6.61191906371416295e1, 2.98635138197400131e2, 8.81952221241769090e2,
        1.71204761263407058e3, 2.05107837782607147e3, 1.23033935479799725e3,
    ),
    (
        1.0, 1.57449261107098347e1, 1.17693950891312499e2, 5.37181101862009858e2,
        1.62138957456669019e3, 3.29079923573345963e3, 4.36261909014324716e3,
        3.43936767414372164e3, 1.23033935480374942e3,
    ),
)  # fmt: skip


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

    def exponential(self, alpha: str) -> str:
        """max(x, 0) + alpha (exp(min(x, 0)) - 1)."""
        above, below = self.halves()
        step = self.do("Sub", self.do("Exp", below), self.number(1.0))
        return self.do("Add", above, self.do("Mul", alpha, step))

    def ratio(self, x: str, polynomials: Sequence[Sequence[float]]) -> str:
        """The quotient of two polynomials by Horner's rule."""
        sums = []
        for coefficients in polynomials:
            total = self.number(coefficients[0])
            for coefficient in coefficients[1:]:
                product = self.do("Mul", total, x)
                total = self.do("Add", product, self.number(coefficient))
            sums.append(total)
        return self.do("Div", *sums)


def _elu(form: _Form) -> None:
    form.end("Identity", form.exponential(form.attribute("alpha", 1.0)))


def _selu(form: _Form) -> None:
    """Scaled ELU with the constants of Klambauer et al. (2017), in full."""
    elu = form.exponential(form.number(1.6732632423543772))
    form.end("Mul", elu, form.number(1.0507009873554805))


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


def _erf(form: _Form) -> None:
    size = form.do("Abs", form.x)
    middle = form.number(_ERF_MIDDLE)
    near = form.do("Min", size, middle)
    inner = form.do("Mul", form.x, form.ratio(form.do("Mul", near, near), _ERF))
    far = form.do("Min", size, form.number(_ERF_END))
    fall = form.do("Exp", form.do("Neg", form.do("Mul", far, far)))
    rest = form.do("Sub", form.number(1.0), form.do("Mul", fall, form.ratio(far, _ERFC)))
    outer = form.do("Mul", form.do("Sign", form.x), rest)
    form.end("Where", form.do("Less", size, middle), inner, outer)


def _square(form: _Form) -> None:
    form.end("Mul", form.x, form.x)


_FORMS: dict[str, Callable[[_Form], None]] = {
    "Elu": _elu,
    "Erf": _erf,
    "HardSigmoid": _hard_sigmoid,
    "LeakyRelu": _leaky,
    "PRelu": _leaky,
    "Selu": _selu,
    "Softplus": _softplus,
}


def add_node(graph: Graph, node: Any, numbers: Mapping[str, float]) -> None:
    """Add a node of an ONNX model to a graph, in another form where that is needed.

    `numbers` are the constants of the model that are single numbers.
    """
    form = _FORMS.get(node.op_type)
    if node.op_type == "Pow" and numbers.get(node.input[1]) == 2.0:
        form = _square
    if form is None:
        graph.nodes.append(node)
    else:
        form(_Form(graph, node))
