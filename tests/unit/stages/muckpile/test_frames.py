"""Animation and ParaView files of a cast: read back, framed by the end, nothing left behind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from castblast.errors import SpecError
from castblast.muckpile.balls.contact import ContactLaw
from castblast.muckpile.balls.particles import particles_at_rest
from castblast.muckpile.bench.geometry import Bench, block_velocities, echelon_delays
from castblast.muckpile.bench.surroundings import bench_walls
from castblast.muckpile.cast.case import CastCase
from castblast.stages.muckpile.frames import Frames, check_frames

BENCH = Bench(length=6.0, width=6.0, height=4.0, burden=3.0, spacing=3.0)
TIMES = (0.0, 0.1, 0.2, 0.3, 0.3)  # the last state may come twice


def case() -> CastCase:
    axis = np.arange(0.5, 6.0, 1.0)
    x, y, z = (a.ravel() for a in np.meshgrid(axis - 6.0, axis, axis[:4]))
    block = (x < -3.0) * 2 + (y > 3.0)
    balls = particles_at_rest(np.column_stack([x, y, z]), np.full(x.size, 0.45), block)
    return CastCase(
        balls, ContactLaw(), bench_walls(BENCH), echelon_delays(2, 2), block_velocities(5.0, 4)
    )


def visible(folder: Path) -> list[str]:
    """Files but for the hidden ones, from which they can be written again."""
    return [path.name for path in folder.iterdir() if not path.name.startswith(".")]


def film(folder: Path, **options: object) -> tuple[Frames, list[Path]]:
    start = case()
    frames = Frames(folder, start, BENCH, **options)
    for time in TIMES:
        moved = start.particles.position + np.array([30.0 * time, 0.0, 0.0])
        frames(time, start.particles._replace(position=moved))
    return frames, frames.close()


def test_animation_has_a_frame_per_state_and_moves(tmp_path: Path) -> None:
    frames, files = film(tmp_path, animation="gif")
    assert frames
    assert files == [tmp_path / "animation.gif"]
    with Image.open(files[0]) as image:
        assert image.n_frames == 4
        shown = []
        for k in range(4):
            image.seek(k)
            shown.append((image.info["duration"], np.asarray(image.convert("RGB"), dtype=int)))
    assert [duration for duration, _ in shown] == [100, 100, 100, 1500]
    assert np.abs(shown[3][1] - shown[0][1]).max() > 100
    # Balls, which alone are colourful, keep inside the picture and move to the right.
    colourful = [np.nonzero(np.ptp(picture, axis=2) > 40)[1].mean() for _, picture in shown]
    assert colourful == sorted(colourful)
    assert visible(tmp_path) == ["animation.gif"]


def test_vtkhdf_alone_leaves_no_series_behind(tmp_path: Path) -> None:
    pytest.importorskip("vtkmodules.vtkIOHDF", reason="VTK is not installed")
    _, files = film(tmp_path, vtkhdf=True)
    assert files == [tmp_path / "balls.vtkhdf"]
    assert visible(tmp_path) == ["balls.vtkhdf"]


def test_vtk_writes_the_series(tmp_path: Path) -> None:
    pytest.importorskip("vtkmodules.vtkIOHDF", reason="VTK is not installed")
    _, files = film(tmp_path, vtk=True)
    assert files == [tmp_path / "frames" / "balls.pvd"]
    assert len(list((tmp_path / "frames").glob("balls_*.vtp"))) == 4


def test_a_stopped_run_goes_on_with_its_frames(tmp_path: Path) -> None:
    """Frames that came after the restart file was written are taken anew."""
    pytest.importorskip("vtkmodules.vtkIOHDF", reason="VTK is not installed")
    wanted = {"animation": "gif", "vtk": True, "vtkhdf": True}
    _, whole = film(tmp_path / "whole", **wanted)
    start, folder = case(), tmp_path / "stopped"

    def take(frames: Frames, times: tuple[float, ...]) -> None:
        for time in times:
            moved = start.particles.position + np.array([30.0 * time, 0.0, 0.0])
            frames(time, start.particles._replace(position=moved))

    first = Frames(folder, start, BENCH, **wanted)
    take(first, TIMES[:2])
    kept = first.save()
    take(first, (0.25, 0.27, 0.29))
    second = Frames(folder, start, BENCH, **wanted)
    second.resume(kept)
    take(second, TIMES[2:])
    again = second.close()
    assert [path.name for path in again] == [path.name for path in whole]
    for one, other in zip(whole, again, strict=True):
        if one.suffix != ".vtkhdf":  # HDF5 notes the time of day
            assert one.read_bytes() == other.read_bytes()
    assert len(list((folder / "frames").glob("balls_*.vtp"))) == 4


def test_other_frames_than_those_of_the_stopped_run_are_refused(tmp_path: Path) -> None:
    frames = Frames(tmp_path, case(), BENCH, animation="gif")
    with pytest.raises(
        SpecError, match=r"kept other frames \(none\) than are requested now \(animation"
    ):
        frames.resume({})
    kept = frames.save() | {"frames.time": np.array([0.0, 0.1])}
    with pytest.raises(SpecError, match="frames of the run that was stopped are gone"):
        frames.resume(kept)


def test_nothing_wanted_is_nothing_done(tmp_path: Path) -> None:
    frames, files = film(tmp_path)
    assert not frames
    assert files == []
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_written_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SpecError, match="--animation: avi: unknown format; allowed: gif, mp4"):
        check_frames("avi", vtk=False, vtkhdf=False)
    monkeypatch.setattr("matplotlib.animation.FFMpegWriter.isAvailable", lambda: False)
    with pytest.raises(SpecError, match="needs the program ffmpeg"):
        check_frames("mp4", vtk=False, vtkhdf=False)
    monkeypatch.setitem(__import__("sys").modules, "vtkmodules.vtkIOXML", None)
    with pytest.raises(SpecError, match="--vtkhdf: needs VTK"):
        check_frames(None, vtk=False, vtkhdf=True)
