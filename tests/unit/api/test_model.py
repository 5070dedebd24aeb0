"""Models and tables of designs from Python: DataFrames in and out, one line for a fault."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

import castblast as cb
from castblast.errors import CastblastError, SpecError
from castblast.prediction.answer import load_network, predict


@pytest.fixture(scope="module")
def model() -> "cb.Model":
    return cb.load_model("full")


def test_a_table_is_answered_as_single_designs(model: "cb.Model") -> None:
    designs = pd.DataFrame(
        {
            "burden": ["4 m", np.nan, "350 cm"],
            "ucs": [8e7, 4e8, np.nan],
            "explosive": pd.array(["anfo", "HANFO", None], dtype="string"),
        },
        index=["x", "y", "z"],
    )
    answer = model.predict(designs)
    assert list(answer.index) == ["x", "y", "z"]
    for label, given, explosive in (
        ("x", {"burden": 4.0, "ucs": 8e7}, "anfo"),
        ("y", {"ucs": 4e8}, "heavy_anfo"),
        ("z", {"burden": 3.5}, "anfo"),
    ):
        one = predict(given, explosive, load_network(Path("full")))
        row = answer.loc[label]
        for name, ends in one["prediction_band"].items():
            assert row[name] == pytest.approx(one[name], rel=1e-13)
            assert row[f"{name}_prediction_lower"] == pytest.approx(ends["lower"], rel=1e-13)
            assert row[f"{name}_prediction_upper"] == pytest.approx(ends["upper"], rel=1e-13)
        assert row["domain"] == one["domain"]
        assert row["at_fault"] == " ".join(one["out_of_domain"])
    assert answer.attrs["units"]["burden_velocity"] == "m s-1"


def test_answers_and_runs_can_be_asked_again(model: "cb.Model") -> None:
    designs = cb.sample("full", 6)
    runs = cb.simulate_many(designs)
    answer = model.predict(designs)
    error = np.abs(answer["burden_velocity"].to_numpy() / runs.burden_velocity.to_numpy() - 1.0)
    assert error.max() < 0.03
    joined = designs.join(answer)
    assert model.predict(joined).equals(answer)


@pytest.mark.parametrize(
    ("designs", "field", "words"),
    [
        ({"burdn": [3.0]}, "burdn", "did you mean 'burden'"),
        ({"ucs": ["80 MPa", "80 m"]}, "ucs", "row 1: ucs: 80 m: 'm' is a length"),
        ({"ucs": ["80 MPa", "80"]}, "ucs", "row 1: ucs: 80: no unit given"),
        ({"ucs": [8e7, 80.0]}, "ucs", "row 1: ucs 8e-05 MPa is not plausible"),
        ({"burden": 4.0, "charge_length": [5.0, 40.0]}, "charge_length", "row 1: charge_length"),
        ({"burden": [4.0], "explosive": ["dynamite"]}, "explosive", "row 0: explosive 'dynamite'"),
        ({"burden": [4.0, 5.0], "ucs": [8e7, 8e7, 8e7]}, "burden", "2 values, other columns"),
    ],
)
def test_a_faulty_table_is_refused_in_one_line(
    model: "cb.Model", designs: dict[str, object], field: str, words: str
) -> None:
    with pytest.raises(CastblastError) as caught:
        model.predict(designs)
    (line,) = str(caught.value).splitlines()
    assert words in line
    assert caught.value.field == field
    assert caught.value.allowed is not None


def test_an_index_that_names_no_rows_is_refused(model: "cb.Model") -> None:
    with pytest.raises(SpecError, match="labels of mixed kinds \\(int, str\\)") as caught:
        model.predict(pd.DataFrame({"burden": [3.0, 4.0]}, index=[1, "b"]))
    assert caught.value.field == "index"
    levels = pd.MultiIndex.from_tuples([("a", 1), ("a", 2)])
    with pytest.raises(SpecError, match="2 levels"):
        model.predict(pd.DataFrame({"burden": [3.0, 4.0]}, index=levels))
    twice = pd.DataFrame([[3.0, 4.0]], columns=["burden", "burden"])
    with pytest.raises(SpecError, match="two columns"):
        model.predict(twice)
    with pytest.raises(SpecError, match="is not a table"):
        model.predict("burden")


def test_an_explosive_is_given_once(model: "cb.Model") -> None:
    with pytest.raises(SpecError, match="given twice"):
        model.predict({"burden": [4.0], "explosive": ["anfo"]}, "anfo")


def test_a_saved_model_is_the_same(model: "cb.Model", tmp_path: Path) -> None:
    designs = cb.sample("full", 4)
    for place in (tmp_path / "mine.json", str(tmp_path / "folder")):
        again = cb.load_model(model.save(place))
        assert again.predict(designs).equals(model.predict(designs))
    with pytest.raises(SpecError, match=r"none\.json"):
        cb.load_model(tmp_path / "none.json")


def test_what_a_model_says_of_itself(model: "cb.Model") -> None:
    assert list(model.explosives.index) == list(model.network.explosives)
    assert model.explosives["density"].notna().all()
    assert (model.outputs["prediction_factor"] > 1.1).all()
    assert (model.outputs["network_band"] < 0.02).all()
    assert model.inputs.loc["burden", "unit"] == "m"
    text = " ".join(ElementTree.fromstring(model._repr_html_()).itertext())
    assert "prediction band" in text
    assert "network band" in text
    lower, upper = (model.inputs.loc["ucs", end] * 1e-6 for end in ("lower", "upper"))
    assert f"{lower:.3g} to {upper:.3g} MPa" in text


def test_a_missing_library_is_named(model: "cb.Model", monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("castblast.api.shared.frames.is_installed", lambda name: name != "pandas")
    with pytest.raises(CastblastError, match=r'pip install "castblast\[data\]"'):
        model.predict({"burden": [4.0]})
    with pytest.raises(CastblastError, match="pandas"):
        cb.explosives()
