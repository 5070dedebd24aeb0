"""`Network` to ONNX, float64, with every transform and scaling inside the graph.

The graph is put together with `onnx.helper`: converters of whole scikit-learn pipelines know no
transformed targets and fall back to float32. Opset 13 and IR 7 load in runtimes since 2021.

Inputs: ``numeric`` float64 [n, k] in SI, columns in the order of the metadata entry ``inputs``;
``explosive`` int64 [n], positions in the entry ``explosives``. Outputs, all [n], SI: one float64
per output under its own name; the ends of its 95 % band, ``NAME_lower`` and ``NAME_upper``; for a
network with members ``NAME_spread``, their relative standard deviation; ``domain_score`` float64,
at most 1 inside the joint density of the training rows (NaN without one); ``in_domain`` bool, box,
rules and density together; ``offending`` bool [n, k], the inputs at fault where it is false. The
metadata carry units, domain box, rules, density and bands.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from castblast.export.answers import Answers
from castblast.network import (
    BLAME,
    Column,
    Constraint,
    DensityScore,
    Floats,
    Layer,
    Network,
    derived_matrix,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

OPSET = 13
_IR_VERSION = 7
#: Code of float64 in ONNX, for `Cast`.
_DOUBLE = 11
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

    def chain(self, x: str, prefix: str, network: Network, layers: Sequence[Layer]) -> str:
        """Layers, then un-scaling of the outputs: (n, m) in SI."""
        for number, layer in enumerate(layers, 1):
            x = self.dense(x, f"{prefix}_{number}", layer)
        scale = self.constant(f"{prefix}_output_scale", _of(network.outputs, "scale"))
        mean = self.constant(f"{prefix}_output_mean", _of(network.outputs, "mean"))
        x = self.add("Mul", f"{prefix}_unscaled", x, scale)
        x = self.add("Add", f"{prefix}_values", x, mean)
        return self.transform("Exp", x, network.outputs)

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
    scaled = graph.scaled("numeric", "input", network.inputs)
    parts = [scaled]
    if network.derived:
        combination = graph.constant("derived_coefficients", derived_matrix(network))
        derived = graph.add("MatMul", "derived", "numeric", combination)
        parts.append(graph.scaled(derived, "derived", network.derived))
    codes = graph.constant("explosive_codes", network.codes)
    parts.append(graph.add("Gather", "explosive_code", codes, "explosive", axis=0))
    features = graph.add("Concat", "features", *parts, axis=1)
    values = graph.chain(features, "network", network, network.layers)
    graph.columns(values, network.output_names)
    _add_band(graph, values, network)
    if network.members:
        _add_spread(graph, values, features, network)
    _add_domain(graph, scaled, network)

    def entry(name: str, kind: int, *widths: int) -> Any:
        return helper.make_tensor_value_info(name, kind, ["n", *widths])

    inputs = [entry("numeric", TensorProto.DOUBLE, len(network.inputs))]
    inputs.append(entry("explosive", TensorProto.INT64))
    outputs = [entry(name, TensorProto.DOUBLE) for name in _result_names(network)]
    outputs.append(entry("in_domain", TensorProto.BOOL))
    outputs.append(entry("offending", TensorProto.BOOL, len(network.inputs)))
    model = helper.make_model(
        helper.make_graph(graph.nodes, "castblast", inputs, outputs, initializer=graph.constants),
        producer_name="castblast",
        producer_version=str(network.provenance.get("castblast_version", "")),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=_IR_VERSION,
    )
    helper.set_model_props(model, _metadata(network))
    onnx.checker.check_model(model, full_check=True)
    return bytes(model.SerializeToString(deterministic=True))


def _result_names(network: Network) -> list[str]:
    """Float64 outputs in their order."""
    endings = ["", "_lower", "_upper", *(["_spread"] if network.members else [])]
    names = [f"{name}{ending}" for ending in endings for name in network.output_names]
    return [*names, "domain_score"]


def _add_band(graph: _Graph, values: str, network: Network) -> None:
    band = graph.constant("relative_band", _of(network.outputs, "relative_band"))
    magnitude = graph.add("Abs", "magnitudes", values)
    half = graph.add("Mul", "half_widths", magnitude, band)
    for operator, ending in (("Sub", "lower"), ("Add", "upper")):
        x = graph.add(operator, f"all_{ending}", values, half)
        graph.columns(x, [f"{name}_{ending}" for name in network.output_names])


def _add_spread(graph: _Graph, values: str, features: str, network: Network) -> None:
    """Relative standard deviation over the network and its members."""
    others = [
        graph.chain(features, f"member_{number}", network, layers)
        for number, layers in enumerate(network.members, 1)
    ]
    count = len(others) + 1.0
    total = graph.add("Sum", "member_sum", values, *others)
    mean = graph.add("Div", "member_mean", total, graph.constant("member_count", np.array(count)))
    squares = []
    for number, answer in enumerate((values, *others)):
        step = graph.add("Sub", f"member_step_{number}", answer, mean)
        squares.append(graph.add("Mul", f"member_square_{number}", step, step))
    total = graph.add("Sum", "member_squares", *squares)
    divisor = graph.constant("member_divisor", np.array(count - 1.0))
    deviation = graph.add("Sqrt", "spreads", graph.add("Div", "variances", total, divisor))
    x = graph.add("Div", "relative_spreads", deviation, "magnitudes")
    graph.columns(x, [f"{name}_spread" for name in network.output_names])


def _add_domain(graph: _Graph, scaled: str, network: Network) -> None:
    """Score of the joint density, flag of box, rules and density, and the inputs at fault."""
    above, below = (
        graph.add(operator, f"box_{end}", "numeric", graph.constant(end, _of(network.inputs, end)))
        for operator, end in (("GreaterOrEqual", "lower"), ("LessOrEqual", "upper"))
    )
    faults = graph.add("Not", "box_faults", graph.add("And", "box_kept", above, below))
    if network.constraints:
        sums = _rule_sums(graph, network)
        least = graph.constant("rule_lower", _of(network.constraints, "lower"))
        kept = graph.add("GreaterOrEqual", "rules_kept", sums, least)
        broken = graph.add("Cast", "rules_broken", graph.add("Not", "rule_fault", kept), to=_DOUBLE)
        named = np.array(
            [[name in rule.coefficients for name in network.input_names]
             for rule in network.constraints], dtype=np.float64,
        )  # fmt: skip
        count = graph.add("MatMul", "rule_counts", broken, graph.constant("rule_inputs", named))
        some = graph.add("Greater", "rule_faults", count, graph.constant("no_rule", np.zeros(1)))
        faults = graph.add("Or", "plain_faults", faults, some)
    broken = graph.add("Cast", "broken", faults, to=_DOUBLE)
    half = graph.constant("half", np.array([0.5]))
    kept = graph.add("Less", "box_and_rules_kept", graph.row_sums(broken, "faults"), half)
    if network.density is None:
        # No value for any row, but one for every row.
        nothing = graph.row_sums(scaled, "any_number")
        missing = graph.constant("missing", np.array([np.nan]))
        graph.add("Add", "domain_score", nothing, missing)
        graph.add("Identity", "in_domain", kept)
        graph.add("Identity", "offending", faults)
        return
    blamed = _density(graph, scaled, network.density)
    one = graph.constant("one", np.array([1.0]))
    usual = graph.add("LessOrEqual", "usual", "domain_score", one)
    graph.add("And", "in_domain", kept, usual)
    unusual = graph.add("And", "unusual", kept, graph.add("Not", "not_usual", usual))
    together = graph.add("And", "together", graph.column(unusual, "unusual"), blamed)
    graph.add("Or", "offending", faults, together)


def _rule_sums(graph: _Graph, network: Network) -> str:
    """Sums of the rules (n, r), each over its own inputs: NaN elsewhere does not enter."""
    sums = []
    for number, rule in enumerate(network.constraints):
        places = [network.input_names.index(name) for name in rule.coefficients]
        position = graph.constant(f"rule_{number}_inputs", np.array(places, dtype=np.int64))
        part = graph.add("Gather", f"rule_{number}_values", "numeric", position, axis=1)
        column = np.array([[c] for c in rule.coefficients.values()], dtype=np.float64)
        matrix = graph.constant(f"rule_{number}_coefficients", column)
        sums.append(graph.add("MatMul", f"rule_{number}_sum", part, matrix))
    return graph.add("Concat", "rule_sums", *sums, axis=1)


def _density(graph: _Graph, scaled: str, density: DensityScore) -> str:
    """Add `domain_score`; return which inputs make a row unusual about its nearest centre."""
    distances, reliefs = [], []
    for j, centre in enumerate(density.centres):
        whitening = density.whitening[j]
        step = graph.add("Sub", f"step_{j}", scaled, graph.constant(f"centre_{j}", centre))
        matrix = graph.constant(f"whitening_{j}", whitening.T)
        white = graph.add("MatMul", f"white_{j}", step, matrix)
        total = graph.row_sums(graph.add("Mul", f"square_{j}", white, white), f"distance_{j}")
        offset = graph.constant(f"offset_{j}", density.offsets[j : j + 1])
        distances.append(graph.add("Add", f"term_{j}", total, offset))
        back = graph.constant(f"whitening_back_{j}", whitening)
        slope = graph.add("MatMul", f"slope_{j}", white, back)
        curvature = graph.constant(f"curvature_{j}", np.sum(whitening**2, axis=0))
        square = graph.add("Mul", f"slope_square_{j}", slope, slope)
        reliefs.append(graph.add("Div", f"relief_{j}", square, curvature))
    least = graph.add("Min", "least_term", *distances)
    threshold = graph.constant("threshold", np.array([density.threshold]))
    graph.add("Div", "domain_score", least, threshold)
    zero = graph.constant("zero", np.zeros(1))
    chosen = []
    for j, (distance, relief) in enumerate(zip(distances, reliefs, strict=True)):
        nearest = graph.column(graph.add("Equal", f"nearest_{j}", distance, least), f"nearest_{j}")
        chosen.append(graph.add("Where", f"chosen_{j}", nearest, relief, zero))
    relief = graph.add("Sum", "reliefs", *chosen)
    most = graph.add("ReduceMax", "most_relief", relief, axes=[1], keepdims=1)
    bound = graph.add("Mul", "blame_bound", most, graph.constant("blame", np.array([BLAME])))
    return graph.add("Not", "blamed", graph.add("Less", "minor", relief, bound))


def _of(columns: Sequence[Column | Constraint], attribute: str) -> Floats:
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
        "density": network.density
        and {"threshold": network.density.threshold, "level": network.density.level},
        "relative_band": [column.relative_band for column in network.outputs],
        "provenance": dict(network.provenance),
    }
    return {key: json.dumps(value) for key, value in entries.items()}


def run_onnx(model: bytes, numeric: Floats, index: NDArray[np.int64]) -> Floats:
    """Values (n, m) of an ONNX file for SI rows (n, k), in the order of its outputs."""
    return run_onnx_rows(model, numeric, index).values


def run_onnx_rows(model: bytes, numeric: Floats, index: NDArray[np.int64]) -> Answers:
    """Evaluate an ONNX file: with onnxruntime on one thread, or with the reference of ONNX.

    Parameters
    ----------
    model : bytes
        Contents of the file.
    numeric : (n, k) float64, SI
    index : (n,) int64
    """
    rows = {"numeric": numeric, "explosive": index}
    try:
        import onnxruntime
    except ImportError:
        names, columns = _reference_columns(model, rows)
    else:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
        names = [entry.name for entry in session.get_outputs()]
        columns = session.run(None, rows)
    found = dict(zip(names, columns, strict=True))
    outputs = [name.removesuffix("_lower") for name in names if name.endswith("_lower")]
    values, lower, upper = (
        np.stack([found[f"{name}{ending}"] for name in outputs], axis=1)
        for ending in ("", "_lower", "_upper")
    )
    score, inside, offending = (found[name] for name in ("domain_score", "in_domain", "offending"))
    return Answers(values, lower, upper, score, inside, offending)


def _reference_columns(
    model: bytes, rows: dict[str, NDArray[Any]]
) -> tuple[list[str], list[NDArray[Any]]]:
    """Names and outputs by the evaluator that comes with the format: slow, right by definition."""
    from onnx.reference import ReferenceEvaluator

    evaluator = ReferenceEvaluator(model)
    # The graph takes logarithms of all columns and then those that are meant: 0 may be among them.
    with np.errstate(divide="ignore", invalid="ignore"):
        return list(evaluator.output_names), list(evaluator.run(None, rows))
