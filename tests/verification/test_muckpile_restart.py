"""An interrupted cast goes on to the same last bit; a foreign restart file is refused."""

from __future__ import annotations

import numpy as np
import pytest

from castblast.errors import SpecError
from castblast.muckpile.contact import ContactLaw
from castblast.muckpile.particles import particles_at_rest
from castblast.muckpile.restart import read_restart
from castblast.muckpile.solver import CastCase, run_cast
from castblast.muckpile.walls import floor


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
    assert not file.exists()
    for one, other in zip(whole.particles, resumed.particles, strict=True):
        assert one.tobytes() == other.tobytes()
    for one, other in zip(whole.history, resumed.history, strict=True):
        assert one.tobytes() == other.tobytes()
    assert whole.ledger == resumed.ledger
    assert whole.counters._replace(seconds=0.0) == resumed.counters._replace(seconds=0.0)


def test_a_restart_file_of_another_case_is_refused(tmp_path):
    file = tmp_path / "run.npz"

    def pull_the_plug(share, line):
        raise PlugPulledError

    with pytest.raises(PlugPulledError):
        run_cast(case(), pull_the_plug, restart=file, restart_interval=0.0)
    with pytest.raises(SpecError, match="another case"):
        run_cast(case()._replace(gravity=9.8), restart=file)
    file.write_bytes(file.read_bytes()[:100])
    with pytest.raises(SpecError, match="not a restart file"):
        read_restart(file, "")


def test_an_unstable_run_keeps_its_restart_file(tmp_path):
    """A step far too long: status, ball and time are named, and the file stays."""
    file = tmp_path / "run.npz"
    result = run_cast(case()._replace(time_step=0.03), restart=file, restart_interval=0.0)
    assert result.failed_ball >= 0
    assert file.exists()
