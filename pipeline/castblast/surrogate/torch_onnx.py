"""A trained torch module of any shape as an ONNX model, from scaled columns to scaled targets."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch

from castblast.errors import SpecError
from castblast.surrogate.fitting.estimators import bare_model, is_torch_model
from castblast.surrogate.fitting.families.custom import importable
from castblast.surrogate.fitting.families.torch_mlp import as_module, determined
from castblast.surrogate.fitting.training import Fit

#: Operator sets tried in turn; attention came with the second.
_OPSETS = (13, 14)
#: Rows of the example that is traced; no number of rows or columns a module is likely to hold.
_ROWS = 3


def torch_core(fit: Fit) -> bytes:
    """Write the module of a fit as an ONNX model.

    Parameters
    ----------
    fit : Fit

    Returns
    -------
    bytes
        One float64 input [n, width], what enters the first layer of a network, and one float64
        output [n, m], the scaled outputs; any number of rows.

    Raises
    ------
    SpecError
        The model is not a torch module, or holds what `torch.onnx` cannot write in float64 with an
        operator set that our files may have.
    """
    model = bare_model(fit.estimator)
    if not is_torch_model(model):
        message = f"{fit.spec.name}: {type(model).__name__} is not a torch module"
        raise SpecError(message)
    columns = fit.estimator.regressor_["columns"].transform(fit.table.frame.head(_ROWS))
    example = torch.as_tensor(columns, dtype=torch.float64)
    fault: Exception | None = None
    with importable(str(getattr(fit.spec, "folder", ""))), determined(0), _double():
        for opset in _OPSETS:
            try:
                return _exported(as_module(model), example, opset)
            except Exception as reason:  # whatever a user's own forward raises when traced
                fault = reason
    said = next((line.strip() for line in str(fault).splitlines() if line.strip()), "")
    message = f"{fit.spec.name}: torch.onnx cannot export this module: {said}"
    raise SpecError(message) from fault


def _exported(module: torch.nn.Module, example: torch.Tensor, opset: int) -> bytes:
    stream: Any = io.BytesIO()
    rows = {0: "n"}
    with warnings.catch_warnings():
        # The newer exporter needs a further package and writes no operator set this old.
        warnings.simplefilter("ignore", DeprecationWarning)
        # Told of every attention, right or wrong; the golden rows, other ones and more, decide.
        warnings.simplefilter("ignore", torch.jit.TracerWarning)  # type: ignore[attr-defined]
        torch.onnx.export(
            module,
            (example,),
            stream,
            input_names=["features"],
            output_names=["answers"],
            dynamic_axes={"features": rows, "answers": rows},
            opset_version=opset,
            dynamo=False,
        )
    content: bytes = stream.getvalue()
    return content


@contextmanager
def _double() -> Iterator[None]:
    """Constants that the exporter makes are float64, and its graph is not printed on a fault."""
    kind, printer = torch.get_default_dtype(), getattr(torch._C, "_jit_onnx_log", None)
    torch.set_default_dtype(torch.float64)
    setattr(torch._C, "_jit_onnx_log", lambda *_: None)  # noqa: B010  (unknown to type checkers)
    try:
        yield
    finally:
        setattr(torch._C, "_jit_onnx_log", printer)  # noqa: B010
        torch.set_default_dtype(kind)
