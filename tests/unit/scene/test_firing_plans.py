"""Firing plans: delays by geometry, directions normal to the front, scatter, files of holes."""

from __future__ import annotations

from math import atan2, degrees, inf, pi, radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from castblast.errors import SpecError
from castblast.muckpile.bench.geometry import Bench, block_centres
from castblast.muckpile.bench.timing import (
    echelon_delays,
    firing_front_azimuth,
    row_delays,
    scatter_delays,
    v_delays,
)
from castblast.prediction.answer import predict
from castblast.scene.plan import make_plan
from castblast.specs.bench.bench import load_bench
from castblast.specs.bench.holes import blocks_of_holes, read_holes

BENCH = Bench(length=12.0, width=9.0, height=6.0)
HEAD = "x [m],y [m],delay [ms],velocity [m/s],direction [deg]"


def test_intervals_between_rows_and_holes() -> None:
    """Echelon from either end; rows one hole after the other; a V that opens at one side."""
    times = echelon_delays(3, 4, 0.02, 0.1, row_interval=0.05, from_far_end=True).reshape(3, 4)
    np.testing.assert_allclose(np.diff(times, axis=0), 0.05)
    np.testing.assert_allclose(np.diff(times, axis=1), -0.02)
    assert times.min() == pytest.approx(0.1)
    times = row_delays(2, 3, 0.1, hole_interval=0.01)
    assert times.tolist() == pytest.approx([0.0, 0.01, 0.02, 0.1, 0.11, 0.12])
    times = v_delays(2, 4, 0.01, row_interval=0.03, apex=1.0).reshape(2, 4)
    np.testing.assert_allclose(times[0], [0.01, 0.0, 0.01, 0.02], atol=1e-15)
    np.testing.assert_allclose(times[1] - times[0], 0.03)


def test_rock_moves_at_right_angles_to_the_front() -> None:
    """Lines of equal delay of an echelon over B x S blocks: tan(azimuth) = -(dS/S) / (dR/B)."""
    bench = Bench(length=20.0, width=9.0, height=6.0, burden=3.0, spacing=4.0)
    place = block_centres(bench)
    found = firing_front_azimuth(place, echelon_delays(3, 5, 0.02, row_interval=0.03), 6.0)
    assert found == pytest.approx(atan2(-0.02 / 4.0, 0.03 / 3.0))
    rows = firing_front_azimuth(place, row_delays(3, 5, 0.02), 6.0)
    assert rows == pytest.approx(0.0)
    vee = firing_front_azimuth(place, v_delays(3, 5, 0.03), 6.0).reshape(3, 5)
    assert np.all(vee[:, :2] > 0.3)
    assert vee[:, 2] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(vee, -vee[:, ::-1], atol=1e-9)
    assert firing_front_azimuth(place, np.full(15, inf), 6.0).tolist() == [0.0] * 15


def test_scatter_of_detonators() -> None:
    """2 % of the delay and 1 ms add as variances: 4.12 ms at 200 ms; infinite delays stay."""
    delay = np.append(np.full(20_000, 0.25), inf)
    fired = scatter_delays(delay, 7, relative=0.02, absolute=0.001, start=0.05)
    assert fired[:-1].mean() == pytest.approx(0.25, abs=1e-4)
    assert fired[:-1].std() == pytest.approx(np.hypot(0.004, 0.001), rel=0.02)
    assert fired[-1] == inf
    assert np.array_equal(
        fired, scatter_delays(delay, 7, relative=0.02, absolute=0.001, start=0.05)
    )
    assert not np.array_equal(fired, scatter_delays(delay, 8, relative=0.02, absolute=0.001))
    assert scatter_delays(np.zeros(1000), 1, absolute=0.01).min() == 0.0
    np.testing.assert_array_equal(scatter_delays(delay, 1), delay)


def holes_file(folder: Path, *lines: str, head: str = HEAD) -> Path:
    path = folder / "holes.csv"
    path.write_text("\n".join((head, *lines)) + "\n")
    return path


