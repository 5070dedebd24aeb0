"""States of a cast along the way: animation and files for ParaView."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from castblast.muckpile.bench import Bench
from castblast.muckpile.case import CastCase
from castblast.muckpile.particles import Particles

if TYPE_CHECKING:
    from castblast.report.animation import Animation
    from castblast.report.vtk_files import VtkSeries

#: Simulated time [s] between two states by default.
FRAME_INTERVAL = 0.1
_FOLDER = "frames"


def check_frames(animation: str | None, *, vtk: bool, vtkhdf: bool) -> None:
    """Refuse what cannot be written here, before anything is computed.

    Raises
    ------
    SpecError
        Unknown format, mp4 without ffmpeg, or VTK missing.
    """
    if animation is not None:
        from castblast.report.animation import need_format

        need_format(animation)
    for option, wanted in (("--vtk", vtk), ("--vtkhdf", vtkhdf)):
        if wanted:
            from castblast.report.vtk_files import need_vtk

            need_vtk(option)


class Frames:
    """Takes the states of a run; an instance is the snapshot callback of `run_cast`.

    Parameters
    ----------
    folder : path
        Of the results: ``animation.gif`` (or mp4), ``frames/balls_*.vtp`` and ``balls.pvd``,
        ``balls.vtkhdf``.
    case : CastCase
        Give it a `snapshot_interval`.
    bench : Bench
    animation : "gif", "mp4" or None
    vtk, vtkhdf : bool
    """

    def __init__(
        self,
        folder: Path,
        case: CastCase,
        bench: Bench,
        *,
        animation: str | None = None,
        vtk: bool = False,
        vtkhdf: bool = False,
    ) -> None:
        check_frames(animation, vtk=vtk, vtkhdf=vtkhdf)
        self._folder, self._format = folder, animation
        self._vtk, self._vtkhdf = vtk, vtkhdf
        self._film: Animation | None = None
        self._series: VtkSeries | None = None
        self._scratch: Path | None = None
        folder.mkdir(parents=True, exist_ok=True)
        if animation:
            from castblast.report.animation import Animation

            self._film = Animation(folder, case.particles, bench, case.walls)
        if vtk or vtkhdf:
            from castblast.report.vtk_files import VtkSeries

            if not vtk:
                self._scratch = Path(tempfile.mkdtemp(prefix=".frames-", dir=folder))
            self._series = VtkSeries(self._scratch or folder / _FOLDER)

    def __bool__(self) -> bool:
        """Whether anything is wanted."""
        return self._film is not None or self._series is not None

    def __call__(self, time: float, balls: Particles) -> None:
        """Take the state at `time` [s]; a state at the same time again is left out."""
        if self._film is not None and (not self._film.times or time > self._film.times[-1]):
            self._film.add(time, balls)
        if self._series is not None and (not self._series.times or time > self._series.times[-1]):
            self._series.add(time, balls)

    def close(self) -> list[Path]:
        """Write what is still open; return the files that matter to people."""
        files: list[Path] = []
        try:
            if self._series is not None and self._series.times:
                if self._vtk:
                    files.append(self._series.close())
                if self._vtkhdf:
                    from castblast.report.vtk_files import write_vtkhdf

                    files.append(write_vtkhdf(self._folder / "balls.vtkhdf", self._series))
        finally:
            if self._scratch is not None:
                shutil.rmtree(self._scratch, ignore_errors=True)
        if self._film is not None and self._film.times:
            files.append(self._film.write(self._folder / f"animation.{self._format}"))
        return files
