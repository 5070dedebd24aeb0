"""Rows of designs through a network as formulas of a worksheet.

Every step is one array formula over all rows, so that one row and two hundred are the same
formulas; matrices stand on a sheet of constants. Functions that every spreadsheet of the last
twenty years knows: MMULT, TANH, EXP, LN, IF, MIN, MAX.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from castblast.names import printable
from castblast.network import BLAME, Column, Constraint, Network, prediction_factors
from castblast.types import FloatArray

if TYPE_CHECKING:
    from openpyxl.worksheet.worksheet import Worksheet


class Block(NamedTuple):
    """Where the answers of a block stand on its sheet: first column of each part, 1-based."""

    values: int
    prediction_lower: int
    prediction_upper: int
    network_lower: int
    network_upper: int
    score: int
    domain: int
    offending: int
    end: int


class Constants:
    """A sheet of matrices, one under the other, each with a title."""

    def __init__(self, sheet: Worksheet) -> None:
        self.sheet = sheet
        self.row = 1
        self.known: dict[str, str] = {}

    def place(self, title: str, matrix: Sequence[Sequence[Any]] | FloatArray) -> str:
        """Write a matrix and return its absolute address; the same title is written once."""
        if title in self.known:
            return self.known[title]
        lines = matrix.tolist() if isinstance(matrix, np.ndarray) else matrix
        put(self.sheet, self.row, 1, title)
        for j, line in enumerate(lines, self.row + 1):
            for i, value in enumerate(line, 1):
                put(self.sheet, j, i, value)
        first, last = self.row + 1, self.row + len(lines)
        self.row = last + 2
        address = f"'{self.sheet.title}'!{span(1, first, len(lines[0]), last)}"
        self.known[title] = address
        return address


def put(sheet: Worksheet, row: int, column: int, value: Any) -> Any:
    """Write a number or a text into a cell; a text is a text, whatever it begins with."""
    cell = sheet.cell(row, column)
    cell.value = printable(value) if isinstance(value, str) else value
    if isinstance(value, str):
        cell.data_type = "s"  # openpyxl takes what begins with "=" for a formula
        cell.quotePrefix = value.startswith(("=", "+", "-", "@"))
    return cell


def in_formula(text: str) -> str:
    """Text as a literal of a formula."""
    return '"' + text.replace('"', '""') + '"'


def letter(column: int) -> str:
    """Letters of a 1-based column."""
    from openpyxl.utils import get_column_letter

    return str(get_column_letter(column))


def span(left: int, top: int, right: int, bottom: int) -> str:
    """Absolute address of a range."""
    return f"${letter(left)}${top}:${letter(right)}${bottom}"


class _Writer:
    """Writes arrays side by side into rows `top` to `bottom` of a sheet."""

    def __init__(self, sheet: Worksheet, top: int, rows: int, column: int) -> None:
        self.sheet, self.top, self.bottom, self.column = sheet, top, top + rows - 1, column

    def array(self, title: str, width: int, formula: str) -> str:
        """One array formula over all rows; returns its address."""
        from openpyxl.worksheet.formula import ArrayFormula

        left, right = self.column, self.column + width - 1
        address = span(left, self.top, right, self.bottom)
        cell = f"{letter(left)}{self.top}"
        self.sheet[cell] = ArrayFormula(address.replace("$", ""), f"={formula}")
        self._titled(title, width)
        return address

    def rows(self, title: str, pattern: str) -> str:
        """One formula a row, `{row}` in it stands for the row; returns the address."""
        column = self.column
        for row in range(self.top, self.bottom + 1):
            self.sheet.cell(row, column, "=" + pattern.replace("{row}", str(row)))
        self._titled(title, 1)
        return span(column, self.top, column, self.bottom)

    def in_row(self, address: str) -> str:
        """Turn a range of this block into the pattern of one of its rows."""
        left, right = address.split(":")
        return f"{left.rstrip('0123456789')}{{row}}:{right.rstrip('0123456789')}{{row}}"

    def _titled(self, title: str, width: int) -> None:
        put(self.sheet, self.top - 1, self.column, title)
        self.column += width


def write_block(
    network: Network, constants: Constants, sheet: Worksheet, top: int, rows: int
) -> Block:
    """Write the formulas for rows whose explosive (1-based) is in column A and inputs from B on."""
    k, m = len(network.inputs), len(network.outputs)
    x = span(2, top, k + 1, top + rows - 1)
    writer = _Writer(sheet, top, rows, k + 2)
    features, scaled = _features(network, constants, writer, x)
    for number, layer in enumerate(network.layers, 1):
        weights = constants.place(f"weights {number}", layer.weights)
        biases = constants.place(f"biases {number}", layer.biases[None, :])
        width = len(layer.biases)
        sums = writer.array(f"layer {number}", width, f"MMULT({features},{weights})+{biases}")
        features = _activated(writer, number, layer.activation, sums, width)
    scale = _row(constants, "output scale", network.outputs, "scale")
    mean = _row(constants, "output mean", network.outputs, "mean")
    logged = _logged(constants, "output", network.outputs)
    plain = writer.array("outputs", m, f"{features}*{scale}+{mean}")
    first = writer.column
    values = writer.array("value", m, f"IF({logged}=1,EXP({plain}),{plain})")
    band = _row(constants, "relative band", network.outputs, "relative_band")
    less, more = _prediction_factors(network, constants)
    for title, below, above in (("lower", more, less), ("upper", less, more)):
        ends = f"IF({values}<0,{values}*{below},{values}*{above})"
        writer.array(f"prediction {title}", m, ends)
    writer.array("network lower", m, f"{values}-ABS({values})*{band}")
    writer.array("network upper", m, f"{values}+ABS({values})*{band}")
    hard, any_hard = _faults(network, constants, writer, x)
    score, domain, offending = _domain(network, constants, writer, scaled, hard, any_hard)
    return Block(
        values=first,
        prediction_lower=first + m,
        prediction_upper=first + 2 * m,
        network_lower=first + 3 * m,
        network_upper=first + 4 * m,
        score=score,
        domain=domain,
        offending=offending,
        end=writer.column,
    )


def _prediction_factors(network: Network, constants: Constants) -> tuple[str, str]:
    """Addresses of the ends of the prediction bands over the value; NA() where none is stated."""
    less, more = (
        constants.place(title, [["=NA()" if isnan(factor) else factor for factor in factors]])
        for title, factors in zip(
            ("prediction lower over value", "prediction upper over value"),
            zip(*prediction_factors(network), strict=True),
            strict=True,
        )
    )
    return less, more


def _features(network: Network, constants: Constants, writer: _Writer, x: str) -> tuple[str, str]:
    """Scaled inputs, scaled derived columns and codes side by side; and the scaled inputs."""
    k, d, c = len(network.inputs), len(network.derived), network.codes.shape[1]
    derived = ""
    if network.derived:
        matrix = [[float(column.coefficients.get(name, 0.0)) for column in network.derived]
                  for name in network.input_names]  # fmt: skip
        address = constants.place("derived coefficients", matrix)
        derived = writer.array("derived", d, f"MMULT({x},{address})")
    left = writer.column
    scaled = writer.array("scaled", k, _scaled(constants, "input", network.inputs, x))
    if network.derived:
        text = _scaled(constants, "derived", network.derived, derived)
        writer.array("scaled derived", d, text)
    numbers = constants.place("positions", [list(range(1, len(network.explosives) + 1))])
    codes = constants.place("explosive codes", network.codes)
    kind = span(1, writer.top, 1, writer.bottom)
    writer.array("code", c, f"MMULT(IF({kind}={numbers},1,0),{codes})")
    return span(left, writer.top, left + k + d + c - 1, writer.bottom), scaled


def _scaled(constants: Constants, what: str, columns: Sequence[Column], x: str) -> str:
    logged = _logged(constants, what, columns)
    mean = _row(constants, f"{what} mean", columns, "mean")
    scale = _row(constants, f"{what} scale", columns, "scale")
    return f"(IF({logged}=1,LN({x}),{x})-{mean})/{scale}"


def _activated(writer: _Writer, number: int, kind: str, sums: str, width: int) -> str:
    small = f"EXP(-ABS({sums}))"
    logistic = f"IF({sums}>=0,1,{small})/(1+{small})"
    formulas = {
        "tanh": f"TANH({sums})",
        "relu": f"IF({sums}>0,{sums},0)",
        "logistic": logistic,
        "silu": f"{sums}*{logistic}",
    }
    if kind == "identity":
        return sums
    return writer.array(f"nodes {number}", width, formulas[kind])


def _faults(network: Network, constants: Constants, writer: _Writer, x: str) -> tuple[str, str]:
    """Ranges and rules: inputs at fault (1 or 0), and whether there is any."""
    k, r = len(network.inputs), len(network.constraints)
    lower = _row(constants, "lower", network.inputs, "lower")
    upper = _row(constants, "upper", network.inputs, "upper")
    inner = f"IF({x}>={lower},IF({x}<={upper},0,1),1)"
    hard = writer.array("out of range", k, f"IF(ISNUMBER({x}),{inner},1)")
    if r:
        matrix = [[float(rule.coefficients.get(name, 0.0)) for rule in network.constraints]
                  for name in network.input_names]  # fmt: skip
        named = [[float(name in rule.coefficients) for name in network.input_names]
                 for rule in network.constraints]  # fmt: skip
        involved = [list(column) for column in zip(*named, strict=True)]
        sums = constants.place("rules", matrix)
        bound = _row(constants, "rule lower", network.constraints, "lower")
        number = writer.array("numbers", k, f"IF(ISNUMBER({x}),{x},0)")
        gaps = writer.array("no numbers", k, f"IF(ISNUMBER({x}),0,1)")
        missing = f"MMULT({gaps},{constants.place('inputs of rules', involved)})>0"
        kept = f"IF(MMULT({number},{sums})-{bound}>=0,0,1)"
        broken = writer.array("rules broken", r, f"IF({missing},1,{kept})")
        inputs = f"MMULT({broken},{constants.place('rules of inputs', named)})"
        hard = writer.array("at fault", k, f"IF({hard}+{inputs}>0,1,0)")
    return hard, writer.rows("any fault", f"MAX({writer.in_row(hard)})")


def _domain(
    network: Network,
    constants: Constants,
    writer: _Writer,
    scaled: str,
    hard: str,
    any_hard: str,
) -> tuple[int, int, int]:
    """Score, domain (0 inside, 1 unusual, 2 outside) and offending inputs; first columns."""
    k, density = len(network.inputs), network.density
    fault = writer.in_row(any_hard).split(":")[0]
    if density is None:
        start = writer.column
        writer.rows("score", "NA()")
        writer.rows("domain", f"2*{fault}")
        writer.array("offending", k, f"{hard}+0")
        return start, start + 1, start + 2
    ones = constants.place("ones", [[1.0]] * k)
    whites, reliefs = [], []
    for c, (centre, whitening) in enumerate(
        zip(density.centres, density.whitening, strict=True), 1
    ):
        step = f"{scaled}-{constants.place(f'centre {c}', centre[None, :])}"
        turned = constants.place(f"whitening {c}, transposed", whitening.T)
        white = writer.array(f"whitened {c}", k, f"MMULT({step},{turned})")
        back = constants.place(f"whitening {c}", whitening)
        curvature = constants.place(f"curvature {c}", np.sum(whitening**2, axis=0)[None, :])
        whites.append(white)
        reliefs.append(writer.array(f"relief {c}", k, f"MMULT({white},{back})^2/{curvature}"))
    start = writer.column
    distances = [
        writer.array(f"distance {c}", 1, f"MMULT({white}^2,{ones})+{float(offset)!r}")
        for c, (white, offset) in enumerate(zip(whites, density.offsets, strict=True), 1)
    ]
    row = f"${letter(start)}{{row}}:${letter(writer.column - 1)}{{row}}"
    least = writer.rows("least", f"MIN({row})")
    terms = [f"IF({d}={least},1,0)*{relief}"
             for d, relief in zip(distances, reliefs, strict=True)]  # fmt: skip
    relief = writer.array("relief", k, "+".join(terms))
    most = writer.rows("most relief", f"MAX({writer.in_row(relief)})")
    first = writer.column
    least_here = writer.in_row(least).split(":")[0]
    score = writer.rows("score", f"{least_here}/{density.threshold!r}")
    score_here = writer.in_row(score).split(":")[0]
    writer.rows("domain", f"IF({fault}=1,2,IF({score_here}<=1,0,1))")
    blamed = f"IF({relief}<{BLAME!r}*{most},0,1)"
    writer.array("offending", k, f"IF({any_hard}=1,{hard},IF({score}<=1,0,{blamed}))")
    return first, first + 1, first + 2


def _row(
    constants: Constants, title: str, columns: Sequence[Column | Constraint], attribute: str
) -> str:
    return constants.place(title, [[float(getattr(column, attribute)) for column in columns]])


def _logged(constants: Constants, what: str, columns: Sequence[Column]) -> str:
    flags = [[float(column.transform == "log") for column in columns]]
    return constants.place(f"{what} is log", flags)
