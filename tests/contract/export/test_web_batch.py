"""Tables in the web page: read as `castblast predict --csv` reads them, with the same answers."""

import json
from functools import partial

import pytest
from page_scripts import ask, page_scripts

from castblast.prediction.answer import load_network
from castblast.stages.predict_table import predict_csv

NETWORK = load_network()
evaluated = partial(ask, page_scripts(NETWORK))


DESIGNS = "id;explosive;burden [m];ucs [MPa];bench_height [m]\nH1;anfo;3,5;80;10\nH2;ANFO;4;;12,5\n"
TABLES = {
    "semicolons and decimal commas": DESIGNS,
    "a mark": "\ufeff" + DESIGNS,
    "commas": DESIGNS.replace(",", ".").replace(";", ","),
    "tabs": DESIGNS.replace(";", "\t"),
    "round brackets": DESIGNS.replace("[", "(").replace("]", ")"),
    "remarks": "# made by hand\n" + DESIGNS.replace("\nH2", "\n# more\n\nH2"),
    "separator said": "sep=;\n" + DESIGNS,
    "windows line ends": DESIGNS.replace("\n", "\r\n"),
    "blank ends": DESIGNS.replace("\n", ";;\n") + ";;;\n",
    "units below": "id;explosive;burden;ucs;bench_height\n;;m;MPa;m\n" + DESIGNS.split("\n", 1)[1],
    "other heads": DESIGNS.replace("id;", "Hole ID;")
    .replace("burden", "Burden")
    .replace("_h", " H"),
    "units behind numbers": "id;explosive;burden;ucs;bench_height\nH1;anfo;350 cm;80 MPa;10 m\n"
    "H2;ANFO;4m;;12,5 m\n",
}


@pytest.mark.parametrize("text", TABLES.values(), ids=TABLES)
def test_a_table_is_read_as_predict_reads_it(text: str, tmp_path) -> None:
    """Ids, order, what is completed and the answers: the page against `predict --csv`."""
    found = evaluated(f"answerBatch({json.dumps(text)})")
    assert found["faults"] == []
    path = tmp_path / "designs.csv"
    path.write_text(text, encoding="utf-8", newline="")
    rows = predict_csv(path).rows
    assert [row[0] for row in found["rows"]] == ["H1", "H2"] == [row["id"] for row in rows]
    for cells, row in zip(found["rows"], rows, strict=True):
        shown = dict(zip(found["header"][1:], cells[1:], strict=True))
        assert shown["explosive"] == row["explosive"]
        assert shown["domain"] == row["domain"]
        for column in (*NETWORK.inputs, *NETWORK.outputs):
            value = row["inputs"].get(column.name, row.get(column.name))
            assert shown[f"{column.name} [{column.unit}]"] == pytest.approx(value, rel=1e-9)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("burden\n3\n", "line 2: burden: 3: no unit given, such as m"),
        ("burden [kg]\n3\n", "line 1: column 'burden [kg]': unit 'kg' is not known"),
        ("burdn [m]\n3\n", "line 1: column 'burdn [m]': unknown column"),
        ("burden [m],Burden [m]\n3,3\n", "line 1: column 'Burden [m]': given twice"),
        ('burden [m]\n"1,260"\n', "line 2: burden: 1,260: a number is needed, without thousands"),
        ("hole;burden [m]\nH7;x\n", "line 2 (hole 'H7'): burden: x: a number is needed"),
        ("burden [m],ucs [MPa]\n3\n", "line 2: 1 cells for 2 heads"),
        ("burden [m]\n", "holds heads only; at least one row is needed"),
        ("explosive,burden [m]\nannfo,3\n", "line 2: explosive 'annfo' is not one of"),
        ("burden [m];ucs [MPa]\n1,260;80.5\n", "a comma beside decimal points"),
        ("charge_length [m],stemming_length [m]\n5,2.5\n", "this network was trained on"),
    ],
)  # fmt: skip
def test_faults_of_a_table_are_named(text: str, line: str) -> None:
    found = evaluated(f"answerBatch({json.dumps(text)})")
    assert found["rows"] == []
    assert line in found["faults"][0]


def test_answers_are_no_formulas() -> None:
    text = "id,burden [m]\n=1+1,3\n-12,3\n"
    answers = f"answerBatch({json.dumps(text)})"
    lines = evaluated(f"((a) => csvText(a.header, a.rows))({answers})").splitlines()
    assert lines[1].startswith("'=1+1,anfo,")
    assert lines[2].startswith("-12,anfo,")


def test_encodings_of_a_table() -> None:
    text = "name;burden [m]\nBöschung;3,5\n"
    for data in (
        text.encode(),
        text.encode("cp1252"),
        b"\xff\xfe" + text.encode("utf-16-le"),
        b"\xfe\xff" + text.encode("utf-16-be"),
    ):
        found = evaluated(f"decoded(new Uint8Array({list(data)}).buffer)")
        assert found.removeprefix("\ufeff") == text
