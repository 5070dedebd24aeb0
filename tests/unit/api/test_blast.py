"""One blast and many from Python: units in, the same bits as the physics, tables out."""

import pickle
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from matplotlib.figure import Figure

import castblast as cb
from castblast.blast.run import make_case, result_values, run_blast
from castblast.errors import CastblastError, CheckError, SpecError
from castblast.specs.explosive import load_explosive


@pytest.fixture(scope="module")
def blast() -> "cb.api.blast.Blast":
    return cb.simulate("anfo", burden="4 m", ucs="80 MPa")


def test_the_physics_answers_to_the_bit(blast: "cb.api.blast.Blast") -> None:
    case = make_case(load_explosive("anfo").to_explosive(), {"burden": 4.0, "ucs": 8e7})
    truth = result_values(run_blast(case))
    assert {name: q.value for name, q in blast.outputs.items()} == truth


@pytest.mark.parametrize(
    ("burden", "ucs"),
    [
        (4.0, 8e7),
        (4, np.float32(8e7)),
        (np.array(4.0), "80 MPa"),
        ("400 cm", xr.DataArray(80.0, attrs={"units": "MPa"})),
        (np.int64(4), np.array([8e7])[0]),
    ],
)
def test_a_value_may_be_written_in_many_ways(
    blast: "cb.api.blast.Blast", burden: object, ucs: object
) -> None:
    other = cb.simulate("ANFO", burden=burden, ucs=ucs)
    assert other.burden_velocity == blast.burden_velocity


def test_quantities_of_pint(blast: "cb.api.blast.Blast") -> None:
    import pint

    registry = pint.UnitRegistry()
    other = cb.simulate(burden=4 * registry.meter, ucs=registry.Quantity(80, "megapascal"))
    assert other.burden_velocity == blast.burden_velocity
    with pytest.raises(SpecError, match=r"ucs: .*a length"):
        cb.simulate(ucs=4 * registry.meter)


def test_an_explosive_file_as_text_or_path(repository: Path) -> None:
    path = repository / "data_specs/explosives/heavy_anfo.yaml"
    velocities = {
        float(cb.simulate(given, burden=4.0).burden_velocity)
        for given in (path, str(path), "Heavy ANFO")
    }
    assert len(velocities) == 1


def test_histories_end_where_the_outputs_say(blast: "cb.api.blast.Blast") -> None:
    near, burden = blast.near_field, blast.burden
    assert near.hole_radius.attrs["units"] == "m"
    assert near.time.attrs["units"] == burden.time.attrs["units"] == "s"
    assert float(near.time[-1]) == blast.end_time
    assert float(burden.velocity[-1]) == pytest.approx(blast.burden_velocity, rel=1e-12)


def test_the_ledger_adds_up(blast: "cb.api.blast.Blast") -> None:
    shares = blast.ledger.groupby("part")["share"].sum()
    assert shares["near field"] == pytest.approx(1.0 - blast.energy_residual, abs=1e-12)
    assert shares["burden"] == pytest.approx(1.0 - blast.burden_energy_residual, abs=1e-12)


def test_tables_of_a_blast_carry_units(blast: "cb.api.blast.Blast") -> None:
    table, whole = blast.to_frame(), blast.to_xarray()
    assert table.loc["ucs", "value"] == 8e7
    low, high = table.loc["burden_velocity", ["prediction_lower", "prediction_upper"]]
    assert low < blast.burden_velocity < high
    assert whole.burden_velocity.attrs["units"] == "m s-1"
    assert str(whole.explosive.item()) == "anfo"
    assert np.array_equal(whole.burden_velocity_history, blast.burden.velocity)


