"""The one reader of tables: the same numbers however a table is saved, every fault by its line."""

from __future__ import annotations

import codecs
import math
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from castblast.errors import SpecError
from castblast.specs.quantity import QuantityIn, VariableIn
from castblast.specs.tables.table import ID_HEADS, Form, Table, read_table
from castblast.specs.tables.text import LONGEST_LINE, MOST_COLUMNS

FORM = Form(
    columns={
        "x": "m",
        "delay": QuantityIn("s", 0.0, 10.0),
        "direction": QuantityIn("rad", -math.pi / 2, math.pi / 2),
        "hole_diameter": VariableIn("hole_diameter"),
        "share": "1",
    },
    required=("x",),
    texts=("explosive",),
    aliases={"firing_time": "delay"},
    ids=ID_HEADS,
)
PLAIN = "x [m],delay [ms],explosive\n-1.5,0,anfo\n4.25,42,\n"


def read(folder: Path, text: str | bytes, form: Form = FORM) -> Table:
    path = folder / "table.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_table(path, form)


def said(folder: Path, text: str | bytes, form: Form = FORM) -> str:
    with pytest.raises(SpecError) as caught:
        read(folder, text, form)
    return str(caught.value).replace(f"{folder / 'table.csv'}: ", "")


SAVED = {
    "plain": PLAIN,
    "windows line ends": PLAIN.replace("\n", "\r\n"),
    "old Mac line ends": PLAIN.replace("\n", "\r"),
    "mark": codecs.BOM_UTF8 + PLAIN.encode(),
    "UTF-16 LE": codecs.BOM_UTF16_LE + PLAIN.encode("utf-16-le"),
    "UTF-16 BE": codecs.BOM_UTF16_BE + PLAIN.encode("utf-16-be"),
    "UTF-16 without a mark": PLAIN.encode("utf-16-le"),
    "UTF-32": codecs.BOM_UTF32_LE + PLAIN.encode("utf-32-le"),
    "tabs": PLAIN.replace(",", "\t"),
    "semicolons": PLAIN.replace(",", ";"),
    "decimal commas": PLAIN.replace(",", ";").replace(".", ","),
    "decimal commas, tabs": PLAIN.replace(",", "\t").replace(".", ","),
    "separator said": "sep=;\n" + PLAIN.replace(",", ";"),
    "round units": PLAIN.replace("[", "(").replace("]", ")"),
    "units below": "x,delay,explosive\nm,ms,\n-1.5,0,anfo\n4.25,42,\n",
    "units below, in brackets": "x,delay,explosive\n[m],[ms],\n-1.5,0,anfo\n4.25,42,\n",
    "units behind numbers": "x,delay,explosive\n-1.5 m,0 s,anfo\n425 cm,42ms,\n",
    "units and decimal commas": "x;delay;explosive\n-1,5 m;0 s;anfo\n425,0 cm;42ms;\n",
    "blank ends": "x [m],delay [ms],explosive,,\n-1.5,0,anfo,,\n4.25,42,,,\n,,,,\n\n",
    "remarks": "# made by hand\n" + PLAIN.replace("\n4", '\n# a, "remark\n   # more\n4'),
    "quotation marks": '"x [m]","delay [ms]","explosive"\n"-1.5","0","anfo"\n"4.25","42",""\n',
    "blanks around": PLAIN.replace(",", " , "),
    "case and words": PLAIN.replace("x [m]", "X [m]").replace("delay", "Firing Time"),
    "order": "delay [ms],explosive,x [m]\n0,anfo,-1.5\n42,,4.25\n",
    "exponents": PLAIN.replace("-1.5", "-15e-1").replace("4.25", "+.425E1"),
    "feet": f"x [ft],delay [s],explosive\n{-1.5 / 0.3048!r},0,anfo\n{4.25 / 0.3048!r},0.042,\n",
}


@pytest.mark.parametrize("saved", SAVED.values(), ids=SAVED)
def test_the_same_table_however_it_is_saved(saved: str | bytes, tmp_path: Path) -> None:
    table = read(tmp_path, saved)
    assert table.number["x"].tolist() == pytest.approx([-1.5, 4.25], rel=1e-15)
    assert table.number["delay"].tolist() == [0.0, 0.042]
    assert table.text == {"explosive": ["anfo", ""]}


def test_latin_1_and_degrees(tmp_path: Path) -> None:
    text = "x [m],direction [°],name\n1,30,Böschung\n"
    for encoding in ("utf-8", "latin-1", "cp1252"):
        table = read(tmp_path, text.encode(encoding))
        assert table.number["direction"].tolist() == [math.radians(30.0)]
        assert table.label == ["Böschung"]