def test_holes_are_read_in_their_units(tmp_path: Path) -> None:
    path = holes_file(tmp_path, "# remark", "-1.5,1.5,25,9.5,-10", "", "-1500e-3,4.5,50,,")
    holes = read_holes(path, BENCH, by_block=True)
    assert holes.delay.tolist() == [0.025, 0.05]
    assert holes.velocity[0] == 9.5
    assert holes.direction[0] == pytest.approx(radians(-10))
    assert np.isnan(holes.velocity[1])
    assert holes.where[1].endswith("line 5")


def test_ends_of_staggered_rows_go_with_their_neighbour(tmp_path: Path) -> None:
    """Three holes in a row of four blocks: the end block goes with the nearest, the rear stands."""
    path = holes_file(tmp_path, "-1,3,0,9,0", "-1,6,1,9,0", "-1,9,2,9,0")
    blocks = blocks_of_holes(read_holes(path, BENCH, by_block=True), BENCH).reshape(3, 4)
    assert blocks[0].tolist() == [0, 0, 1, 2]
    assert blocks[2].tolist() == [-1] * 4


@pytest.mark.parametrize(
    ("lines", "head", "said"),
    [
        (["-1,13,0,9,0"], HEAD, "line 2: the hole at x = -1 m, y = 13 m stands outside the bench"),
        (["2,3,0,9,0"], HEAD, "-9 to 0 m in x and 0 to 12 m in y"),
        (["-1,1,0,9,0", "-2,2,5,9,0"], HEAD, "lines 2 and 3: two holes on block 0, 3 x 3 m"),
        (["-1,1,nan,9,0"], HEAD, "line 2: delay: nan: a number is needed"),
        (["-1,1,,9,0"], HEAD, "line 2: delay: empty: a number is needed"),
        (["-1,1,x,9,0"], HEAD, "line 2: delay: x: a number is needed"),
        (["-1,1,5,900,0"], HEAD, "line 2: velocity: 900 m/s: implausible"),
        (["-1,1,5,9"], HEAD, "line 2: 4 cells for 5 heads"),
        (["-1,1,5"], "x [m],y [m],dely [ms]", "unknown column, did you mean 'delay'?"),
        (["-1,1,5"], "x [m],y [m],delay", "column 'delay': no unit given; a time is needed"),
        (["-1,1,5"], "x [m],y [m],delay [kg]", "column 'delay [kg]': 'kg' is"),
        (["-1,1"], "x [m],y [m]", "the column 'delay' is missing"),
        (["-1,1,5,99"], "x [m],y [m],delay [ms],burden [m]", "line 2: burden: 99 m: implausible"),
        ([], HEAD, "has a header but no data rows"),
    ],
)
def test_faulty_holes(tmp_path: Path, lines: list[str], head: str, said: str) -> None:
    path = holes_file(tmp_path, *lines, head=head)
    with pytest.raises(SpecError) as caught:
        read_holes(path, BENCH, by_block=True)
    assert said in str(caught.value)
    assert all(line.startswith(str(path)) for line in str(caught.value).splitlines())


def test_holes_off_the_grid_may_share_a_block_but_no_spot(tmp_path: Path) -> None:
    read_holes(holes_file(tmp_path, "-1,1,0,9,0", "-2,2,5,9,0"), BENCH, by_block=False)
    path = holes_file(tmp_path, "-1,1,0,9,0", "-1,1.5,5,9,0")
    with pytest.raises(SpecError, match=r"lines 2 and 3: two holes on one block, 0\.5 m apart"):
        read_holes(path, BENCH, by_block=False)


def spec_with(folder: Path, firing: dict[str, Any], **change: Any) -> Any:
    content = {
        "name": "plans",
        "bench": {"length": "12 m", "width": "9 m", "height": "6 m"},
        "balls": {"count": 100},
        "firing": firing,
        "velocity": "10 m/s",
    } | change
    path = folder / "bench.yaml"
    path.write_text(yaml.safe_dump({k: v for k, v in content.items() if v is not None}))
    return load_bench(path)


