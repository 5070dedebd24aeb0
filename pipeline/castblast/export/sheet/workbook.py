"""`Network` to a workbook with live formulas, and to a lookup table.

`model.xlsx`: sheet Predict takes one design in usual units and shows values, both bands and the
domain; Working holds its formulas, Network the numbers, Check the golden rows through the same
formulas. `lookup.csv`: answers over a grid, for those who may not open a workbook.
"""

from __future__ import annotations

import io
import re
import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np

from castblast.bands import BAND_SENTENCE
from castblast.export.sheet.block import (
    Block,
    Constants,
    in_formula,
    letter,
    put,
    span,
    write_block,
)
from castblast.export.sheet.design import write_refusals
from castblast.export.sheet.lookup import lookup_csv
from castblast.export.source.plain import Files, compact
from castblast.extras import require
from castblast.names import people_unit
from castblast.network import Network

if TYPE_CHECKING:
    from openpyxl import Workbook
    from openpyxl.worksheet.worksheet import Worksheet

#: First row of designs on Check and Working, of inputs on Predict.
TOP = 4
INPUT_TOP = 6
_MOMENT = "2020-01-01T00:00:00Z"


def to_excel(network: Network) -> Files:
    """Write ``model.xlsx`` and ``lookup.csv``.

    Raises
    ------
    MissingLibraryError
        openpyxl is not installed.
    """
    require("excel", purpose="export target 'excel'")
    import openpyxl
    from openpyxl.worksheet.properties import PageSetupProperties

    book = openpyxl.Workbook()
    predict = book.active
    predict.title = "Predict"
    predict.sheet_properties.pageSetUpPr = PageSetupProperties(fitToPage=True)
    working, check = book.create_sheet("Working"), book.create_sheet("Check")
    constants = Constants(book.create_sheet("Network"))
    block = _working(network, constants, working)
    cells = {name: f"${letter(i)}${TOP}" for i, name in enumerate(network.input_names, 2)}
    reasons = write_refusals(network, working, TOP + 3, cells)
    _check(network, constants, check)
    _predict(network, predict, block, constants, reasons)
    return {"model.xlsx": _same_bytes(book), "lookup.csv": lookup_csv(network).encode()}


def _working(network: Network, constants: Constants, sheet: Worksheet) -> Block:
    sheet.cell(1, 1, "The design of sheet Predict in SI units, step by step")
    names = constants.place("explosives", [list(network.explosives)])
    sheet.cell(TOP, 1, f"=MATCH(Predict!$B$4,{names},0)")
    for i, column in enumerate(compact(network)["inputs"]):
        cell = f"Predict!$B${INPUT_TOP + i}"
        factor = column["shown_factor"]
        sheet.cell(TOP, i + 2, f'=IF(ISNUMBER({cell}),{cell}/{factor!r},"")')
        put(sheet, TOP - 1, i + 2, column["name"])
    return write_block(network, constants, sheet, TOP, 1)


def _check(network: Network, constants: Constants, sheet: Worksheet) -> None:
    """Golden rows, the answers of the formulas, and their largest deviation in B1."""
    from openpyxl.worksheet.formula import ArrayFormula

    golden, k, m = network.golden, len(network.inputs), len(network.outputs)
    rows = len(golden.explosives)
    if rows == 0:
        return
    for i, name in enumerate(network.input_names):
        put(sheet, TOP - 1, i + 2, name)
    for j, (kind, row) in enumerate(zip(golden.explosives, golden.inputs.tolist(), strict=True)):
        sheet.cell(TOP + j, 1, network.explosives.index(kind) + 1)
        for i, value in enumerate(row):
            sheet.cell(TOP + j, i + 2, value)
    block = write_block(network, constants, sheet, TOP, rows)
    for j, row in enumerate(golden.outputs.tolist()):
        for i, value in enumerate(row):
            sheet.cell(TOP + j, block.end + i, value)
    sheet.cell(TOP - 1, block.end, "answers of the fitted estimator")
    truth = span(block.end, TOP, block.end + m - 1, TOP + rows - 1)
    found = span(block.values, TOP, block.values + m - 1, TOP + rows - 1)
    spread = constants.place("golden deviation", np.std(golden.outputs, axis=0)[None, :])
    size = f"IF(ABS({truth})>{spread},ABS({truth}),{spread})"
    sheet.cell(1, 1, "Largest relative deviation from the fitted estimator")
    sheet["B1"] = ArrayFormula("B1", f"=MAX(ABS({found}-{truth})/{size})")
    sheet.freeze_panes = sheet.cell(TOP, k + 2)


