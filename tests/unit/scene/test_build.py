"""From a spec to a result with public names only, in memory."""

from pathlib import Path

import numpy as np
import pytest

from castblast.errors import SpecError
from castblast.muckpile.cast.solver import run_cast
from castblast.scene.bounds import BallSizes
from castblast.scene.build import build, read_site
from castblast.specs.bench.bench import BenchSpec
from castblast.specs.loading import make_spec

BENCH = {
    "name": "small",
    "bench": {"length": "6 m", "width": "6 m", "height": "6 m"},
    "firing": {"pattern": "row", "delay": "50 ms"},
    "velocity": "8 m/s",
    "balls": {"count": 60},
    "stop": {"longest_time": "0.2 s"},
}


@pytest.fixture(scope="module")
def spec() -> BenchSpec:
    return make_spec(BENCH, BenchSpec, "small")


def test_a_scene_is_all_that_a_cast_takes(spec: BenchSpec, tmp_path: Path) -> None:
    """The case holds balls, walls and plan of the scene, and throws the bench forward."""
    site = read_site(spec, tmp_path)
    scene = build(spec, site, tmp_path, tmp_path)
    assert scene.case.walls is site.walls
    np.testing.assert_array_equal(scene.case.block_delay, site.plan.delay)
    np.testing.assert_array_equal(scene.case.particles.position, scene.start.balls.position)
    moved = run_cast(scene.case).particles.position - scene.start.balls.position
    assert moved[:, 0].mean() > 0.5
    again = build(spec, site, tmp_path, tmp_path)
    assert again.start.reused
    assert not scene.start.reused
    np.testing.assert_array_equal(again.start.balls.position, scene.start.balls.position)


def test_balls_beyond_the_limit_are_never_packed(spec: BenchSpec, tmp_path: Path) -> None:
    """`limit` speaks before the packing, which leaves no file."""

    def refuse(sizes: BallSizes) -> None:
        raise SpecError(f"{type(sizes).__name__} refused")

    with pytest.raises(SpecError, match="BallSizes refused"):
        build(spec, read_site(spec, tmp_path), tmp_path, tmp_path, limit=refuse)
    assert not list(tmp_path.iterdir())