def test_plan_of_an_echelon_away_from_its_front(tmp_path: Path) -> None:
    """Equal burden, spacing and delays: all blocks go 45 degrees towards the first corner."""
    spec = spec_with(
        tmp_path, {"delay": "20 ms", "scatter": {"absolute": "1 ms"}},
        direction={"normal_to": "firing_front", "elevation": "30 deg"},
    )  # fmt: skip
    plan = make_plan(spec, spec.bench.to_bench(), tmp_path)
    part = 10 * np.cos(radians(30)) * np.sqrt(0.5)
    np.testing.assert_allclose(plan.velocity, [[part, -part, 5.0]] * 12, atol=1e-9)
    assert plan.speed == 10.0
    off = plan.delay - spec.firing.block_delay(spec.bench.to_bench())
    assert 0.0 < np.abs(off).max() < 0.005


def test_plan_from_holes(tmp_path: Path) -> None:
    """A hole gives its own velocity and direction; what it leaves out is that of the bench."""
    holes_file(tmp_path, "-1,3,0,8,20", "-1,6,10,,", "-1,9,20,,")
    spec = spec_with(tmp_path, {"holes": "holes.csv", "start": "5 ms"})
    plan = make_plan(spec, spec.bench.to_bench(), tmp_path)
    assert plan.delay[:4].tolist() == pytest.approx([0.005, 0.005, 0.015, 0.025])
    assert np.isinf(plan.delay[8:]).all()
    assert degrees(atan2(plan.velocity[0, 1], plan.velocity[0, 0])) == pytest.approx(20)
    assert plan.velocity[3].tolist() == [10.0, 0.0, 0.0]
    near = spec_with(tmp_path, {"holes": "holes.csv", "blocks": "nearest_hole"})
    plan = make_plan(near, near.bench.to_bench(), tmp_path)
    assert len(plan.delay) == 3
    assert plan.blocks_of(np.array([[-8.0, 5.9, 1.0]]), near.bench.to_bench()).tolist() == [1]
    bare = spec_with(tmp_path, {"holes": "holes.csv"}, velocity=None)
    with pytest.raises(SpecError, match=r"holes\.csv: line 3: velocity: is missing"):
        make_plan(bare, bare.bench.to_bench(), tmp_path)


def test_velocity_of_each_hole_by_its_own_design(tmp_path: Path) -> None:
    """The surrogate is asked with the burden and charge of each hole, as `predict` would be.

    75 kg of ANFO (800 kg/m3) in 150 mm are 75 / (800 pi 0.15^2 / 4) = 5.305 m of charge.
    """
    holes_file(
        tmp_path, "-1,1,0,2.5,", "-1,4,10,,75",
        head="x [m],y [m],delay [ms],burden [m],charge_mass [kg]",
    )  # fmt: skip
    design = {"explosive": "anfo", "ucs": "100 MPa", "hole_diameter": "150 mm"}
    spec = spec_with(
        tmp_path, {"holes": "holes.csv"}, velocity=None, surrogate=design,
        bench={"length": "12 m", "width": "9 m", "height": "10 m"},
    )  # fmt: skip
    plan = make_plan(spec, spec.bench.to_bench(), tmp_path)
    common = {"ucs": 1e8, "hole_diameter": 0.15, "bench_height": 10.0, "face_angle": pi / 2}
    length = 75.0 / (800.0 * 0.25 * pi * 0.15**2)
    first = predict(common | {"burden": 2.5, "spacing": 3.0}, "anfo")["burden_velocity"]
    second = predict(common | {"burden": 3.0, "spacing": 3.0, "charge_length": length}, "anfo")
    assert plan.velocity[0, 0] == pytest.approx(first)
    assert plan.velocity[1, 0] == pytest.approx(second["burden_velocity"])
    assert first > second["burden_velocity"]
    assert plan.prediction["holes"] == 2
    holes_file(tmp_path, "-1,1,0,700", head="x [m],y [m],delay [ms],charge_mass [kg]")
    with pytest.raises(
        SpecError, match=r"holes\.csv: line 2: charge_length .* leaves no room for stemming"
    ):
        make_plan(spec, spec.bench.to_bench(), tmp_path)


