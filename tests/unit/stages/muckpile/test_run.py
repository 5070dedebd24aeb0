"""The muckpile stage: what it writes, that it repeats itself, and what it says of bad input."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from small_bench import SMALL, write_bench

from castblast.api.muckpile.document import metric_rows
from castblast.bands import BAND_WORDS, BASIS, show_band, show_value
from castblast.errors import SpecError
from castblast.prediction.answer import predict
from castblast.stages.muckpile.compare import run_seeds
from castblast.stages.muckpile.extras import Extras
from castblast.stages.muckpile.run import run_muckpile

FILES = (
    "blocks.csv",
    "energy.png",
    "final_state.npz",
    "history.csv",
    "metrics.json",
    "movement.png",
    "plan.png",
    "profile.csv",
    "profiles.png",
    "section.png",
    "sections.png",
    "surface.npz",
    "view.png",
)


written = partial(write_bench, balls={"count": 250})


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("muckpile")
    bench = written(folder)
    shares: list[float] = []
    outcome = run_muckpile(
        bench, folder / "out", threads=1, progress=lambda share, _: shares.append(share)
    )
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    return bench, folder / "out", outcome.document


def test_every_file_is_written(run: tuple[Path, Path, dict[str, Any]]) -> None:
    _, out, document = run
    assert sorted(p.name for p in out.iterdir() if p.name != "packings") == list(FILES)
    stored = json.loads((out / "metrics.json").read_text())
    assert stored["throw"] == document["throw"]
    for name in ("profile.csv", "history.csv", "blocks.csv"):
        table = np.loadtxt(out / name, delimiter=",", skiprows=1)
        assert np.isfinite(table).all()
    for name in (name for name in FILES if name.endswith(".png")):
        assert (out / name).read_bytes().startswith(b"\x89PNG")


def test_the_pile_is_thrown_and_keeps_its_mass(run: tuple[Path, Path, dict[str, Any]]) -> None:
    """Balls end in front of the face, none below the floor; mass is that before."""
    _, out, document = run
    with np.load(out / "final_state.npz") as final:
        x, r, before = final["x"], final["r"], final["x_before"]
    mass = r**3 / (r**3).sum()
    moved = mass @ (x - before)
    assert moved == pytest.approx(document["throw"], rel=1e-9, abs=1e-12)
    assert moved[0] > 1.0
    assert moved[2] < 0.0
    assert (x[:, 2] > 0.9 * r).all()
    assert document["cast_fraction"] == pytest.approx(mass[x[:, 0] > 0.0].sum(), abs=0.02)
    # A random packing of rough balls at rest; denser than 0.68 would be overlaps.
    assert 0.50 < document["solid_fraction"] < 0.68


def test_a_second_run_reuses_the_packing_and_repeats_every_file(
    run: tuple[Path, Path, dict[str, Any]], tmp_path: Path
) -> None:
    bench, out, document = run
    before = {name: (out / name).read_bytes() for name in FILES}
    again = run_muckpile(bench, out, threads=2).document
    assert again["packing_reused"]
    assert not document["packing_reused"]
    assert {name for name in FILES if (out / name).read_bytes() != before[name]} == set()


def test_a_given_velocity_is_said_to_be_given(run: tuple[Path, Path, dict[str, Any]]) -> None:
    _, out, document = run
    stored = json.loads((out / "metrics.json").read_text())
    assert (stored["velocity_source"], stored["prediction_band"]) == ("given", {})
    assert metric_rows(document)[0] == ("burden velocity", "6, as given", "m/s")


def test_a_predicted_velocity_has_its_band_and_its_domain(tmp_path: Path) -> None:
    """A bench of 3 m is lower than any in training: said in words, with the value at fault."""
    surrogate = {"explosive": "anfo", "hole_diameter": "102 mm", "stemming_length": "1 m"}
    bench = written(tmp_path, velocity=None, surrogate=surrogate, balls={"count": 60})
    outcome = run_muckpile(bench, tmp_path / "out", threads=1)
    stored = json.loads((tmp_path / "out" / "metrics.json").read_text())
    asked = {name: stored["surrogate"]["inputs"][name] for name in ("burden", "bench_height")}
    assert asked == {"burden": 2.0, "bench_height": 3.0}
    speed, band = stored["initial_velocity"], stored["prediction_band"]["burden_velocity"]
    answer = predict(stored["surrogate"]["inputs"], "anfo")
    assert answer["burden_velocity"] == pytest.approx(speed)
    assert band == pytest.approx(answer["prediction_band"]["burden_velocity"])
    assert outcome.rows[0] == (
        "burden velocity",
        f"{show_value('burden_velocity', speed)} ({show_band('burden_velocity', speed)})",
        "m/s",
    )
    assert outcome.remarks[0] == BAND_WORDS
    assert any(line.startswith("outside the training data: bench_height = 3 m") for line in
               outcome.remarks)  # fmt: skip
    assert BASIS in stored["prediction_basis"]["words"]


def test_ore_and_frames(run: tuple[Path, Path, dict[str, Any]], tmp_path: Path) -> None:
    """Ore loses at least nothing and at most all; frames do not change the numbers."""
    _, out, plain = run
    corners = [[-4, 0], [-2, 0], [-2, 4], [-4, 4]]
    polygons = [{"name": "rear", "grade": 3.0, "corners": corners}]
    (tmp_path / "ore.yaml").write_text(yaml.safe_dump({"polygons": polygons}))
    bench = written(tmp_path, ore="ore.yaml")
    extras = Extras(dig_block="1 m", animation="gif", frame_interval="0.2 s")
    outcome = run_muckpile(bench, tmp_path, threads=1, packings=out / "packings", extras=extras)
    assert outcome.document["packing_reused"]
    assert outcome.document["throw"] == plain["throw"]
    ore = outcome.document["ore"]
    assert ore["dig_block"] == 1.0
    # The rear half of the bench is thrown less far than the whole.
    assert 0.0 < ore["polygons"][0]["displacement"][0] < plain["throw"][0]
    assert ore["polygons"][0]["balls"] == pytest.approx(125, abs=15)
    for result in ore["digging"]:
        assert 0.0 <= result["loss"] <= 1.0
        assert 0.0 <= result["dilution"] <= 1.0
        assert result["grade"] == pytest.approx(3.0 * (1.0 - result["dilution"]))
    by_method = {result["method"]: result["loss"] for result in ore["digging"]}
    assert by_method["dig_blocks"] < by_method["as_planned"]
    names = {path.name for path in outcome.files}
    assert {"ore.png", "animation.gif"} <= names
    assert "rear: ore loss, dug in blocks" in {row[0] for row in outcome.rows}


def test_bands_over_seeds(tmp_path: Path) -> None:
    bench = written(tmp_path)
    outcome = run_seeds(bench, tmp_path / "out", 2, threads=1)
    found = [json.loads((tmp_path / f"out/seed_{k}/metrics.json").read_text()) for k in (0, 1)]
    assert found[0]["throw"] != found[1]["throw"]
    mean = 0.5 * (found[0]["runout_95"] + found[1]["runout_95"])
    assert outcome.document["bands"]["runout_95"]["mean"] == pytest.approx(mean)
    assert (tmp_path / "out" / "profiles.png").is_file()


def test_a_file_of_balls(run: tuple[Path, Path, dict[str, Any]], tmp_path: Path) -> None:
    """Balls that collapse from a column under their own weight, without being fired."""
    _, out, _ = run
    with np.load(out / "final_state.npz") as final:
        np.savez(tmp_path / "balls.npz", x=final["x_before"], r=final["r"])
    bench = written(
        tmp_path, velocity=None, balls="balls.npz", firing={"pattern": "none"},
        bench=SMALL["bench"] | {"rear": False},
    )  # fmt: skip
    document = run_muckpile(bench, tmp_path / "out", threads=1).document
    assert document["initial_velocity"] == 0.0
    assert document["balls"] == len(np.load(tmp_path / "balls.npz")["r"])
    assert document["throw"][2] < -0.2
    # It spreads to both sides: no direction is preferred.
    assert abs(document["throw"][0]) < 0.3
    with pytest.raises(SpecError, match="takes its balls from"):
        run_muckpile(bench, tmp_path / "out", balls=100)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"velocity": "12.7"}, "--velocity: 12.7: no unit given"),
        ({"extras": Extras(dig_block="3")}, "--dig-block: 3: no unit given"),
        ({"extras": Extras(frame_interval="0 s")}, "--frame-interval: 0 s: must be larger than 0"),
        ({"extras": Extras(animation="avi")}, "--animation: avi: unknown format"),
        ({"extras": Extras(ore=Path("none.csv"))}, "none.csv: no such file"),
        ({"velocity": "200 m/s"}, "--velocity: 200 m/s: implausible"),
        ({"balls": 10}, "must fit at least twice into the shortest side of the bench, 3 m"),
    ],
)
def test_options_that_cannot_be(tmp_path: Path, options: dict[str, Any], line: str) -> None:
    with pytest.raises(SpecError) as caught:
        run_muckpile(written(tmp_path), tmp_path / "out", **options)
    assert line in str(caught.value)
    assert not any((tmp_path / "out").glob("*.npz"))
