"""Tables of designs: every row answered as if alone, in its place and under its id."""

from __future__ import annotations

import csv
import io
import time
from pathlib import Path

import numpy as np
import pytest

from castblast.errors import SpecError
from castblast.prediction.answer import load_network, predict
from castblast.stages.predict_table import PredictionTable, predict_csv

DATA = Path(__file__).parents[1] / "data" / "designs"
NETWORK = load_network()
#: Cells that a row gives; blank ones are completed from the others.
ROWS = [
    {"explosive": "anfo", "burden": "3", "ucs": "80"},
    {"explosive": "ANFO", "burden": "3.5", "charge_length": "9.8", "bench_height": "12.5"},
    {"explosive": "heavy_anfo", "spacing": "4", "stemming_length": "2.5"},
    {"burden": "4", "stemming_length": "2", "charge_length": "10.5", "bench_height": "12.5"},
    {"explosive": "Heavy ANFO", "burden": "8", "ucs": "300", "hole_diameter": "0.3"},
    {},
]
_UNITS = {"burden": "m", "ucs": "MPa", "charge_length": "m", "bench_height": "m",
          "spacing": "m", "stemming_length": "m", "hole_diameter": "m"}  # fmt: skip


def table_of(rows: list[dict[str, str]], ids: list[str]) -> str:
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(["Hole ID", "explosive", *(f"{n} [{u}]" for n, u in _UNITS.items())])
    for label, row in zip(ids, rows, strict=True):
        writer.writerow([label, row.get("explosive", ""), *(row.get(n, "") for n in _UNITS)])
    return buffer.getvalue()


def predicted(folder: Path, text: str, **options: object) -> PredictionTable:
    path = folder / "designs.csv"
    path.write_text(text, encoding="utf-8")
    return predict_csv(path, **options)


def test_every_row_is_answered_as_if_alone(tmp_path: Path) -> None:
    """Blank cells are completed from their own row; ids and their order stay."""
    ids = ["B-7", "=1+1", "a,b", "B-7", 'say "x"', "6"]
    found = predicted(tmp_path, table_of(ROWS, ids))
    lines = list(csv.DictReader(io.StringIO(found.text)))
    assert [line["Hole ID"] for line in lines] == ["B-7", "'=1+1", *ids[2:]]
    assert [row["id"] for row in found.rows] == ids
    factor = {"MPa": 1e6, "m": 1.0}
    for row, line, document in zip(ROWS, lines, found.rows, strict=True):
        values = {n: float(row[n]) * factor[u] for n, u in _UNITS.items() if n in row}
        alone = predict(values, row.get("explosive", "anfo"), NETWORK)
        assert set(document) == {"id", *alone}
        # Sums over one row and over many are rounded in another order.
        for name in NETWORK.output_names:
            assert document[name] == pytest.approx(alone[name], rel=1e-12)
        for part in ("explosive", "inputs", "domain", "out_of_domain", "domain_faults", "model"):
            assert document[part] == alone[part]
        assert line["domain"] == alone["domain"]
        assert line["out_of_domain"].split() == alone["out_of_domain"]
        assert float(line["burden_velocity [m s-1]"]) == pytest.approx(
            alone["burden_velocity"], rel=1e-7
        )
        upper = float(line["burden_velocity_prediction_upper [m s-1]"])
        assert upper == pytest.approx(
            alone["prediction_band"]["burden_velocity"]["upper"], rel=1e-3
        )


def test_charge_and_stemming_are_one_design() -> None:
    """The same holes by charge and by stemming: numbers, verdict and bands, to the last figure."""
    by_charge = predict_csv(DATA / "designs_charge.csv").text
    by_stemming = predict_csv(DATA / "designs_stemming.csv").text
    assert by_charge == by_stemming
    assert ",inside," in by_charge.splitlines()[1]


def test_inputs_beside_the_table_hold_for_all_rows(tmp_path: Path) -> None:
    text = "burden [m]\n3\n4\n"
    found = predicted(tmp_path, text, explosive="heavy_anfo", common={"ucs": 8e7})
    assert [row["inputs"]["ucs"] for row in found.rows] == [8e7, 8e7]
    assert {row["explosive"] for row in found.rows} == {"heavy_anfo"}
    with pytest.raises(SpecError, match="the table has a column 'burden'; leave it out beside"):
        predicted(tmp_path, text, common={"burden": 3.0})


def test_faults_name_line_and_id(tmp_path: Path) -> None:
    rows = [{}, {"burden": "80"}, {"stemming_length": "14", "bench_height": "12.5"}]
    with pytest.raises(SpecError) as caught:
        predicted(tmp_path, table_of(rows[:2], ["A", "B"]))
    assert "designs.csv: line 3 (Hole ID 'B'): burden: 80 m: implausible" in str(caught.value)
    with pytest.raises(SpecError) as caught:
        predicted(tmp_path, table_of([*rows[::2], {"explosive": "annfo"}], ["A", "C", "D"]))
    assert "line 4 (Hole ID 'D'): explosive 'annfo'" in str(caught.value)
    with pytest.raises(SpecError) as caught:
        predicted(tmp_path, table_of(rows[::2], ["A", "C"]))
    assert "line 3 (Hole ID 'C'): charge_length" in str(caught.value)
    assert "leaves no room" in str(caught.value)
    with pytest.raises(SpecError) as caught:
        predicted(tmp_path, "stemming_length [m]\n" + "14\n" * 5000)
    assert len(str(caught.value).splitlines()) == 21
    assert str(caught.value).endswith("... and 4980 more lines")


def test_many_rows_take_no_time_each(tmp_path: Path) -> None:
    """A row of a table costs some 20 us, not the millisecond of a single prediction."""
    rng = np.random.default_rng(0)
    burden, ucs = rng.uniform(2.0, 9.0, 20_000), rng.uniform(40.0, 200.0, 20_000)
    lines = [f"H{k},anfo,{b:.3f},{s:.2f}" for k, (b, s) in enumerate(zip(burden, ucs, strict=True))]
    text = "id,explosive,burden [m],ucs [MPa]\n" + "\n".join(lines) + "\n"
    start = time.process_time()
    found = predicted(tmp_path, text).text
    assert time.process_time() - start < 3.0
    last = found.splitlines()[-1].split(",")
    assert last[:2] == ["H19999", "anfo"]