def _predict(
    network: Network, sheet: Worksheet, block: Block, constants: Constants, reasons: str
) -> None:
    from openpyxl.styles import Font

    document = compact(network)
    model = document["model"]
    sheet["A1"] = f"Blast surrogate {model['name']}, trained on {model['dataset']}"
    sheet["A1"].font = Font(name="Calibri", bold=True, size=14)
    sheet["A2"] = (
        "Answers hold for the simulator that the surrogate was trained on, inside its domain only."
    )
    sheet["A3"] = "Change the blue cells."
    _inputs(document, sheet, block, constants.known["explosives"])
    bottom = INPUT_TOP + len(document["inputs"])
    domain = f"Working!${letter(block.domain)}${TOP}"
    sheet.cell(bottom + 1, 1, "Domain")
    words = f'IF({domain}=0,"inside",IF({domain}=1,"unusual together","outside"))'
    possible = f'$B${bottom + 3}="possible"'
    sheet.cell(bottom + 1, 2, f'=IF({possible},IFERROR({words},"outside"),"impossible")')
    sheet.cell(bottom + 3, 1, "Design")
    sheet.cell(bottom + 3, 2, f'=IF({reasons}="","possible",{reasons})')
    state = f"$B${bottom + 1}"
    sheet.cell(bottom + 2, 1, "Inputs at fault")
    flags = [f"Working!${letter(block.offending + i)}${TOP}" for i in range(len(network.inputs))]
    texts = [f'IF({flag}=1,{in_formula(name + " ")},"")'
             for flag, name in zip(flags, network.input_names, strict=True)]  # fmt: skip
    sheet.cell(bottom + 2, 2, "=TRIM(" + "&".join(texts) + ")")
    _results(document, sheet, block, bottom + 5, state)
    _colours(sheet, state)
    last = bottom + 9 + len(document["outputs"])
    sheet.cell(last, 1, "Self-check: largest relative deviation on the golden rows")
    sheet.cell(last, 2, "=Check!$B$1").number_format = "0.0E+00"
    sheet.page_setup.orientation = "landscape"
    sheet.page_setup.fitToHeight = 0
    for column, width in zip("ABCDEFG", (62, 20, 20, 20, 12, 16, 16), strict=True):
        sheet.column_dimensions[column].width = width


