"""The rule of a design as formulas, calculated as a worksheet would, against the rule itself."""

from __future__ import annotations

import re
from io import BytesIO

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from castblast.design.rule import fault_columns
from castblast.export.sheet.design import write_refusals
from castblast.export.sheet.workbook import INPUT_TOP, TOP, to_excel
from castblast.prediction.answer import load_network

openpyxl = pytest.importorskip("openpyxl")
NETWORKS = {name: load_network(name) for name in ("full", "paper")}


class Text(str):
    """A text of a formula; ``&`` joins."""

    def __and__(self, other):
        return Text(f"{self}{other}")

    def __rand__(self, other):
        return Text(f"{other}{self}")


class Number(float):
    """A number that ``&`` turns into text."""

    def __and__(self, other):
        return Text(f"{float(self):.12g}{other}")

    def __rand__(self, other):
        return Text(f"{other}{float(self):.12g}")


FUNCTIONS = {
    "IF": lambda condition, yes, no: yes if condition else no,
    "IFERROR": lambda value, _: value,
    "AND": lambda *parts: all(parts),
    "ABS": abs,
    "MAX": lambda *parts: max(parts),
    "ROUND": lambda value, places: Number(round(value, places)),
    "Text": Text,
}


def calculated(formula: str, cells: dict[str, float]) -> str:
    """Value of a formula of the few functions and operators that the rule needs."""
    parts = re.split(r'("(?:[^"]|"")*")', formula.removeprefix("="))
    for i, part in enumerate(parts):
        if i % 2:
            parts[i] = f"Text({part[1:-1]!r})"
        else:
            parts[i] = re.sub(r"\$([A-Z]+)\$(\d+)", lambda m: f"({cells[m[1] + m[2]]!r})", part)
    return eval("".join(parts), {"__builtins__": {}}, FUNCTIONS)


SHAPE = {
    "bench_height": st.floats(0.5, 30.0),
    "burden": st.floats(0.1, 12.0),
    "spacing": st.floats(0.2, 15.0),
    "stemming_length": st.floats(0.0, 14.0),
    "charge_length": st.floats(0.05, 25.0),
    "hole_diameter": st.floats(0.05, 0.6),
    "friction_angle": st.floats(0.1, 1.2),
    "dilation_angle": st.floats(0.0, 0.6),
    "ucs": st.floats(1e5, 1e9),
}


@pytest.mark.parametrize("name", sorted(NETWORKS))
@given(st.fixed_dictionaries(SHAPE))
@settings(max_examples=80, deadline=None)
def test_a_worksheet_refuses_as_the_rule_does(name, values) -> None:
    """As many reasons as the rule gives, about the same inputs in the same order."""
    network = NETWORKS[name]
    sheet = openpyxl.Workbook().active
    addresses = {n: f"${openpyxl.utils.get_column_letter(i)}$4"
                 for i, n in enumerate(network.input_names, 2)}  # fmt: skip
    write_refusals(network, sheet, 7, addresses)
    example = {c.name: 0.5 * (c.lower + c.upper) for c in network.inputs}
    row = {n: values.get(n, example[n]) for n in network.input_names}
    cells = {addresses[n].replace("$", ""): value for n, value in row.items()}
    said = [calculated(line[0].value, cells) for line in sheet.iter_rows(min_row=8)]
    said = [text.strip() for text in said if text]
    faults = [fault.say(0) for fault in fault_columns(row, 1) if fault.rows[0]]
    assert sorted(text.split()[0] for text in said) == sorted(
        re.split(r"[_ ]", fault)[0] for fault in faults
    )
    for text in said:
        assert "_" not in text
        assert text.endswith(".")


def test_the_reasons_take_the_place_of_values() -> None:
    book = openpyxl.load_workbook(BytesIO(to_excel(NETWORKS["full"])["model.xlsx"]))
    predict, working = book["Predict"], book["Working"]
    bottom = INPUT_TOP + len(NETWORKS["full"].inputs)
    lines = {row[0].value: row for row in predict.iter_rows() if row[0].value}
    reasons = lines["Design"][1].value
    places = re.findall(r"'Working'!\$A\$(\d+)", reasons.split('"possible"')[0])
    assert len(places) > len(NETWORKS["full"].inputs)
    assert all(working[f"A{row}"].value.startswith("=IFERROR(IF(") for row in places)
    assert f'IF($B${bottom + 3}="possible"' in lines["Domain"][1].value
    velocity = lines["final velocity of the burden"]
    assert all('="impossible","no value"' in velocity[i].value for i in (1, 2, 3, 5, 6))
    assert working.cell(TOP + 3, 1).value.startswith("Why no bench")