def test_a_charge_by_its_mass_is_the_same_design(tmp_path: Path) -> None:
    """103.17 kg of ANFO in 150 mm are 7.298 m: below 2.702 m of stemming in a bench of 10 m.

    Written either way the design is inside the training data and has the same velocity.
    """
    design = {"explosive": "ANFO", "ucs": "100 MPa", "hole_diameter": "150 mm"}
    bench = {"length": "12 m", "width": "9 m", "height": "10 m", "spacing": "3.6 m"}
    length = 103.17 / (800.0 * 0.25 * pi * 0.15**2)
    plans = []
    for head, cell in (
        ("charge_mass [kg]", 103.17),
        ("stemming_length [m]", repr(10.0 - length)),
        ("charge_length [m]", repr(length)),
    ):
        holes_file(tmp_path, f"-1,1,0,{cell}", head=f"x [m],y [m],delay [ms],{head}")
        spec = spec_with(
            tmp_path, {"holes": "holes.csv", "blocks": "nearest_hole"},
            velocity=None, surrogate=design, bench=bench,
        )  # fmt: skip
        plans.append(make_plan(spec, spec.bench.to_bench(), tmp_path))
    assert all(plan.prediction["in_domain"] for plan in plans)
    assert [plan.speed for plan in plans] == pytest.approx([plans[0].speed] * 3, rel=1e-12)
    assert plans[0].prediction["explosive"] == "anfo"


def test_a_hole_that_says_how_it_is_charged_leaves_the_bench_behind(tmp_path: Path) -> None:
    """Its stemming replaces the charge of the bench file; two charges of one hole are refused."""
    surrogate = {"explosive": "anfo", "charge_length": "5 m", "hole_diameter": "150 mm"}
    bench = {"length": "12 m", "width": "9 m", "height": "10 m"}

    def plan_of(head: str, cells: str) -> Any:
        holes_file(tmp_path, f"-1,1,0,{cells}", head=f"x [m],y [m],delay [ms],{head}")
        firing = {"holes": "holes.csv", "blocks": "nearest_hole"}
        spec = spec_with(tmp_path, firing, velocity=None, surrogate=surrogate, bench=bench)
        return make_plan(spec, spec.bench.to_bench(), tmp_path)

    found = plan_of("stemming_length [m]", "2.7").speed
    common = {"bench_height": 10.0, "hole_diameter": 0.15, "stemming_length": 2.7}
    assert found == pytest.approx(predict(common, "anfo")["burden_velocity"], rel=1e-12)
    with pytest.raises(SpecError, match=r"line 2: charge_mass and charge_length are both given"):
        plan_of("charge_mass [kg],charge_length [m]", "75,5")
    with pytest.raises(SpecError, match=r"line 2: stemming_length 9 m and charge_length 5\.3\d* m"):
        plan_of("charge_mass [kg],stemming_length [m]", "75,9")


def test_a_design_that_no_bench_can_hold_names_the_bench_file(tmp_path: Path) -> None:
    surrogate = {"explosive": "anfo", "charge_length": "5 m", "stemming_length": "4 m"}
    spec = spec_with(tmp_path, {}, velocity=None, surrogate=surrogate)
    with pytest.raises(
        SpecError, match=r"^plans: surrogate: stemming_length 4 m and charge_length"
    ):
        make_plan(spec, spec.bench.to_bench(), tmp_path)


@pytest.mark.parametrize(
    ("firing", "line"),
    [
        ({"pattern": "row", "row_delay": "5 ms"}, "row_delay: means nothing to the pattern 'row'"),
        ({"pattern": "holes"}, "holes: the name of a CSV file is needed"),
        ({"pattern": "v", "holes": "a.csv"}, "holes: means nothing to the pattern 'v'"),
        ({"scatter": {"relative": 0.5}}, "firing.scatter.relative: 0.5: implausible"),
        ({"scatter": {"absolute": 0.001}}, "firing.scatter.absolute: 0.001: no unit given"),
    ],
)
def test_faulty_plans(tmp_path: Path, firing: dict[str, Any], line: str) -> None:
    with pytest.raises(SpecError) as caught:
        spec_with(tmp_path, firing)
    assert line in str(caught.value)