def test_a_plot_is_a_figure_and_no_file(
    blast: "cb.api.blast.Blast", tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    figure = blast.plot()
    assert isinstance(figure, Figure)
    assert len(figure.axes) == 5
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert not list(tmp_path.iterdir())
    monkeypatch.undo()


def test_html_is_well_formed_and_names_the_band(blast: "cb.api.blast.Blast") -> None:
    page = blast._repr_html_()
    text = " ".join(ElementTree.fromstring(page).itertext())
    assert "prediction band" in text
    assert "5.7 to 18" in text
    assert "burden velocity" in text


def test_html_shows_the_design_and_folds_the_parameters(blast: "cb.api.blast.Blast") -> None:
    page = ElementTree.fromstring(blast._repr_html_())
    (folded,) = page.iter("details")
    heads = [set(part.itertext()) for part in (page, folded)]
    for name in blast.inputs:
        words = name.replace("_", " ")
        assert words in heads[0]
        is_parameter = cb.variables().loc[name, "role"] in ("burden_model", "solver")
        assert (words in heads[1]) == is_parameter


def test_a_blast_cannot_be_changed_and_travels(blast: "cb.api.blast.Blast") -> None:
    with pytest.raises(AttributeError):
        blast.mode = "paper"
    with pytest.raises(AttributeError, match="did you mean 'burden_velocity'"):
        _ = blast.burden_velocty
    again = pickle.loads(pickle.dumps(blast))
    assert again.burden_velocity == blast.burden_velocity
    assert again.burden_velocity.unit == "m s-1"


@pytest.mark.parametrize(
    ("given", "field", "words"),
    [
        ({"ucs": "80 m"}, "ucs", "'m' is a length; a pressure is needed"),
        ({"ucs": "80"}, "ucs", "no unit given"),
        ({"ucs": 80.0}, "ucs", "allowed: 1 to 600 MPa"),
        ({"burdn": 3.0}, "burdn", "did you mean 'burden'"),
        ({"ucs": True}, "ucs", "not a quantity"),
        ({"ucs": [8e7, 9e7]}, "ucs", "not a quantity"),
        ({"mode": "papr"}, "mode", "did you mean 'paper'"),
        ({"tension": "soft"}, "tension", "ductile, brittle, none"),
    ],
)
def test_bad_input_is_one_line_with_its_field(
    given: dict[str, object], field: str, words: str
) -> None:
    with pytest.raises(CastblastError) as caught:
        cb.simulate("anfo", **given)
    (line,) = str(caught.value).splitlines()
    assert words in line
    assert caught.value.field == field
    assert caught.value.allowed is not None
    assert pickle.loads(pickle.dumps(caught.value)).field == field


def test_an_unknown_explosive_names_the_nearest() -> None:
    with pytest.raises(SpecError, match="did you mean 'anfo'") as caught:
        cb.simulate("anfoo")
    assert caught.value.field == "explosive"
    assert "heavy_anfo" in caught.value.allowed


def test_an_inconsistent_explosive_is_refused(tmp_path: Path, repository: Path) -> None:
    text = (repository / "data_specs/explosives/anfo.yaml").read_text()
    path = tmp_path / "odd.yaml"
    path.write_text(text.replace("heat_of_explosion: 3", "heat_of_explosion: 0"))
    assert path.read_text() != text
    with pytest.raises(CheckError):
        cb.simulate(str(path))


def test_many_blasts_are_the_single_ones_to_the_bit(blast: "cb.api.blast.Blast") -> None:
    designs = pd.DataFrame(
        {
            "burden": ["4 m", None, "5 m"],
            "ucs": [8e7, 8e7, 1e8],
            "explosive": ["ANFO", "", "HANFO"],
        },
        index=pd.Index(["a", "b", "c"], name="blast"),
    )
    runs = cb.simulate_many(designs)
    assert list(runs.sample.values) == ["a", "b", "c"]
    assert list(runs.explosive.values) == ["anfo", "anfo", "heavy_anfo"]
    for label, given in (
        ("a", ("anfo", {"burden": 4.0, "ucs": 8e7})),
        ("b", ("anfo", {"ucs": 8e7})),
        ("c", ("heavy_anfo", {"burden": 5.0, "ucs": 1e8})),
    ):
        one = cb.simulate(given[0], **given[1])
        row = runs.sel(sample=label)
        for name, quantity in {**one.inputs, **one.outputs}.items():
            assert float(row[name]) == quantity.value, name
        assert np.array_equal(row.history_pressure, one.near_field.pressure)


def test_many_blasts_from_a_dataset_with_units() -> None:
    given = xr.Dataset(
        {
            "burden": ("case", [4000.0, 5000.0], {"units": "mm"}),
            "ucs": ((), 80.0, {"units": "MPa"}),
        },
        coords={"case": [7, 9]},
    )
    runs = cb.simulate_many(given, "anfo")
    assert runs.burden.values.tolist() == [4.0, 5.0]
    assert runs.sample.values.tolist() == [7, 9]
    again = cb.simulate_many(runs)
    assert np.array_equal(again.burden_velocity, runs.burden_velocity)


def test_a_failed_run_keeps_its_status() -> None:
    runs = cb.simulate_many({"burden": [4.0, 4.0], "outer_radius": [0.0, 0.7], "zones": 100.0})
    assert runs.status.values[0] == "ok"
    for name in ("burden_velocity", "history_pressure"):
        failed = np.isnan(runs[name].values.reshape(2, -1)).all(axis=1)
        assert failed.tolist() == (runs.status.values != "ok").tolist()


def test_designs_of_a_recipe_are_drawn_as_by_generate() -> None:
    designs = cb.sample("paper", 16)
    assert len(designs) == 16
    assert designs.equals(cb.sample(Path("paper"), 16))
    assert not designs.equals(cb.sample("paper", 16, seed=7))
    assert cb.sample("paper", 16, seed=7).equals(cb.sample("paper", 16, seed=7))
    with pytest.raises(SpecError, match="seed"):
        cb.sample("paper", 16, seed=-1)
    with pytest.raises(SpecError, match="did you mean 'paper'"):
        cb.sample("papr", 16)


def test_progress_reaches_the_end(capsys: pytest.CaptureFixture[str]) -> None:
    seen = []
    cb.simulate_many({"burden": 4.0}, progress=lambda share, line: seen.append((share, line)))
    assert seen[0][0] == 0.0
    assert seen[-1] == (1.0, "1 blasts simulated")
    cb.simulate_many({"burden": 4.0}, progress=True)
    assert "100%" in capsys.readouterr().err
