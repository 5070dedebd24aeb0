"""Benches and muckpiles from Python: the same bits as the command line, nothing written."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver

import castblast as cb
from castblast.disk.reading import read_json
from castblast.errors import SpecError
from castblast.report.piles.bench_plan import bench_figure
from castblast.stages.muckpile.run import run_muckpile

SMALL = {
    "name": "small",
    "bench": {"length": 9.0, "width": "6 m", "height": "8 m", "burden": 3, "spacing": 3.0},
    "firing": {"pattern": "row", "delay": 0.05},
    "velocity": 9.0,
    "balls": {"count": 400},
}


@pytest.fixture(scope="module")
def pile() -> "cb.api.muckpile.pile.Muckpile":
    return cb.cast(SMALL, snapshots="0.25 s")


def test_numbers_are_si_and_texts_carry_units() -> None:
    bench = cb.Bench(SMALL, seed=4)
    assert bench.spec.bench.height == 8.0
    assert bench.spec.seed == 4
    assert bench.blocks["delay"].tolist() == [0.0] * 3 + [0.05] * 3
    assert bench.blocks.attrs["units"]["speed"] == "m s-1"
    with pytest.raises(SpecError, match=r"velocity: 9 kg: 'kg' is a mass"):
        cb.Bench(SMALL, velocity="9 kg")
    with pytest.raises(SpecError, match="did you mean 'demo'"):
        cb.load_bench("deom")


def test_a_file_still_needs_its_units(tmp_path: Path) -> None:
    path = tmp_path / "bench.yaml"
    path.write_text("name: small\nvelocity: 9\nbench: {length: 9 m, width: 6 m, height: 8 m}\n"
                    "firing: {pattern: row, delay: 50 ms}\nballs: {count: 400}\n")  # fmt: skip
    with pytest.raises(SpecError, match="velocity: 9: no unit given"):
        cb.load_bench(str(path))


def test_a_bench_draws_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("demo", "holes_from_file", "polygon", "v_pattern"):
        bench = cb.load_bench(name)
        assert isinstance(bench.plot(), Figure)
        page = ElementTree.fromstring(bench._repr_html_())
        assert page.find(".//img").attrib["src"].startswith("data:image/png;base64,")
        assert len(bench.blocks) == len(bench.plan.delay)
    assert not list(tmp_path.iterdir())
    monkeypatch.undo()


def test_arrows_of_a_plan_are_whole_and_end_before_the_next_row() -> None:
    bench = cb.load_bench("row_by_row")
    axes = bench.plot().axes[0]
    (arrows,) = (part for part in axes.collections if isinstance(part, Quiver))
    tips = arrows.get_offsets()[:, 1] + np.asarray(arrows.V)
    assert len(tips) == len(bench.blocks)
    assert axes.get_ylim()[0] < tips.min()
    assert tips.max() < axes.get_ylim()[1]
    rows = np.unique(bench.blocks["x"].round(6))
    lengths = np.asarray(arrows.V)
    assert 0.3 < lengths.min() / np.diff(rows).min() < 1.0


@pytest.mark.parametrize("is_fired", [True, False])
def test_a_plan_names_what_is_not_fired(is_fired: bool) -> None:
    bench = cb.load_bench("row_by_row")
    geometry, plan = bench.spec.bench.to_bench(), bench.plan
    delay = np.array(plan.delay)
    delay[0] = delay[0] if is_fired else np.inf
    place = bench.blocks[["x", "y"]].to_numpy()
    (legend,) = bench_figure("plan", geometry, place, delay, plan.velocity).legends
    words = [text.get_text() for text in legend.get_texts()]
    assert words == ["toe of the face", *([] if is_fired else ["not fired"])]


def test_a_cast_is_that_of_the_command_line(
    pile: "cb.api.muckpile.pile.Muckpile", tmp_path: Path, repository: Path
) -> None:
    bench = repository / "data_specs/benches/demo.yaml"
    here = cb.cast(bench, balls=300, velocity="8 m/s")
    there = run_muckpile(bench, tmp_path / "there", balls=300, velocity="8 m/s")
    files = here.save(str(tmp_path / "here"))
    for name in ("final_state.npz", "surface.npz", "blocks.csv", "history.csv", "section.png"):
        assert (tmp_path / "here" / name) in files
        mine, theirs = ((tmp_path / side / name).read_bytes() for side in ("here", "there"))
        assert mine == theirs, name
    documents = [read_json(tmp_path / side / "metrics.json") for side in ("here", "there")]
    assert documents[0] == documents[1]
    assert {path.name for path in files} == {path.name for path in there.files}


def test_what_a_pile_says(pile: "cb.api.muckpile.pile.Muckpile") -> None:
    moved = pile.balls.x - pile.balls.x_before
    mass = pile.balls.radius**3
    throw = float((moved * mass).sum() / mass.sum())
    assert pile.metrics["throw_x"] == pytest.approx(throw, rel=1e-9)
    assert pile.metrics.attrs["units"]["throw_x"] == "m"
    assert pile.metrics["initial_velocity"] == 9.0
    assert "initial_velocity_prediction_lower" not in pile.metrics
    assert pile.blocks.index.name == "block"
    assert pile.blocks["balls"].sum() == pile.balls.sizes["ball"]
    assert pile.blocks.attrs["units"]["throw"] == "m"
    assert pile.surface.dims == ("y", "x")
    assert float(pile.surface.max()) == pytest.approx(pile.metrics["maximum_height"], rel=0.05)
    assert pile.faults == []


def test_snapshots_begin_and_end_with_the_cast(pile: "cb.api.muckpile.pile.Muckpile") -> None:
    on_the_way = pile.snapshots
    assert isinstance(on_the_way, xr.DataArray)
    assert on_the_way.time[0] == 0.0
    first, last = on_the_way[0], on_the_way[-1]
    for letter in "xyz":
        assert np.array_equal(first.sel(axis=letter), pile.balls[f"{letter}_before"])
        assert np.array_equal(last.sel(axis=letter), pile.balls[letter])
    plain = cb.cast(SMALL)
    assert np.array_equal(plain.balls.x, pile.balls.x)
    with pytest.raises(SpecError, match="none were kept"):
        _ = plain.snapshots


def test_pictures_are_figures(pile: "cb.api.muckpile.pile.Muckpile") -> None:
    for figure in (pile.plot.section(), pile.plot.section(1.0), pile.plot.plan(),
                   pile.plot.view(), pile.plot.energy()):  # fmt: skip
        assert isinstance(figure, Figure)
        assert figure._repr_png_().startswith(b"\x89PNG")
    text = " ".join(ElementTree.fromstring(pile._repr_html_()).itertext())
    assert "throw of the centre of mass" in text


def test_a_model_gives_the_velocity_with_its_band() -> None:
    surrogate = {"explosive": "anfo", "ucs": "80 MPa", "hole_diameter": 0.15}
    given = {**SMALL, "surrogate": surrogate}
    del given["velocity"]
    bench = cb.Bench(given)
    full, paper = (cb.load_model(name) for name in ("full", "paper"))
    speeds = []
    for model in (full, paper):
        design = {"burden": [3.0], "spacing": 3.0, "bench_height": 8.0, "ucs": 8e7,
                  "hole_diameter": 0.15}  # fmt: skip
        answer = model.predict(design, "anfo").iloc[0]
        thrown = cb.cast(bench, model=model, balls=50)
        assert thrown.metrics["initial_velocity"] == pytest.approx(answer["burden_velocity"])
        for end in ("lower", "upper"):
            assert thrown.metrics[f"initial_velocity_prediction_{end}"] == pytest.approx(
                answer[f"burden_velocity_prediction_{end}"]
            )
        assert any("prediction band" in line for line in thrown.remarks)
        speeds.append(thrown.metrics["initial_velocity"])
    assert speeds[0] != speeds[1]


@pytest.mark.parametrize(
    ("options", "field", "words"),
    [
        ({"balls": 3}, "balls", "3: allowed: 10 to"),
        ({"velocity": 900.0}, "velocity", "allowed: 0 to 100 m/s"),
        ({"snapshots": "3 m"}, None, "a time is needed"),
        ({"snapshots": -1.0}, "snapshots", "larger than 0 s"),
        ({"precision": "half"}, None, "one of"),
    ],
)
def test_what_cannot_be_cast_is_refused(
    options: dict[str, object], field: str | None, words: str
) -> None:
    with pytest.raises(SpecError, match=words) as caught:
        cb.cast(SMALL, **options)
    assert caught.value.field == field