def test_blanks_between_cells(tmp_path: Path) -> None:
    table = read(tmp_path, "x [m]  delay (ms)\n  -1.5   0\n4.25 42\n")
    assert table.number["delay"].tolist() == [0.0, 0.042]


@pytest.mark.parametrize(
    "heads", ["# x share\n", "#x share\n", "// x share\n", "#format x_share\n"]
)
def test_heads_in_a_remark(heads: str, tmp_path: Path) -> None:
    bare = Form(columns={"x": "m", "share": "1"}, required=("x",), bare=True)
    table = read(tmp_path, "# notes\n" + heads + "1.5 2\n3 4\n", bare)
    assert table.number["x"].tolist() == [1.5, 3.0]
    assert table.line.tolist() == [3, 4]


def test_ids_lines_and_empty_cells(tmp_path: Path) -> None:
    text = "hole;x [m];delay [ms]\n# north\nH1;1;\n\nH2;2;42\n"
    table = read(tmp_path, text)
    assert table.label == ["H1", "H2"]
    assert table.line.tolist() == [3, 5]
    assert math.isnan(table.number["delay"][0])
    assert table.where(1).endswith("table.csv: line 5 (hole 'H2')")
    first = read(tmp_path, ",x [m]\n0,5\n1,6\n")
    assert (first.label, first.number["x"].tolist()) == (["0", "1"], [5.0, 6.0])


FAULTS = {
    "no unit": ("x,share\n1,2\n", "column 'x': no unit given; a length is needed, such as '3 m'"),
    "wrong unit": ("x [kg]\n1\n", "line 1: column 'x [kg]': 'kg' is a mass; a length is needed"),
    "wrong unit below": ("x,delay\nm,kg\n1,2\n", "line 2: column 'delay': 'kg' is a mass"),
    "unknown": ("x [m],dely [s]\n1,2\n", "'dely [s]': unknown column, did you mean 'delay'?"),
    "twice": ("x [m],X [m]\n1,2\n", "line 1: column 'X [m]': given twice"),
    "no head": ("x [m],,share\n1,2,3\n", "line 2: '2' has no head"),
    "missing": ("share\n1\n", "the column 'x' is missing"),
    "heads only": ("x [m]\n", "has a header but no data rows"),
    "units only": ("x\nm\n", "holds heads and units only"),
    "numbers only": ("1,2,3\n4,5,6\n", "line 1: holds 3 numbers where the heads of 3 columns"),
    "empty": ("\n , ,\n# nothing\n", "is empty"),
    "too few": ("x [m],share\n1\n", "line 2: 1 cells for 2 heads"),
    "too many": ("x [m],share\n1,2,3\n", "line 2: 3 cells for 2 heads"),
    "commas everywhere": ("x [m],share\n1,5,2,5\n", "4 cells for 2 heads; decimal commas need ';'"),
    "empty cell": ("x [m],share\n,2\n", "line 2: x: empty: a number is needed"),
    "thousands": ('x [m]\n"1,260"\n', "line 2: x: 1,260: a number is needed, without thousands"),
    "thousands too": ("x [m];share\n1,260;0.5\n", "1,260: a comma in a file with decimal points"),
    "both signs": ("x [m];share\n1.260,5;2\n", "x: 1.260,5: a number is needed, without thousands"),
    "comma in quotes": ('x [m]\n"1,5"\n', "1,5: a number is needed, with a decimal point, or with"),
    "imperial": ("x [in]\n6 1/4\n", "line 2: x: 6 1/4: a number is needed"),
    "fortran": ("x [m]\n1.5D+00\n", "1.5D+00: a number is needed; write its exponent with e"),
    "underscore": ("x [m]\n1_000\n", "line 2: x: 1_000: a number is needed"),
    "nan": ("x [m]\nnan\n", "line 2: x: nan: a number is needed"),
    "inf": ("x [m]\ninf\n", "line 2: x: inf: a number is needed"),
    "too large": ("x [m]\n1e999\n", "line 2: x: 1e999: is too large for a number"),
    "two units": ("x [mm]\n3 m\n", "line 2: x: 3 m: a number is needed"),
    "unknown unit": ("x\n3 furlong\n", "line 2: x: 3 furlong: unknown unit 'furlong'"),
    "beyond": ("x [m],delay [ms]\n1,10001\n", "10001 ms: implausible (10.001 s); allowed: 0"),
    "angle": ("x [m],direction [deg]\n1,175.94\n", "175.94 deg: implausible (175.94 deg)"),
    "variable": ("x [m],hole_diameter [m]\n1,3\n", "3 m: implausible (3000 mm); allowed: 20"),
    "of an id": ("hole,x [m]\nH7,nan\n", "line 2 (hole 'H7'): x: nan: a number is needed"),
    "quotation mark": ('x [m]\n"1\n2\n', "not valid CSV: unexpected end of data"),
    "no text": (b"x [m]\n\x001\n", "holds bytes that are not text; save it as UTF-8"),
    "cut UTF-16": (codecs.BOM_UTF16_LE + b"x\x00[", "is not a text file in UTF-16-LE; save it as"),
    "undefined byte": (b"x [m]\n1\n\x81\n", "is not a text file in UTF-8 or Windows-1252"),
    "workbook": (b"PK\x03\x04rest", "is a workbook or another zip archive; save its sheet as CSV"),
    "array": (b"\x93NUMPY\x01", "is an array of NumPy (.npy)"),
    "xml": ("<?xml version='1.0'?>", "is XML, such as IREDES"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "line"), FAULTS.values(), ids=FAULTS)
