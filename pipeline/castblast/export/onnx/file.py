"""A surrogate to ONNX, float64, with every transform and scaling inside the graph.

Between the scalings stand the dense layers of a `Network`, or the ONNX model of a torch module of
any shape; everything around them is the same.

The graph is put together with `onnx.helper`: converters of whole scikit-learn pipelines know no
transformed targets and fall back to float32. Opset 13 (14 for attention) and IR 7
load in runtimes since 2021.

Inputs: ``numeric`` float64 [n, k] in SI, columns in the order of the metadata entry ``inputs``;
``explosive`` int64 [n], positions in the entry ``explosives``. Outputs, all [n], SI: one float64
per output under its own name; the ends of its prediction band (`castblast.bands`, NaN where no
prior is stated), ``NAME_prediction_lower`` and ``_upper``, and of the 95 % band of the network,
``NAME_network_lower`` and ``_upper``; for a network with members ``NAME_spread``, their relative
standard deviation; ``domain_score`` float64, at most 1 inside the joint density of the training
rows (NaN without one); ``in_domain`` bool, box, rules and density together; ``offending`` bool
[n, k], the inputs at fault where it is false. The metadata carry units, domain box, rules, density
and what both bands rest on.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from castblast.bands import BASIS, prior_sd
from castblast.errors import CheckError
from castblast.export.onnx.core import OPSET, add_core
from castblast.export.onnx.graph import Graph, values_of
from castblast.export.source.answers import Answers
from castblast.network import (
    BLAME,
    Bounds,
    DensityScore,
    Layer,
    Network,
    Shell,
    derived_matrix,
    prediction_factors,
)
from castblast.types import FloatArray, IntArray

_IR_VERSION = 7
#: Code of float64 in ONNX, for `Cast`.
_DOUBLE = 11
#: What the name of an output is followed by, in the order of the ends of `Answers`.
_ENDS = ("_prediction_lower", "_prediction_upper", "_network_lower", "_network_upper")


def to_onnx(network: Network) -> bytes:
    """Build the ONNX file of a network.

    Returns
    -------
    bytes
        A checked model; the same network gives the same bytes.
    """
    graph = Graph()
    scaled, features = _add_features(graph, network)
    values = _add_chain(graph, features, "network", network.layers, network)
    _add_values(graph, values, network)
    if network.members:
        others = [
            _add_chain(graph, features, f"member_{number}", layers, network)
            for number, layers in enumerate(network.members, 1)
        ]
        _add_spread(graph, values, others, network)
    _add_domain(graph, scaled, network)
    return _finished(graph, network, OPSET, spread=bool(network.members))


def wrap_onnx(shell: Shell, core: bytes) -> bytes:
    """Build the ONNX file of a model of any shape from the ONNX model of its core.

    Parameters
    ----------
    shell : Shell
        Everything but the core.
    core : bytes
        An ONNX model with one float64 input [n, shell.width], what enters the first layer of a
        network, and one float64 output [n, m], the scaled outputs; opset 13 or 14.

    Returns
    -------
    bytes
        A checked model with the inputs, outputs and metadata of any other.

    Raises
    ------
    SpecError
        The core is no such model, or holds what cannot be computed in float64.
    """
    graph = Graph()
    scaled, features = _add_features(graph, shell)
    answers, opset = add_core(graph, features, core, shell)
    _add_values(graph, graph.unscaled(answers, "network", shell.outputs), shell)
    _add_domain(graph, scaled, shell)
    return _finished(graph, shell, opset)


def _add_features(graph: Graph, shell: Shell) -> tuple[str, str]:
    """Scaled numeric inputs (n, k), and all that enters the first layer (n, k + d + c)."""
    scaled = graph.scaled("numeric", "input", shell.inputs)
    parts = [scaled]
    if shell.derived:
        combination = graph.constant("derived_coefficients", derived_matrix(shell))
        derived = graph.add("MatMul", "derived", "numeric", combination)
        parts.append(graph.scaled(derived, "derived", shell.derived))
    codes = graph.constant("explosive_codes", shell.codes)
    parts.append(graph.add("Gather", "explosive_code", codes, "explosive", axis=0))
    return scaled, graph.add("Concat", "features", *parts, axis=1)


def _add_chain(
    graph: Graph, features: str, prefix: str, layers: Sequence[Layer], network: Network
) -> str:
    """Layers, then un-scaling of the outputs: (n, m) in SI."""
    return graph.unscaled(graph.chain(features, prefix, layers), prefix, network.outputs)


def _finished(graph: Graph, shell: Shell, opset: int, *, spread: bool = False) -> bytes:
    """The checked model of a complete graph."""
    import onnx
    from onnx import TensorProto, helper

    def entry(name: str, kind: int, *widths: int) -> Any:
        return helper.make_tensor_value_info(name, kind, ["n", *widths])

    inputs = [entry("numeric", TensorProto.DOUBLE, len(shell.inputs))]
    inputs.append(entry("explosive", TensorProto.INT64))
    outputs = [entry(name, TensorProto.DOUBLE) for name in _result_names(shell, spread)]
    outputs.append(entry("in_domain", TensorProto.BOOL))
    outputs.append(entry("offending", TensorProto.BOOL, len(shell.inputs)))
    model = helper.make_model(
        helper.make_graph(graph.nodes, "castblast", inputs, outputs, initializer=graph.constants),
        producer_name="castblast",
        producer_version=str(shell.provenance.get("castblast_version", "")),
        opset_imports=[helper.make_opsetid("", opset)],
        ir_version=_IR_VERSION,
    )
    helper.set_model_props(model, _metadata(shell))
    onnx.checker.check_model(model, full_check=True)
    return bytes(model.SerializeToString(deterministic=True))


def _result_names(shell: Shell, spread: bool) -> list[str]:
    """Float64 outputs in their order."""
    endings = ["", *_ENDS, *(["_spread"] if spread else [])]
    names = [f"{name}{ending}" for ending in endings for name in shell.output_names]
    return [*names, "domain_score"]


def _add_values(graph: Graph, values: str, shell: Shell) -> None:
    """Outputs and the ends of their bands from all values (n, m)."""
    graph.columns(values, shell.output_names)
    band = graph.constant("relative_band", values_of(shell.outputs, "relative_band"))
    magnitude = graph.add("Abs", "magnitudes", values)
    half = graph.add("Mul", "half_widths", magnitude, band)
    less, more = (
        graph.add("Mul", f"value_times_{word}", values, graph.constant(word, np.array(factors)))
        for word, factors in zip(("less", "more"), zip(*prediction_factors(shell), strict=True),
                                 strict=True)
    )  # fmt: skip
    parts = ("Min", less, more), ("Max", less, more), ("Sub", values, half), ("Add", values, half)
    for ending, (operator, one, other) in zip(_ENDS, parts, strict=True):
        x = graph.add(operator, f"all{ending}", one, other)
        graph.columns(x, [f"{name}{ending}" for name in shell.output_names])


def _add_spread(graph: Graph, values: str, others: Sequence[str], shell: Shell) -> None:
    """Relative standard deviation over the network and its members."""
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
    graph.columns(x, [f"{name}_spread" for name in shell.output_names])


def _add_domain(graph: Graph, scaled: str, shell: Shell) -> None:
    """Score of the joint density, flag of box, rules and density, and the inputs at fault."""
    above, below = (
        graph.add(
            operator, f"box_{end}", "numeric", graph.constant(end, values_of(shell.inputs, end))
        )
        for operator, end in (("GreaterOrEqual", "lower"), ("LessOrEqual", "upper"))
    )
    faults = graph.add("Not", "box_faults", graph.add("And", "box_kept", above, below))
    if shell.constraints:
        sums = _rule_sums(graph, shell)
        least = graph.constant("rule_lower", values_of(shell.constraints, "lower"))
        kept = graph.add("GreaterOrEqual", "rules_kept", sums, least)
        broken = graph.add("Cast", "rules_broken", graph.add("Not", "rule_fault", kept), to=_DOUBLE)
        named = np.array(
            [[name in rule.coefficients for name in shell.input_names]
             for rule in shell.constraints], dtype=np.float64,
        )  # fmt: skip
        count = graph.add("MatMul", "rule_counts", broken, graph.constant("rule_inputs", named))
        some = graph.add("Greater", "rule_faults", count, graph.constant("no_rule", np.zeros(1)))
        faults = graph.add("Or", "plain_faults", faults, some)
    broken = graph.add("Cast", "broken", faults, to=_DOUBLE)
    half = graph.constant("half", np.array([0.5]))
    kept = graph.add("Less", "box_and_rules_kept", graph.row_sums(broken, "faults"), half)
    if shell.density is None:
        # No value for any row, but one for every row.
        nothing = graph.row_sums(scaled, "any_number")
        missing = graph.constant("missing", np.array([np.nan]))
        graph.add("Add", "domain_score", nothing, missing)
        graph.add("Identity", "in_domain", kept)
        graph.add("Identity", "offending", faults)
        return
    blamed = _density(graph, scaled, shell.density)
    one = graph.constant("one", np.array([1.0]))
    usual = graph.add("LessOrEqual", "usual", "domain_score", one)
    graph.add("And", "in_domain", kept, usual)
    unusual = graph.add("And", "unusual", kept, graph.add("Not", "not_usual", usual))
    together = graph.add("And", "together", graph.column(unusual, "unusual"), blamed)
    graph.add("Or", "offending", faults, together)


def _rule_sums(graph: Graph, shell: Shell) -> str:
    """Sums of the rules (n, r), each over its own inputs: NaN elsewhere does not enter."""
    sums = []
    for number, rule in enumerate(shell.constraints):
        places = [shell.input_names.index(name) for name in rule.coefficients]
        position = graph.constant(f"rule_{number}_inputs", np.array(places, dtype=np.int64))
        part = graph.add("Gather", f"rule_{number}_values", "numeric", position, axis=1)
        column = np.array([[c] for c in rule.coefficients.values()], dtype=np.float64)
        matrix = graph.constant(f"rule_{number}_coefficients", column)
        sums.append(graph.add("MatMul", f"rule_{number}_sum", part, matrix))
    return graph.add("Concat", "rule_sums", *sums, axis=1)


def _density(graph: Graph, scaled: str, density: DensityScore) -> str:
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


def _metadata(shell: Shell) -> dict[str, str]:
    entries: dict[str, Any] = {
        "inputs": list(shell.input_names),
        "input_units": [column.unit for column in shell.inputs],
        "input_lower": [column.lower for column in shell.inputs],
        "input_upper": [column.upper for column in shell.inputs],
        "constraints": [
            {"label": rule.label, "coefficients": dict(rule.coefficients), "lower": rule.lower}
            for rule in shell.constraints
        ],
        "explosives": list(shell.explosives),
        "outputs": list(shell.output_names),
        "output_units": [column.unit for column in shell.outputs],
        "density": shell.density
        and {"threshold": shell.density.threshold, "level": shell.density.level},
        "relative_band": [column.relative_band for column in shell.outputs],
        "prediction_sd_of_ln": [prior_sd(name) for name in shell.output_names],
        "prediction_basis": BASIS,
        "provenance": dict(shell.provenance),
    }
    return {key: json.dumps(value) for key, value in entries.items()}


def run_onnx_rows(model: bytes, numeric: FloatArray, index: IntArray) -> Answers:
    """Evaluate an ONNX file: with onnxruntime on one thread, or with the reference of ONNX.

    Parameters
    ----------
    model : bytes
        Contents of the file.
    numeric : (n, k) float64, SI
    index : (n,) int64

    Raises
    ------
    CheckError
        onnxruntime does not take the file, or it answers for another number of rows.
    """
    rows = {"numeric": numeric, "explosive": index}
    try:
        import onnxruntime
    except ImportError:
        names, columns = _reference_columns(model, rows)
    else:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        options.log_severity_level = 4  # what is wrong is raised as well
        try:
            session = onnxruntime.InferenceSession(
                model, options, providers=["CPUExecutionProvider"]
            )
            names = [entry.name for entry in session.get_outputs()]
            columns = session.run(None, rows)
        except Exception as fault:  # its exceptions have no common class of their own
            message = f"onnxruntime does not run the file: {str(fault).splitlines()[0]}"
            raise CheckError(message) from fault
    if any(len(column) != len(numeric) for column in columns):
        message = f"the file has a fixed batch size and cannot take {len(numeric)} rows"
        raise CheckError(message)
    found = dict(zip(names, columns, strict=True))
    outputs = [name.removesuffix(_ENDS[0]) for name in names if name.endswith(_ENDS[0])]
    values, *ends = (
        np.stack([found[f"{name}{ending}"] for name in outputs], axis=1) for ending in ("", *_ENDS)
    )
    bands = Bounds(*ends[:2]), Bounds(*ends[2:])
    score, inside, offending = (found[name] for name in ("domain_score", "in_domain", "offending"))
    return Answers(values, *bands, score, inside, offending)


def _reference_columns(
    model: bytes, rows: dict[str, NDArray[Any]]
) -> tuple[list[str], list[NDArray[Any]]]:
    """Names and outputs by the evaluator that comes with the format: slow, right by definition."""
    from onnx.reference import ReferenceEvaluator

    evaluator = ReferenceEvaluator(model)
    # The graph takes logarithms of all columns and then those that are meant: 0 may be among them.
    with np.errstate(divide="ignore", invalid="ignore"):
        return list(evaluator.output_names), list(evaluator.run(None, rows))
