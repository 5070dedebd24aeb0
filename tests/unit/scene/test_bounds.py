"""What a muckpile costs is estimated before the work; the absurd is refused with its field."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_bench import SMALL, write_bench

from castblast.errors import SpecError
from castblast.muckpile.balls.contact import ContactLaw
from castblast.scene import bounds
from castblast.scene.bounds import (
    BallSizes,
    FrameOrder,
    estimated_step,
    require_bounds,
    sizes_of_balls,
)
from castblast.specs.bench.bench import BenchSpec
from castblast.stages.muckpile.extras import Extras
from castblast.stages.muckpile.run import run_muckpile

SIZES = BallSizes(250, 0.1, 0.3, 0.01)


def spec(**changes: Any) -> BenchSpec:
    return BenchSpec.model_validate(SMALL | changes)


@pytest.mark.parametrize(
    ("changes", "extras", "words"),
    [
        (
            {"numerics": {"time_step": "1e-9 s"}},
            Extras(),
            "small: numerics.time_step: 1e-09 s: 3e+10 steps for a stop.longest_time of 30 s; "
            "allowed: 200,000,000 steps, at least 1.5e-07 s",
        ),
        (
            {},
            Extras(vtk=True, frame_interval="1 us"),
            "small: --frame-interval: 1e-06 s: up to 3e+07 frames for a stop.longest_time of 30 s; "
            "allowed: 10,000 frames, at least 0.003 s",
        ),
        (
            {"balls": {"mean_radius": "6 mm"}},
            Extras(),
            "small: balls.mean_radius: 0.006 m: 25,",
        ),
        (
            {"bench": SMALL["bench"] | {"spacing": "1 mm", "burden": "1 mm"}},
            Extras(),
            "burden 0.001 m, spacing 0.001 m: cut the bench into 1.6e+07 blocks; allowed: 100,000",
        ),
        (
            {"contact": {"effective_modulus": "100 GPa"}, "balls": {"count": 4_000_000},
             "stop": {"longest_time": "600 s"}},
            Extras(),
            "take fewer balls, less different sizes, a smaller contact.effective_modulus or a "
            "shorter stop.longest_time",
        ),
    ],
)  # fmt: skip
def test_the_absurd_is_refused_before_anything_is_packed(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    changes: dict[str, Any],
    extras: Extras,
    words: str,
) -> None:
    """Neither memory nor VTK of this machine decides."""
    monkeypatch.setattr(bounds, "require_memory", lambda *_: None)
    monkeypatch.setattr("castblast.stages.muckpile.extras.check_frames", lambda *_, **__: None)
    monkeypatch.setattr("castblast.scene.start.fill_bench", lambda *_, **__: 1 / 0)
    path = write_bench(tmp_path, **changes)
    with pytest.raises(SpecError) as caught:
        run_muckpile(path, tmp_path / "out", threads=2, extras=extras)
    assert words in str(caught.value)
    assert not [p for p in tmp_path.rglob("*") if p.is_file() and p != path]


def test_the_option_for_balls_has_the_bounds_of_the_file(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"--balls: 10,000,000: allowed: 10 to 5,000,000"):
        run_muckpile(write_bench(tmp_path), tmp_path / "out", balls=10_000_000)


def test_what_a_bench_of_today_asks_for_is_allowed(tmp_path: Path) -> None:
    """The published case, twice as many balls as ever thrown, and frames for a film."""
    for number, radius in ((400_000, 0.19), (800_000, 0.15)):
        sizes = BallSizes(number, 0.5 * radius, 1.5 * radius, 1.25 * radius**3)
        require_bounds(spec(), sizes, tmp_path, 2)
    require_bounds(spec(), SIZES, tmp_path, 1, FrameOrder(0.02, 136.0))


def test_very_different_sizes_take_long(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One boulder among fines: each ball is asked whether it meets it."""
    monkeypatch.setattr(bounds, "require_memory", lambda *_: None)
    radius = np.full(2_000_000, 0.05)
    require_bounds(spec(), sizes_of_balls(radius), tmp_path, 2)
    radius[0] = 10.0
    with pytest.raises(SpecError, match=r"2,000,000 balls with radii of 0.05 to 10 m take steps"):
        require_bounds(spec(), sizes_of_balls(radius), tmp_path, 2)


def test_a_disk_that_is_too_small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Usage:
        free = 100_000

    monkeypatch.setattr(bounds.shutil, "disk_usage", lambda _: Usage)
    with pytest.raises(SpecError, match=r"results of 250 balls take up to .* GiB are free in"):
        require_bounds(spec(), SIZES, tmp_path, 1)
    Usage.free = 1_000_000
    require_bounds(spec(), SIZES, tmp_path, 1)
    with pytest.raises(SpecError, match="results and frames of 250 balls"):
        require_bounds(spec(), SIZES, tmp_path, 1, FrameOrder(0.1, 40.0))


def test_the_step_is_that_of_the_smallest_ball_and_the_modulus() -> None:
    """As the engine finds: 0.00113 s in the demo bench with 4,000 balls (0.218 m, 10 MPa)."""
    step = estimated_step(ContactLaw(), 0.218, 0.8)
    assert step == pytest.approx(0.00113, rel=0.25)
    assert estimated_step(ContactLaw(), 0.109, 0.8) == pytest.approx(0.5 * step)
    stiff = ContactLaw(effective_modulus=1e9)
    assert estimated_step(stiff, 0.218, 0.8) == pytest.approx(0.1 * step)