def test_faults_are_named(text: str | bytes, line: str, tmp_path: Path) -> None:
    words = said(tmp_path, text)
    assert line in words
    assert len(words.splitlines()) <= 2


def test_bounds_are_those_of_yaml(tmp_path: Path) -> None:
    """A column and a field of one rule refuse and accept the same values, the ends included."""
    for written, fine in (("90", True), ("-90", True), ("90.1", False)):
        rule = FORM.columns["direction"]
        assert isinstance(rule, QuantityIn)
        text = f"x [m],direction [deg]\n1,{written}\n"
        if fine:
            assert read(tmp_path, text).number["direction"][0] == rule.parse(f"{written} deg")
            continue
        with pytest.raises(ValueError, match="allowed: -90 to 90 deg"):
            rule.parse(f"{written} deg")
        assert "allowed: -90 to 90 deg" in said(tmp_path, text)


def test_ids_that_must_be_single(tmp_path: Path) -> None:
    form = Form(columns={"x": "m"}, ids=ID_HEADS, unique_ids=True, bare=True)
    words = said(tmp_path, "hole,x\nH1,1\nH2,2\nH1,3\n,4\n", form)
    assert words.splitlines() == ["lines 2 and 4: hole 'H1': given twice", "line 5: hole: empty"]


def test_at_most_twenty_faults(tmp_path: Path) -> None:
    words = said(tmp_path, "x [m]\n" + "a\n" * 100_000).splitlines()
    assert len(words) == 21
    assert words[-1] == "... and 99980 more"


def test_columns_that_the_user_maps(tmp_path: Path) -> None:
    text = "Hole Name,Collar X,Colour,Time\nA,1,red,25\nB,2,blue,50\n"
    form = Form(FORM.columns, ("x", "delay"), ids=("hole_name",),
                chosen={"x": "Collar X [m]", "delay": "Time [ms]"})  # fmt: skip
    table = read(tmp_path, text, form)
    assert table.number["delay"].tolist() == [0.025, 0.05]
    assert table.label == ["A", "B"]
    wrong = Form(FORM.columns, ("x",), chosen={"x": "Colar X [m]"})
    assert "no column 'Colar X' for 'x', did you mean 'Collar X'?" in said(tmp_path, text, wrong)
    numbered = Form(FORM.columns, ("x", "delay"), ids=ID_HEADS,
                    chosen={"x": "2 [m]", "delay": "4 [ms]", "id": "1"})  # fmt: skip
    for headless in (text, text.split("\n", 1)[1]):
        table = read(tmp_path, headless, numbered)
        assert table.number["x"].tolist() == [1.0, 2.0]
        assert table.label == ["A", "B"]


def test_a_hostile_table_is_one_line_at_once(tmp_path: Path) -> None:
    start = time.process_time()
    long = said(tmp_path, b"x [m]\n" + b"1," * (50 * 2**20) + b"\n")
    assert long == f"line 2: {100 * 2**20 + 1:,} characters; at most {LONGEST_LINE:,}"
    wide = said(tmp_path, "x," * 200_000 + "x\n1\n")
    assert wide == f"line 1: 200,001 columns; at most {MOST_COLUMNS:,}"
    cell = said(tmp_path, "x [m]\n" + "1" * 200_000 + "\n")
    assert cell.startswith("line 2: not valid CSV: field larger than field limit")
    assert time.process_time() - start < 10.0


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=20), st.sampled_from(";\t,"))
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_numbers_read_back_to_the_same_bits(
    tmp_path: Path, values: list[float], separator: str
) -> None:
    rows = "".join(f"{value!r}{separator}{k}\n" for k, value in enumerate(values))
    text = f"x [m]{separator}share\n{rows}"
    assert read(tmp_path, text).number["x"].tolist() == values
    if separator != ",":
        assert read(tmp_path, text.replace(".", ",")).number["x"].tolist() == values
