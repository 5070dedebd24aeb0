"""An interrupted cast goes on to the same last bit; a foreign restart file is refused."""

from __future__ import annotations

import numpy as np
import pytest

from castblast.errors import SpecError, Status
from castblast.muckpile.balls.contact import ContactLaw
from castblast.muckpile.balls.particles import particles_at_rest
from castblast.muckpile.bench.geometry import Bench
from castblast.muckpile.bench.packing import fill_bench
from castblast.muckpile.cast.restart import Keeper, read_restart
from castblast.muckpile.cast.solver import CastCase, run_cast
from castblast.muckpile.ground.walls import floor
from castblast.stopping import Stopped, StopRequest


class PlugPulledError(Exception):
    """Stands for a pulled plug."""


def case():
    """A pillar of 27 balls in two blocks, fired apart in time."""
    grid = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    position = 0.2 * grid + [0.0, 0.0, 0.1] + 1e-3 * np.sin(np.arange(81.0)).reshape(-1, 3)
    balls = particles_at_rest(position, np.full(27, 0.1), block=grid[:, 0] // 2)
    velocity = np.array([[1.0, 0.5, 0.0], [3.0, 0.0, 1.0]])
    return CastCase(
        balls, ContactLaw(), floor(), np.array([0.1, 0.3]), velocity, max_time=0.8, min_time=0.8
    )


@pytest.mark.parametrize("sample", [3, 9, 30])
def test_an_interrupted_run_ends_in_the_same_bits(tmp_path, sample):
    """Stopped before the first firing, between firings, after them."""
    file, seen = tmp_path / "run.npz", []

    def pull_the_plug(share, line):
        seen.append(share)
        if len(seen) == sample:
            raise PlugPulledError

    whole = run_cast(case())
    with pytest.raises(PlugPulledError):
        run_cast(case(), pull_the_plug, restart=file, restart_interval=0.0)
    assert file.exists()
    resumed = run_cast(case(), restart=file)
    assert file.exists()  # until the caller has made use of the result
    assert_same(whole, resumed)
    # From the state at the end nothing is left to do.
    assert_same(whole, run_cast(case(), restart=file))


def assert_same(whole, resumed):
    for one, other in zip(whole.particles, resumed.particles, strict=True):
        assert one.tobytes() == other.tobytes()
    for one, other in zip(whole.history, resumed.history, strict=True):
        assert one.tobytes() == other.tobytes()
    assert whole.ledger == resumed.ledger
    assert whole.counters._replace(seconds=0.0) == resumed.counters._replace(seconds=0.0)


class After(StopRequest):
    """Asked to stop when it has been looked at so many times."""

    def __init__(self, looks):
        super().__init__()
        self.left = looks

    @property
    def made(self):
        self.left -= 1
        return self.left < 0


@pytest.mark.parametrize("looks", [0, 1, 7, 20, 33, 34, 35, 60])
def test_a_stop_at_any_look_keeps_the_state(tmp_path, looks):
    """Wherever lists are renewed, within a step or between two, before and after firings."""
    file = tmp_path / "run.npz"
    whole = run_cast(case())
    with pytest.raises(Stopped, match=r"of the cast; its state is kept in .*run\.npz; run"):
        run_cast(case(), restart=file, stop=After(looks))
    assert_same(whole, run_cast(case(), restart=file))


def test_a_state_that_cannot_be_kept_does_not_end_the_run(tmp_path):
    (tmp_path / "file").touch()
    lines = []
    path = tmp_path / "file" / "run.npz"
    result = run_cast(case(), lambda _, line: lines.append(line), None, path, 0.0)
    assert_same(run_cast(case()), result)
    assert any("run.npz: cannot be written" in line for line in lines)


def test_a_stop_ratio_of_zero_runs_to_the_longest_time():
    """Nothing is ever at rest then; the share that is shown is that of time."""
    shares = []
    endless = case()._replace(stop_energy_ratio=0.0, min_time=0.0)
    result = run_cast(endless, lambda share, _: shares.append(share))
    assert result.status is Status.NOT_CONVERGED
    assert result.time == pytest.approx(0.8)
    assert np.isfinite(shares).all()
    assert max(shares[:-1]) < 1.0


def test_a_restart_file_of_another_case_is_refused(tmp_path):
    file = tmp_path / "run.npz"

    def pull_the_plug(share, line):
        raise PlugPulledError

    with pytest.raises(PlugPulledError):
        run_cast(case(), pull_the_plug, restart=file, restart_interval=0.0)
    with pytest.raises(SpecError, match="another case"):
        run_cast(case()._replace(gravity=9.8), restart=file)
    file.write_bytes(file.read_bytes()[:100])
    with pytest.raises(SpecError, match="is not a restart file of a cast"):
        read_restart(file, "")


def test_an_unstable_run_keeps_its_restart_file(tmp_path):
    """A step far too long: status, ball and time are named, and the file stays."""
    file = tmp_path / "run.npz"
    result = run_cast(case()._replace(time_step=0.03), restart=file, restart_interval=0.0)
    assert result.failed_ball >= 0
    assert file.exists()


BENCH = Bench(length=2.0, width=2.0, height=2.0, burden=1.0, spacing=1.0)


@pytest.mark.parametrize("looks", [0, 3, 8, 12, 40])
def test_a_packing_that_was_stopped_goes_on_to_the_same_bits(tmp_path, looks):
    """While overlaps are pushed apart, and while the balls settle."""
    size = {"mean_radius": 0.2, "seed": 3, "threads": 1}
    whole = fill_bench(BENCH, **size)
    keeper = Keeper(tmp_path / "part.npz", "key")
    with pytest.raises(Stopped, match=r"packed; its state is kept in .*part\.npz"):
        fill_bench(BENCH, **size, restart=keeper, stop=After(looks))
    resumed = fill_bench(BENCH, **size, restart=keeper)
    assert resumed[1:] == whole[1:]
    for one, other in zip(whole.particles, resumed.particles, strict=True):
        assert one.tobytes() == other.tobytes()


def test_a_damaged_part_of_a_packing_is_passed_over(tmp_path):
    size = {"mean_radius": 0.2, "seed": 3, "threads": 1}
    whole = fill_bench(BENCH, **size)
    (tmp_path / "part.npz").write_bytes(b"PK nonsense")
    again = fill_bench(BENCH, **size, restart=Keeper(tmp_path / "part.npz", "key"))
    assert again.particles.position.tobytes() == whole.particles.position.tobytes()