def _inputs(document: dict[str, Any], sheet: Worksheet, block: Block, explosives: str) -> None:
    """Cells for one design; `explosives` is the range of their names."""
    from openpyxl.styles import Font, PatternFill
    from openpyxl.worksheet.datavalidation import DataValidation

    blue = {
        "font": Font(name="Calibri", color="1F3FBF"),
        "fill": PatternFill("solid", fgColor="E8EEFC"),
    }
    sheet["A4"] = "Explosive"
    put(sheet, 4, 2, document["explosives"][0])
    listed = DataValidation(type="list", formula1=f"={explosives}")
    listed.error = "This surrogate does not know that explosive."
    sheet.add_data_validation(listed)
    listed.add("B4")
    for i, head in enumerate(("Input", "Value", "Trained from", "to", "Unit", "Verdict"), 1):
        sheet.cell(INPUT_TOP - 1, i, head).font = Font(name="Calibri", bold=True)
    for i, column in enumerate(document["inputs"]):
        row, factor = INPUT_TOP + i, column["shown_factor"]
        lower, upper = column["lower"] * factor, column["upper"] * factor
        put(sheet, row, 1, column["title"])
        sheet.cell(row, 2, column["example"] * factor)
        sheet.cell(row, 3, lower).number_format = "0.####"
        sheet.cell(row, 4, upper).number_format = "0.####"
        put(sheet, row, 5, people_unit(column["shown_unit"]))
        flag = f"Working!${letter(block.offending + i)}${TOP}"
        sheet.cell(row, 6, f'=IF(ISNUMBER($B${row}),IF({flag}=1,"at fault","ok"),"no number")')
        rule = DataValidation(
            type="decimal", operator="between", formula1=repr(lower), formula2=repr(upper)
        )
        rule.errorStyle = "warning"
        rule.error = f"Trained on {lower:.6g} to {upper:.6g} {people_unit(column['shown_unit'])}."
        sheet.add_data_validation(rule)
        rule.add(f"B{row}")
    for row in (4, *range(INPUT_TOP, INPUT_TOP + len(document["inputs"]))):
        sheet.cell(row, 2).font, sheet.cell(row, 2).fill = blue["font"], blue["fill"]


def _results(
    document: dict[str, Any], sheet: Worksheet, block: Block, top: int, state: str
) -> None:
    from openpyxl.styles import Font

    heads = ("Result", "Value", "Prediction from", "to", "Unit", "Network from", "to")
    for i, head in enumerate(heads, 1):
        sheet.cell(top, i, head).font = Font(name="Calibri", bold=True)
    starts = (
        (2, block.values), (3, block.prediction_lower), (4, block.prediction_upper),
        (6, block.network_lower), (7, block.network_upper),
    )  # fmt: skip
    for j, column in enumerate(document["outputs"]):
        row, factor = top + 1 + j, column["shown_factor"]
        put(sheet, row, 1, column["title"])
        for i, start in starts:
            cell = f"Working!${letter(start + j)}${TOP}*{factor!r}"
            text = f'IFERROR({cell},"{"no value" if i == 2 else "not stated"}")'
            if i > 2:
                text = f'IF({state}="outside","unknown",{text})'
            text = f'IF({state}="impossible","no value",{text})'
            sheet.cell(row, i, f"={text}").number_format = "0.0000"
        put(sheet, row, 5, people_unit(column["shown_unit"]))
    bottom = top + 1 + len(document["outputs"])
    sheet.cell(bottom, 1, BAND_SENTENCE)
    sheet.cell(
        bottom + 1, 1, "Network band: 95 % of what the simulator would give; not of a blast."
    )


def _colours(sheet: Worksheet, state: str) -> None:
    from openpyxl.formatting.rule import CellIsRule
    from openpyxl.styles import PatternFill

    for word, colour in (("inside", "C6E7C8"), ("unusual together", "FFE6A8"),
                         ("outside", "F6C1BC"), ("impossible", "F6C1BC")):  # fmt: skip
        fill = PatternFill("solid", bgColor=colour, fgColor=colour)
        rule = CellIsRule(operator="equal", formula=[f'"{word}"'], fill=fill)
        sheet.conditional_formatting.add(state.replace("$", ""), rule)


def _same_bytes(book: Workbook) -> bytes:
    """Save without the moment of saving: equal networks give equal bytes."""
    first, second = io.BytesIO(), io.BytesIO()
    book.save(first)
    with zipfile.ZipFile(first) as old, zipfile.ZipFile(second, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "docProps/core.xml":
                pattern = rb"(<dcterms:(?:created|modified)[^>]*>)[^<]*"
                content = re.sub(pattern, rb"\g<1>" + _MOMENT.encode(), content)
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            new.writestr(entry, content)
    return second.getvalue()
